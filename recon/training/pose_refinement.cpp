#include "recon/training/pose_refinement.h"

namespace lumen {
namespace {

Vec3f Part(const PoseMotions& motions, int frame, int part) {
  return Eigen::Map<const Vec3f>(&motions.values[static_cast<size_t>(frame * kPoseNumbers + 3 * part)]);
}

Mat3<float> RotationBy(const Vec3f& vector) {
  const float angle = vector.norm();
  if (angle == 0) return Mat3<float>::Identity();
  return Eigen::AngleAxisf(angle, vector / angle).toRotationMatrix();
}

}  // namespace

void PoseMotions::Resize(int frames) {
  for (std::vector<float>* numbers : {&values, &first, &second}) {
    numbers->assign(static_cast<size_t>(frames * kPoseNumbers), 0.0f);
  }
}

Pose Moved(const Pose& world_from_camera, const PoseMotions& motions, int frame) {
  Pose pose = world_from_camera;
  pose.translation() += Part(motions, frame, 0).cast<double>();
  pose.linear() = RotationBy(Part(motions, frame, 1)).cast<double>() * pose.linear();
  return pose;
}

void Move(const PoseMotions& motions, RayBatch<float>::Ray* ray) {
  ray->origin += Part(motions, ray->frame, 0);
  ray->direction = (RotationBy(Part(motions, ray->frame, 1)) * ray->direction).normalized();
}

void UpdateMotions(const AdamStep& translation, const AdamStep& rotation, std::vector<float>* gradient,
                   PoseMotions* motions) {
  Vec3f mean[2] = {Vec3f::Zero(), Vec3f::Zero()};
  for (int frame = 0; frame < motions->frames(); ++frame) {
    for (int part = 0; part < 2; ++part) {
      const size_t at = static_cast<size_t>(frame * kPoseNumbers + 3 * part);
      AdamUpdate(part == 0 ? translation : rotation, 3, &motions->values[at], &(*gradient)[at],
                 &motions->first[at], &motions->second[at]);
      mean[part] += Part(*motions, frame, part) / static_cast<float>(motions->frames());
    }
  }
  for (size_t i = 0; i < motions->values.size(); ++i) {
    motions->values[i] -= mean[i % kPoseNumbers / 3][static_cast<Eigen::Index>(i % 3)];
  }
}

}  // namespace lumen
