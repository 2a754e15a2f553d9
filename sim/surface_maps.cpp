#include "sim/surface_maps.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "common/parallel.h"

namespace lumen {
namespace {

// Calls body(place, x, y) for every pixel that has a place; place: on the wall at rest, from the anchor.
template <class Body>
void ForEachPlace(const Vec3d& anchor_mm, const FrameTruth& truth, const Body& body) {
  const ImageF& position = truth.rest_position.empty() ? truth.position : truth.rest_position;
  ParallelFor(0, position.height, [&](int64_t row) {
    const int y = static_cast<int>(row);
    for (int x = 0; x < position.width; ++x) {
      const float* p = position.Pixel(x, y);
      if (!std::isnan(p[0])) body((Vec3d(p[0], p[1], p[2]) - anchor_mm).cast<float>(), x, y);
    }
  });
}

ImageF NothingLike(const ImageF& position) {
  return ImageF(position.width, position.height, 3, std::numeric_limits<float>::quiet_NaN());
}

}  // namespace

ImageF AlbedoMap(const Surface& surface, uint64_t surface_seed, const Vec3d& anchor_mm,
                 const FrameTruth& truth) {
  ImageF albedo = NothingLike(truth.position);
  ForEachPlace(anchor_mm, truth, [&](const Vec3f& place, int x, int y) {
    const Vec3f value = AlbedoAt(surface, surface_seed, place);
    std::copy_n(value.data(), 3, albedo.Pixel(x, y));
  });
  return albedo;
}

ImageF ShadingNormalMap(const Surface& surface, uint64_t surface_seed, const Vec3d& anchor_mm,
                        const Pose& world_from_camera, const FrameTruth& truth) {
  if (!surface.coat) return truth.smooth_normal;
  const Mat3<float> rotation = world_from_camera.linear().cast<float>();
  ImageF normals = NothingLike(truth.position);
  ForEachPlace(anchor_mm, truth, [&](const Vec3f& place, int x, int y) {
    const Vec3f smooth = Eigen::Map<const Vec3f>(truth.smooth_normal.Pixel(x, y));
    const Vec3f relief =
        surface.coat->ReliefNormal(surface_seed, Broadcast(place), Broadcast(Vec3f(rotation * smooth)))[0];
    const Vec3f normal = rotation.transpose() * relief;
    std::copy_n(normal.data(), 3, normals.Pixel(x, y));
  });
  return normals;
}

}  // namespace lumen
