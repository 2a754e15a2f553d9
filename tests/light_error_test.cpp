// Learnt albedo and light between walls against the simulator's channels.
#include "recon/evaluation/light_error.h"

#include <gtest/gtest.h>

#include <cmath>
#include <cstdlib>
#include <limits>

#include "common/error.h"
#include "common/files.h"
#include "common/progress.h"
#include "common/statistics.h"
#include "recon/training/train.h"
#include "sim/render.h"
#include "tests/support.h"

namespace lumen {
namespace {

constexpr float kNothing = std::numeric_limits<float>::quiet_NaN();

// 20 × 10 pixels, half of them 10 mm away, half 50 mm; the last row shows nothing.
LightFrame Uniform(const Vec3f& albedo, const Vec3f& direct, const Vec3f& indirect) {
  LightFrame frame{ImageF(20, 10, 3), ImageF(20, 10, 3), ImageF(20, 10, 3), ImageF(20, 10, 1)};
  for (int y = 0; y < 10; ++y) {
    for (int x = 0; x < 20; ++x) {
      for (int c = 0; c < 3; ++c) {
        frame.albedo.Pixel(x, y)[c] = y == 9 ? kNothing : albedo[c];
        frame.direct.Pixel(x, y)[c] = y == 9 ? kNothing : direct[c];
        frame.indirect.Pixel(x, y)[c] = y == 9 ? kNothing : indirect[c];
      }
      *frame.distance_mm.Pixel(x, y) = y == 9 ? kNothing : x < 10 ? 10.0f : 50.0f;
    }
  }
  return frame;
}

LightErrors::Row RowAt(const LightErrors& errors, double distance_mm) {
  for (size_t i = 1; i < errors.rows.size(); ++i)
    if (distance_mm >= errors.rows[i].from_mm && distance_mm < errors.rows[i].to_mm) return errors.rows[i];
  ADD_FAILURE() << "no row of " << distance_mm;
  return {};
}

TEST(LightError, AFactorAChannelIsNoErrorOfTheAlbedo) {
  const LightFrame truth = Uniform({0.8f, 0.35f, 0.3f}, {1, 2, 4}, {1, 2, 4});
  const LightErrors errors = CompareLight({Uniform({1.6f, 0.07f, 0.3f}, {10, 1, 1}, {10, 1, 1})}, {truth});
  EXPECT_TRUE(errors.albedo_factor.isApprox(Vec3d(0.5, 5, 1), 1e-6));
  EXPECT_EQ(errors.above_one, Vec3d(1, 0, 0));
  EXPECT_TRUE(errors.true_share.isApprox(Vec3d(0.5, 0.5, 0.5)));
  for (const auto* channels : {&errors.rows[0].albedo, &errors.rows[0].share}) {
    for (const RelativeErrors& channel : *channels) {
      EXPECT_EQ(channel.pixels, 180);
      EXPECT_NEAR(channel.median, 0, 1e-6);
      EXPECT_NEAR(channel.percentile_90, 0, 1e-6);
    }
  }
}

// Shares of .5 learnt as .4 near by and, in red, as .75 far away; a fifth of the green albedos half as large
// again.
TEST(LightError, KnownErrorsAreFound) {
  const LightFrame truth = Uniform({0.8f, 0.35f, 0.3f}, {1, 1, 1}, {1, 1, 1});
  LightFrame learnt = Uniform({0.8f, 0.35f, 0.3f}, {3, 3, 3}, {2, 2, 2});
  for (int y = 0; y < 9; ++y) {
    for (int x = 10; x < 20; ++x) learnt.indirect.Pixel(x, y)[0] = 9;
    for (int x = 0; x < 20; x += 5) learnt.albedo.Pixel(x, y)[1] *= 1.5f;
  }
  const LightErrors errors = CompareLight({learnt}, {truth});
  EXPECT_NEAR(RowAt(errors, 10).share[0].median, 0.2, 1e-6);
  EXPECT_NEAR(RowAt(errors, 50).share[0].median, 0.5, 1e-6);
  EXPECT_NEAR(RowAt(errors, 50).share[1].percentile_90, 0.2, 1e-6);
  EXPECT_NEAR(errors.rows[0].albedo[1].median, 0, 1e-6);
  EXPECT_NEAR(errors.rows[0].albedo[1].percentile_90, 0.5, 1e-6);
  EXPECT_NEAR(errors.rows[0].albedo[0].percentile_90, 0, 1e-6);
  EXPECT_EQ(RowAt(errors, 20).albedo[0].pixels, 0);
}

TEST(LightError, NothingToCompareIsRefused) {
  const LightFrame truth = Uniform({0.8f, 0.35f, 0.3f}, {1, 1, 1}, {0, 0, 0});
  EXPECT_THROW(CompareLight({Uniform(Vec3f::Constant(kNothing), {1, 1, 1}, {1, 1, 1})}, {truth}), InputError);
  // No light between walls in the truth: its share can't be wrong by a part of itself.
  const LightErrors errors = CompareLight({Uniform({0.8f, 0.35f, 0.3f}, {1, 1, 1}, {1, 1, 1})}, {truth});
  EXPECT_EQ(errors.rows[0].share[0].pixels, 0);
  EXPECT_NE(ToTable(errors).find("no light between walls"), std::string::npos);
}

// A colon of one colour under direct light alone.
class LearntLightOfAColon : public testing::Test {
 protected:
  LearntLightOfAColon() {
    SetQuiet(true);
    const Scene scene = ReadScene(LUMEN_SOURCE_FOLDER "/scenes/colon.toml",
                                  {"camera.width=90", "camera.height=72", "trajectory.frames=6",
                                   "path.samples=1", "geometry.tolerance_mm=0.3", "truth.c3vd=false",
                                   "truth.exact=[\"albedo\", \"direct\", \"indirect\", \"distance\"]",
                                   "surface.mottling.contrast=0", "surface.vessels.absorption=[0, 0, 0]"},
                                  0);
    RenderOptions options;
    options.folder = folder_ / "sequence";
    Render(scene, options);
  }
  LightErrors Learn(const Sequence& sequence, std::vector<std::string> settings) {
    TrainRun run;
    run.folder = folder_ / "run";
    const TrainOptions options = ReadTrainOptions("fast", settings);
    Train(sequence, options, run);
    EXPECT_EQ(FormatTrainOptions(ReadRunOptions(run.folder / "config.toml").train),
              FormatTrainOptions(options));
    const LearntLight light(run.folder, sequence);
    std::vector<LightFrame> learnt, truth;
    std::vector<double> ratios;
    for (size_t n = 0; n < light.frames().size(); ++n) {
      truth.push_back(TrueLight(sequence, sequence.frames[light.frames()[n]], 2));
      learnt.push_back(light.At(static_cast<int>(n), 2));
      for (size_t i = 1; i < truth[n].direct.data.size(); i += 3) {
        const double ratio = learnt[n].direct.data[i] / truth[n].direct.data[i];
        if (std::isfinite(ratio)) ratios.push_back(ratio);
      }
    }
    direct_ratio_ = MedianOf(ratios);
    return CompareLight(learnt, truth);
  }
  std::string Evaluate(const std::string& arguments) {
    const std::string command = std::string(LUMEN_COMMAND) + " evaluate " + arguments + " >'" +
                                (folder_ / "out").string() + "' 2>'" + (folder_ / "err").string() + "'";
    exit_code_ = WEXITSTATUS(std::system(command.c_str()));
    return ReadFile(folder_ / (exit_code_ == 0 ? "out" : "err"));
  }

  test::ScratchFolder folder_;
  int exit_code_ = -1;
  double direct_ratio_ = 0;  // green, learnt over true, in the median
};

// One albedo, after its factor, and what the frames show is known to be right: the direct light. The factor
// is off as the square of the distance is, which so short a run leaves too small; of guides that are said to
// be twice as strong as they are, half the albedo is found.
TEST_F(LearntLightOfAColon, IsItsAlbedo) {
  Sequence sequence = ReadSequence(folder_ / "sequence");
  const LightErrors errors = Learn(sequence, {"schedule.iterations=200", "network.interreflection=none"});
  for (int c = 1; c < 3; ++c) {  // red saturates near by
    EXPECT_GT(errors.rows[0].albedo[c].pixels, 5000);
    EXPECT_LT(errors.rows[0].albedo[c].median, 0.1);
  }
  EXPECT_NEAR(direct_ratio_, 1, 0.03);
  const std::string mesh = "'" + (folder_ / "run" / "mesh.ply").string() + "'",
                    folder = "'" + (folder_ / "sequence").string() + "'",
                    result = "'" + (folder_ / "result").string() + "'";
  EXPECT_NE(Evaluate(mesh + " " + folder + " --light -o " + result).find("albedo: the learnt one"),
            std::string::npos);
  EXPECT_EQ(exit_code_, 0);
  EXPECT_GT(ReadImage8(folder_ / "result" / "light.png", 3).width, 600);

  for (LightSource& source : sequence.calibration.light.sources) source.intensity *= 2;
  const LightErrors doubled = Learn(sequence, {"schedule.iterations=200", "network.interreflection=none"});
  for (int c = 1; c < 3; ++c) EXPECT_NEAR(doubled.albedo_factor[c] / errors.albedo_factor[c], 2, 0.2);

  // What can't be compared is named, with what to do.
  EXPECT_NE(Evaluate(folder + "/mesh.ply " + folder + " --light").find("config.toml: there is none; name"),
            std::string::npos);
  EXPECT_EQ(exit_code_, 1);
  std::filesystem::remove_all(folder_ / "sequence" / "exact");
  EXPECT_NE(Evaluate(mesh + " " + folder + " --light").find("0000.exr: there is none; render with"),
            std::string::npos);
  EXPECT_EQ(exit_code_, 1);
}

// Of guides that are said to have a thousandth of their power, whether that counts as known or not: an albedo
// without bounds is a thousand times too large, a bounded one is an albedo, and the frames look the same.
TEST_F(LearntLightOfAColon, StaysAnAlbedo) {
  Sequence sequence = ReadSequence(folder_ / "sequence");
  const LightErrors right = Learn(sequence, {"schedule.iterations=100"});
  const double direct_ratio = direct_ratio_;
  EXPECT_EQ(right.above_one, Vec3d::Zero());
  EXPECT_NEAR(direct_ratio, 1, 0.1);
  for (LightSource& source : sequence.calibration.light.sources) source.intensity *= 1e-3;
  const LightErrors without = Learn(sequence, {"schedule.iterations=100", "network.bound_albedo=false"});
  EXPECT_GT(without.above_one.minCoeff(), 0.99);
  EXPECT_LT(without.albedo_factor.maxCoeff(), 1e-2);
  for (const bool known : {true, false}) {
    sequence.calibration.light.calibrated = known;
    const LightErrors bounded = Learn(sequence, {"schedule.iterations=100"});
    EXPECT_EQ(bounded.above_one, Vec3d::Zero());
    EXPECT_GT(bounded.albedo_factor.minCoeff(), 0.5);
    EXPECT_LT(bounded.albedo_factor.maxCoeff(), 4);
    EXPECT_NEAR(direct_ratio_ / direct_ratio, 1, 0.1);
  }
  // Where the bound is for radiosity alone, it does nothing elsewhere.
  EXPECT_FALSE(Field<float>(ReadTrainOptions("fast", {"network.interreflection=mean"}).field,
                            InitialSurface({}, {Pose::Identity()}, Vec3d::Zero()),
                            Eigen::AlignedBox3d(Vec3d::Constant(-50), Vec3d::Constant(50)))
                   .bounds_albedo());
}

}  // namespace
}  // namespace lumen
