#include "sim/scene.h"

#include <gtest/gtest.h>

#include <algorithm>

#include "common/image.h"
#include "tests/render_scenes.h"
#include "tests/support.h"

namespace lumen {
namespace {

using test::ErrorOf;
using test::kSmallScene;
using test::SharedData;
using test::WriteScene;

TEST(Scene, ReadsEveryTable) {
  test::ScratchFolder scratch;
  const Scene scene =
      ReadScene(WriteScene(scratch),
                {"path.roulette_after=5", "sensor.record_gain=false", "sensor.auto_gain.target=0.3",
                 "truth.exact=[\"z\", \"direct\"]", "truth.c3vd=false", "surface.vessels.width_mm=0.4"},
                3);
  EXPECT_EQ(scene.calibration.camera.width, 60);
  EXPECT_EQ(scene.calibration.camera.model, CameraModel::kScaramuzza);
  EXPECT_EQ(scene.calibration.mask.height, 48);
  ASSERT_EQ(scene.calibration.light.sources.size(), 2u);
  EXPECT_EQ(scene.calibration.light.sources[0].position, Vec3d(3.24, 0.55, 0));
  EXPECT_EQ(scene.calibration.light.sources[1].intensity, Vec3d(600, 600, 600));
  EXPECT_EQ(scene.calibration.response.vignetting, 1.5);
  EXPECT_EQ(scene.surface.albedo, Vec3d(0.7, 0.4, 0.3));
  EXPECT_EQ(scene.surface.vessels->options().width_mm, 0.4);
  EXPECT_TRUE(scene.surface.mottling);
  EXPECT_EQ(scene.path.samples, 3);
  EXPECT_EQ(scene.path.bounces, 2);
  EXPECT_EQ(scene.path.roulette_after, 5);
  EXPECT_FALSE(scene.sensor.record_gain);
  EXPECT_EQ(scene.sensor.auto_gain->target, 0.3);
  EXPECT_FALSE(scene.truth.c3vd);
  EXPECT_EQ(scene.truth.exact, (std::vector<std::string>{"z", "direct"}));
  EXPECT_EQ(scene.world_from_camera.size(), 3u);
  EXPECT_GT(scene.geometry.mesh.faces.size(), 100u);
  EXPECT_EQ(scene.effects, (std::vector<std::string>{"interreflection", "mottling", "vessels",
                                                     "offset_guides", "vignetting", "auto_gain", "mask"}));
}

// The scene without a table and all up to the next empty line.
std::string Without(const std::string& table) {
  std::string text = kSmallScene;
  const size_t begin = text.find(table), end = text.find("\n\n", begin);
  return text.erase(begin, end + 2 - begin);
}

TEST(Scene, EffectsThatAreNotNamedAreNotThere) {
  test::ScratchFolder scratch;
  std::string text = Without("[sensor.auto_gain]");
  for (const std::string part : {"[surface.mottling]\n", "[surface.vessels]\n", "vignetting = 1.5\n",
                                 "bounces = 2\n", "mask = \"octagon\"\n"}) {
    text.erase(text.find(part), part.size());
  }
  const Scene scene = ReadScene(WriteScene(scratch, text), {"light.source.0.position=[0, 0, 0]"}, 3);
  EXPECT_TRUE(scene.effects.empty());
  EXPECT_FALSE(scene.surface.mottling || scene.surface.vessels || scene.sensor.auto_gain);
  EXPECT_TRUE(scene.calibration.mask.empty());
  EXPECT_EQ(scene.path.bounces, 0);
  EXPECT_EQ(scene.sensor.gain, 1);
  EXPECT_TRUE(scene.truth.c3vd && scene.truth.exact.empty() && scene.sensor.record_gain);
}

TEST(Scene, SeedChangesTheColon) {
  test::ScratchFolder scratch;
  const auto file = WriteScene(scratch);
  const Scene one = ReadScene(file, {}, 1), again = ReadScene(file, {}, 1), other = ReadScene(file, {}, 2);
  EXPECT_EQ(one.geometry.mesh.vertices, again.geometry.mesh.vertices);
  EXPECT_NE(one.geometry.mesh.vertices, other.geometry.mesh.vertices);
}

int LineOf(const std::string& text, const std::string& part) {
  const auto end = text.begin() + static_cast<ptrdiff_t>(text.find(part));
  return 1 + static_cast<int>(std::count(text.begin(), end, '\n'));
}

TEST(Scene, MistakesAreNamedWithTheirPlace) {
  struct Mistake {
    std::string part, replacement;
    std::string culprit;  // what stands at the place
    std::string said;
  };
  const std::vector<Mistake> mistakes = {
      {"samples = 3", "sample = 3", "sample =", "sample"},
      {"samples = 3", "samples = 0", "samples =", "samples"},
      {"samples = 3", "samples = 2.5", "samples =", "samples"},
      {"bounces = 2", "bounces = -1", "bounces =", "bounces"},
      {"preset = \"c3vd\"", "preset = \"c4vd\"", "preset =", "preset"},
      {"width = 60", "width = 0", "width =", "width"},
      {"mask = \"octagon\"", "mask = 8", "mask =", "mask"},
      {"spread = 2\n", "spread = -2\n", "spread =", "spread"},
      {"direction = [0, 0, 1]", "direction = [0, 0]", "direction =", "direction"},
      {"gamma = 2.2", "gamma = 0", "gamma =", "gamma"},
      {"[0.7, 0.4, 0.3]", "[0.7, 1.4, 0.3]", "albedo =", "albedo"},
      {"[0.7, 0.4, 0.3]", "[0.7, nan, 0.3]", "albedo =", "albedo"},
      {"[sensor.auto_gain]", "[sensor]\ngain = 2\n[sensor.auto_gain]", "gain = 2", "gain"},
      {"[sensor.auto_gain]", "[sensor.auto_gain]\ntarget = 2", "target =", "target"},
      {"[truth]", "[truth]\nexact = [\"z\", \"depth\"]", "exact =", "depth"},
      {"kind = \"colon\"", "kind = \"tube\"", "kind =", "kind"},
      {"[truth]", "[thruth]", "[thruth]", "thruth"},
      {"gamma = 2.2", "gamma 2.2", "gamma 2.2", ""},
  };
  test::ScratchFolder scratch;
  for (const Mistake& mistake : mistakes) {
    std::string text = kSmallScene;
    text.replace(text.find(mistake.part), mistake.part.size(), mistake.replacement);
    const std::string message = ErrorOf([&] { ReadScene(WriteScene(scratch, text), {}, 1); });
    const std::string place = "scene.toml:" + std::to_string(LineOf(text, mistake.culprit)) + ":";
    EXPECT_NE(message.find(place), std::string::npos)
        << mistake.replacement << " at " << place << " said: " << message;
    EXPECT_NE(message.find(mistake.said), std::string::npos) << message;
    EXPECT_EQ(message.find('\n'), std::string::npos) << message;
  }
}

TEST(Scene, MissingTablesAndFilesAreNamed) {
  test::ScratchFolder scratch;
  for (const std::string table : {"geometry", "trajectory", "camera", "response", "surface"}) {
    const std::string text = Without("[" + table + "]");
    const std::string message = ErrorOf([&] { ReadScene(WriteScene(scratch, text), {}, 1); });
    EXPECT_NE(message.find("scene.toml"), std::string::npos) << message;
    EXPECT_NE(message.find(table), std::string::npos) << message;
  }
  const auto file = WriteScene(scratch);
  const std::string mask = ErrorOf([&] { ReadScene(file, {"camera.mask=no.png"}, 1); });
  EXPECT_NE(mask.find("no.png"), std::string::npos) << mask;
  EXPECT_NE(ErrorOf([&] { ReadScene(scratch / "none.toml", {}, 1); }).find("none.toml"), std::string::npos);
}

TEST(Scene, LightBehindTheWallIsRefused) {
  test::ScratchFolder scratch;
  const auto file = WriteScene(scratch);
  const std::string message = ErrorOf([&] { ReadScene(file, {"light.source.0.position=[200, 0, 0]"}, 1); });
  EXPECT_NE(message.find("frame 0"), std::string::npos) << message;
  EXPECT_NE(message.find("light"), std::string::npos) << message;
}

TEST(Scene, MaskFileIsResized) {
  test::ScratchFolder scratch;
  Image8 mask(120, 96, 1);
  for (int y = 0; y < 96; ++y) {
    for (int x = 40; x < 120; ++x) *mask.Pixel(x, y) = 255;
  }
  WriteImage(scratch / "right.png", mask);
  std::string text = kSmallScene;
  text.replace(text.find("octagon"), 7, "right.png");
  const Scene scene = ReadScene(WriteScene(scratch, text), {}, 1);
  for (int x = 0; x < 60; ++x) EXPECT_EQ(*scene.calibration.mask.Pixel(x, 30), x < 20 ? 0 : 255) << x;
}

TEST(Scene, OctagonIsC3vds) {
  LUMEN_NEEDS_DATA("c3vd/mask.png");
  test::ScratchFolder scratch;
  const Scene scene = ReadScene(WriteScene(scratch), {"camera.width=1350", "camera.height=1080"}, 1);
  const Image8 official = ReadImage8(SharedData("c3vd/mask.png"), 1);
  const auto difference = [&](int shift) {
    int count = 0;
    for (int y = 0; y < 1080; ++y) {
      for (int x = 0; x + shift < 1350; ++x) {
        count += (*scene.calibration.mask.Pixel(x, y) != 0) != (*official.Pixel(x + shift, y) != 0);
      }
    }
    return count;
  };
  EXPECT_LT(difference(0), 500);  // half a pixel along four edges of 250 rows
  EXPECT_GT(difference(2), 1000);
}

TEST(Scene, ScenesOfTheProjectRead) {
  for (const std::string name : {"colon", "colon_lit"}) {
    const Scene scene =
        ReadScene(LUMEN_SOURCE_FOLDER "/scenes/" + name + ".toml", {"geometry.tolerance_mm=0.2"}, 0);
    EXPECT_GE(scene.world_from_camera.size(), 20u) << name;
    EXPECT_EQ(scene.path.bounces, name == "colon" ? 0 : 3);
    EXPECT_EQ(scene.calibration.light.sources.size(), name == "colon" ? 1u : 3u);
  }
}

}  // namespace
}  // namespace lumen
