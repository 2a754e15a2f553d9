#include "sim/imaging/path.h"

#include <algorithm>
#include <bit>
#include <cmath>
#include <type_traits>

#include "common/parallel.h"
#include "sim/imaging/sampler.h"

namespace lumen {
namespace {

constexpr int kBlock = 4;  // pixels along the edge of a block: one packet of rays
static_assert(kBlock * kBlock == RayPacket::kSize);

constexpr float kFar = 1e30f;

// Pairs of random numbers, by use; from kDirectionPair on, one of each a bounce.
enum : uint32_t {
  kPixelPair = 0,
  kDirectionPair = 1,
  kRoulettePair = 2,
  kGuidePair = 3,
  kPairsPerBounce = 3,
  kTimePair = 0xffffffffu  // beyond any bounce's
};

// bounce: from 1.
constexpr uint32_t PairOf(int bounce, uint32_t use) {
  return static_cast<uint32_t>(bounce - 1) * kPairsPerBounce + use;
}

struct Source {
  Vec3f position, direction;  // in the wall's coordinates
  float spread;
  Vec3f intensity;
  bool at_camera;  // what the camera sees, it lights: no shadow at the first vertex
};

// The camera and its guides at a moment.
struct Eye {
  Vec3f origin;
  Mat3<float> rotation;
  std::vector<Source> sources;
};

struct PlainVertex {
  Vec3f point, normal;  // normal: unit, to the side that the ray came from; 0 for a face without area
  Vec3f albedo;         // set for a packet at a time
};

struct CoatedVertex : CoatedPlace {
  Vec3f point;
  const Coat* coat;
};

// One frame's tracing. The effects that make a difference inside the loops are its template parameters,
// resolved once a render: shadows of guides off the camera's place, light from wall to wall, the coat.
template <bool kShadows, bool kBounces, bool kCoat>
class Tracer {
  using Vertex = std::conditional_t<kCoat, CoatedVertex, PlainVertex>;
  // Light that leaves a vertex, RGB, a column a lobe: what the wall scatters, and what the coat reflects.
  static constexpr int kLobes = kCoat ? 2 : 1;
  using Lobes = Eigen::Matrix<float, 3, kLobes>;

 public:
  Tracer(const PathScene& scene, const View& view, const PathOptions& options, uint64_t seed, int frame)
      : scene_(scene), view_(view), options_(options), seed_(seed), frame_(static_cast<uint64_t>(frame)) {
    PlaceEye(view.world_from_camera, &eye_);
  }

  PathCount Run(bool with_parts, Film* film) const {
    const int width = view_.valid->width, height = view_.valid->height;
    film->radiance = ImageF(width, height, 3);
    if (with_parts) film->direct = film->indirect = film->radiance;
    if (with_parts && kCoat) film->glint = film->radiance;
    const int block_rows = (height + kBlock - 1) / kBlock;
    std::vector<PathCount> counts(block_rows);
    ParallelFor(0, block_rows, [&](int64_t row) {
      for (int x = 0; x < width; x += kBlock) {
        TraceBlock(x, static_cast<int>(row) * kBlock, with_parts, film, &counts[row]);
      }
    });
    PathCount total;
    for (const PathCount& count : counts) {
      total.samples += count.samples;
      total.rays += count.rays;
      if (total.failure.count == 0) {
        total.failure = count.failure;
      } else {
        total.failure.count += count.failure.count;
      }
    }
    return total;
  }

 private:
  void PlaceEye(const Pose& world_from_camera, Eye* eye) const {
    eye->origin = scene_.wall->ToLocal(world_from_camera.translation());
    eye->rotation = world_from_camera.linear().cast<float>();
    eye->sources.clear();
    for (const LightSource& source : view_.light->sources) {
      eye->sources.push_back({scene_.wall->ToLocal(world_from_camera * source.position),
                              (world_from_camera.linear() * source.direction).cast<float>(),
                              static_cast<float>(source.spread), source.intensity.cast<float>(),
                              source.position.isZero(0)});
    }
  }

  struct Lane {
    int x, y;
    bool on;
    Eigen::Matrix<double, 3, kLobes> direct;  // sums over samples
    Vec3d indirect;
    int samples;
  };

  void TraceBlock(int x0, int y0, bool with_parts, Film* film, PathCount* count) const {
    const int width = view_.valid->width, height = view_.valid->height;
    Lane lanes[RayPacket::kSize];
    bool any = false;
    for (int i = 0; i < RayPacket::kSize; ++i) {
      const int x = x0 + i % kBlock, y = y0 + i / kBlock;
      const bool on = x < width && y < height && *view_.valid->Pixel(x, y) != 0;
      lanes[i] = {x, y, on, Eigen::Matrix<double, 3, kLobes>::Zero(), Vec3d::Zero(), 0};
      any = any || on;
    }
    if (!any) return;
    TraceSamples(lanes, count);
    for (const Lane& lane : lanes) {
      if (!lane.on || lane.samples == 0) continue;
      const double share = 1.0 / lane.samples;
      for (int c = 0; c < 3; ++c) {
        film->radiance.Pixel(lane.x, lane.y)[c] =
            static_cast<float>(share * (lane.direct.row(c).sum() + lane.indirect[c]));
        if (!with_parts) continue;
        film->direct.Pixel(lane.x, lane.y)[c] = static_cast<float>(share * lane.direct(c, 0));
        if constexpr (kCoat) {
          film->glint.Pixel(lane.x, lane.y)[c] = static_cast<float>(share * lane.direct(c, 1));
        }
        film->indirect.Pixel(lane.x, lane.y)[c] = static_cast<float>(share * lane.indirect[c]);
      }
    }
  }

  void TraceSamples(Lane* lanes, PathCount* count) const {
    if (!view_.motion) {
      for (int sample = 0; sample < options_.samples; ++sample) TraceSample(eye_, sample, lanes, count);
      return;
    }
    Eye eye;
    const double row = (lanes[0].y + kBlock / 2) / double(view_.valid->height);
    for (int sample = 0; sample < options_.samples; ++sample) {
      const double time = view_.motion->Time(row, SamplerOf(lanes[0], sample).Pair(kTimePair)[0]);
      PlaceEye(view_.motion->At(time), &eye);
      TraceSample(eye, sample, lanes, count);
    }
  }

  // A block's paths, which take their bounces together: those still under way, where they are, and what share
  // of the light that leaves there reaches the pixel.
  struct Wavefront {
    bool alive[RayPacket::kSize];
    Vertex vertices[RayPacket::kSize];
    Vec3f throughput[RayPacket::kSize];
  };

  Sampler SamplerOf(const Lane& lane, int sample) const {
    const uint64_t width = static_cast<uint64_t>(view_.valid->width);
    const uint64_t pixel = static_cast<uint64_t>(lane.y) * width + static_cast<uint64_t>(lane.x);
    return Sampler(seed_, (frame_ << 40) ^ pixel, sample);
  }

  // One sample of each of a block's pixels. Flattened: inlined as a whole, whatever other variants there are.
  [[gnu::flatten]] void TraceSample(const Eye& eye, int sample, Lane* lanes, PathCount* count) const {
    RayPacket rays;
    for (int i = 0; i < RayPacket::kSize; ++i) {
      Vec2f pixel(static_cast<float>(lanes[i].x), static_cast<float>(lanes[i].y));
      if (lanes[i].on && options_.samples > 1) {
        pixel += SamplerOf(lanes[i], sample).Pair(kPixelPair) - Vec2f(0.5f, 0.5f);
      }
      const auto ray = lanes[i].on ? view_.camera->Unproject(pixel) : std::nullopt;
      const Vec3f direction = ray ? Vec3f(eye.rotation * *ray) : Vec3f(0, 0, 1);
      for (int d = 0; d < 3; ++d) {
        rays.origin[d][i] = eye.origin[d];
        rays.direction[d][i] = direction[d];
      }
      rays.tnear[i] = 0;
      rays.tfar[i] = ray ? kFar : -1.0f;
      count->rays += ray.has_value();
    }
    HitPacket hits;
    scene_.wall->Intersect(rays, &hits);
    Wavefront wave;
    for (int i = 0; i < RayPacket::kSize; ++i) {
      wave.alive[i] = hits.face[i] != kNoFace;
      if (!wave.alive[i]) continue;
      wave.vertices[i] =
          VertexAt(hits.face[i], hits.u[i], hits.v[i],
                   Vec3f(rays.direction[0][i], rays.direction[1][i], rays.direction[2][i]), false);
    }
    SetAlbedos(&wave);
    Lobes direct[RayPacket::kSize];
    Vec3f indirect[RayPacket::kSize];
    std::fill_n(direct, RayPacket::kSize, Lobes(Lobes::Zero()));
    std::fill_n(indirect, RayPacket::kSize, Vec3f(0, 0, 0));
    for (const Source& source : eye.sources) AddDirect(source, wave, direct, count);
    if constexpr (kBounces) FollowPaths(eye, sample, lanes, &wave, indirect, count);
    for (int i = 0; i < RayPacket::kSize; ++i) {
      if (!lanes[i].on) continue;
      ++count->samples;
      Collect(direct[i], indirect[i], sample, &lanes[i], count);
    }
  }

  static void Collect(const Lobes& direct, const Vec3f& indirect, int sample, Lane* lane, PathCount* count) {
    if (!std::isfinite(direct.sum() + indirect.sum())) {
      Failure& failure = count->failure;
      const bool first = failure.count == 0 || std::pair(lane->y, lane->x) < std::pair(failure.y, failure.x);
      if (first) failure = {failure.count, lane->x, lane->y, sample};
      ++failure.count;
      return;
    }
    lane->direct += direct.template cast<double>();
    lane->indirect += indirect.cast<double>();
    ++lane->samples;
  }

  Vertex VertexAt(uint32_t face, float u, float v, const Vec3f& incoming, bool bounced) const {
    const Mesh& mesh = scene_.wall->mesh();
    const Vec3i& corners = mesh.faces[face];
    const Vec3d a = mesh.vertices[corners[0]];
    const Vec3d ab = mesh.vertices[corners[1]] - a, ac = mesh.vertices[corners[2]] - a;
    Vertex vertex;
    vertex.point = (a - scene_.wall->anchor() + double(u) * ab + double(v) * ac).template cast<float>();
    const Vec3d cross = ab.cross(ac);
    const double length = cross.norm();
    vertex.normal = length > 0 ? (cross / length).template cast<float>() : Vec3f(Vec3f::Zero());
    if (vertex.normal.dot(incoming) > 0) vertex.normal = -vertex.normal;
    if constexpr (kCoat) {
      const Surface& surface = *scene_.surface;
      vertex.coat = bounced && surface.bounced_coat ? &*surface.bounced_coat : &*surface.coat;
      SetCoat(corners, u, v, incoming, &vertex);
    }
    return vertex;
  }

  // The coat lies on the smooth wall that the triangles stand for: its lobe is narrower than the angles
  // between them.
  void SetCoat(const Vec3i& corners, float u, float v, const Vec3f& incoming, Vertex* vertex) const {
    const std::vector<Vec3d>& normals = *scene_.vertex_normals;
    const Vec3d mean = double(1 - u - v) * normals[corners[0]] + double(u) * normals[corners[1]] +
                       double(v) * normals[corners[2]];
    const double length = mean.norm();
    Vec3f smooth = length > 0 ? (mean / length).template cast<float>() : vertex->normal;
    if (smooth.dot(vertex->normal) < 0) smooth = -smooth;
    vertex->outgoing = -incoming;
    vertex->coat_normal = vertex->coat->ReliefNormal(scene_.surface_seed, vertex->point, smooth);
    vertex->reflectance = vertex->coat->Reflectance(vertex->coat_normal.dot(vertex->outgoing));
  }

  void SetAlbedos(Wavefront* wave) const {
    static_assert(Lanes3::kSize == RayPacket::kSize);
    Lanes3 places, albedos;
    for (int i = 0; i < RayPacket::kSize; ++i) {
      for (int d = 0; d < 3; ++d) places.c[d][i] = wave->alive[i] ? wave->vertices[i].point[d] : 0.0f;
    }
    AlbedoAt(*scene_.surface, scene_.surface_seed, places, &albedos);
    for (int i = 0; i < RayPacket::kSize; ++i) {
      wave->vertices[i].albedo = Vec3f(albedos.c[0][i], albedos.c[1][i], albedos.c[2][i]);
    }
  }

  // Light that comes from a source to a vertex and leaves it to where its ray came from, shadows apart.
  Lobes Reflected(const Source& source, const Vertex& vertex) const {
    const Irradiance<float> irradiance =
        IrradianceAt<float>(source.position, source.direction, source.spread, vertex.point);
    const float cosine = vertex.normal.dot(irradiance.toward);
    if (!(cosine > 0)) return Lobes::Zero();
    if constexpr (kCoat) {
      const CoatLobes lobes = vertex.coat->Eval(vertex, irradiance.toward);
      Lobes light;
      light << source.intensity.cwiseProduct(lobes.base), source.intensity * lobes.glint;
      return irradiance.per_intensity * light;
    } else {
      return (irradiance.per_intensity * cosine) *
             source.intensity.cwiseProduct(lambert::Eval(vertex.albedo));
    }
  }

  void AddDirect(const Source& source, const Wavefront& wave, Lobes* direct, PathCount* count) const {
    Lobes light[RayPacket::kSize];
    for (int i = 0; i < RayPacket::kSize; ++i) {
      light[i] = wave.alive[i] ? Reflected(source, wave.vertices[i]) : Lobes(Lobes::Zero());
    }
    if constexpr (kShadows) {
      if (!source.at_camera) Shade(source, wave.vertices, light, count);
    }
    for (int i = 0; i < RayPacket::kSize; ++i) direct[i] += light[i];
  }

  // Takes away the light of a packet's vertices that something keeps from them.
  void Shade(const Source& source, const Vertex* vertices, Lobes* light, PathCount* count) const {
    RayPacket shadow;
    for (int i = 0; i < RayPacket::kSize; ++i) {
      const bool lit = !light[i].isZero(0);
      const Vec3f from = lit ? OffsetOrigin(vertices[i].point, vertices[i].normal) : Vec3f(Vec3f::Zero());
      const Vec3f toward = lit ? Vec3f(source.position - from) : Vec3f(0, 0, 1);
      for (int d = 0; d < 3; ++d) {
        shadow.origin[d][i] = from[d];
        shadow.direction[d][i] = toward[d];
      }
      shadow.tnear[i] = 0;
      shadow.tfar[i] = lit ? 1.0f : -1.0f;
      count->rays += lit;
    }
    uint8_t occluded[RayPacket::kSize];
    scene_.wall->Occluded(shadow, occluded);
    for (int i = 0; i < RayPacket::kSize; ++i)
      if (occluded[i]) light[i].setZero();
  }

  // The path loop: from the first vertices on, what comes to them by way of other places.
  void FollowPaths(const Eye& eye, int sample, const Lane* lanes, Wavefront* wave, Vec3f* radiance,
                   PathCount* count) const {
    std::fill_n(wave->throughput, RayPacket::kSize, Vec3f(1, 1, 1));
    for (int bounce = 1; bounce <= options_.bounces; ++bounce) {
      bool any = false;
      for (int i = 0; i < RayPacket::kSize; ++i) {
        if (!wave->alive[i]) continue;
        wave->alive[i] =
            Bounce(SamplerOf(lanes[i], sample), bounce, &wave->vertices[i], &wave->throughput[i], count);
        any = any || wave->alive[i];
      }
      if (!any) break;
      SetAlbedos(wave);
      for (int i = 0; i < RayPacket::kSize; ++i) {
        if (!wave->alive[i]) continue;
        const float random = SamplerOf(lanes[i], sample).Pair(PairOf(bounce, kGuidePair))[0];
        radiance[i] +=
            wave->throughput[i].cwiseProduct(LightFromOneGuide(eye, wave->vertices[i], random, count));
      }
    }
  }

  // Takes a path to its next vertex. False where it ends: by Russian roulette, or without meeting a wall.
  bool Bounce(const Sampler& sampler, int bounce, Vertex* vertex, Vec3f* throughput, PathCount* count) const {
    Vec3f direction;
    if constexpr (kCoat) {
      const Coat& coat = *vertex->coat;
      const float choice = sampler.Pair(PairOf(bounce, kRoulettePair))[1];
      direction = coat.Sample(*vertex, sampler.Pair(PairOf(bounce, kDirectionPair)), choice);
      if (!(direction.dot(vertex->normal) > 0)) return false;
      const CoatLobes lobes = coat.Eval(*vertex, direction);
      *throughput =
          throughput->cwiseProduct(lobes.base + Vec3f::Constant(lobes.glint)) / coat.Pdf(*vertex, direction);
    } else {
      // Cosine-distributed directions: BRDF · cos / density is the albedo.
      *throughput = throughput->cwiseProduct(vertex->albedo);
    }
    if (bounce > options_.roulette_after) {
      const float survival = std::min(1.0f, std::sqrt(throughput->maxCoeff()));
      if (sampler.Pair(PairOf(bounce, kRoulettePair))[0] >= survival) return false;
      *throughput /= survival;
    }
    if constexpr (!kCoat) {
      direction = lambert::Sample(vertex->normal, sampler.Pair(PairOf(bounce, kDirectionPair)));
    }
    const RayHit hit =
        scene_.wall->Intersect(OffsetOrigin(vertex->point, vertex->normal), direction, 0.0f, kFar);
    ++count->rays;
    if (hit.hit()) *vertex = VertexAt(hit.face, hit.u, hit.v, direction, true);
    return hit.hit();
  }

  // What a vertex sends on of the guides' light, estimated without bias from one of them, chosen by what each
  // would send if nothing stood in its way: guides lie close together, so that one shadow ray tells nearly as
  // much as one to each.
  Vec3f LightFromOneGuide(const Eye& eye, const Vertex& vertex, float random, PathCount* count) const {
    float sum = 0;
    for (const Source& source : eye.sources) sum += Reflected(source, vertex).sum();
    if (!std::isfinite(sum)) return Vec3f::Constant(sum);  // for Collect to name
    if (!(sum > 0)) return Vec3f::Zero();
    // Adds up in the order of `sum`, so that random < 1 finds a guide; where random · sum rounds up to sum,
    // the last that shines.
    const Source* chosen = nullptr;
    Vec3f light = Vec3f::Zero();
    float below = 0;
    for (const Source& source : eye.sources) {
      const Vec3f candidate = Reflected(source, vertex).rowwise().sum();
      if (candidate.sum() == 0) continue;
      chosen = &source;
      light = candidate;
      below += candidate.sum();
      if (random * sum < below) break;
    }
    const Vec3f from = OffsetOrigin(vertex.point, vertex.normal);
    ++count->rays;
    if (scene_.wall->Occluded(from, chosen->position - from, 0.0f, 1.0f)) return Vec3f::Zero();
    return light * (sum / light.sum());
  }

  const PathScene scene_;
  const View view_;
  const PathOptions options_;
  uint64_t seed_, frame_;
  Eye eye_;  // at the frame's moment
};

bool HasShadows(const Light& light) {
  return std::any_of(light.sources.begin(), light.sources.end(),
                     [](const LightSource& source) { return !source.position.isZero(0); });
}

// Resolves what the scene has, one flag after the other.
template <bool... kFlags>
PathCount RenderWith(const PathScene& scene, const View& view, const PathOptions& options, uint64_t seed,
                     int frame, bool with_parts, Film* film) {
  if constexpr (sizeof...(kFlags) == 3) {
    return Tracer<kFlags...>(scene, view, options, seed, frame).Run(with_parts, film);
  } else {
    const bool on = sizeof...(kFlags) == 0   ? HasShadows(*view.light)
                    : sizeof...(kFlags) == 1 ? options.bounces > 0
                                             : scene.surface->coat.has_value();
    return on ? RenderWith<kFlags..., true>(scene, view, options, seed, frame, with_parts, film)
              : RenderWith<kFlags..., false>(scene, view, options, seed, frame, with_parts, film);
  }
}

}  // namespace

Vec3f OffsetOrigin(const Vec3f& point, const Vec3f& normal) {
  // 256 steps of a coordinate's own floating point cover the rounding of the hit point and of the ray's
  // transform; below 1/32 of a mm, where such steps vanish, a fixed length takes over.
  constexpr float kScale = 256, kNearZero = 1.0f / 32, kFixed = 1.0f / 65536;
  Vec3f moved;
  for (int d = 0; d < 3; ++d) {
    const int steps = static_cast<int>(kScale * normal[d]);
    const int bits = std::bit_cast<int>(point[d]) + (point[d] < 0 ? -steps : steps);
    moved[d] = std::abs(point[d]) < kNearZero ? point[d] + kFixed * normal[d] : std::bit_cast<float>(bits);
  }
  return moved;
}

PathCount RenderFrame(const PathScene& scene, const View& view, const PathOptions& options, uint64_t seed,
                      int frame, bool with_parts, Film* film) {
  return RenderWith<>(scene, view, options, seed, frame, with_parts, film);
}

}  // namespace lumen
