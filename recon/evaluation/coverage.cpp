#include "recon/evaluation/coverage.h"

#include <numeric>

#include "common/parallel.h"
#include "recon/evaluation/nearest_point.h"

namespace lumen {

SurveyedShare MeasureShare(const std::vector<SurfacePoint>& points, const std::vector<int>& frames_seeing,
                           double reach_mm) {
  std::vector<Vec3d> seen;
  for (size_t i = 0; i < points.size(); ++i) {
    if (frames_seeing[i] > 0) seen.push_back(points[i].position);
  }
  const double count = static_cast<double>(seen.size());
  SurveyedShare share;
  share.whole = count / static_cast<double>(points.size());
  if (seen.empty()) return share;
  const NearestPoint nearest(seen);
  std::vector<uint8_t> near(points.size());
  constexpr int64_t kGrain = 512;  // outweighs a task's cost
  ParallelChunks(0, static_cast<int64_t>(points.size()), kGrain, [&](int64_t first, int64_t last) {
    for (int64_t i = first; i < last; ++i) {
      near[i] = frames_seeing[i] > 0 || nearest.Distance(points[i].position) <= reach_mm;
    }
  });
  share.near = count / std::accumulate(near.begin(), near.end(), 0.0);
  return share;
}

}  // namespace lumen
