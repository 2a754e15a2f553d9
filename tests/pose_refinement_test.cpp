// Poses that are learnt with the surface.
#include "recon/training/pose_refinement.h"

#include <gtest/gtest.h>

#include <Eigen/Geometry>

#include "common/files.h"
#include "common/random.h"
#include "recon/training/learnt_light.h"
#include "recon/training/pose_noise.h"
#include "recon/training/train.h"
#include "recon/training/trainer.h"
#include "tests/small_sequence.h"
#include "tests/support.h"

namespace lumen {
namespace {

// Rms shift, mm, and turn, rad, between poses, less what all have in common of the shift.
struct PoseError {
  double shift_mm, turn_rad;
};
PoseError ErrorOf(const std::vector<Pose>& poses, const std::vector<Pose>& truth) {
  Vec3d mean = Vec3d::Zero();
  const double share = 1.0 / static_cast<double>(poses.size());
  for (size_t i = 0; i < poses.size(); ++i) mean += share * (poses[i].translation() - truth[i].translation());
  PoseError error{0, 0};
  for (size_t i = 0; i < poses.size(); ++i) {
    error.shift_mm += share * (poses[i].translation() - truth[i].translation() - mean).squaredNorm();
    const double angle = Eigen::AngleAxisd(poses[i].linear().transpose() * truth[i].linear()).angle();
    error.turn_rad += share * angle * angle;
  }
  return {std::sqrt(error.shift_mm), std::sqrt(error.turn_rad)};
}

TEST(PoseNoise, HasTheRootMeanSquareThatItIsToldAndFollowsFromSeedAndFrame) {
  Sequence exact;
  for (int number = 0; number < 4000; ++number) {
    SequenceFrame frame;
    frame.number = number;
    frame.world_from_camera.translate(Vec3d(1, 2, 3));
    frame.world_from_camera.rotate(Eigen::AngleAxisd(1, Vec3d(0, 0.6, 0.8)));
    exact.frames.push_back(frame);
  }
  Sequence noisy = exact, again = exact, other = exact;
  const PoseNoise noise{0.5, 0.005};
  AddPoseNoise(noise, 7, &noisy);
  AddPoseNoise(noise, 7, &again);
  AddPoseNoise(noise, 8, &other);
  double shift = 0, angle = 0;
  Vec3d mean = Vec3d::Zero();
  for (size_t i = 0; i < exact.frames.size(); ++i) {
    const Pose &a = exact.frames[i].world_from_camera, &b = noisy.frames[i].world_from_camera;
    EXPECT_EQ(b.matrix(), again.frames[i].world_from_camera.matrix());
    EXPECT_NE(b.matrix(), other.frames[i].world_from_camera.matrix());
    const Vec3d by = b.translation() - a.translation();
    mean += by / double(exact.frames.size());
    shift += by.squaredNorm() / double(exact.frames.size());
    const double turned = Eigen::AngleAxisd(a.rotation().transpose() * b.rotation()).angle();
    angle += turned * turned / double(exact.frames.size());
  }
  // Four standard errors of 4000 frames: the mean's is 0.5 / √4000 at most, a root mean square's relative one
  // √(2/3 / 4000) / 2.
  EXPECT_LT(mean.norm(), 4 * 0.5 / std::sqrt(4000.0));
  EXPECT_NEAR(std::sqrt(shift), 0.5, 0.5 * 4 * std::sqrt(2.0 / 3 / 4000) / 2);
  EXPECT_NEAR(std::sqrt(angle), 0.005, 0.005 * 4 * std::sqrt(2.0 / 3 / 4000) / 2);
}

// A run that disturbs its poses is one on a sequence whose poses are so disturbed; what it has learnt of the
// light is looked at from there.
TEST(PoseNoise, ARunMayStartFromDisturbedPoses) {
  const test::ScratchFolder folder;
  const Sequence& exact = test::SmallSequence();
  Sequence noisy = exact;
  constexpr uint64_t kSeed = 3;
  AddPoseNoise({0.7, 0.01}, kSeed, &noisy);
  const auto run_on = [&](const Sequence& sequence, const std::string& name,
                          std::vector<std::string> settings) {
    settings.insert(settings.end(), {"schedule.iterations=20", "sampling.rays=32", "extract.cell_mm=3"});
    TrainRun run;
    run.folder = folder / name;
    run.seed = kSeed;
    Train(sequence, ReadTrainOptions("fast", settings), run);
    return ReadFile(run.folder / "mesh.ply");
  };
  const std::string disturbed =
      run_on(exact, "disturbed", {"poses.disturb_mm=0.7", "poses.disturb_rad=0.01"});
  EXPECT_EQ(disturbed, run_on(noisy, "noisy", {}));
  EXPECT_NE(disturbed, run_on(exact, "exact", {}));
  const LightFrame found = LearntLight(folder / "disturbed", exact).At(1, 7),
                   expected = LearntLight(folder / "noisy", noisy).At(1, 7);
  ASSERT_FALSE(found.distance_mm.data.empty());
  for (size_t i = 0; i < found.distance_mm.data.size(); ++i) {
    const float a = found.distance_mm.data[i], b = expected.distance_mm.data[i];
    EXPECT_TRUE(a == b || (std::isnan(a) && std::isnan(b))) << i;
  }
}

TEST(PoseRefinement, MotionsComeToPosesAndRaysAlike) {
  PoseMotions motions;
  motions.Resize(2);
  const float values[] = {0, 0, 0, 0, 0, 0, 0.1f, -0.2f, 0.3f, 0.02f, 0.01f, -0.03f};
  std::copy(std::begin(values), std::end(values), motions.values.begin());
  Pose pose = Pose::Identity();
  pose.linear() = Eigen::AngleAxisd(0.7, Vec3d(1, 2, -1).normalized()).toRotationMatrix();
  pose.translation() = Vec3d(5, -3, 2);
  EXPECT_TRUE(Moved(pose, motions, 0).matrix() == pose.matrix());
  const Pose moved = Moved(pose, motions, 1);
  EXPECT_NEAR((moved.linear().transpose() * moved.linear() - Mat3<double>::Identity()).norm(), 0, 1e-6);
  RayBatch<float>::Ray ray;
  ray.frame = 1;
  ray.origin = pose.translation().cast<float>();
  const Vec3d in_camera = Vec3d(0.3, -0.2, 1).normalized();
  ray.direction = (pose.linear() * in_camera).cast<float>();
  Move(motions, &ray);
  EXPECT_NEAR((ray.origin.cast<double>() - moved.translation()).norm(), 0, 1e-6);
  EXPECT_NEAR((ray.direction.cast<double>() - moved.linear() * in_camera).norm(), 0, 1e-6);
}

TEST(PoseRefinement, WhatAllFramesHaveInCommonStaysOut) {
  PoseMotions motions;
  motions.Resize(3);
  std::vector<Pose> given(3, Pose::Identity());
  given[1].translation() = Vec3d(1, 5, -20);
  given[2].translation() = Vec3d(-3, 4, -31);
  std::vector<float> gradient(3 * kPoseNumbers);
  for (size_t i = 0; i < gradient.size(); ++i) gradient[i] = 1.0f + 0.5f * static_cast<float>(i % 5);
  for (int step = 1; step < 20; ++step) {
    std::vector<float> now = gradient;
    now[7] = step % 2 ? -1.0f : 2.0f;
    UpdateMotions(AdamStep(0.01, step, 0.99), AdamStep(0.01, step, 0.99), &now, &motions);
    for (float g : now) EXPECT_EQ(g, 0);
  }
  float largest = 0;
  for (size_t d = 0; d < kPoseNumbers; ++d) {
    float sum = 0;
    for (size_t frame = 0; frame < 3; ++frame) {
      sum += motions.values[frame * kPoseNumbers + d];
      largest = std::max(largest, std::abs(motions.values[frame * kPoseNumbers + d]));
    }
    EXPECT_NEAR(sum, 0, 1e-6);
  }
  EXPECT_GT(largest, 0.1);
}

std::vector<Pose> Path(double length_mm) {
  std::vector<Pose> path;
  for (int i = 0; i < 20; ++i) {
    Pose pose = Pose::Identity();
    pose.translation() = Vec3d(std::sin(i), std::cos(2.0 * i), i) * length_mm / 20 + Vec3d(7, 8, 9);
    pose.rotate(Eigen::AngleAxisd(0.1 * i, Vec3d::UnitY()));
    path.push_back(pose);
  }
  return path;
}

// What has drifted comes back: of a long path all of it but for what the noise leaves open, of one that is
// shorter than its noise only the shift.
TEST(PoseRefinement, DriftIsTakenBackAsFarAsTheGivenPathTellsIt) {
  Similarity drift;
  drift.scale = 1.03;
  drift.rotation = Eigen::AngleAxisd(0.01, Vec3d(1, 2, 2).normalized()).toRotationMatrix();
  drift.translation = Vec3d(0.2, -0.1, 0.3);
  const auto left_mm = [&](double length_mm, double noise_mm) {
    const std::vector<Pose> given = Path(length_mm);
    std::vector<Pose> refined;
    for (const Pose& pose : given) refined.push_back(Mapped(drift, pose));
    const Similarity back = BackToGiven(refined, given, {noise_mm, 0.005});
    double worst = 0;
    for (size_t i = 0; i < given.size(); ++i)
      worst = std::max(worst, (Mapped(back, refined[i]).translation() - given[i].translation()).norm());
    return worst;
  };
  EXPECT_LT(left_mm(40, 1e-6), 1e-9);
  // Squares of 20 places over 40 mm come to 2,900 mm² and more: a variance of 0.0053² beside 0.03² leaves 3%
  // of 3% of 20 mm.
  EXPECT_LT(left_mm(40, 0.5), 0.02);
  EXPECT_GT(left_mm(40, 0.5), 0);
  EXPECT_LT(left_mm(0.2, 0.5), 0.03 * 0.2 + 0.01 * 0.2);
  // Cameras at one place have no scale.
  const std::vector<Pose> one(4, Pose::Identity());
  EXPECT_TRUE(Mapped(BackToGiven(one, one, {0.5, 0.005}), one[0]).matrix() == one[0].matrix());
}

// Against differences of what it is the gradient of.
TEST(PoseRefinement, ThePullIsTheGradientOfSquaresInUnitsOfTheNoise) {
  PoseMotions motions;
  motions.Resize(2);
  for (size_t i = 0; i < motions.values.size(); ++i)
    motions.values[i] = 0.1f * static_cast<float>(i % 5) - 0.2f;
  const auto loss = [&](size_t at, double step) {
    double sum = 0;
    for (size_t i = 0; i < motions.values.size(); ++i) {
      const double value = motions.values[i] + (i == at ? step : 0);
      const double square = i % 6 < 3 ? 0.5 * 0.5 / 3 : 0.01 * 0.01 / 3;
      sum += 0.7 * value * value / square / 2 / 2;
    }
    return sum;
  };
  std::vector<float> gradient(motions.values.size(), 1.0f);
  AddPull(0.7, {0.5, 0.01}, motions, &gradient);
  for (size_t i = 0; i < gradient.size(); ++i) {
    const double expected = (loss(i, 1e-3) - loss(i, -1e-3)) / 2e-3;
    EXPECT_NEAR(gradient[i], 1 + expected, 1e-5 * (1 + std::abs(expected))) << i;
  }
}

// Poses that are off by half a mm and half a degree come nearer to the true ones.
TEST(PoseRefinement, PosesComeNearerToTheTruth) {
  Sequence sequence = test::SmallSequence();
  std::vector<Pose> truth;
  uint64_t draw = 0;
  const auto uniform = [&] { return 2 * UniformDouble(RandomBits(5, ++draw)) - 1; };
  for (SequenceFrame& frame : sequence.frames) {
    truth.push_back(frame.world_from_camera);
    const Vec3d shift = 0.5 * Vec3d(uniform(), uniform(), uniform());
    const Vec3d turn = 0.5 * kPi / 180 * Vec3d(uniform(), uniform(), uniform());
    frame.world_from_camera.translation() += shift;
    frame.world_from_camera.linear() = Eigen::AngleAxisd(turn.norm(), turn.normalized()).toRotationMatrix() *
                                       frame.world_from_camera.linear();
  }
  const TrainOptions options = ReadTrainOptions("fast", {"poses.refine=true", "sampling.rays=128"});
  const TrainingFrames frames(sequence, options.frames, true);
  Trainer trainer(frames, options, 1);
  const PoseError before = ErrorOf(trainer.Poses(), truth);
  constexpr int kSteps = 1500;
  for (int step = 0; step < kSteps; ++step) trainer.Step(double(step) / kSteps);
  const PoseError after = ErrorOf(trainer.Poses(), truth);
  RecordProperty("shift_mm", std::to_string(before.shift_mm) + " to " + std::to_string(after.shift_mm));
  RecordProperty("turn_rad", std::to_string(before.turn_rad) + " to " + std::to_string(after.turn_rad));
  EXPECT_LT(after.shift_mm, 0.8 * before.shift_mm);
  EXPECT_LT(after.turn_rad, before.turn_rad);
  // Without being asked for, poses stay as they are.
  Trainer still(frames, ReadTrainOptions("fast", {"sampling.rays=32"}), 1);
  still.Step(0.5);
  EXPECT_EQ(ErrorOf(still.Poses(), truth).shift_mm, before.shift_mm);
}

}  // namespace
}  // namespace lumen
