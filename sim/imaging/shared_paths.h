// Light from wall to wall by paths that the pixels of a tile share (Bekaert, Sbert and Halton 2002,
// "Accelerating path tracing by re-using paths"). From the n places that the tile's pixels see, K bounce
// paths start with the density cos/π of their directions; where each first ends, y, is joined to all n places
// x_i. With g_i(y) = V·cos·cos'/d², what path k contributes to place i is, by the balance heuristic over all
// the places that it could have started from,
//
//   ρ_i · L(y_k → x_i) · g_i(y_k) / (K/n · Σ_j g_j(y_k)),
//
// at most n/K · ρ_i L. A join takes n shadow rays, in coherent packets, and is what costs; so of the K ends
// only some are joined, chosen with a probability e_k and divided by it (resampled importance sampling:
// Talbot, Cline and Egbert 2005); e_k is in proportion to the root mean square of what the n places would
// get, so that an end close to a few of them, which would leave spots there, is joined more often. All of it
// is without bias. Noise is smaller than with a path for each pixel, and alike in neighbouring pixels.
#pragma once

#include <array>
#include <cmath>
#include <vector>

#include "sim/imaging/bounce_paths.h"
#include "sim/imaging/tile_shadows.h"

namespace lumen {

template <bool kCoat, bool kTissue>
class SharedPaths {
 public:
  SharedPaths(const PathScene& scene, const PathOptions& options, GuideLobes guide_lobes)
      : wall_(*scene.wall),
        count_(options.shared_paths),
        sampling_(options.sampler),
        paths_per_join_(kCoat && guide_lobes == GuideLobes::kAll ? 8 : 4),
        paths_(scene, options, guide_lobes) {}

  // A path whose light is not finite is left out.
  struct Lost {
    int block, lane;  // that it started from
  };

  // Adds to the indirect light of a sample. On a wall that moves the tile's places must be of the eye's time.
  // key: of the tile's random numbers; sample: of the frame. lost is called with a Lost for each path that
  // isn't finite.
  template <class OnLost>
  void Add(const Eye& eye, uint64_t seed, uint64_t key, int sample, TileSample<kCoat>* tile, int64_t* rays,
           const OnLost& lost) const {
    const Places places(*tile);
    if (places.count == 0) return;
    const TileShadows shadows(wall_, eye.time, *tile);
    const int packets = (count_ * paths_per_join_ + kLanes - 1) / kLanes;
    const Sampler tile_sampler(seed, key ^ kTileNumbers, static_cast<uint32_t>(sample), sampling_);
    std::vector<Packet> paths(static_cast<size_t>(packets));
    double whole = 0;
    for (int p = 0; p < packets; ++p) {
      Packet& path = paths[static_cast<size_t>(p)];
      const BounceStart start = Start(places, shadows, *tile, seed, key, sample, p, packets, path.source);
      path.ends = paths_.End(eye, start, kPairs, rays);
      paths_.AddRest(eye, start, kPairs, &path.ends, rays);
      path.brightness = Brightness(path.ends, start, *tile);
      for (int i = 0; i < kLanes; ++i) {
        if (!path.ends.places.alive[i]) path.brightness[i] = 0;
        if (std::isfinite(path.brightness[i])) {
          whole += path.brightness[i];
        } else {
          lost(Lost{path.source[i] / kLanes, path.source[i] % kLanes});
          path.brightness[i] = 0;
        }
      }
    }
    if (!(whole > 0)) return;
    // Systematic sampling: an end is chosen where the sum of the e_k passes an integer. In the order of the
    // places that the paths start from, so that the chosen ones are spread over the tile.
    double passed = tile_sampler.Pair(0)[0];
    for (int i = 0; i < kLanes; ++i) {
      for (Packet& path : paths) {
        if (path.brightness[i] == 0) continue;
        const double chance = std::min(1.0, count_ * path.brightness[i] / whole);
        const double before = std::floor(passed);
        passed += chance;
        if (std::floor(passed) == before) continue;
        const double share = places.count / (double(packets) * kLanes * chance);
        Join(path.ends, i, path.source[i], static_cast<float>(share), shadows, tile, rays);
      }
    }
  }

 private:
  static constexpr uint64_t kTileNumbers = 1ull << 38;  // apart from its paths'
  static constexpr uint32_t kSourcePair = 0;
  static constexpr BouncePairs kPairs{1};

  struct Packet {
    FarEnds<kCoat, kTissue> ends;
    int source[kLanes];  // place that each path starts from
    Lanes brightness;
  };

  // What the choice of the joins goes by: the root mean square of what the places would get, shadows apart.
  static Lanes Brightness(const FarEnds<false, kTissue>& ends, const BounceStart& start,
                          const TileSample<false>& tile) {
    Lanes brightness = LuminanceOf(ends.RadianceTo(start.direction * Broadcast(-1)));
    for (int i = 0; i < kLanes; ++i) {
      if (!ends.places.alive[i]) continue;
      const Lanes3 point = Broadcast(ends.places.point[i]), normal = Broadcast(ends.places.normal[i]);
      Lanes sum{}, squares{};
      for (const auto& seen : tile.places) {
        const Lanes coupling = Coupling(seen, point, normal);
        sum += coupling;
        squares += coupling * coupling;
      }
      brightness[i] *= std::sqrt(Total(squares)) * Inverse(Total(sum));
    }
    return brightness;
  }
  // A coat sends to each place something else: the root mean square of what they would get, shadows apart.
  static Lanes Brightness(const FarEnds<true, kTissue>& ends, const BounceStart&,
                          const TileSample<true>& tile) {
    Lanes brightness{};
    for (int i = 0; i < kLanes; ++i) {
      if (!ends.places.alive[i]) continue;
      const FarEnds<true, kTissue> end = ends.Lane(i);
      const Lanes3 point = Broadcast(ends.places.point[i]);
      Lanes couplings{}, densities{}, squares[3] = {};
      for (int block = 0; block < kBlocks; ++block) {
        const auto& seen = tile.places[block];
        const Lanes coupling = Coupling(seen, point, end.places.normal);
        // A place that is the end itself has no direction: it isn't joined, whatever is sent there.
        const LanesI joined = coupling > 0.0f;
        if (!Any(joined)) continue;
        const auto sent = end.To(Normalized(seen.point - point));
        const Lanes3 reflected = seen.albedo * coupling;
        const Lanes of_guide = joined ? LuminanceOf(reflected * sent.of_guide) : Lanes{};
        const Lanes of_walls = joined ? LuminanceOf(reflected * sent.of_walls) : Lanes{};
        couplings += coupling;
        densities += joined ? coupling * sent.density : Lanes{};
        squares[0] += of_guide * of_guide;
        squares[1] += of_guide * of_walls;
        squares[2] += of_walls * of_walls;
      }
      const float to_guide = Inverse(Total(couplings)), to_walls = Inverse(Total(densities));
      brightness[i] =
          std::sqrt(Total(squares[0]) * to_guide * to_guide + 2 * Total(squares[1]) * to_guide * to_walls +
                    Total(squares[2]) * to_walls * to_walls);
    }
    return brightness;
  }

  static Lanes LuminanceOf(const Lanes3& light) {
    return 0.2126f * light.x + 0.7152f * light.y + 0.0722f * light.z;
  }
  static float Total(const Lanes& lanes) {
    float total = 0;
    for (int i = 0; i < kLanes; ++i) total += lanes[i];
    return total;
  }
  // 0 of 0: what is divided by it is 0 too.
  static float Inverse(float value) { return value > 0 ? 1 / value : 0; }

  // g/V = cos·cos'/d² between places that are seen and one on the wall; 0 where either faces away.
  static Lanes Coupling(const PlacesOf<kCoat>& seen, const Lanes3& point, const Lanes3& normal) {
    const Lanes3 to = point - seen.point;
    const Lanes squared = Dot(to, to), near = Dot(seen.normal, to), far = -Dot(normal, to);
    const LanesI faces = seen.alive & (near > 0.0f) & (far > 0.0f);
    // A quotient at a time: the product of the squares could vanish.
    return faces ? (near / squared) * (far / squared) : Lanes{};
  }

  // The tile's places that are alive.
  struct Places {
    explicit Places(const TileSample<kCoat>& tile) {
      for (int block = 0; block < kBlocks; ++block) {
        for (int i = 0; i < kLanes; ++i) {
          if (tile.places[block].alive[i]) order[count++] = static_cast<int16_t>(block * kLanes + i);
        }
      }
    }
    int count = 0;
    std::array<int16_t, kBlocks * kLanes> order;
  };

  // A packet's starts. Its lanes lie a packet count apart in the order of all paths, each of which has a
  // share of the places for its own: together their densities are those of any path from any place.
  BounceStart Start(const Places& places, const TileShadows& shadows, const TileSample<kCoat>& tile,
                    uint64_t seed, uint64_t key, int sample, int packet, int packets,
                    int source[kLanes]) const {
    BounceStart start;
    const int all = packets * kLanes;
    for (int i = 0; i < kLanes; ++i) {
      const int path = i * packets + packet;
      const Sampler& sampler =
          start.samplers[i].emplace(seed, key, static_cast<uint32_t>(sample * all + path), sampling_);
      const double pick = places.count * (path + double(sampler.Pair(kSourcePair)[0])) / all;
      source[i] = places.order[std::min(static_cast<int>(pick), places.count - 1)];
      const int block = source[i] / kLanes, lane = source[i] % kLanes;
      const auto& from = tile.places[block];
      start.on[i] = -1;
      start.origin.Set(i, shadows.origins(block)[lane]);
      start.direction.Set(i, lambert::Sample(from.normal[lane], sampler.Pair(kPairs.Direction(1))));
      start.weight.Set(i, from.albedo[lane]);
    }
    return start;
  }

  void Join(const FarEnds<kCoat, kTissue>& ends, int lane, int source, float share,
            const TileShadows& shadows, TileSample<kCoat>* tile, int64_t* rays) const {
    const Lanes3 point = Broadcast(ends.places.point[lane]), normal = Broadcast(ends.places.normal[lane]);
    const Lanes3 from = OffsetOrigin(point, normal);
    Lanes coupling[kBlocks], sum{};
    for (int block = 0; block < kBlocks; ++block) {
      const auto& seen = tile->places[block];
      coupling[block] = Coupling(seen, point, normal);
      const LanesI faces = coupling[block] > 0.0f;
      if (!Any(faces)) continue;
      LanesI visible = ~shadows.Hidden(from, block, faces, rays);
      // The path itself has shown that its start is seen.
      if (source / kLanes == block) visible[source % kLanes] = -1;
      coupling[block] = visible ? coupling[block] : Lanes{};
      sum += coupling[block];
    }
    const float total = Total(sum);
    // Rounding can turn the path's own start away; then nothing is seen from where it ended.
    if (!(total > 0)) return;
    const FarEnds<kCoat, kTissue> end = ends.Lane(lane);
    if constexpr (kCoat) {
      AddCoated(end, coupling, point, share, total, tile);
    } else {
      for (int block = 0; block < kBlocks; ++block) {
        const auto& seen = tile->places[block];
        const Lanes3 light = end.RadianceTo(Normalized(seen.point - point));
        AddLight(block, coupling[block] > 0.0f, seen.albedo * light * (coupling[block] * (share / total)),
                 tile);
      }
    }
  }

  // Beyond an end a path's direction, too, could have been chosen by paths from all the places: under a coat
  // with another density by each. That density goes into the balance heuristic, so that a glint of the light
  // from other walls weighs no more towards a place that the path did not come from.
  static void AddCoated(const FarEnds<true, kTissue>& end, const Lanes* coupling, const Lanes3& point,
                        float share, float total, TileSample<true>* tile) {
    CoatedLight sent[kBlocks];
    Lanes sum{};
    for (int block = 0; block < kBlocks; ++block) {
      const LanesI joined = coupling[block] > 0.0f;
      if (!Any(joined)) continue;
      sent[block] = end.To(Normalized(tile->places[block].point - point));
      sum += joined ? coupling[block] * sent[block].density : Lanes{};
    }
    const Lanes of_guide = Broadcast(share / total), of_walls = Broadcast(share * Inverse(Total(sum)));
    for (int block = 0; block < kBlocks; ++block) {
      const LanesI joined = coupling[block] > 0.0f;
      if (!Any(joined)) continue;
      const auto& seen = tile->places[block];
      const Lanes3 light = sent[block].of_guide * of_guide + sent[block].of_walls * of_walls;
      const Lanes passed = seen.coat->Transmission(seen.lanes(), Normalized(point - seen.point));
      AddLight(block, joined, seen.albedo * light * (coupling[block] * passed), tile);
    }
  }

  static void AddLight(int block, const LanesI& joined, const Lanes3& light, TileSample<kCoat>* tile) {
    tile->indirect[block] = tile->indirect[block] + Select(joined, light, Lanes3{});
  }

  const RayScene& wall_;
  const int count_;
  const Sampling sampling_;
  // Least time to a given noise, of 1 to 8 without a coat; with one, of 4 and 8 where ends mirror the guides'
  // light, of 2 to 16 where they don't.
  const int paths_per_join_;
  BouncePaths<kCoat, kTissue> paths_;
};

}  // namespace lumen
