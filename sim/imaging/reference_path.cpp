#include "sim/imaging/reference_path.h"

#include <cmath>
#include <limits>
#include <optional>
#include <type_traits>

#include "common/error.h"
#include "common/parallel.h"
#include "sim/imaging/offset_origin.h"
#include "sim/imaging/sampler.h"

namespace lumen {
namespace {

// Pairs of random numbers: the pixel's, then two a bounce.
constexpr uint32_t kPixelPair = 0;
constexpr uint32_t DirectionPair(int bounce) { return 2 * static_cast<uint32_t>(bounce) - 1; }
constexpr uint32_t RoulettePair(int bounce) { return 2 * static_cast<uint32_t>(bounce); }

template <class T>
class ReferenceTracer {
 public:
  ReferenceTracer(const PathScene& scene, const View& view, const PathOptions& options)
      : scene_(scene),
        options_(options),
        camera_(view.camera->intrinsics()),
        origin_(ToLocal(view.world_from_camera.translation())),
        rotation_(view.world_from_camera.linear().cast<T>()) {
    for (const LightSource& source : view.light->sources) {
      guides_.push_back({ToLocal(view.world_from_camera * source.position),
                         (view.world_from_camera.linear() * source.direction).cast<T>(),
                         static_cast<T>(source.spread), source.intensity.cast<T>()});
    }
  }

  Vec3<T> Sample(int x, int y, const Sampler& sampler) const {
    Vec2<T> pixel(static_cast<T>(x), static_cast<T>(y));
    if (options_.samples > 1) {
      const Vec2f random = sampler.Pair(kPixelPair);
      pixel += Vec2<T>(static_cast<T>(random[0]) - T(0.5), static_cast<T>(random[1]) - T(0.5));
    }
    const auto in_camera = camera_.Unproject(pixel);
    if (!in_camera) return Vec3<T>::Zero();
    return Follow(rotation_ * *in_camera, sampler);
  }

 private:
  struct Guide {
    Vec3<T> position, direction;
    T spread;
    Vec3<T> intensity;
  };
  struct Place {
    Vec3<T> point, normal, albedo;  // the normal: unit, to the side that the ray came from
    Vec3f ray_origin;               // of rays that leave it
  };

  Vec3<T> ToLocal(const Vec3d& world) const { return (world - scene_.wall->anchor()).template cast<T>(); }

  // The light that comes along a path.
  Vec3<T> Follow(Vec3<T> direction, const Sampler& sampler) const {
    Vec3<T> light = Vec3<T>::Zero(), throughput = Vec3<T>::Ones(), origin = origin_;
    Vec3f ray_origin = origin_.template cast<float>();
    for (int bounce = 0;; ++bounce) {
      const std::optional<Place> place = Meet(origin, ray_origin, direction);
      if (!place) return light;
      light += throughput.cwiseProduct(DirectLight(*place));
      if (bounce == options_.bounces) return light;
      // With directions in proportion to the cosine, a Lambertian wall passes on its albedo.
      throughput = throughput.cwiseProduct(place->albedo).eval();
      if (bounce > options_.roulette_after) {
        const T survival = std::min(T(1), std::sqrt(throughput.maxCoeff()));
        if (static_cast<T>(sampler.Pair(RoulettePair(bounce + 1))[0]) >= survival) return light;
        throughput /= survival;
      }
      direction = CosineDirection(place->normal, sampler.Pair(DirectionPair(bounce + 1)));
      origin = place->point;
      ray_origin = place->ray_origin;
    }
  }

  std::optional<Place> Meet(const Vec3<T>& origin, const Vec3f& ray_origin, const Vec3<T>& direction) const {
    const RayScene& wall = *scene_.wall;
    const RayHit hit = wall.Intersect(ray_origin, direction.template cast<float>(), 0,
                                      std::numeric_limits<float>::infinity());
    if (!hit.hit()) return std::nullopt;
    const Vec3i& corners = wall.mesh().faces[hit.face];
    Vec3<T> vertices[3];
    for (int i = 0; i < 3; ++i) vertices[i] = ToLocal(wall.mesh().vertices[corners[i]]);
    Place place;
    if constexpr (std::is_same_v<T, double>) {
      place.point = origin + wall.ExactDistance(hit.face, origin + wall.anchor(), direction) * direction;
    } else {
      place.point = (1 - hit.u - hit.v) * vertices[0] + hit.u * vertices[1] + hit.v * vertices[2];
    }
    place.normal = (vertices[1] - vertices[0]).cross(vertices[2] - vertices[0]).normalized();
    if (place.normal.dot(direction) > 0) place.normal = -place.normal;
    place.ray_origin =
        OffsetOrigin(place.point.template cast<float>().eval(), place.normal.template cast<float>().eval());
    place.albedo =
        AlbedoAt(*scene_.surface, scene_.surface_seed, Resting(hit, place.point)).template cast<T>();
    return place;
  }

  // Where the texture of a place is looked up: it moves with the wall.
  Vec3f Resting(const RayHit& hit, const Vec3<T>& point) const {
    if (!scene_.rest) return point.template cast<float>();
    const Vec3i& corners = scene_.rest->faces[hit.face];
    const double u = hit.u, v = hit.v;
    const Vec3d resting = (1 - u - v) * scene_.rest->vertices[corners[0]] +
                          u * scene_.rest->vertices[corners[1]] + v * scene_.rest->vertices[corners[2]];
    return (resting - scene_.rest_anchor).template cast<float>();
  }

  // What the guides make a place send.
  Vec3<T> DirectLight(const Place& place) const {
    Vec3<T> light = Vec3<T>::Zero();
    for (const Guide& guide : guides_) {
      const Irradiance<T> irradiance =
          IrradianceAt(guide.position, guide.direction, guide.spread, place.point);
      const T cosine = place.normal.dot(irradiance.toward);
      if (!(cosine > 0)) continue;
      const Vec3f to_guide = guide.position.template cast<float>() - place.ray_origin;
      if (scene_.wall->Occluded(place.ray_origin, to_guide, 0, 1)) continue;
      light += (irradiance.per_intensity * cosine / static_cast<T>(kPi)) *
               place.albedo.cwiseProduct(guide.intensity);
    }
    return light;
  }

  // With density cos/π: a place that is even over the unit disk, lifted to the hemisphere (Malley).
  static Vec3<T> CosineDirection(const Vec3<T>& normal, const Vec2f& random) {
    const T squared = static_cast<T>(random[0]), angle = static_cast<T>(2 * kPi) * static_cast<T>(random[1]);
    const Vec3<T> tangent = normal.unitOrthogonal(), bitangent = normal.cross(tangent);
    const T radius = std::sqrt(squared), height = std::sqrt(1 - squared);
    return (radius * std::cos(angle) * tangent + radius * std::sin(angle) * bitangent + height * normal)
        .normalized();
  }

  const PathScene& scene_;
  const PathOptions& options_;
  const Camera<T> camera_;
  const Vec3<T> origin_;
  const Mat3<T> rotation_;
  std::vector<Guide> guides_;
};

}  // namespace

std::string MissingInReference(const Surface& surface, bool has_shutter, bool has_defocus) {
  if (surface.coat) return "coat";
  if (surface.subsurface) return "subsurface";
  if (has_shutter) return "shutter";
  return has_defocus ? "defocus" : "";
}

template <class T>
ImageF RenderReference(const PathScene& scene, const View& view, const PathOptions& options, uint64_t seed,
                       int frame) {
  const std::string missing = MissingInReference(*scene.surface, view.motion, view.defocus);
  if (!missing.empty()) {
    throw InputError("the plain path tracer doesn't know the effect " + missing +
                     ": take it out of the scene");
  }
  const ReferenceTracer<T> tracer(scene, view, options);
  ImageF radiance(view.valid->width, view.valid->height, 3);
  ParallelFor(0, radiance.height, [&](int64_t y) {
    for (int x = 0; x < radiance.width; ++x) {
      if (!*view.valid->Pixel(x, static_cast<int>(y))) continue;
      const uint64_t pixel = RandomBits(static_cast<uint64_t>(frame), static_cast<uint64_t>(y), x);
      Vec3d sum = Vec3d::Zero();
      for (int sample = 0; sample < options.samples; ++sample) {
        const Sampler sampler(seed, pixel, static_cast<uint32_t>(sample), options.sampler);
        sum += tracer.Sample(x, static_cast<int>(y), sampler).template cast<double>();
      }
      for (int c = 0; c < 3; ++c) {
        radiance.Pixel(x, static_cast<int>(y))[c] = static_cast<float>(sum[c] / options.samples);
      }
    }
  });
  return radiance;
}

template ImageF RenderReference<float>(const PathScene&, const View&, const PathOptions&, uint64_t, int);
template ImageF RenderReference<double>(const PathScene&, const View&, const PathOptions&, uint64_t, int);

}  // namespace lumen
