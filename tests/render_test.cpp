#include "sim/render.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <map>
#include <nlohmann/json.hpp>

#include "common/image.h"
#include "common/parallel.h"
#include "common/sequence.h"
#include "tests/render_scenes.h"
#include "tests/support.h"

namespace lumen {
namespace {

using test::Exact;

namespace fs = std::filesystem;
using test::ErrorOf;
using test::WriteScene;

constexpr uint64_t kSeed = 4;

// Every file of a folder, by its name in it.
std::map<std::string, std::string> Bytes(const fs::path& folder) {
  std::map<std::string, std::string> bytes;
  for (const auto& entry : fs::recursive_directory_iterator(folder)) {
    if (entry.is_regular_file()) bytes[fs::relative(entry.path(), folder).string()] = ReadFile(entry.path());
  }
  return bytes;
}

// Whether both hold the same files; names the first that differs.
testing::AssertionResult SameFiles(const fs::path& a, const fs::path& b) {
  const auto in_a = Bytes(a), in_b = Bytes(b);
  for (const auto& [name, bytes] : in_a) {
    const auto other = in_b.find(name);
    if (other == in_b.end()) return testing::AssertionFailure() << name << " is missing in " << b;
    if (other->second != bytes) return testing::AssertionFailure() << name << " differs";
  }
  if (in_a.size() != in_b.size()) return testing::AssertionFailure() << b << " holds more files";
  return testing::AssertionSuccess();
}

class RenderTest : public testing::Test {
 protected:
  RenderResult RenderTo(const std::string& name, const std::vector<std::string>& settings = {}, int first = 0,
                        int last = -1) {
    const Scene scene = ReadScene(WriteScene(scratch_), settings, kSeed);
    return Render(scene, {scratch_ / name, first, last, kSeed});
  }
  test::ScratchFolder scratch_;
};

TEST_F(RenderTest, WritesASequenceThatReadsBack) {
  const RenderResult result = RenderTo("sequence", {"truth.exact=[\"z\", \"normal\", \"flow\"]"});
  EXPECT_EQ(result.frames, 3);
  EXPECT_EQ(result.not_finite, 0);
  const Scene scene = ReadScene(scratch_ / "scene.toml", {}, kSeed);
  const Sequence sequence = ReadSequence(scratch_ / "sequence");
  EXPECT_TRUE(sequence.has_toml);
  ASSERT_EQ(sequence.frames.size(), 3u);
  EXPECT_EQ(ReadMesh(sequence.ground_truth_mesh).faces.size(), scene.geometry.mesh.faces.size());
  const Image8 valid = ValidPixels(sequence.calibration);
  const auto pixels = std::count(valid.data.begin(), valid.data.end(), 255);
  EXPECT_EQ(result.samples, 3 * 3 * pixels);  // frames · samples
  EXPECT_GT(result.rays, 2 * result.samples);
  for (int i = 0; i < 3; ++i) {
    const SequenceFrame& frame = sequence.frames[i];
    const Pose motion = frame.world_from_camera.inverse() * scene.world_from_camera[i];
    EXPECT_LT(motion.translation().norm(), 1e-9);
    EXPECT_LT((motion.linear() - Mat3d::Identity()).norm(), 1e-9);
    EXPECT_GT(frame.gain.value(), 0);
    EXPECT_EQ(frame.flow.empty(), i == 0);
    EXPECT_EQ(ReadColor(sequence, frame).width, 60);
    const fs::path exact = scratch_ / "sequence" / "exact" / ("000" + std::to_string(i) + ".exr");
    const ImageF z = Exact(exact, "z"), depth = DecodeDepth(ReadImage16(frame.depth, 1));
    const ImageF normal = Exact(exact, "normal"), coded = DecodeNormals(ReadImage16(frame.normals, 3));
    for (size_t pixel = 0; pixel < z.data.size(); ++pixel) {
      EXPECT_EQ(std::isnan(depth.data[pixel]), std::isnan(z.data[pixel]));
      if (std::isnan(z.data[pixel])) continue;
      EXPECT_NEAR(depth.data[pixel], z.data[pixel], 100.0 / 65535);
      for (int c = 0; c < 3; ++c) {
        EXPECT_NEAR(coded.data[3 * pixel + c], normal.data[3 * pixel + c], 2.0 / 65535);
      }
    }
    EXPECT_EQ(Exact(exact, "flow").channels, i == 0 ? 0 : 2);
  }
}

// The colour file's definition: ((gain · cos^k · radiance) clipped to 0…1) ^ (1/γ) in 8 bits.
TEST_F(RenderTest, PixelsFollowFromRadianceAndGain) {
  RenderTo("sequence", {"truth.exact=[\"radiance\", \"direct\", \"indirect\"]"});
  const Sequence sequence = ReadSequence(scratch_ / "sequence");
  const Camera<double> camera(sequence.calibration.camera);
  const Image8 valid = ValidPixels(sequence.calibration);
  const fs::path exact = scratch_ / "sequence" / "exact" / "0001.exr";
  const ImageF radiance = Exact(exact, "radiance"), direct = Exact(exact, "direct");
  const ImageF indirect = Exact(exact, "indirect");
  const Image8 color = ReadColor(sequence, sequence.frames[1]);
  int off = 0, off_without_gain = 0;
  for (int y = 0; y < color.height; ++y) {
    for (int x = 0; x < color.width; ++x) {
      for (int c = 0; c < 3; ++c) {
        const float value = radiance.Pixel(x, y)[c];
        EXPECT_FLOAT_EQ(direct.Pixel(x, y)[c] + indirect.Pixel(x, y)[c], value);
        if (!*valid.Pixel(x, y)) {
          EXPECT_EQ(color.Pixel(x, y)[c], 0);
          continue;
        }
        const double vignetting = std::pow(camera.Unproject(Vec2d(x, y))->z(), 1.5);
        const auto code = [&](double gain) {
          return 255 * std::pow(std::min(1.0, gain * vignetting * value), 1 / 2.2);
        };
        off += std::abs(code(*sequence.frames[1].gain) - color.Pixel(x, y)[c]) > 0.5 + 1e-3;
        off_without_gain += std::abs(code(1) - color.Pixel(x, y)[c]) > 0.5 + 1e-3;
      }
    }
  }
  EXPECT_EQ(off, 0);
  EXPECT_GT(off_without_gain, 1000);
}

TEST_F(RenderTest, FrameIsTheSameAloneAndAmongOthers) {
  RenderTo("all");
  RenderTo("last", {}, 2, 3);
  auto all = Bytes(scratch_ / "all"), last = Bytes(scratch_ / "last");
  for (const std::string name : {"color.png", "depth.tiff", "normals.tiff", "flow.tiff", "occlusion.png"}) {
    EXPECT_FALSE(all["0002_" + name].empty());
    EXPECT_TRUE(all["0002_" + name] == last["0002_" + name]) << name;
  }
  EXPECT_FALSE(all["0001_color.png"] == all["0002_color.png"]);
  const Sequence whole = ReadSequence(scratch_ / "all"), alone = ReadSequence(scratch_ / "last");
  ASSERT_EQ(alone.frames.size(), 1u);
  EXPECT_EQ(alone.frames[0].number, 2);
  EXPECT_EQ(alone.frames[0].gain, whole.frames[2].gain);
  EXPECT_NE(whole.frames[0].gain, whole.frames[2].gain);
}

TEST_F(RenderTest, SameFilesForAnyNumberOfThreads) {
  const std::vector<std::string> settings = {"truth.exact=[\"radiance\", \"position\", \"seen_before\"]"};
  SetThreadCount(1);
  RenderTo("one", settings);
  SetThreadCount(2);
  RenderTo("two", settings);
  SetThreadCount(0);
  EXPECT_TRUE(SameFiles(scratch_ / "one", scratch_ / "two"));
  RenderTo("other", {"path.samples=2"});
  EXPECT_FALSE(SameFiles(scratch_ / "one", scratch_ / "other"));
}

TEST_F(RenderTest, TruthLeavesFramesAlone) {
  std::string every;
  for (const std::string& channel : ExactChannels())
    every += (every.empty() ? "\"" : ", \"") + channel + "\"";
  RenderTo("all", {"truth.exact=[" + every + "]"}, 0, 2);
  RenderTo("none", {"truth.c3vd=false"}, 0, 2);
  auto all = Bytes(scratch_ / "all"), none = Bytes(scratch_ / "none");
  for (const std::string name : {"0000_color.png", "0001_color.png", "sequence.toml", "pose.txt"}) {
    EXPECT_FALSE(all[name].empty());
    EXPECT_TRUE(all[name] == none[name]) << name;
  }
  for (const auto& [name, bytes] : none) {
    EXPECT_EQ(name.find(".tiff"), std::string::npos) << name;
    EXPECT_EQ(name.find("exact"), std::string::npos) << name;
  }
  std::vector<std::string> names;
  ReadExr(scratch_ / "all" / "exact" / "0001.exr", &names);
  EXPECT_EQ(names.size(), 6 * 3 + 1 + 1 + 3 + 3 + 3 + 2 + 1 + 2 + 1u);
}

// Nothing of an earlier render is left to be taken for the new one's.
TEST_F(RenderTest, RendersOverAnEarlierSequence) {
  RenderTo("fresh", {"truth.c3vd=false"}, 1, 2);
  RenderTo("sequence", {"truth.exact=[\"z\"]"});
  WriteFile(scratch_ / "sequence" / "calibration.toml", "");
  WriteFile(scratch_ / "sequence" / "notes.txt", "mine");
  RenderTo("sequence", {"truth.c3vd=false"}, 1, 2);
  EXPECT_EQ(ReadFile(scratch_ / "sequence" / "notes.txt"), "mine");
  fs::remove(scratch_ / "sequence" / "notes.txt");
  EXPECT_TRUE(SameFiles(scratch_ / "sequence", scratch_ / "fresh"));
}

TEST_F(RenderTest, RefusesAFolderOfSomebodyElses) {
  CreateFolder(scratch_ / "c3vd");
  WriteFile(scratch_ / "c3vd" / "pose.txt", "1,0,0,0,0,1,0,0,0,0,1,0,0,0,0,1\n");
  WriteFile(scratch_ / "c3vd" / "0000_color.png", "a picture");
  const auto before = Bytes(scratch_ / "c3vd");
  const std::string message = ErrorOf([&] { RenderTo("c3vd"); });
  EXPECT_NE(message.find("c3vd"), std::string::npos) << message;
  EXPECT_NE(message.find("another folder"), std::string::npos) << message;
  EXPECT_EQ(Bytes(scratch_ / "c3vd"), before);
}

TEST_F(RenderTest, GainsAreLeftOutIfAskedFor) {
  RenderTo("sequence", {"sensor.record_gain=false"}, 0, 1);
  EXPECT_FALSE(ReadSequence(scratch_ / "sequence").frames[0].gain.has_value());
}

TEST_F(RenderTest, RefusesFramesThatAreNotThere) {
  for (const auto& [first, last] : {std::pair(0, 4), std::pair(3, -1), std::pair(2, 2), std::pair(-1, 2)}) {
    const std::string message = ErrorOf([&] { RenderTo("sequence", {}, first, last); });
    EXPECT_NE(message.find("0:3"), std::string::npos) << message;
  }
}

TEST_F(RenderTest, CommandSaysWhatItDid) {
  WriteScene(scratch_);
  const auto run = [&](const std::string& arguments) {
    const std::string command = std::string(LUMEN_COMMAND) + " render '" +
                                (scratch_ / "scene.toml").string() + "' -o '" + (scratch_ / "out").string() +
                                "' " + arguments + " >/dev/null 2>'" + (scratch_ / "err").string() + "'";
    return WEXITSTATUS(std::system(command.c_str()));
  };
  const std::string json_file = "'" + (scratch_ / "json").string() + "'";
  ASSERT_EQ(run("--frames 1:3 --seed 4 --set truth.c3vd=false --json " + json_file), 0);
  const nlohmann::json json = nlohmann::json::parse(ReadFile(scratch_ / "json"));
  EXPECT_EQ(json["frames"], 2);
  EXPECT_GT(json["seconds"], 0);
  EXPECT_GT(json["rays"], json["samples"]);
  EXPECT_EQ(json["effects"].size(), 7u);
  RenderTo("here", {"truth.c3vd=false"}, 1, 3);
  EXPECT_TRUE(SameFiles(scratch_ / "out", scratch_ / "here"));
  for (const std::string bad : {"--frames 3:9", "--frames 2", "--set path.sample=3"}) {
    EXPECT_EQ(run(bad), 1) << bad;
    const std::string said = ReadFile(scratch_ / "err");
    EXPECT_EQ(std::count(said.begin(), said.end(), '\n'), 1) << said;
  }
}

}  // namespace
}  // namespace lumen
