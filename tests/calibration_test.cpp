// Gains from places that several frames show: the regression against values made by its own model's formula
// with everything known, and the whole against simulated frames.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <map>

#include "common/files.h"
#include "common/progress.h"
#include "common/random.h"
#include "recon/calibration/calibrate.h"
#include "recon/calibration/calibration_report.h"
#include "recon/training/trainer.h"
#include "sim/render.h"
#include "tests/support.h"

namespace lumen::test {
namespace {

double Uniform(int a, int b) { return UniformDouble(RandomBits(7, a, b)); }

// Places that frames see from distances of 10 to 40 mm, with an albedo each; every 20th value is a glint.
struct Synthetic {
  static constexpr int kPlaces = 120, kFrames = 6;
  Sequence sequence;
  Sightings sightings;
  std::vector<Eigen::ArrayXXf> bounced;
  std::vector<double> gain = {1, 1.7, 0.6, 2.4, 1.1, 0.9};

  explicit Synthetic(const Eigen::Array3d& strength) {
    sequence.folder = "synthetic";
    for (int f = 0; f < kFrames; ++f) sequence.frames.emplace_back().number = f;
    const Eigen::ArrayXXf zero = Eigen::ArrayXXf::Zero(kPlaces, kFrames);
    auto& s = sightings;
    s.irradiance = s.by_spread = s.log_cosine = s.view_cosine = s.distance_mm = zero;
    bounced.assign(3, zero);
    for (auto& value : s.value) value = zero;
    for (int p = 0; p < kPlaces; ++p) {
      s.places.push_back({Vec3d(100 * Uniform(p, 0), 100 * Uniform(p, 1), 0), Vec3d::UnitZ()});
      for (int f = 0; f < kFrames; ++f) Fill(p, f, strength);
    }
  }

  void Fill(int p, int f, const Eigen::Array3d& strength) {
    auto& s = sightings;
    const double d = 10 + 30 * Uniform(p, 10 + f), cosine = 0.3 + 0.7 * Uniform(p, 20 + f);
    const double off_axis = Uniform(p, 30 + f);
    s.irradiance(p, f) = static_cast<float>(3600 * std::exp(-2.7 * off_axis) * cosine / (d * d));
    s.by_spread(p, f) = static_cast<float>(-off_axis);
    s.log_cosine(p, f) = static_cast<float>(std::log(cosine));
    s.view_cosine(p, f) = static_cast<float>(cosine);
    s.distance_mm(p, f) = static_cast<float>(d);
    for (int c = 0; c < 3; ++c) {
      const double albedo = 0.1 + 0.8 * Uniform(p, 40 + c);
      bounced[c](p, f) = static_cast<float>(gain[f] * Uniform(p, 50 + 10 * c + f));
      const double value =
          albedo * (gain[f] * double(s.irradiance(p, f)) / kPi + strength[c] * double(bounced[c](p, f)));
      const double glint = (p + 7 * f) % 20 == 0 ? 3 : 1;
      s.value[c](p, f) = static_cast<float>(glint * value);
    }
  }

  double LargestError(const Eigen::VectorXd& log_gain) const {
    double largest = 0;
    for (int f = 0; f < kFrames; ++f)
      largest = std::max(largest, std::abs(log_gain[f] - std::log(gain[f] / gain[0])));
    return largest;
  }
};

TEST(GainFit, FindsGainsPastGlints) {
  const Synthetic scene(Eigen::Array3d(0, 0, 0));
  const GainFit fit = FitGains(scene.sequence, scene.sightings, {}, {}, nullptr);
  EXPECT_LT(scene.LargestError(fit.wall.log_gain), 1e-4);
  EXPECT_EQ(fit.places, Synthetic::kPlaces);
  EXPECT_EQ(fit.wall.log_gain[0], 0);
}

TEST(GainFit, FindsBouncedLightAndIsWrongWithoutIt) {
  const Eigen::Array3d strength(0.9, 0.4, 0.3);
  const Synthetic scene(strength);
  const GainFit direct = FitGains(scene.sequence, scene.sightings, {}, {}, nullptr);
  EXPECT_GT(scene.LargestError(direct.wall.log_gain), 0.01);  // what the comparison rejects
  const GainFit fit = FitGains(scene.sequence, scene.sightings, scene.bounced, {}, &direct);
  EXPECT_LT(scene.LargestError(fit.wall.log_gain), 1e-3);
  EXPECT_LT((fit.wall.strength - strength).abs().maxCoeff(), 1e-2);
  // Where there is none, none is found.
  const Synthetic plain(Eigen::Array3d(0, 0, 0));
  const GainFit none = FitGains(plain.sequence, plain.sightings, plain.bounced, {}, nullptr);
  EXPECT_LT(none.wall.strength.maxCoeff(), 1e-3);
  EXPECT_LT(plain.LargestError(none.wall.log_gain), 1e-3);
}

TEST(GainFit, FindsSpreadAndContrast) {
  Synthetic scene(Eigen::Array3d(0, 0, 0));
  // The frames were lit with a spread larger by .2, and developed with γ 10% off.
  for (auto& value : scene.sightings.value)
    value = (value * (0.2f * scene.sightings.by_spread).exp()).pow(1.1f);
  GainFitOptions options;
  options.spread = options.contrast = true;
  const GainFit fit = FitGains(scene.sequence, scene.sightings, {}, options, nullptr);
  EXPECT_NEAR(fit.spread_off, 0.2, 1e-2);
  EXPECT_NEAR(fit.contrast, 1.1, 1e-2);
  EXPECT_LT(scene.LargestError(fit.wall.log_gain), 1e-2);
}

TEST(GainFit, TooLittleInCommonIsSaidInOneLine) {
  Synthetic scene(Eigen::Array3d(0, 0, 0));
  for (auto& value : scene.sightings.value) {
    for (int p = 10; p < Synthetic::kPlaces; ++p) value(p, 3) = NAN;
  }
  EXPECT_EQ(
      ErrorOf([&] { FitGains(scene.sequence, scene.sightings, {}, {}, nullptr); }),
      "synthetic: frame 3 shares 10 places with other frames, which is fewer than 30; its gain can't be "
      "told: add frames between, or leave it out");
}

TEST(GainComparison, CountsUpToACommonFactor) {
  std::vector<double> truth, found;
  for (int i = 0; i < 40; ++i) {
    truth.push_back(std::sin(i));
    found.push_back(truth.back() + 5);
  }
  EXPECT_LT(CompareGains(found, truth).largest, 1e-12);
  // One of forty off: 39/40 of .4 from the common factor, the others 1/40 of it to the other side.
  found[3] += 0.4;
  const GainComparison off = CompareGains(found, truth);
  EXPECT_NEAR(off.percentile95, -std::expm1(-0.01), 1e-12);
  EXPECT_NEAR(off.largest, std::expm1(0.39), 1e-12);
}

// Eight frames whose gain swings by 4, calibrated once for all tests.
class Calibrated : public testing::Test {
 protected:
  static void SetUpTestSuite() {
    SetQuiet(true);
    folder_ = new ScratchFolder;
    const Scene scene =
        ReadScene(LUMEN_SOURCE_FOLDER "/scenes/colon.toml",
                  {"camera.width=90", "camera.height=72", "trajectory.frames=8", "trajectory.end_mm=34",
                   "path.samples=1", "geometry.tolerance_mm=0.3", "truth.c3vd=false",
                   "sensor.gain_swing.factor=4", "sensor.gain_swing.period=5.3"},
                  0);
    RenderOptions options;
    options.folder = *folder_ / "sequence";
    Render(scene, options);
    sequence_ = new Sequence(ReadSequence(options.folder));
    found_ = new SequenceCalibration(Calibrate(*sequence_, Quick(), 0));
  }
  static void TearDownTestSuite() {
    delete found_;
    delete sequence_;
    delete folder_;
  }
  static CalibrateOptions Quick() {
    CalibrateOptions options;
    options.surface.iterations = 500;
    options.surface.cell_mm = 2;
    options.sightings.places = 600;
    return options;
  }
  // Makes calibration.toml of the findings and reads the sequence again.
  static Sequence ReadBack(const Findings& findings) {
    WriteFile(sequence_->folder / "calibration.toml", CalibrationText(*sequence_, *found_, findings));
    Sequence read = ReadSequence(sequence_->folder);
    std::filesystem::remove(sequence_->folder / "calibration.toml");
    return read;
  }

  static inline ScratchFolder* folder_;
  static inline Sequence* sequence_;
  static inline SequenceCalibration* found_;
};

TEST_F(Calibrated, GainsThatSwingByFourAreFound) {
  const auto compared = CompareWithSequence(*sequence_, *found_);
  ASSERT_TRUE(compared);
  EXPECT_LT(compared->calibrated.largest, 0.1);
  // What the comparison must reject: gains taken for all the same, or in another order.
  SequenceCalibration wrong = *found_;
  for (Estimate& gain : wrong.log_gain) gain.value = 0;
  EXPECT_GT(CompareWithSequence(*sequence_, wrong)->calibrated.largest, 0.5);
  wrong = *found_;
  std::reverse(wrong.log_gain.begin(), wrong.log_gain.end());
  EXPECT_GT(CompareWithSequence(*sequence_, wrong)->calibrated.largest, 0.5);
  for (size_t i = 1; i < found_->log_gain.size(); ++i) EXPECT_GT(found_->log_gain[i].standard_error, 0);
}

TEST_F(Calibrated, TheTruthIsNotLookedAt) {
  Sequence blind = *sequence_;
  blind.ground_truth_mesh.clear();
  for (SequenceFrame& frame : blind.frames) {
    frame.gain.reset();
    frame.depth = frame.normals = frame.flow = frame.occlusion = "nowhere";
  }
  CalibrateOptions quick = Quick();
  quick.surface.iterations = 20;
  const SequenceCalibration one = Calibrate(blind, quick, 0), other = Calibrate(*sequence_, quick, 0);
  for (size_t i = 0; i < one.log_gain.size(); ++i) EXPECT_EQ(one.log_gain[i].value, other.log_gain[i].value);
}

TEST_F(Calibrated, FileComesBack) {
  found_->spread = {3.1, 0.02};
  found_->gamma = {2.1, 0.01};
  const Sequence read = ReadBack({true, true, true});
  for (size_t i = 0; i < read.frames.size(); ++i) {
    EXPECT_NEAR(std::log(read.frames[i].gain.value()), found_->log_gain[i].value, 1e-5);
    EXPECT_NEAR(read.frames[i].log_gain_error.value(), found_->log_gain[i].standard_error, 1e-6);
  }
  EXPECT_NEAR(read.calibration.light.sources[0].spread, 3.1, 1e-12);
  EXPECT_NEAR(read.calibration.response.gamma, 2.1, 1e-12);
  EXPECT_EQ(read.calibration.light.sources[0].intensity, sequence_->calibration.light.sources[0].intensity);
  // What isn't found stays the sequence's own.
  const Sequence untold = ReadBack({false, false, false});
  EXPECT_EQ(untold.frames[1].gain, sequence_->frames[1].gain);
  EXPECT_FALSE(untold.frames[1].log_gain_error);
  EXPECT_EQ(untold.calibration.response.gamma, 2.2);
}

TEST_F(Calibrated, OnlyWhatTheSequenceDoesNotSayIsWritten) {
  SequenceCalibration sure = *found_;
  sure.tells_spread = sure.tells_gamma = true;
  const Findings own = FindingsOf(*sequence_, sure, false), all = FindingsOf(*sequence_, sure, true);
  EXPECT_FALSE(own.gains || own.spread || own.gamma);
  EXPECT_TRUE(all.gains && all.spread && all.gamma);
  Sequence unknown = *sequence_;
  for (SequenceFrame& frame : unknown.frames) frame.gain.reset();
  EXPECT_TRUE(FindingsOf(unknown, sure, false).gains);
  sure.tells_gamma = false;
  EXPECT_FALSE(FindingsOf(*sequence_, sure, true).gamma);
  EXPECT_NE(ToTable(*sequence_, sure, all).find("the data can't tell it"), std::string::npos);
}

TEST_F(Calibrated, MistakesInTheFileAreNamed) {
  const auto error = [&](const std::string& text) {
    WriteFile(sequence_->folder / "calibration.toml", text);
    const std::string said = ErrorOf([&] { ReadSequence(sequence_->folder); });
    EXPECT_EQ(ErrorOf([&] { ReadSequence(sequence_->folder, {.calibration = false}); }), "");
    std::filesystem::remove(sequence_->folder / "calibration.toml");
    return said.substr(std::min(said.size(), said.find("calibration.toml")));
  };
  EXPECT_EQ(error("[uncertainty]\nspraed = 1\n"),
            "calibration.toml:2: uncertainty.spraed: unknown key; is \"spread\" meant?");
  EXPECT_EQ(error("[uncertainty]\nlog_gain = [0, 1]\n"),
            "calibration.toml:2: uncertainty.log_gain: there is no gain in [frames] that it is of");
  EXPECT_EQ(error("[frames]\ngain = [1, 1, 1, 1, 1, 1, 1, 1]\n[uncertainty]\nlog_gain = [0, 1]\n"),
            "calibration.toml:4: uncertainty.log_gain: has 2 elements, but there are 8 gains");
  EXPECT_NE(error("[uncertainty]\ngamma = -1\n"), "");
  EXPECT_NE(error("format = \"lumen-sequence\"\n"), "");
}

TEST_F(Calibrated, TrainingStartsAtTheGainsAndRefinesThem) {
  const TrainingFrames exact(*sequence_, 8, true);
  EXPECT_TRUE(exact.gains_known());
  EXPECT_EQ(exact.LogGainReach(2), 0);
  const Sequence estimated = ReadBack({true, false, false});
  const TrainingFrames frames(estimated, 8, true);
  EXPECT_FALSE(frames.gains_known());
  EXPECT_NEAR(frames.LogGainReach(2), found_->log_gain[2].standard_error, 1e-5);
  Sequence unknown = *sequence_;
  for (SequenceFrame& frame : unknown.frames) frame.gain.reset();
  EXPECT_TRUE(std::isinf(TrainingFrames(unknown, 8, true).LogGainReach(2)));
  Trainer trainer(frames, ReadTrainOptions("fast", {}), 0);
  for (int i = 0; i < 30; ++i) trainer.Step(i / 30.0);
  int moved = 0;
  for (int i = 0; i < frames.size(); ++i) {
    const double off = std::abs(trainer.state().log_gain[i]);
    EXPECT_LE(off, frames.LogGainReach(i) * (1 + 1e-6));
    moved += off > 0;
  }
  EXPECT_EQ(moved, frames.size() - 1);  // but the first
}

// Where others' gains are given the first frame's isn't 1 for want of a better number.
TEST_F(Calibrated, AFirstFrameWithoutGainIsLearntBesideTheOthers) {
  Sequence sequence = *sequence_;
  sequence.frames[0].gain.reset();
  const TrainingFrames frames(sequence, 8, true);
  EXPECT_TRUE(frames.learns_first_gain());
  EXPECT_FALSE(TrainingFrames(*sequence_, 8, true).learns_first_gain());
  Trainer trainer(frames, ReadTrainOptions("fast", {}), 0);
  for (int i = 0; i < 10; ++i) trainer.Step(i / 10.0);
  EXPECT_NE(trainer.state().log_gain[0], 0);
  for (int i = 1; i < frames.size(); ++i) EXPECT_EQ(trainer.state().log_gain[i], 0);
  for (SequenceFrame& frame : sequence.frames) frame.gain.reset();
  EXPECT_FALSE(TrainingFrames(sequence, 8, true).learns_first_gain());
}

TEST_F(Calibrated, OneFrameIsRefusedInOneLine) {
  Sequence one = *sequence_;
  one.frames.resize(1);
  EXPECT_EQ(ErrorOf([&] { Calibrate(one, Quick(), 0); }),
            one.folder.string() + ": has one frame; gains are told by places that several share");
}

// The command writes calibration.toml and leaves everything else as it was.
TEST_F(Calibrated, CommandTouchesNothingElse) {
  const auto contents = [&] {
    std::map<std::string, std::string> files;
    for (const auto& entry : std::filesystem::recursive_directory_iterator(sequence_->folder)) {
      if (entry.is_regular_file()) files[entry.path().string()] = ReadFile(entry.path());
    }
    return files;
  };
  auto before = contents();
  const auto run = [&](const std::string& options) {
    const std::string command = std::string(LUMEN_COMMAND) + " calibrate --quiet '" +
                                sequence_->folder.string() + "' " + options + " >'" +
                                (*folder_ / "out").string() + "' 2>'" + (*folder_ / "err").string() + "'";
    return WEXITSTATUS(std::system(command.c_str()));
  };
  ASSERT_EQ(run("--everything --set surface.iterations=20 --set places.count=600 --set surface.cell_mm=2"), 0)
      << ReadFile(*folder_ / "err");
  auto after = contents();
  const std::string file = (sequence_->folder / "calibration.toml").string();
  EXPECT_EQ(after.count(file), 1u);
  EXPECT_TRUE(ReadSequence(sequence_->folder).frames[1].log_gain_error);
  after.erase(file);
  EXPECT_EQ(after, before);
  std::filesystem::remove(file);
  EXPECT_EQ(run("--set surface.iteration=20"), 1);
  EXPECT_NE(ReadFile(*folder_ / "err").find("is \"iterations\" meant?"), std::string::npos);
}

}  // namespace
}  // namespace lumen::test
