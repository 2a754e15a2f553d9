// One frame's tracing, for path.cpp and tissue_path.cpp alone: in an unnamed namespace, so that the compiler
// sees all of its callers and makes one loop of it.
#pragma once

#include <algorithm>
#include <mutex>
#include <optional>
#include <utility>
#include <vector>

#include "common/parallel.h"
#include "sim/imaging/bounce_paths.h"
#include "sim/imaging/eye.h"
#include "sim/imaging/glint_paths.h"
#include "sim/imaging/guide_light.h"
#include "sim/imaging/light_paths.h"
#include "sim/imaging/path.h"
#include "sim/imaging/photon_joins.h"
#include "sim/imaging/pixel_samples.h"
#include "sim/imaging/places.h"
#include "sim/imaging/sampler.h"
#include "sim/imaging/shared_paths.h"
#include "sim/imaging/tile.h"
#include "sim/imaging/tissue_walks.h"

namespace lumen {

// RenderFrame of a scene with tissue, which is compiled apart: what it adds doesn't change what the compiler
// makes of the rest.
PathCount RenderTissue(const PathScene& scene, const View& view, const PathOptions& options, uint64_t seed,
                       int frame, bool with_parts, Film* film);

namespace {

constexpr float kFar = 1e30f;

// Pairs of a pixel's random numbers, by use.
enum : uint32_t {
  kPixelPair = 0,
  kOwnPairs = 1,           // of the pixel's own bounce path
  kGlintPairs = 1u << 30,  // of the path that leaves in the coat's mirror direction
  kLensPair = 0xfffffffeu,
  kTimePair = 0xffffffffu
};

void Note(const Failure& failure, Failure* total) {
  if (failure.count == 0) return;
  const int64_t count = total->count + failure.count;
  const bool first = total->count == 0 || std::pair(failure.y, failure.x) < std::pair(total->y, total->x);
  if (first) *total = failure;
  total->count = count;
}

// One frame's tracing, by tiles. The coat, and tissue below it, make a difference inside the loops and are
// template parameters, resolved once a frame; other effects make one once a packet at most.
template <bool kCoat, bool kTissue>
class Tracer {
 public:
  Tracer(const PathScene& scene, const View& view, const PathOptions& options, uint64_t seed, int frame)
      : scene_(scene),
        view_(view),
        options_(options),
        direct_samples_(options.samples * options.direct_oversampling),
        seed_(seed),
        frame_(static_cast<uint64_t>(frame)),
        pinhole_(!view.defocus || view.defocus->aperture_mm == 0),
        eye_(*scene.wall, *view.light, view.world_from_camera, pinhole_),
        light_paths_(PathsFromGuides()),
        finder_(scene),
        own_paths_(scene, options, LobesOfBase()),
        shared_paths_(scene, options, LobesOfBase()),
        glint_paths_(GlintPathsOf(scene, options)) {
    if (kTissue) walks_.emplace(scene);
  }

  // Direct light first; light from wall to wall takes a pass over the frame for each sample, on a grid of
  // tiles shifted at random, so that what a tile's pixels have in common leaves no edges. It looks again
  // where the direct light looked, which costs little beside it.
  PathCount Run(bool with_parts, Film* film) {
    const int width = view_.valid->width, height = view_.valid->height;
    film->radiance = ImageF(width, height, 3);
    if (with_parts) film->direct = film->indirect = film->radiance;
    if (with_parts && kCoat) film->glint = film->radiance;
    if (with_parts && walks_) film->subsurface = film->radiance;
    PathCount total;
    ForEachTile({width, height, 0, 0}, &total,
                [&](const TilePixels& pixels, int, PathCount* count) { TraceDirect(pixels, film, count); });
    if (options_.bounces == 0) return total;
    indirect_.resize(film->radiance.data.size());
    if (kCoat && walks_) mirrored_.resize(indirect_.size());
    for (int sample = 0; sample < options_.samples; ++sample) {
      const uint64_t shift = RandomBits(seed_, frame_, kShiftKey, static_cast<uint64_t>(sample));
      const TileGrid grid(width, height, static_cast<int>(shift % kTileEdge),
                          static_cast<int>(shift / kTileEdge % kTileEdge));
      std::optional<PhotonsOfTiles> photons;
      if (light_paths_) {
        photons.emplace(light_paths_->Trace(static_cast<uint32_t>(sample), &total.rays), grid);
      }
      ForEachTile(grid, &total, [&](const TilePixels& pixels, int tile, PathCount* count) {
        TraceIndirect(pixels, tile, sample, photons ? &*photons : nullptr, count);
      });
    }
    AddIndirect(film);
    return total;
  }

 private:
  static constexpr uint64_t kShiftKey = 1ull << 63;  // no pixel's
  static constexpr uint64_t kTileKey = 1ull << 39;   // with a tile's number, no pixel's

  // trace(pixels, tile, count) for each tile that holds pixels to render; tile: its number.
  template <class Trace>
  void ForEachTile(const TileGrid& grid, PathCount* total, const Trace& trace) const {
    std::vector<PathCount> counts(static_cast<size_t>(grid.rows));
    ParallelFor(0, grid.rows, [&](int64_t row) {
      for (int column = 0; column < grid.columns; ++column) {
        const TilePixels pixels(column * kTileEdge - grid.shift_x,
                                static_cast<int>(row) * kTileEdge - grid.shift_y, *view_.valid);
        if (pixels.Empty()) continue;
        trace(pixels, static_cast<int>(row) * grid.columns + column, &counts[row]);
      }
    });
    for (const PathCount& count : counts) {
      total->samples += count.samples;
      total->rays += count.rays;
      Note(count.failure, &total->failure);
    }
  }

  void TraceDirect(const TilePixels& pixels, Film* film, PathCount* count) const {
    // What moves is where it is at one moment for all of a packet.
    const int each = view_.motion ? 1 : PixelSamples::EachOf(direct_samples_);
    for (int block = 0; block < kBlocks; ++block) {
      if (!Any(pixels.on[block])) continue;
      for (int group = 0; group < each; ++group) {
        TraceDirectGroup(pixels, block, each, group, film, count);
      }
      count->samples += int64_t{options_.samples} * Count(pixels.on[block]);
    }
  }

  // All samples of the pixels that share packets.
  void TraceDirectGroup(const TilePixels& pixels, int block, int each, int group, Film* film,
                        PathCount* count) const {
    PixelSamples packet = SamplesOf(pixels, block, each, group);
    if (!Any(packet.on)) return;
    double sums[kCoat ? 2 : 1][3][kLanes] = {};  // by lobe
    int lost[kLanes] = {};
    for (int first = 0; first < direct_samples_; first += each) {
      LobesOf<kCoat> light{};
      if (view_.motion) {
        AddDirectOfPacket(EyeOf(pixels, block, first), packet, &light, count);
      } else {
        AddDirectOfPacket(eye_, packet, &light, count);
      }
      const LanesI finite = IsFinite(Sum(light.Whole()));
      if (Any(packet.on & ~finite)) {
        for (int i = 0; i < kLanes; ++i) {
          if (!packet.on[i] || finite[i]) continue;
          Note({1, pixels.X(block, packet.pixel[i]), pixels.Y(block, packet.pixel[i]),
                static_cast<int>(packet.sample[i])},
               &count->failure);
          ++lost[i];
        }
      }
      Accumulate(Select(finite, light.base, Lanes3{}), sums[0]);
      if constexpr (kCoat) Accumulate(Select(finite, light.glint, Lanes3{}), sums[1]);
      packet.sample += static_cast<uint32_t>(each);
    }
    // A pixel's lanes lie as far apart as there are pixels.
    const int group_pixels = kLanes / each;
    for (int i = 0; i < group_pixels; ++i) {
      if (!packet.on[i]) continue;
      int kept = direct_samples_;
      for (int k = i; k < kLanes; k += group_pixels) kept -= lost[k];
      if (kept == 0) continue;
      const int x = pixels.X(block, packet.pixel[i]), y = pixels.Y(block, packet.pixel[i]);
      for (int c = 0; c < 3; ++c) {
        double mean[2] = {};
        for (int lobe = 0; lobe < (kCoat ? 2 : 1); ++lobe) {
          for (int k = i; k < kLanes; k += group_pixels) mean[lobe] += sums[lobe][c][k] / kept;
        }
        film->radiance.Pixel(x, y)[c] = static_cast<float>(mean[0] + mean[1]);
        ImageF& scattered = walks_ ? film->subsurface : film->direct;
        if (!scattered.empty()) scattered.Pixel(x, y)[c] = static_cast<float>(mean[0]);
        if (!film->glint.empty()) film->glint.Pixel(x, y)[c] = static_cast<float>(mean[1]);
      }
    }
  }

  void AddDirectOfPacket(const Eye& eye, const PixelSamples& packet, LobesOf<kCoat>* light,
                         PathCount* count) const {
    HitPacket hits;
    const PlacesOf<kCoat> places = Look(eye, packet, &hits, count);
    if (kCoat || !walks_) AddDirect(eye, places, true, light, count);
    if (!walks_) return;
    LobesOf<kCoat> scattered{};
    AddDirect(eye, Entries(eye.time, hits, places, packet, count), false, &scattered, count);
    light->base = scattered.base;
  }

  // Where what is seen of tissue came in.
  PlacesOf<kCoat> Entries(float time, const HitPacket& hits, const PlacesOf<kCoat>& places,
                          const PixelSamples& packet, PathCount* count) const {
    const auto sampler = [&](int i) {
      return Sampler(seed_, packet.key[i], packet.sample[i], options_.sampler);
    };
    return walks_->Entries(time, hits, places, WalkPair(0), false, sampler, &count->rays);
  }

  static void Accumulate(const Lanes3& light, double (*sums)[kLanes]) {
    alignas(64) float values[3][kLanes];
    Store3(light, values);
    for (int c = 0; c < 3; ++c) {
      for (int i = 0; i < kLanes; ++i) sums[c][i] += values[c][i];
    }
  }

  void TraceIndirect(const TilePixels& pixels, int tile_number, int sample, const PhotonsOfTiles* photons,
                     PathCount* count) {
    const uint64_t key = (frame_ << 40) ^ kTileKey ^ static_cast<uint64_t>(tile_number);
    TileSample<kCoat> tile;
    HitPacket hits[kBlocks];
    // Places are joined as they are at one moment. Where only the camera moves they are the same at all, and
    // each block is seen at a moment of its own.
    std::optional<Eye> moved;
    if (view_.motion) moved.emplace(EyeAt(pixels.y0 + kTileEdge / 2, key, sample));
    const Eye& tile_eye = moved ? *moved : eye_;
    const auto eye_of = [&](int block, std::optional<Eye>* own) -> const Eye& {
      if (!view_.motion || scene_.wall->moves()) return tile_eye;
      return own->emplace(EyeOf(pixels, block, sample));
    };
    for (int block = 0; block < kBlocks; ++block) {
      tile.places[block].alive = LanesI{};
      tile.indirect[block] = Lanes3{};
      if constexpr (kCoat) tile.mirrored[block] = Lanes3{};
      if (!Any(pixels.on[block])) continue;
      std::optional<Eye> own;
      tile.places[block] = Look(eye_of(block, &own), SamplesOf(pixels, block, sample), &hits[block], count);
    }
    // The coat mirrors its light where the pixels look, not where light enters the tissue.
    if constexpr (kCoat) AddGlints(tile_eye, pixels, sample, &tile, count);
    for (int block = 0; block < kBlocks; ++block) {
      if (!Any(pixels.on[block]) || !(walks_ || options_.shared_paths == 0)) continue;
      std::optional<Eye> own;
      const Eye& eye = eye_of(block, &own);
      const PixelSamples packet = SamplesOf(pixels, block, sample);
      if (walks_) tile.places[block] = Entries(eye.time, hits[block], tile.places[block], packet, count);
      if (options_.shared_paths == 0) AddOwnPaths(eye, packet, block, &tile, count);
    }
    if (options_.shared_paths > 0) {
      const auto lost = [&](const auto& path) {
        Note({1, pixels.X(path.block, path.lane), pixels.Y(path.block, path.lane), sample}, &count->failure);
      };
      shared_paths_.Add(tile_eye, seed_, key, sample, &tile, &count->rays, lost);
    }
    if constexpr (kCoat) {
      if (photons && photons->Has(tile_number))
        JoinPhotons(pixels, tile_number, sample, *photons, &tile, count);
    }
    for (int block = 0; block < kBlocks; ++block) {
      Deposit(pixels, block, sample, tile.indirect[block], tile.mirrored[block], count);
    }
  }

  void AddGlints(const Eye& eye, const TilePixels& pixels, int sample, TileSample<true>* tile,
                 PathCount* count) const {
    const auto sampler_of = [&](int block, int i) {
      return Sampler(seed_, PixelKey(pixels.X(block, i), pixels.Y(block, i)), static_cast<uint32_t>(sample),
                     options_.sampler);
    };
    const auto lost = [&](const auto& path) {
      Note({1, pixels.X(path.block, path.lane), pixels.Y(path.block, path.lane), sample}, &count->failure);
    };
    glint_paths_->Add(eye, *tile, sampler_of, walks_ ? tile->mirrored : tile->indirect, &count->rays, lost);
  }

  void JoinPhotons(const TilePixels& pixels, int tile_number, int sample, const PhotonsOfTiles& photons,
                   TileSample<true>* tile, PathCount* count) const {
    PhotonJoins joins(scene_, view_, eye_, pixels, tile);
    for (int block = 0; block < kBlocks; ++block) {
      if (!Any(tile->places[block].alive)) continue;
      Lanes x, y;
      Position(SamplesOf(pixels, block, sample), &x, &y);
      joins.SetPositions(block, x, y);
    }
    photons.ForEach(tile_number, [&](const Photon& photon) {
      if (photon.source.power.allFinite()) {
        joins.Add(photon, &count->rays);
      } else {
        Note({1, photon.x, photon.y, sample}, &count->failure);
      }
    });
  }

  // Adds a block's sample of indirect light to the frame's sums, but for pixels where it is not finite.
  // mirrored: what the coat mirrors, if it is kept apart.
  void Deposit(const TilePixels& pixels, int block, int sample, const Lanes3& light, const Lanes3& mirrored,
               PathCount* count) {
    for (int i = 0; i < kLanes; ++i) {
      if (!pixels.on[block][i]) continue;
      const int x = pixels.X(block, i), y = pixels.Y(block, i);
      const size_t pixel = static_cast<size_t>(y) * view_.valid->width + x;
      const Vec3f value = light[i], apart = mirrored_.empty() ? Vec3f(0, 0, 0) : mirrored[i];
      if (value.allFinite() && apart.allFinite()) {
        for (int c = 0; c < 3; ++c) indirect_[3 * pixel + c] += value[c];
        for (int c = 0; c < 3 && !mirrored_.empty(); ++c) mirrored_[3 * pixel + c] += apart[c];
        continue;
      }
      Note({1, x, y, sample}, &count->failure);
      std::call_once(any_lost_, [&] { lost_.assign(indirect_.size() / 3, 0); });
      ++lost_[pixel];
    }
  }

  static std::optional<GlintPaths<kTissue>> GlintPathsOf(const PathScene& scene, const PathOptions& options) {
    if (!kCoat || options.bounces == 0) return std::nullopt;
    return std::make_optional<GlintPaths<kTissue>>(scene, options, kGlintPairs);
  }

  std::optional<LightPaths> PathsFromGuides() const {
    if (!kCoat || !LightPaths::Serve(scene_, view_, options_)) return std::nullopt;
    return std::make_optional<LightPaths>(scene_, view_, options_, eye_, seed_, frame_);
  }

  // Of guides' light that the base of what is seen sends on, by paths from the camera.
  GuideLobes LobesOfBase() const { return light_paths_ ? GuideLobes::kBase : GuideLobes::kAll; }

  void AddIndirect(Film* film) const {
    ImageF& part = walks_ ? film->subsurface : film->indirect;
    ParallelFor(0, view_.valid->height, [&](int64_t y) {
      for (int x = 0; x < view_.valid->width; ++x) {
        const size_t pixel = static_cast<size_t>(y) * view_.valid->width + x;
        const int64_t kept = int64_t{options_.samples} - (lost_.empty() ? 0 : lost_[pixel]);
        if (kept == 0) continue;
        for (int c = 0; c < 3; ++c) {
          const float mean = static_cast<float>(indirect_[3 * pixel + c] / static_cast<double>(kept));
          film->radiance.data[3 * pixel + c] += mean;
          if (!part.empty()) part.data[3 * pixel + c] += mean;
          if (mirrored_.empty()) continue;
          const float apart = static_cast<float>(mirrored_[3 * pixel + c] / static_cast<double>(kept));
          film->radiance.data[3 * pixel + c] += apart;
          if (!film->indirect.empty()) film->indirect.data[3 * pixel + c] = apart;
        }
      }
    });
  }

  // The endoscope when some rows, whose middle is given, are read out for a sample.
  Eye EyeAt(double row, uint64_t key, int sample) const {
    const double height = std::clamp(row / view_.valid->height, 0.0, 1.0);
    const double random =
        Sampler(seed_, key, static_cast<uint32_t>(sample), options_.sampler).Pair(kTimePair)[0];
    const CameraMotion& motion = *view_.motion;
    const double time = motion.Time(height, random);
    return Eye(*scene_.wall, *view_.light, motion.At(time), pinhole_,
               scene_.wall->moves() ? motion.Part(time) : 0);
  }
  Eye EyeOf(const TilePixels& pixels, int block, int sample) const {
    return EyeAt(pixels.Y(block, 0) + kBlockEdge / 2, PixelKey(pixels.X(block, 0), pixels.Y(block, 0)),
                 sample);
  }

  uint64_t PixelKey(int x, int y) const {
    return (frame_ << 40) ^ (static_cast<uint64_t>(y) * view_.valid->width + static_cast<uint64_t>(x));
  }

  PixelSamples SamplesOf(const TilePixels& pixels, int block, int each, int group) const {
    return PixelSamples(
        pixels, block, each, group, [&](int x, int y) { return PixelKey(x, y); },
        [&](const uint64_t* keys) { return SamplerLanes(seed_, keys, options_.sampler); });
  }

  // Where in the image samples look, px.
  void Position(const PixelSamples& packet, Lanes* x, Lanes* y) const {
    *x = packet.x;
    *y = packet.y;
    if (direct_samples_ == 1) return;
    Lanes u, v;
    packet.sampler.Pair(packet.sample, kPixelPair, &u, &v);
    *x += u - 0.5f;
    *y += v - 0.5f;
  }

  // A sample of each of the pixels.
  PixelSamples SamplesOf(const TilePixels& pixels, int block, int sample) const {
    PixelSamples packet = SamplesOf(pixels, block, 1, 0);
    packet.sample += static_cast<uint32_t>(sample);
    return packet;
  }

  // The places that are seen.
  PlacesOf<kCoat> Look(const Eye& eye, const PixelSamples& packet, HitPacket* hits, PathCount* count) const {
    Lanes x, y;
    Position(packet, &x, &y);
    Lanes3 in_camera;
    const LanesI seen = view_.camera->Unproject(x, y, &in_camera) & packet.on;
    RayPacket rays;
    Store3(Broadcast(eye.origin), rays.origin);
    if (!pinhole_) {
      const Lanes3 on_aperture = PassLens(packet, &in_camera);
      Store3(Broadcast(eye.origin) + Rotated(eye.rotation, on_aperture), rays.origin);
    }
    Store3(Rotated(eye.rotation, in_camera), rays.direction);
    Store(Lanes{}, rays.tnear);
    Store(seen ? Broadcast(kFar) : Broadcast(-1), rays.tfar);
    rays.time = eye.time;
    scene_.wall->Intersect(rays, hits);
    count->rays += Count(seen);
    return finder_.Find(rays, *hits, false);
  }

  static Lanes3 Rotated(const Mat3<float>& r, const Lanes3& v) {
    const auto row = [&](int i) { return r(i, 0) * v.x + r(i, 1) * v.y + r(i, 2) * v.z; };
    return {row(0), row(1), row(2)};
  }

  // Turns directions to those of rays from places on the aperture, which are returned; camera axes.
  Lanes3 PassLens(const PixelSamples& packet, Lanes3* direction) const {
    Lanes u, v;
    packet.sampler.Pair(packet.sample, kLensPair, &u, &v);
    Lanes3 origin;
    for (int i = 0; i < kLanes; ++i) {
      const LensRay ray = ThroughLens(*view_.defocus, (*direction)[i], Vec2f(u[i], v[i]));
      origin.Set(i, ray.origin);
      direction->Set(i, ray.direction);
    }
    return origin;
  }

  // seen: by the camera.
  void AddDirect(const Eye& eye, const PlacesOf<kCoat>& places, bool seen, LobesOf<kCoat>* direct,
                 PathCount* count) const {
    for (const Guide& guide : eye.guides) {
      LobesOf<kCoat> light = Reflected<kCoat>(guide, IncidenceFrom(guide, places.point), places);
      if (!(guide.at_camera && seen)) {
        const LanesI asked = Sum(light.Whole()) != 0.0f;
        const LanesI shadowed = Shadowed(*scene_.wall, guide, eye.time, places, asked);
        count->rays += Count(asked);
        light.base = Select(shadowed, Lanes3{}, light.base);
        if constexpr (kCoat) light.glint = Select(shadowed, Lanes3{}, light.glint);
      }
      direct->base = direct->base + light.base;
      if constexpr (kCoat) direct->glint = direct->glint + light.glint;
    }
  }

  // Light that the wall scatters, by a bounce path for each pixel.
  void AddOwnPaths(const Eye& eye, const PixelSamples& packet, int block, TileSample<kCoat>* tile,
                   PathCount* count) const {
    constexpr BouncePairs kPairs(kOwnPairs);
    const auto& places = tile->places[block];
    BounceStart start;
    start.on = places.alive;
    start.origin = OffsetOrigin(places.point, places.normal);
    start.weight = places.albedo;
    for (int i = 0; i < kLanes; ++i) {
      if (!places.alive[i]) continue;
      const Sampler& sampler =
          start.samplers[i].emplace(seed_, packet.key[i], packet.sample[i], options_.sampler);
      start.direction.Set(i, lambert::Sample(places.normal[i], sampler.Pair(kPairs.Direction(1))));
    }
    FarEnds<kCoat, kTissue> ends = own_paths_.End(eye, start, kPairs, &count->rays);
    own_paths_.AddRest(eye, start, kPairs, &ends, &count->rays);
    Lanes3 light = places.albedo * ends.RadianceTo(start.direction * Broadcast(-1));
    if constexpr (kCoat) light = light * places.coat->Transmission(places.lanes(), start.direction);
    tile->indirect[block] = tile->indirect[block] + Select(ends.places.alive, light, Lanes3{});
  }

  const PathScene scene_;
  const View view_;
  const PathOptions options_;
  const int direct_samples_;
  const uint64_t seed_, frame_;
  const bool pinhole_;
  const Eye eye_;                                // at the frame's moment
  const std::optional<LightPaths> light_paths_;  // that bring what the coat mirrors onto other walls
  const PlaceFinder<kCoat> finder_;
  const BouncePaths<kCoat, kTissue> own_paths_;
  const SharedPaths<kCoat, kTissue> shared_paths_;
  const std::optional<GlintPaths<kTissue>> glint_paths_;
  std::optional<TissueWalks<kCoat>> walks_;
  std::vector<double> indirect_;  // sums over samples, RGB of each pixel
  std::vector<double> mirrored_;  // likewise off the coat, where there is tissue below; else in indirect_
  std::once_flag any_lost_;
  std::vector<uint32_t> lost_;  // samples of a pixel that were not finite; empty while there are none
};

}  // namespace
}  // namespace lumen
