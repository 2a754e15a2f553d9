#include "recon/surface/radiosity.h"

namespace lumen {
namespace {

// Row i: what share of what leaves each patch patch i's irradiance has.
Eigen::MatrixXd FormFactors(const std::vector<Patch>& patches) {
  const auto n = static_cast<Eigen::Index>(patches.size());
  Eigen::MatrixXd factors(n, n);
  for (Eigen::Index i = 0; i < n; ++i) {
    for (Eigen::Index k = 0; k < n; ++k) {
      factors(i, k) = FormFactor(patches[static_cast<size_t>(i)], patches[static_cast<size_t>(k)]);
    }
    const double sum = factors.row(i).sum();
    if (sum > 1) factors.row(i) /= sum;
  }
  return factors;
}

// One patch for each group: what its parts are in the mean, by their areas.
std::vector<Patch> Merged(const std::vector<Patch>& patches, const std::vector<int>& group, int groups) {
  const Vec3d zero = Vec3d::Zero();
  std::vector<Patch> merged(static_cast<size_t>(groups), {zero, zero, 0, zero, zero});
  for (size_t i = 0; i < patches.size(); ++i) {
    const Patch& part = patches[i];
    Patch& whole = merged[static_cast<size_t>(group[i])];
    whole.area_mm2 += part.area_mm2;
    whole.point += part.area_mm2 * part.point;
    whole.normal += part.area_mm2 * part.normal;
    whole.albedo += part.area_mm2 * part.albedo.cwiseMin(kPalest);
    whole.irradiance += part.area_mm2 * part.irradiance;
  }
  for (Patch& whole : merged) {
    whole.point /= whole.area_mm2;
    whole.normal.normalize();
    whole.albedo /= whole.area_mm2;
    whole.irradiance /= whole.area_mm2;
  }
  return merged;
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

std::vector<Vec3d> InterreflectedIrradiance(const std::vector<Patch>& patches, const std::vector<int>& group,
                                            int groups) {
  const std::vector<Vec3d> bounced = InterreflectedIrradiance(Merged(patches, group, groups));
  std::vector<Vec3d> leaving;
  for (size_t i = 0; i < patches.size(); ++i) {
    const Patch& patch = patches[i];
    const Vec3d received = patch.irradiance + bounced[static_cast<size_t>(group[i])];
    leaving.push_back(patch.albedo.cwiseMin(kPalest).cwiseProduct(received));
  }
  return GatherInLanes(patches, leaving);
}

}  // namespace lumen
