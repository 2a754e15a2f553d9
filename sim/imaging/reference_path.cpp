#include "sim/imaging/reference_path.h"

#include <bit>
#include <cmath>
#include <limits>
#include <optional>
#include <type_traits>

#include "common/error.h"
#include "common/parallel.h"
#include "sim/imaging/offset_origin.h"
#include "sim/imaging/reference_glint.h"
#include "sim/imaging/sampler.h"

namespace lumen {
namespace {

// Pairs of random numbers: the pixel's, then two a bounce; from kWalkPairs on, two a walk.
constexpr uint32_t kPixelPair = 0;
constexpr uint32_t DirectionPair(int bounce) { return 2 * static_cast<uint32_t>(bounce) - 1; }
constexpr uint32_t RoulettePair(int bounce) { return 2 * static_cast<uint32_t>(bounce); }
constexpr uint32_t kWalkPairs = 1u << 31;

// How many of the paths go on by a coat's first lobe where it has one: any number will do.
constexpr double kGlintPaths = 0.3;

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
    uint32_t face;
    // Under a coat.
    const Coat* coat = nullptr;
    Vec3<T> outgoing, coat_normal;
    bool glints() const { return coat && outgoing.dot(coat_normal) > 0; }
  };

  Vec3<T> ToLocal(const Vec3d& world) const { return (world - scene_.wall->anchor()).template cast<T>(); }

  // The light that comes along a path. What the wall scatters came in at `entry`: in tissue that is another
  // place.
  Vec3<T> Follow(Vec3<T> direction, const Sampler& sampler) const {
    Vec3<T> light = Vec3<T>::Zero(), throughput = Vec3<T>::Ones(), origin = origin_;
    Vec3f ray_origin = origin_.template cast<float>();
    for (int bounce = 0;; ++bounce) {
      const std::optional<Place> place = Meet(origin, ray_origin, direction, bounce);
      if (!place) return light;
      const Place entry = scene_.surface->subsurface ? EntryOf(*place, bounce, sampler) : *place;
      light += throughput.cwiseProduct(DirectLight(*place, entry));
      if (bounce == options_.bounces) return light;
      const Vec2f random = sampler.Pair(DirectionPair(bounce + 1)),
                  chance = sampler.Pair(RoulettePair(bounce + 1));
      const bool by_glint = place->glints() && chance[1] < kGlintPaths;
      if (by_glint) {
        const GlintLobe<T> lobe(*place->coat);
        const Vec3<T> half = lobe.SampleHalf(place->coat_normal, random), out = place->outgoing;
        direction = (2 * out.dot(half) * half - out).normalized();
        if (!(half.dot(out) > 0 && Above(*place, direction))) return light;
        throughput *= lobe.Weight(place->coat_normal, half, direction, out) / static_cast<T>(kGlintPaths);
      } else {
        // With directions in proportion to the cosine, a Lambertian wall passes on its albedo.
        direction = CosineDirection(entry.normal, random);
        throughput = throughput.cwiseProduct(entry.albedo).eval();
        throughput *=
            Passed(*place, entry, direction) / static_cast<T>(place->glints() ? 1 - kGlintPaths : 1);
      }
      if (throughput.isZero(0)) return light;
      if (bounce > options_.roulette_after) {
        const T survival = std::min(T(1), std::sqrt(throughput.maxCoeff()));
        if (static_cast<T>(chance[0]) >= survival) return light;
        throughput /= survival;
      }
      origin = by_glint ? place->point : entry.point;
      ray_origin = by_glint ? place->ray_origin : entry.ray_origin;
    }
  }

  std::optional<Place> Meet(const Vec3<T>& origin, const Vec3f& ray_origin, const Vec3<T>& direction,
                            int bounce) const {
    const RayScene& wall = *scene_.wall;
    const RayHit hit = wall.Intersect(ray_origin, direction.template cast<float>(), 0,
                                      std::numeric_limits<float>::infinity());
    if (!hit.hit()) return std::nullopt;
    if constexpr (std::is_same_v<T, double>) {
      const T distance = wall.ExactDistance(hit.face, origin + wall.anchor(), direction);
      return PlaceAt(hit, origin + distance * direction, direction, bounce);
    } else {
      return PlaceAt(hit, PointOf(hit), direction, bounce);
    }
  }

  Vec3<T> Corner(uint32_t face, int corner) const {
    const Mesh& mesh = scene_.wall->mesh();
    return ToLocal(mesh.vertices[mesh.faces[face][corner]]);
  }
  Vec3<T> PointOf(const RayHit& hit) const {
    return (1 - hit.u - hit.v) * Corner(hit.face, 0) + hit.u * Corner(hit.face, 1) +
           hit.v * Corner(hit.face, 2);
  }

  // direction: that it is met from.
  Place PlaceAt(const RayHit& hit, const Vec3<T>& point, const Vec3<T>& direction, int bounce) const {
    Place place;
    place.face = hit.face;
    place.point = point;
    const Vec3<T> origin = Corner(hit.face, 0);
    place.normal = (Corner(hit.face, 1) - origin).cross(Corner(hit.face, 2) - origin).normalized();
    if (place.normal.dot(direction) > 0) place.normal = -place.normal;
    place.ray_origin =
        OffsetOrigin(place.point.template cast<float>().eval(), place.normal.template cast<float>().eval());
    const Vec3f resting = Resting(hit, place.point);
    place.albedo = AlbedoAt(*scene_.surface, scene_.surface_seed, resting).template cast<T>();
    const Surface& surface = *scene_.surface;
    if (surface.coat) {
      place.coat = bounce > 0 && surface.bounced_coat ? &*surface.bounced_coat : &*surface.coat;
      place.outgoing = -direction;
      place.coat_normal = CoatNormal(*place.coat, hit, place.normal, resting);
    }
    return place;
  }

  Vec3<T> CoatNormal(const Coat& coat, const RayHit& hit, const Vec3<T>& normal, const Vec3f& resting) const {
    const Vec3i& corners = scene_.wall->mesh().faces[hit.face];
    const std::vector<Vec3d>& normals = *scene_.vertex_normals;
    const double u = hit.u, v = hit.v;
    Vec3d smooth = (1 - u - v) * normals[corners[0]] + u * normals[corners[1]] + v * normals[corners[2]];
    smooth.normalize();
    if (smooth.dot(normal.template cast<double>()) < 0) smooth = -smooth;
    const Lanes3 relief = coat.ReliefNormal(scene_.surface_seed, Broadcast(resting),
                                            Broadcast(smooth.template cast<float>().eval()));
    return relief[0].template cast<T>().normalized();
  }

  // Where what leaves the tissue at a place came in; its albedo is what of the light leaves. Black if the
  // walk gets lost.
  Place EntryOf(const Place& place, int bounce, const Sampler& sampler) const {
    const uint32_t pair = kWalkPairs + 2 * static_cast<uint32_t>(bounce);
    const Vec2f numbers = sampler.Pair(pair + 1);
    const Vec3f inward = CosineDirection(-place.normal, sampler.Pair(pair)).template cast<float>();
    int64_t rays = 0;
    const WalkExit exit = scene_.surface->subsurface->Walk(
        *scene_.wall,
        {place.face, place.point.template cast<float>(), place.normal.template cast<float>(), inward},
        {std::bit_cast<uint32_t>(numbers[0]), std::bit_cast<uint32_t>(numbers[1]), 0}, &rays);
    if (!exit.found) {
      Place nowhere = place;
      nowhere.albedo.setZero();
      return nowhere;
    }
    Place entry = PlaceAt(exit.hit, PointOf(exit.hit), -exit.normal.template cast<T>(), bounce);
    const Vec3f palest = PalestAlbedo(*scene_.surface);
    for (int c = 0; c < 3; ++c) {
      const T both = place.albedo[c] * entry.albedo[c];
      entry.albedo[c] = both > 0 ? exit.weight[c] * std::sqrt(both) / palest[c] : T(0);
    }
    return entry;
  }

  static bool Above(const Place& place, const Vec3<T>& direction) {
    return direction.dot(place.normal) > 0 && direction.dot(place.coat_normal) > 0;
  }

  // Of what comes in from a direction, what the coat lets through on both ways, over a Lambertian wall's.
  static T Passed(const Place& place, const Place& entry, const Vec3<T>& direction) {
    if (!place.coat) return 1;
    const auto through = [&](const Place& at, const Vec3<T>& way) {
      return 1 - T(place.coat->Reflectance(static_cast<float>(way.dot(at.coat_normal))));
    };
    return through(place, place.outgoing) * through(entry, direction) /
           (1 - T(place.coat->mean_reflectance()));
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

  // What the guides make a place send, of what is scattered by lighting the entry.
  Vec3<T> DirectLight(const Place& place, const Place& entry) const {
    Vec3<T> light = Vec3<T>::Zero();
    for (const Guide& guide : guides_) {
      light += FromGuide(guide, entry, [&](const Vec3<T>& toward) {
        return Vec3<T>(entry.albedo *
                       (toward.dot(entry.normal) / static_cast<T>(kPi) * Passed(place, entry, toward)));
      });
      if (!place.glints()) continue;
      light += FromGuide(guide, place, [&](const Vec3<T>& toward) {
        const GlintLobe<T> lobe(*place.coat);
        return Vec3<T>(Vec3<T>::Ones() *
                       (Above(place, toward) ? lobe.Eval(place.coat_normal, toward, place.outgoing) : T(0)));
      });
    }
    return light;
  }

  // lobe(toward): BRDF times cosine.
  template <class Lobe>
  Vec3<T> FromGuide(const Guide& guide, const Place& place, const Lobe& lobe) const {
    const Irradiance<T> irradiance = IrradianceAt(guide.position, guide.direction, guide.spread, place.point);
    if (!(place.normal.dot(irradiance.toward) > 0)) return Vec3<T>::Zero();
    const Vec3f to_guide = guide.position.template cast<float>() - place.ray_origin;
    if (scene_.wall->Occluded(place.ray_origin, to_guide, 0, 1)) return Vec3<T>::Zero();
    return irradiance.per_intensity * lobe(irradiance.toward).cwiseProduct(guide.intensity);
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

std::string MissingInReference(bool has_shutter, bool has_defocus) {
  if (has_shutter) return "shutter";
  return has_defocus ? "defocus" : "";
}

template <class T>
ImageF RenderReference(const PathScene& scene, const View& view, const PathOptions& options, uint64_t seed,
                       int frame) {
  const std::string missing = MissingInReference(view.motion, view.defocus);
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
