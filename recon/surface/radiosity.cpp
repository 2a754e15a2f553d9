#include "recon/surface/radiosity.h"

#include <algorithm>
#include <cmath>

namespace lumen {
namespace {

// Row i: what share of what leaves each patch patch i's irradiance has.
Eigen::MatrixXd FormFactors(const std::vector<Patch>& patches) {
  const auto n = static_cast<Eigen::Index>(patches.size());
  Eigen::MatrixXd factors = Eigen::MatrixXd::Zero(n, n);
  for (Eigen::Index i = 0; i < n; ++i) {
    const Patch& to = patches[static_cast<size_t>(i)];
    for (Eigen::Index k = 0; k < n; ++k) {
      const Patch& from = patches[static_cast<size_t>(k)];
      const Vec3d d = from.point - to.point;
      const double squared = d.squaredNorm(), near = to.normal.dot(d), far = -from.normal.dot(d);
      if (i == k || !(near > 0) || !(far > 0)) continue;
      factors(i, k) = near * far / squared * from.area_mm2 / (kPi * squared + from.area_mm2);
    }
    const double sum = factors.row(i).sum();
    if (sum > 1) factors.row(i) /= sum;
  }
  return factors;
}

}  // namespace

std::vector<Vec3d> InterreflectedIrradiance(const std::vector<Patch>& patches) {
  const auto n = static_cast<Eigen::Index>(patches.size());
  const Eigen::MatrixXd factors = FormFactors(patches);
  Eigen::MatrixX3d albedo(n, 3), direct(n, 3), bounced = Eigen::MatrixX3d::Zero(n, 3);
  for (Eigen::Index i = 0; i < n; ++i) {
    albedo.row(i) = patches[static_cast<size_t>(i)].albedo.cwiseMin(kPalest);
    direct.row(i) = patches[static_cast<size_t>(i)].irradiance;
  }
  // Every round adds a bounce. What all later ones would add is at most albedo^32 of the whole: .001 at .8,
  // .19 at the palest, which is for the learnt factor to make up for.
  constexpr int kBounces = 32;
  for (int bounce = 0; bounce < kBounces; ++bounce) {
    bounced = factors * (albedo.array() * (direct + bounced).array()).matrix();
  }
  std::vector<Vec3d> result;
  for (Eigen::Index i = 0; i < n; ++i) result.push_back(bounced.row(i).transpose());
  return result;
}

}  // namespace lumen
