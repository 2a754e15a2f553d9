#include "recon/calibration/bounced_light.h"

#include <algorithm>
#include <cmath>
#include <vector>

#include "common/parallel.h"

namespace lumen {
namespace {

// Rays between places start and end this far from the wall, which is as rough as its mesh.
constexpr double kLift_mm = 0.7;

// Bounces among places that a frame doesn't show; of light that comes from those it shows.
constexpr int kRounds = 6;

// One product with the form factors serves so many.
constexpr int kFramesTogether = 8;

// Of places whose albedo nobody has seen.
double MedianResponse(const WallModel& model, int channel) {
  std::vector<float> known;
  for (Eigen::Index i = 0; i < model.log_response.rows(); ++i) {
    if (std::isfinite(model.log_response(i, channel))) known.push_back(model.log_response(i, channel));
  }
  if (known.empty()) return 0;
  const auto middle = known.begin() + std::ptrdiff_t(known.size() / 2);
  std::nth_element(known.begin(), middle, known.end());
  return std::exp(*middle);
}

}  // namespace

Eigen::MatrixXf FormFactors(const RayScene& scene, const Sightings& sightings) {
  const int n = sightings.count();
  const auto& places = sightings.places;
  Eigen::MatrixXf factors = Eigen::MatrixXf::Zero(n, n);
  // By columns, which are contiguous; pairs are symmetric, as all places stand for the same area.
  ParallelFor(0, n, [&](int64_t k) {
    const Vec3f from = scene.ToLocal(places[k].point + kLift_mm * places[k].normal);
    for (int i = 0; i < n; ++i) {
      const Vec3d d = places[k].point - places[i].point;
      const double near = places[i].normal.dot(d), far = -places[k].normal.dot(d);
      if (!(near > 0) || !(far > 0)) continue;
      const double squared = d.squaredNorm();
      const Vec3f way = scene.ToLocal(places[i].point + kLift_mm * places[i].normal) - from;
      if (scene.Occluded(from, way, 0, 1)) continue;
      factors(i, k) = static_cast<float>(near * far / squared * sightings.area_mm2 /
                                         (kPi * squared + sightings.area_mm2));
    }
  });
  for (int i = 0; i < n; ++i) {
    const float sum = factors.row(i).sum();
    if (sum > 1) factors.row(i) /= sum;
  }
  return factors;
}

Eigen::ArrayXXf BouncedLight(const Eigen::MatrixXf& factors, const Sightings& sightings,
                             const WallModel& model, int channel) {
  const Eigen::Index places = sightings.count(), frames = sightings.frames();
  const double unknown = MedianResponse(model, channel);
  const float strength = static_cast<float>(model.strength[channel]);
  Eigen::ArrayXf response(places);
  for (Eigen::Index i = 0; i < places; ++i) {
    const float log_response = model.log_response(i, channel);
    response[i] = std::isfinite(log_response) ? std::exp(log_response) : static_cast<float>(unknown);
  }
  Eigen::ArrayXXf bounced = Eigen::ArrayXXf::Zero(places, frames);
  ParallelChunks(0, frames, kFramesTogether, [&](int64_t first, int64_t last) {
    Eigen::MatrixXf leaves(places, last - first), arrives = Eigen::MatrixXf::Zero(places, last - first);
    for (int round = 0; round < kRounds; ++round) {
      for (int64_t frame = first; frame < last; ++frame) {
        const float gain = static_cast<float>(std::exp(model.log_gain[frame]) / kPi);
        for (Eigen::Index i = 0; i < places; ++i) {
          const float value = sightings.value[channel](i, frame);
          const float predicted =
              response[i] * (gain * sightings.irradiance(i, frame) + strength * arrives(i, frame - first));
          const float unseen = std::isinf(value) ? std::max(1.0f, predicted) : predicted;
          leaves(i, frame - first) = std::isfinite(value) ? value : unseen;
        }
      }
      arrives.noalias() = factors * leaves;
    }
    bounced.middleCols(first, last - first) = arrives.array();
  });
  return bounced;
}

}  // namespace lumen
