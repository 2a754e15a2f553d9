#include "recon/training/surroundings.h"

#include <algorithm>

#include "recon/surface/radiosity.h"
#include "recon/training/meet_surface.h"

namespace lumen {
namespace {

// A direction's patch is 1/cosine times as long as it is wide. Of one more than four times as long a single
// place says little, and it would outweigh all others.
constexpr double kShallowestCosine = 0.25;

constexpr int kCells = DirectionMap<float>::kCells, kEdge = DirectionMap<float>::kEdge;

// Light bounces between the cells' squares of so many by so many.
constexpr int kGroupEdge = 2, kGroups = kCells / (kGroupEdge * kGroupEdge);
static_assert(kEdge % kGroupEdge == 0);

int GroupOf(int cell) { return cell / kEdge / kGroupEdge * (kEdge / kGroupEdge) + cell % kEdge / kGroupEdge; }

}  // namespace

DirectionMap<float> SurroundingsOf(const Field<float>& field, const float* parameters,
                                   const TrainOptions::Sampling& sampling, const FrameLight<float>& light) {
  RayBatch<float> batch;
  batch.rays.resize(kCells);
  for (int cell = 0; cell < kCells; ++cell) {
    batch.rays[cell].origin = light.camera;
    batch.rays[cell].direction = light.camera_from_field.transpose() * DirectionMap<float>::Direction(cell);
  }
  const SurfaceMet wall = LookAtSurface(field, parameters, sampling, 0, &batch);
  const auto vector = [](const Panel<float>& panel, int i) {
    return Vec3f(panel.At(0, i), panel.At(1, i), panel.At(2, i));
  };
  std::vector<Patch> patches(kCells);
  std::vector<int> group(kCells);
  for (int i = 0; i < kCells; ++i) {
    const Vec3f gradient = vector(wall.gradient, i), point = vector(wall.positions, i);
    const float length = gradient.norm();
    const Vec3f normal = length > 0 ? Vec3f(gradient / length) : Vec3f(-batch.rays[i].direction);
    Patch& patch = patches[i];
    patch.point = point.cast<double>();
    patch.normal = normal.cast<double>();
    const double cosine = std::max<double>(kShallowestCosine, -normal.dot(batch.rays[i].direction));
    const double distance = batch.distance[size_t(i + 1) * batch.samples - 1];
    patch.area_mm2 = double(DirectionMap<float>::SolidAngle(i)) * distance * distance / cosine;
    for (int c = 0; c < 3; ++c) patch.albedo[c] = std::exp(field.LogAlbedo(wall.color.At(c, i)));
    patch.irradiance =
        kPi * Shade<float>(Reflectance::kLambertian, Vec3f::Zero(), normal, light, point, Vec3f::Zero())
                  .radiance.cast<double>();
    group[i] = GroupOf(i);
  }
  const std::vector<Vec3d> irradiance = InterreflectedIrradiance(patches, group, kGroups);
  DirectionMap<float> map;
  for (int i = 0; i < kCells; ++i) map.values[i] = irradiance[i].cast<float>();
  return map;
}

}  // namespace lumen
