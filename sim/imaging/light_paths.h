// Light that a coat mirrors onto other walls, traced from the guides: light tracing (Dutré, Lafortune and
// Willems 1993, "Monte Carlo light tracing with direct computation of pixel intensities"; the adjoint
// particles of Veach 1997, "Robust Monte Carlo methods for light transport simulation", ch. 4). Paths from
// the camera meet the place y that mirrors a guide rarely, and find it bright; a path from the guide meets it
// always.
//
// A guide sends a share of its power, intensity · exp(−spread · (1 − D·L)), along each of n directions that
// are drawn with that density; at the wall, y, they go on by the coat's first lobe. Where such a path then
// meets the wall in a pixel's sight, it leaves a photon, whose light photon_joins.h brings to the camera.
// From there paths go on by both lobes. The glints' lobe is written for light that is followed from the
// viewer, as irradiance · f (i·s) with s the relief's normal and not the wall's: along a path from the light
// it weighs (i·s)(o·n)/((i·n)(o·s)) times as much as towards it (Veach, section 5.3, adjoint of shading
// normals).
//
// The paths are those whose vertex next to a guide is a glint and whose vertex next to the camera is another
// one and isn't; estimators that start at the camera leave just these out (GuideLobes::kBase). Bounces count
// as theirs do: `bounces` is how often light goes from wall to wall, and between walls it meets
// `bounced_coat`. Roulette keeps paths equally bright, from the first wall on.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <vector>

#include "common/camera.h"
#include "common/light.h"
#include "common/parallel.h"
#include "sim/imaging/bounce_paths.h"
#include "sim/imaging/photon.h"

namespace lumen {

class LightPaths {
 public:
  // Whether a frame is taken as paths from the guides find it: through a pinhole at one moment (a pixel's
  // moment is not known before the pixel is), over the pixels' whole squares, of a wall without tissue; and
  // wide enough that a part of the paths that is worth while meets what it sees.
  static bool Serve(const PathScene& scene, const View& view, const PathOptions& options) {
    return options.bounces > 0 && scene.surface->coat && !scene.surface->subsurface && !view.motion &&
           !(view.defocus && view.defocus->aperture_mm > 0) &&
           options.samples * options.direct_oversampling > 1 && SolidAngle(view) > kLeastView_sr;
  }

  LightPaths(const PathScene& scene, const View& view, const PathOptions& options, const Eye& eye,
             uint64_t seed, uint64_t frame)
      : scene_(scene),
        view_(view),
        options_(options),
        eye_(eye),
        seed_(seed),
        frame_(frame),
        finder_(scene),
        paths_(scene, options, GuideLobes::kAll) {
    const auto& valid = view.valid->data;
    const double pixels = static_cast<double>(valid.size() - std::count(valid.begin(), valid.end(), 0));
    const double paths = std::min(kPathsPerPixel * pixels, kMostPaths);
    double whole = 0;
    for (const Guide& guide : eye.guides) whole += Power(guide);
    for (const Guide& guide : eye.guides) {
      if (!(Power(guide) > 0)) continue;
      Beam beam{&guide, TangentFrame(guide.direction), packets_, 1, 1, {}};
      const double packets = paths / kLanes * (Power(guide) / whole);
      beam.rows = std::max(1, static_cast<int>(std::lround(std::sqrt(packets / kColumnsPerRow))));
      beam.columns = std::max(1, static_cast<int>(std::lround(packets / beam.rows)));
      const int64_t count = int64_t{beam.rows} * beam.columns;
      beam.power =
          guide.intensity * static_cast<float>(PatternSolidAngle(guide.spread) / double(count * kLanes));
      beams_.push_back(beam);
      packets_ += count;
    }
  }

  // The photons of a frame's sample, always in the same order. Rays are counted.
  std::vector<Photon> Trace(uint32_t sample, int64_t* rays) const {
    const int64_t chunks = (packets_ + kPacketsPerChunk - 1) / kPacketsPerChunk;
    std::vector<Chunk> all(static_cast<size_t>(chunks));
    ParallelFor(0, chunks, [&](int64_t i) {
      const int64_t begin = i * kPacketsPerChunk;
      TraceChunk(begin, std::min(begin + kPacketsPerChunk, packets_), sample, &all[i]);
    });
    std::vector<Photon> photons;
    for (const Chunk& chunk : all) {
      *rays += chunk.rays;
      photons.insert(photons.end(), chunk.photons.begin(), chunk.photons.end());
    }
    return photons;
  }

 private:
  // The guides' paths for each sample and pixel that is rendered, and those that go on from the first wall
  // for each that the coat sends on all light of; least time to a given noise, of 0.15 to 4 and of 0.4 to 20.
  static constexpr double kPathsPerPixel = 0.5;
  static constexpr float kPathsOfWeight = 1;
  // Of a sample. A tenth of them at most leave photons, of some 150 bytes each.
  static constexpr double kMostPaths = 2e6;
  // A part of all directions that is worth while: a fiftieth.
  static constexpr double kLeastView_sr = 0.25;
  // Of a beam's cells, so that they are about as long as wide at the middle of its power.
  static constexpr int kColumnsPerRow = 4;
  static constexpr int kPacketsPerChunk = 256;
  static constexpr uint64_t kPathKey = 1ull << 37;  // with a path's number, neither a pixel's nor a tile's
  static constexpr uint32_t kGuidePair = 0;
  static constexpr BouncePairs kPairs{1};

  // A guide's light in cells alike in power, a packet of 4 × 4 paths each.
  struct Beam {
    const Guide* guide;
    TangentFrame axes;
    int64_t first;  // of its packets
    int rows, columns;
    Vec3f power;  // a path's
  };
  struct Chunk {
    std::vector<Photon> photons;
    int64_t rays = 0;
  };
  // Paths that leave the wall; their weight is their power.
  struct Waiting {
    BounceStart start;
    PhotonSource source[kLanes];  // where they leave it
    int count = 0;
  };

  static float Luminance(const Vec3f& light) { return light.dot(Vec3f(0.2126f, 0.7152f, 0.0722f)); }
  static double Power(const Guide& guide) {
    return Luminance(guide.intensity) * PatternSolidAngle(guide.spread);
  }

  // Of what a view sees, from 16 × 16 of its pixels.
  static double SolidAngle(const View& view) {
    constexpr int kAcross = 16;
    const int width = view.valid->width, height = view.valid->height;
    double sum = 0;
    for (int i = 0; i < kAcross * kAcross; ++i) {
      const int x = (2 * (i % kAcross) + 1) * width / (2 * kAcross);
      const int y = (2 * (i / kAcross) + 1) * height / (2 * kAcross);
      if (!*view.valid->Pixel(x, y)) continue;
      const Vec2f pixel(static_cast<float>(x), static_cast<float>(y));
      const auto ray = view.camera->Unproject(pixel);
      if (ray) sum += 1 / view.camera->AreaPerSteradian(pixel, *ray);
    }
    return sum * width * height / (kAcross * kAcross);
  }

  void TraceChunk(int64_t first, int64_t last, uint32_t sample, Chunk* chunk) const {
    Waiting waiting;
    const Beam* beam = &beams_.back();
    while (beam->first > first) --beam;
    for (int64_t packet = first; packet < last; ++packet) {
      if (beam != &beams_.back() && packet == beam[1].first) ++beam;
      Start(*beam, packet, sample, &waiting, chunk);
    }
    if (waiting.count > 0) Follow(&waiting, chunk);
  }

  // Sends a packet's paths to the first wall; those that go on wait for others.
  void Start(const Beam& beam, int64_t packet, uint32_t sample, Waiting* waiting, Chunk* chunk) const {
    uint64_t keys[kLanes];
    for (int i = 0; i < kLanes; ++i) {
      keys[i] = (frame_ << 40) ^ kPathKey ^ static_cast<uint64_t>(packet * kLanes + i);
    }
    const SamplerLanes sampler(seed_, keys, options_.sampler);
    const LanesU samples = BroadcastU(sample);
    const RayPacket rays = Rays(beam, packet - beam.first, sampler, samples);
    HitPacket hits;
    scene_.wall->Intersect(rays, &hits);
    chunk->rays += kLanes;
    const CoatedPlaces places = finder_.Find(rays, hits, true);
    const Lanes3 origin = OffsetOrigin(places.point, places.normal);
    Lanes u, v, choice, spare;
    sampler.Pair(samples, kPairs.Direction(1), &u, &v);
    sampler.Pair(samples, kPairs.Roulette(1), &choice, &spare);
    for (int i = 0; i < kLanes; ++i) {
      if (!places.alive[i]) continue;
      const CoatedPlace place = places.lanes()[i];
      const Coat::Glint glint = places.coat->SampleGlint(place, Vec2f(u[i], v[i]));
      if (!(glint.weight > 0)) continue;
      const float weight = glint.weight * GlintFromLight(place, glint.incoming);
      const float survival = std::min(1.0f, kPathsOfWeight * weight);
      if (choice[i] >= survival) continue;
      const int lane = waiting->count++;
      waiting->source[lane] = {places.point[i], place, beam.power, beam.power.maxCoeff() / kPathsOfWeight,
                               true};
      waiting->start.on[lane] = -1;
      waiting->start.origin.Set(lane, origin[i]);
      waiting->start.direction.Set(lane, glint.incoming);
      waiting->start.weight.Set(lane, beam.power * (weight / survival));
      waiting->start.samplers[lane].emplace(seed_, keys[i], sample, options_.sampler);
      if (waiting->count == kLanes) Follow(waiting, chunk);
    }
  }

  // Rays from a guide in one of its beam's cells.
  RayPacket Rays(const Beam& beam, int64_t cell, const SamplerLanes& sampler, const LanesU& samples) const {
    Lanes u, v;
    sampler.Pair(samples, kGuidePair, &u, &v);
    RayPacket rays;
    Store3(Broadcast(beam.guide->position), rays.origin);
    Store(Lanes{}, rays.tnear);
    Store(Broadcast(1e30f), rays.tfar);
    rays.time = eye_.time;
    for (int i = 0; i < kLanes; ++i) {
      const double along = (cell / beam.columns * 4 + i / 4 + double(u[i])) / (4.0 * beam.rows);
      const double around = (cell % beam.columns * 4 + i % 4 + double(v[i])) / (4.0 * beam.columns);
      const double below_axis = SamplePattern(beam.guide->spread, along), turn = 2 * kPi * around;
      const double sine = std::sqrt(std::max(0.0, below_axis * (2 - below_axis)));
      const Vec3f direction = static_cast<float>(1 - below_axis) * beam.guide->direction +
                              static_cast<float>(sine * std::cos(turn)) * beam.axes.tangent +
                              static_cast<float>(sine * std::sin(turn)) * beam.axes.bitangent;
      for (int d = 0; d < 3; ++d) rays.direction[d][i] = direction[d];
    }
    return rays;
  }

  // From the first wall on to others, until no path is left; then none waits.
  void Follow(Waiting* waiting, Chunk* chunk) const {
    BounceStart& start = waiting->start;
    for (int bounce = 1; Any(start.on); ++bounce) {
      HitPacket hits;
      const CoatedPlaces places =
          paths_.Meet(eye_.time, start.on, start.origin, start.direction, &hits, &chunk->rays);
      start.on = places.alive;
      AddPhotons(places, *waiting, chunk);
      if (bounce == options_.bounces) break;
      GoOn(places, bounce + 1, waiting);
    }
    waiting->count = 0;
    start.on = LanesI{};
  }

  void GoOn(const CoatedPlaces& places, int bounce, Waiting* waiting) const {
    BounceStart& start = waiting->start;
    start.origin = OffsetOrigin(places.point, places.normal);
    for (int i = 0; i < kLanes; ++i) {
      if (!start.on[i]) continue;
      const Sampler& sampler = *start.samplers[i];
      const Vec2f chance = sampler.Pair(kPairs.Roulette(bounce));
      const CoatedPlace place = places.lanes()[i];
      const Vec3f toward = places.coat->Sample(place, sampler.Pair(kPairs.Direction(bounce)), chance[1]);
      const CoatLobes lobes = places.coat->Eval(place, toward);
      const float glint = lobes.glint > 0 ? lobes.glint * GlintFromLight(place, toward) : 0.0f;
      const Vec3f power = start.weight[i].cwiseProduct((lobes.base + Vec3f::Constant(glint)) /
                                                       places.coat->Pdf(place, toward));
      PhotonSource& source = waiting->source[i];
      source = {places.point[i], place, start.weight[i], source.level, false};
      const float survival = std::min(1.0f, power.maxCoeff() / source.level);
      if (chance[0] >= survival) {
        start.on[i] = 0;
        continue;
      }
      start.weight.Set(i, power / survival);
      start.direction.Set(i, toward);
    }
  }

  // Where the camera sees paths meet the wall.
  void AddPhotons(const CoatedPlaces& places, const Waiting& waiting, Chunk* chunk) const {
    const Lanes3 to_eye = Broadcast(eye_.origin) - places.point;
    const LanesI turned = places.alive & (Dot(to_eye, places.normal) > 0.0f);
    if (!Any(turned)) return;
    const Lanes3 from = OffsetOrigin(places.point, places.normal);
    for (int i = 0; i < kLanes; ++i) {
      if (!turned[i]) continue;
      const auto pixel = view_.camera->Project(eye_.rotation.transpose() * -to_eye[i]);
      if (!pixel) continue;
      const Vec2f corner = (*pixel + Vec2f(0.5f, 0.5f)).array().floor();
      if (!(corner[0] >= 0 && corner[1] >= 0 && corner[0] < static_cast<float>(view_.valid->width) &&
            corner[1] < static_cast<float>(view_.valid->height))) {
        continue;
      }
      const int x = static_cast<int>(corner[0]), y = static_cast<int>(corner[1]);
      if (!*view_.valid->Pixel(x, y)) continue;
      ++chunk->rays;
      const Vec3f origin = from[i];
      if (scene_.wall->Occluded(origin, eye_.origin - origin, 0, 1, eye_.time)) continue;
      chunk->photons.push_back({waiting.source[i], places.point[i], places.normal[i], places.albedo[i],
                                places.coat_normal[i], *pixel, x, y});
    }
  }

  const PathScene scene_;
  const View view_;
  const PathOptions options_;
  const Eye& eye_;
  const uint64_t seed_, frame_;
  const PlaceFinder<true> finder_;
  const BouncePaths<true, false> paths_;
  std::vector<Beam> beams_;
  int64_t packets_ = 0;
};

}  // namespace lumen
