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

void TakeOutMean(std::vector<float>* numbers) {
  const size_t frames = numbers->size() / kPoseNumbers;
  for (size_t d = 0; d < kPoseNumbers; ++d) {
    double mean = 0;
    for (size_t i = d; i < numbers->size(); i += kPoseNumbers) mean += (*numbers)[i] / double(frames);
    for (size_t i = d; i < numbers->size(); i += kPoseNumbers) (*numbers)[i] -= static_cast<float>(mean);
  }
}

// Least squares: the part of the translations that lengthens the given places' distances from their mean. It
// leaves the translations' mean as it is.
void TakeOutScale(const std::vector<Pose>& given, std::vector<float>* numbers) {
  Vec3d mean = Vec3d::Zero();
  for (const Pose& pose : given) mean += pose.translation() / static_cast<double>(given.size());
  double along = 0, squares = 0;
  for (size_t frame = 0; frame < given.size(); ++frame) {
    const Vec3d from_mean = given[frame].translation() - mean;
    for (int d = 0; d < 3; ++d) along += from_mean[d] * (*numbers)[frame * kPoseNumbers + size_t(d)];
    squares += from_mean.squaredNorm();
  }
  if (!(squares > 0)) return;  // cameras that are all at one place have no scale
  for (size_t frame = 0; frame < given.size(); ++frame) {
    const Vec3d longer = along / squares * (given[frame].translation() - mean);
    for (int d = 0; d < 3; ++d) (*numbers)[frame * kPoseNumbers + size_t(d)] -= static_cast<float>(longer[d]);
  }
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

void AddPull(double weight, const GivenPoseError& noise, const PoseMotions& motions,
             std::vector<float>* gradient) {
  for (size_t i = 0; i < gradient->size(); ++i) {
    // Of one of a vector's three components.
    const double rms = i % kPoseNumbers < 3 ? noise.shift_mm : noise.turn_rad;
    (*gradient)[i] += static_cast<float>(3 * weight / (rms * rms) / motions.frames() * motions.values[i]);
  }
}

void UpdateMotions(const AdamStep& translation, const AdamStep& rotation, const std::vector<Pose>& given,
                   std::vector<float>* gradient, PoseMotions* motions) {
  TakeOutMean(gradient);
  TakeOutScale(given, gradient);
  for (int frame = 0; frame < motions->frames(); ++frame) {
    for (int part = 0; part < 2; ++part) {
      const size_t at = static_cast<size_t>(frame * kPoseNumbers + 3 * part);
      AdamUpdate(part == 0 ? translation : rotation, 3, &motions->values[at], &(*gradient)[at],
                 &motions->first[at], &motions->second[at]);
    }
  }
  TakeOutMean(&motions->values);
  TakeOutScale(given, &motions->values);
}

}  // namespace lumen
