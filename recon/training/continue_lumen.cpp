#include "recon/training/continue_lumen.h"

#include "common/random.h"
#include "recon/training/meet_surface.h"

namespace lumen {
namespace {

// Of the wall that the frames see last each sector of Continuation has dozens of them.
constexpr int kRays = 16384;
constexpr int kRaysALook = 1024;  // 16384 at once would take 12 MB of look-ups beside the frames
static_assert(kRays % kRaysALook == 0);

// A ray stands for as much wall as its pixel covers, which has no bound at grazing incidence.
constexpr double kLeastCosine = 0.1;

}  // namespace

std::optional<Continuation> ContinueLumen(const TrainingFrames& frames, const Field<float>& field,
                                          const float* parameters, const Vec3d& origin,
                                          const TrainOptions::Sampling& sampling, uint64_t seed) {
  RayBatch<float> batch;
  batch.rays.resize(kRaysALook);
  const uint64_t key = RandomBits(seed, 0x626568696e64ull);
  std::vector<WallPoint> points;
  for (batch.first = 0; batch.first < kRays; batch.first += kRaysALook) {
    frames.Draw(key, batch.first, origin, &batch.rays);
    const SurfaceMet wall = LookAtSurface(field, parameters, sampling, key, &batch);
    for (int r = 0; r < kRaysALook; ++r) {
      const Vec3d place(wall.positions.At(0, r), wall.positions.At(1, r), wall.positions.At(2, r));
      const Vec3d normal(wall.gradient.At(0, r), wall.gradient.At(1, r), wall.gradient.At(2, r));
      if (wall.free.At(0, r) == 0 || !(normal.norm() > 0)) continue;  // no wall within the bounds
      const Vec3d way = place - batch.rays[r].origin.cast<double>();
      const double cosine = -way.normalized().dot(normal.normalized());
      points.push_back({place, way.squaredNorm() / std::max(cosine, kLeastCosine)});
    }
  }
  std::vector<Pose> cameras = frames.world_from_camera();
  for (Pose& camera : cameras) camera.pretranslate(-origin);
  return Continuation::Fit(points, cameras);
}

}  // namespace lumen
