#include "recon/training/initial_reach.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <vector>

#include "common/parallel.h"
#include "recon/surface/shading.h"

namespace lumen {
namespace {

using Ray = RayBatch<float>::Ray;

constexpr int kRays = 4096;
// From a reach to the next: within a tenth the deviation changes little.
constexpr double kStep = 1.15;
// A logarithm that is farther from the median says that the pixel shows something else than a wall like the
// others: a glint, a shadow.
constexpr double kMostDeviation = 2;

// Where a tile of rays that start inside meet a tube's wall, by steps as long as the distance from it, which
// is exact within the tube and never longer than the way to the wall.
void FindWall(const InitialSurface& tube, const Ray* rays, float* position, float* normal) {
  constexpr int kMostSteps = 200;
  constexpr float kNear_mm = 1e-3f;
  float t[kTile] = {}, value[kTile];
  for (int step = 0; step < kMostSteps; ++step) {
    for (int d = 0; d < 3; ++d) {
      for (int i = 0; i < kTile; ++i) {
        position[d * kTile + i] = rays[i].origin[d] + t[i] * rays[i].direction[d];
      }
    }
    tube.Evaluate<float>(position, value, normal);
    float farthest = 0;
    for (int i = 0; i < kTile; ++i) {
      t[i] += value[i];
      farthest = std::max(farthest, std::abs(value[i]));
    }
    if (farthest < kNear_mm) return;
  }
}

double SumOfDeviations(std::vector<double>* values) {
  if (values->empty()) return 0;
  const auto middle = values->begin() + static_cast<std::ptrdiff_t>(values->size() / 2);
  std::nth_element(values->begin(), middle, values->end());
  const double median = *middle;
  double sum = 0;
  for (const double value : *values) sum += std::min(std::abs(value - median), kMostDeviation);
  return sum;
}

// Mean over pixels and channels; infinite where no pixel says anything.
double Deviation(const TrainingFrames& frames, const InitialSurface& tube,
                 const std::vector<FrameLight<float>>& lights, const std::vector<Ray>& rays) {
  const bool known = frames.gains_known();
  std::vector<std::vector<double>> groups(3 * static_cast<size_t>(known ? 1 : frames.size()));
  size_t count = 0;
  for (int first = 0; first < kRays; first += kTile) {
    alignas(64) float position[3 * kTile], normal[3 * kTile];
    FindWall(tube, &rays[first], position, normal);
    for (int i = 0; i < kTile; ++i) {
      const Ray& ray = rays[first + i];
      const Vec3f point(position[i], position[kTile + i], position[2 * kTile + i]);
      const Vec3f n(normal[i], normal[kTile + i], normal[2 * kTile + i]);
      const Shading<float> white =
          Shade<float>(Reflectance::kLambertian, Vec3f::Zero(), n, lights[ray.frame], point, Vec3f::Zero());
      for (int c = 0; c < 3; ++c) {
        if (ray.bound[c] != PixelBound::kExact || !(ray.observed[c] > 0) || !(white.radiance[c] > 0))
          continue;
        const double shown = std::pow(double(ray.observed[c]), 1 / frames.inverse_gamma()) / ray.exposure;
        groups[(known ? 0 : 3 * size_t(ray.frame)) + c].push_back(std::log(shown / white.radiance[c]));
        ++count;
      }
    }
  }
  double sum = 0;
  for (std::vector<double>& group : groups) sum += SumOfDeviations(&group);
  return count > 0 ? sum / static_cast<double>(count) : std::numeric_limits<double>::infinity();
}

}  // namespace

double FitReach(const TrainingFrames& frames, const InitialSurfaceOptions& initial, double farthest_mm,
                uint64_t seed) {
  static_assert(kRays % kTile == 0);
  const std::vector<Pose>& poses = frames.world_from_camera();
  const Vec3d origin = poses.front().translation();
  std::vector<FrameLight<float>> lights;
  for (const Pose& pose : poses) lights.push_back(LightOfFrame<float>(frames.light(), pose, origin));
  std::vector<Ray> rays(kRays);
  frames.Draw(seed, 0, origin, &rays);
  std::vector<double> reaches;
  for (double reach = initial.radius_mm / 2; reach <= farthest_mm; reach *= kStep) reaches.push_back(reach);
  std::vector<double> deviations(reaches.size());
  ParallelFor(0, static_cast<int64_t>(reaches.size()), [&](int64_t i) {
    InitialSurfaceOptions tried = initial;
    tried.reach_mm = reaches[i];
    deviations[i] = Deviation(frames, InitialSurface(tried, poses, origin), lights, rays);
  });
  const auto least = std::min_element(deviations.begin(), deviations.end());
  return least == deviations.end() || std::isinf(*least) ? initial.reach_mm
                                                         : reaches[least - deviations.begin()];
}

}  // namespace lumen
