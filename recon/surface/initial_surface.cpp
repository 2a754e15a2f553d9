#include "recon/surface/initial_surface.h"

#include <cmath>
#include <limits>

namespace lumen {
namespace {

double DistanceToSegment(const Vec3d& point, const Vec3d& start, const Vec3d& span) {
  const double length2 = span.squaredNorm();
  const double along = length2 > 0 ? std::clamp((point - start).dot(span) / length2, 0.0, 1.0) : 0.0;
  return (point - start - along * span).norm();
}

}  // namespace

InitialSurface::InitialSurface(const InitialSurfaceOptions& options,
                               const std::vector<Pose>& world_from_camera, const Vec3d& origin)
    : is_learnt_(options.shape == InitialShape::kSphere), radius_mm_(options.radius_mm) {
  if (is_learnt_) {
    double farthest = 0;
    for (const Pose& pose : world_from_camera)
      farthest = std::max(farthest, (pose.translation() - origin).norm());
    radius_mm_ += farthest;
    starts_.push_back(Vec3d::Zero());
    spans_.push_back(Vec3d::Zero());
    return;
  }
  auto distance = [&](const Vec3d& point) {
    double nearest = std::numeric_limits<double>::infinity();
    for (size_t i = 0; i < starts_.size(); ++i) {
      nearest = std::min(nearest, DistanceToSegment(point, starts_[i], spans_[i]));
    }
    return nearest;
  };
  auto add = [&](const Vec3d& from, const Vec3d& to) {
    starts_.push_back(from);
    spans_.push_back(to - from);
  };
  const double covered = options.radius_mm / 2;
  Vec3d last = world_from_camera.front().translation() - origin;
  add(last, last);
  for (const Pose& pose : world_from_camera) {
    const Vec3d position = pose.translation() - origin;
    // Every camera lies within an eighth of the radius of the path.
    if ((position - last).norm() > options.radius_mm / 8) {
      add(last, position);
      last = position;
    }
  }
  for (const Pose& pose : world_from_camera) {
    const Vec3d position = pose.translation() - origin;
    const Vec3d tip = position + options.reach_mm * pose.linear().col(2);
    if (distance(tip) > covered) add(position, tip);
  }
}

template <class T, bool kGradient>
void InitialSurface::EvaluateTile(const T* positions, T* value, T* gradient) const {
  alignas(64) T best[kTile];
  alignas(64) T offset[3][kTile] = {};
  std::fill(best, best + kTile, std::numeric_limits<T>::max());
  for (size_t i = 0; i < starts_.size(); ++i) {
    const Vec3<T> start = starts_[i].cast<T>(), span = spans_[i].cast<T>();
    const T length2 = span.squaredNorm();
    const T inverse = length2 > 0 ? 1 / length2 : T(0);
    for (int s = 0; s < kTile; ++s) {
      const T x = positions[s] - start[0], y = positions[kTile + s] - start[1],
              z = positions[2 * kTile + s] - start[2];
      T along = (x * span[0] + y * span[1] + z * span[2]) * inverse;
      along = along < 0 ? T(0) : along;
      along = along > 1 ? T(1) : along;
      const T dx = x - along * span[0], dy = y - along * span[1], dz = z - along * span[2];
      const T distance2 = dx * dx + dy * dy + dz * dz;
      const bool nearer = distance2 < best[s];
      best[s] = nearer ? distance2 : best[s];
      if constexpr (!kGradient) continue;
      offset[0][s] = nearer ? dx : offset[0][s];
      offset[1][s] = nearer ? dy : offset[1][s];
      offset[2][s] = nearer ? dz : offset[2][s];
    }
  }
  for (int s = 0; s < kTile; ++s) {
    const T distance = std::sqrt(best[s]);
    value[s] = static_cast<T>(radius_mm_) - distance;
    best[s] = distance > 0 ? -1 / distance : T(0);
  }
  if constexpr (!kGradient) return;
  for (int d = 0; d < 3; ++d)
    for (int s = 0; s < kTile; ++s) gradient[d * kTile + s] = offset[d][s] * best[s];
}

template <class T>
void InitialSurface::Evaluate(const T* positions, T* value, T* gradient) const {
  gradient ? EvaluateTile<T, true>(positions, value, gradient)
           : EvaluateTile<T, false>(positions, value, gradient);
}

std::vector<Vec3d> InitialSurface::Spine(double step_mm) const {
  std::vector<Vec3d> points;
  for (size_t i = 0; i < starts_.size(); ++i) {
    const int steps = std::max(1, static_cast<int>(std::ceil(spans_[i].norm() / step_mm)));
    for (int k = 0; k <= steps; ++k) points.push_back(starts_[i] + spans_[i] * (double(k) / steps));
  }
  return points;
}

template void InitialSurface::Evaluate<float>(const float*, float*, float*) const;
template void InitialSurface::Evaluate<double>(const double*, double*, double*) const;

}  // namespace lumen
