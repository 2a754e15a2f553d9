#include "common/similarity.h"

#include <Eigen/SVD>
#include <algorithm>
#include <cmath>

#include "common/error.h"

namespace lumen {

Vec3d Mapped(const Similarity& similarity, const Vec3d& point) {
  return similarity.scale * (similarity.rotation * point) + similarity.translation;
}

Pose Mapped(const Similarity& similarity, const Pose& world_from_camera) {
  Pose mapped = Pose::Identity();
  mapped.linear() = similarity.rotation * world_from_camera.linear();
  mapped.translation() = Mapped(similarity, Vec3d(world_from_camera.translation()));
  return mapped;
}

SimilarityFit FitSimilarity(const std::vector<Pose>& from, const std::vector<Pose>& to) {
  const size_t count = from.size();
  if (count < 2) throw InputError("a scale takes two poses at least");
  Mat3d rotations = Mat3d::Zero();
  Vec3d from_mean = Vec3d::Zero(), to_mean = Vec3d::Zero();
  for (size_t i = 0; i < count; ++i) {
    rotations += to[i].linear() * from[i].linear().transpose();
    from_mean += from[i].translation() / static_cast<double>(count);
    to_mean += to[i].translation() / static_cast<double>(count);
  }
  const Eigen::JacobiSVD<Mat3d> svd(rotations, Eigen::ComputeFullU | Eigen::ComputeFullV);
  const double turn = (svd.matrixU() * svd.matrixV().transpose()).determinant();
  SimilarityFit fit;
  fit.similarity.rotation = svd.matrixU() * Vec3d(1, 1, turn).asDiagonal() * svd.matrixV().transpose();
  double along = 0, spread = 0;
  for (size_t i = 0; i < count; ++i) {
    const Vec3d a = fit.similarity.rotation * (from[i].translation() - from_mean);
    along += a.dot(to[i].translation() - to_mean);
    spread += a.squaredNorm();
  }
  // Written so that NaN fails.
  if (!(spread > 0) || !(along > 0)) {
    throw InputError("the poses give no scale: their centres are one, or run the other way");
  }
  fit.similarity.scale = along / spread;
  fit.similarity.translation = to_mean - fit.similarity.scale * (fit.similarity.rotation * from_mean);
  double squares_mm = 0, squares_rad = 0;
  for (size_t i = 0; i < count; ++i) {
    const Pose mapped = Mapped(fit.similarity, from[i]);
    const double distance = (mapped.translation() - to[i].translation()).norm();
    const double angle = Eigen::AngleAxisd(mapped.linear().transpose() * to[i].linear()).angle();
    fit.max_mm = std::max(fit.max_mm, distance);
    fit.max_rad = std::max(fit.max_rad, angle);
    squares_mm += distance * distance;
    squares_rad += angle * angle;
  }
  fit.rms_mm = std::sqrt(squares_mm / static_cast<double>(count));
  fit.rms_rad = std::sqrt(squares_rad / static_cast<double>(count));
  return fit;
}

}  // namespace lumen
