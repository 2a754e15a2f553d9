// Poses that are learnt with the surface.
#include "recon/training/pose_refinement.h"

#include <gtest/gtest.h>

#include "common/random.h"
#include "recon/training/trainer.h"
#include "tests/small_sequence.h"

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
  std::vector<float> gradient(3 * kPoseNumbers);
  for (size_t i = 0; i < gradient.size(); ++i) gradient[i] = 1.0f + 0.5f * static_cast<float>(i % 5);
  for (int step = 1; step < 20; ++step) {
    std::vector<float> now = gradient;
    now[7] = step % 2 ? -1.0f : 2.0f;
    UpdateMotions(AdamStep(0.1, step, 0.99), AdamStep(0.01, step, 0.99), &now, &motions);
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
