// Small frames against stored ones, by their statistics: random numbers may change, expectations may not.
//
// tests/golden/NAME.exr holds, for each pixel and channel, the mean of a number of independent renders and
// the variance of that mean. A pixel passes if Student's t of the two means' difference (Welch 1947), with
// both variances, is within what chance makes of it; the bound is shared out among the pixels so that a whole
// frame which is right is rejected once in 10,000 changes of the random numbers (Šidák 1967). After a change
// that is meant to alter the expectation, LUMEN_WRITE_GOLDEN=tests/golden makes these tests write new frames.
#include <gtest/gtest.h>

#include <cmath>
#include <cstdlib>

#include "common/files.h"
#include "common/image.h"
#include "sim/scene.h"
#include "tests/support.h"
#include "tests/welch.h"

namespace lumen {
namespace {

constexpr int kWidth = 20, kHeight = 16, kRenders = 48;
constexpr double kFalseAlarm = 1e-4;

// A short, coarse colon and a C3VD camera; an effect's tables come behind.
constexpr const char* kScene = R"([geometry]
kind = "colon"
length_mm = 50
tolerance_mm = 0.3

[trajectory]
kind = "withdrawal"
start_mm = 26
end_mm = 20
frames = 2

[camera]
preset = "c3vd"
width = 20
height = 16

[response]
gamma = 2.2

[light]
model = "sls"
calibrated = true
[[light.source]]
position = [3.24, 0.55, 0]
direction = [0, 0, 1]
spread = 2
intensity = [1500, 1500, 1500]
[[light.source]]
position = [-2.77, 2.66, 0]
direction = [0, 0, 1]
spread = 2.77
intensity = [900, 800, 700]
)";

// Mean and its variance, RGB each.
struct Golden {
  ImageF mean{kWidth, kHeight, 3}, variance{kWidth, kHeight, 3};
};

// The linear radiance of the scene's first frame.
Golden RenderMany(const Scene& scene, uint64_t first_seed) {
  const RayScene wall(scene.geometry.mesh);
  const std::vector<Vec3d> normals = VertexNormals(scene.geometry.mesh);
  const Camera<float> camera(scene.calibration.camera);
  const Image8 valid(kWidth, kHeight, 1, 255);
  Golden golden;
  std::vector<double> sums(golden.mean.data.size(), 0), squares = sums;
  for (int i = 0; i < kRenders; ++i) {
    Film film;
    const PathCount count =
        RenderFrame({&wall, &scene.surface, 77, &normals},
                    {&camera, &valid, scene.world_from_camera[0], &scene.calibration.light}, scene.path,
                    first_seed + i, 0, false, &film);
    EXPECT_EQ(count.failure.count, 0);
    for (size_t v = 0; v < sums.size(); ++v) {
      sums[v] += film.radiance.data[v];
      squares[v] += double(film.radiance.data[v]) * film.radiance.data[v];
    }
  }
  for (size_t v = 0; v < sums.size(); ++v) {
    const double mean = sums[v] / kRenders;
    golden.mean.data[v] = static_cast<float>(mean);
    golden.variance.data[v] =
        static_cast<float>(std::max(0.0, squares[v] / kRenders - mean * mean) / (kRenders - 1));
  }
  return golden;
}

std::filesystem::path GoldenFile(const std::filesystem::path& folder, const std::string& name) {
  return folder / (name + ".exr");
}

void WriteGolden(const std::filesystem::path& file, const Golden& golden) {
  ImageF all(kWidth, kHeight, 6);
  for (size_t pixel = 0; pixel < size_t(kWidth) * kHeight; ++pixel) {
    std::copy_n(&golden.mean.data[3 * pixel], 3, &all.data[6 * pixel]);
    std::copy_n(&golden.variance.data[3 * pixel], 3, &all.data[6 * pixel + 3]);
  }
  WriteExr(file, all, {"mean.R", "mean.G", "mean.B", "variance.R", "variance.G", "variance.B"});
}

Golden ReadGolden(const std::filesystem::path& file) {
  std::vector<std::string> names;
  const ImageF all = ReadExr(file, &names);
  Golden golden;
  EXPECT_EQ(all.width, kWidth);
  EXPECT_EQ(all.height, kHeight);
  for (size_t c = 0; c < names.size(); ++c) {
    ImageF& image = names[c].starts_with("mean") ? golden.mean : golden.variance;
    const size_t channel = std::string("RGB").find(names[c].back());
    for (size_t pixel = 0; pixel < size_t(kWidth) * kHeight; ++pixel) {
      image.data[3 * pixel + channel] = all.data[all.channels * pixel + c];
    }
  }
  return golden;
}

// How many pixels' channels differ by more than chance explains.
int Rejected(const Golden& a, const Golden& b) {
  const double count = static_cast<double>(a.mean.data.size());
  const double each = test::SharedOut(kFalseAlarm, count);
  int rejected = 0;
  for (size_t v = 0; v < a.mean.data.size(); ++v) {
    const double va = a.variance.data[v], vb = b.variance.data[v];
    const double difference = std::abs(double(a.mean.data[v]) - b.mean.data[v]);
    // Without noise, as where nothing is lit, the means are the same but for their float rounding.
    const double rounding = 2 * 0x1p-24 * (std::abs(a.mean.data[v]) + std::abs(b.mean.data[v]));
    if (difference <= rounding) continue;
    if (va + vb == 0) {
      ++rejected;
      continue;
    }
    rejected += test::WelchChance(difference, va, vb, kRenders) < each;
  }
  return rejected;
}

class GoldenTest : public testing::Test {
 protected:
  Scene Read(const std::string& effects, const std::vector<std::string>& settings = {}) {
    WriteFile(scratch_ / "scene.toml", kScene + effects);
    return ReadScene(scratch_ / "scene.toml", settings, 4);
  }
  // Compares with the stored frame, then with its albedo 3% too high, which must be rejected.
  void Check(const std::string& name, const std::string& effects) {
    if (const char* folder = std::getenv("LUMEN_WRITE_GOLDEN")) {
      WriteGolden(GoldenFile(folder, name), RenderMany(Read(effects), 1000));
      GTEST_SKIP() << "wrote " << GoldenFile(folder, name);
    }
    const Golden golden = ReadGolden(GoldenFile(LUMEN_SOURCE_FOLDER "/tests/golden", name));
    EXPECT_EQ(Rejected(RenderMany(Read(effects), 1), golden), 0);
    const Scene wrong = Read(effects, {"surface.albedo=[0.721, 0.412, 0.309]"});
    EXPECT_GT(Rejected(RenderMany(wrong, 1), golden), 10);
  }
  test::ScratchFolder scratch_;
};

constexpr const char* kPlainWall = "[surface]\nalbedo = [0.7, 0.4, 0.3]\n";

TEST_F(GoldenTest, DirectLight) {
  Check("direct", std::string(kPlainWall) + "[path]\nsamples = 8\n[surface.mottling]\n[surface.vessels]\n");
}

TEST_F(GoldenTest, Interreflection) {
  Check("interreflection", std::string(kPlainWall) + "[path]\nsamples = 16\nbounces = 5\n");
}

TEST_F(GoldenTest, Coat) {
  Check("coat", std::string(kPlainWall) +
                    "[surface.coat]\nroughness = 0.5\nrelief_mm = 2\nrelief_height_mm = 0.1\n"
                    "[path]\nsamples = 16\nbounces = 3\n");
}

// The frames differ from each other as well.
TEST_F(GoldenTest, FramesAreDistinct) {
  const auto read = [](const char* name) {
    return ReadGolden(GoldenFile(LUMEN_SOURCE_FOLDER "/tests/golden", name));
  };
  EXPECT_GT(Rejected(read("direct"), read("interreflection")), 100);
  EXPECT_GT(Rejected(read("coat"), read("interreflection")), 100);
}

}  // namespace
}  // namespace lumen
