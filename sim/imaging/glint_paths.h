// Light from other walls that the coat of what is seen mirrors. Its lobe is too narrow for paths that come to
// it from elsewhere, so they leave in its own directions; it sends on so little that only some of the pixels
// look. What one finds, y, is joined to all places x_i of the tile, as shared_paths.h does: neighbours on a
// relief mirror much the same. With f the lobe times the cosine there and g = V cos'/d², a pixel gains
//
//   L(y → x_i) f_i g_i / Σ_j r_j g_j,   r = min(q, K f),
//
// by the balance heuristic over the paths that could have found y: q is the density 1/sr of the lobe's
// directions, and K f/q the chance that a pixel whose path leaves so looks, if it is less than 1.
#pragma once

#include <algorithm>
#include <cstdint>

#include "sim/imaging/bounce_paths.h"
#include "sim/imaging/tile_shadows.h"

namespace lumen {

template <bool kTissue>
class GlintPaths {
 public:
  // first_pair: of the random numbers of these paths.
  GlintPaths(const PathScene& scene, const PathOptions& options, uint32_t first_pair)
      : wall_(*scene.wall), paths_(scene, options, GuideLobes::kAll), pairs_(first_pair) {}

  // A pixel whose path's light is not finite: it is left out.
  struct Lost {
    int block, lane;
  };

  // Adds to each block's light. On a wall that moves the tile's places must be of the eye's time.
  // sampler_of(block, lane): a pixel's; lost is called with a Lost for each path that isn't finite.
  template <class SamplerOf, class OnLost>
  void Add(const Eye& eye, const TileSample<true>& tile, const SamplerOf& sampler_of, Lanes3* light,
           int64_t* rays, const OnLost& lost) const {
    const TileShadows shadows(wall_, eye.time, tile);
    Waiting waiting;
    for (int block = 0; block < kBlocks; ++block) {
      const CoatedPlaces& places = tile.places[block];
      for (int i = 0; i < kLanes; ++i) {
        if (!places.alive[i]) continue;
        const Sampler sampler = sampler_of(block, i);
        const Coat::Glint glint =
            places.coat->SampleGlint(places.lanes()[i], sampler.Pair(pairs_.Direction(1)));
        // Roulette: the light of those that look is equally bright, which is least noise for their number.
        const float survival = std::min(1.0f, kPathsOfWeight * glint.weight);
        if (!(sampler.Pair(pairs_.Roulette(1))[0] < survival)) continue;
        BounceStart& start = waiting.start;
        const int lane = waiting.count++;
        start.on[lane] = -1;
        start.origin.Set(lane, shadows.origins(block)[i]);
        start.direction.Set(lane, glint.incoming);
        start.weight.Set(lane, Vec3f::Constant(glint.weight / survival));
        start.samplers[lane].emplace(sampler);
        waiting.source[lane] = {block, i};
        if (waiting.count == kLanes) Trace(eye, tile, shadows, &waiting, light, rays, lost);
      }
    }
    if (waiting.count > 0) Trace(eye, tile, shadows, &waiting, light, rays, lost);
  }

 private:
  // The pixels that look for each that the coat sends on all light of; least time to a given noise, of 0.7,
  // 1.5, 2, 3, 6 and 12.
  static constexpr float kPathsOfWeight = 2;

  struct Source {
    int block, lane;
  };
  // Paths that leave the tile when there is a packet of them.
  struct Waiting {
    BounceStart start;
    Source source[kLanes];
    int count = 0;
  };

  template <class OnLost>
  void Trace(const Eye& eye, const TileSample<true>& tile, const TileShadows& shadows, Waiting* waiting,
             Lanes3* light, int64_t* rays, const OnLost& lost) const {
    FarEnds<true, kTissue> ends = paths_.End(eye, waiting->start, pairs_, rays);
    paths_.AddRest(eye, waiting->start, pairs_, &ends, rays);
    const LanesI finite = ends.Finite();
    for (int i = 0; i < waiting->count; ++i) {
      const Source& source = waiting->source[i];
      if (!ends.places.alive[i]) continue;
      if (finite[i]) {
        Join(ends, i, source, tile, shadows, light, rays);
      } else {
        lost(Lost{source.block, source.lane});
      }
    }
    waiting->count = 0;
    waiting->start.on = LanesI{};
  }

  void Join(const FarEnds<true, kTissue>& ends, int lane, const Source& source, const TileSample<true>& tile,
            const TileShadows& shadows, Lanes3* light, int64_t* rays) const {
    const FarEnds<true, kTissue> end = ends.Lane(lane);
    const Lanes3 point = Broadcast(ends.places.point[lane]), normal = end.places.normal;
    const Lanes3 from = OffsetOrigin(point, normal);
    CoatedLight sent[kBlocks];
    Lanes mirrored[kBlocks], sum{}, sum_on{};
    LanesI joined[kBlocks];
    for (int block = 0; block < kBlocks; ++block) {
      const CoatedPlaces& seen = tile.places[block];
      joined[block] = LanesI{};
      const Lanes3 to = point - seen.point;
      const Lanes squared = Dot(to, to);
      const Lanes3 direction = to * (1.0f / Sqrt(squared));
      const Lanes facing = -Dot(normal, direction);
      const LanesI faces = seen.alive & (facing > 0.0f) & (Dot(seen.normal, direction) > 0.0f);
      if (!Any(faces)) continue;
      const Lanes lobe = seen.coat->EvalGlint(seen.lanes(), direction);
      const LanesI mirrors = faces & (lobe > 0.0f);
      if (!Any(mirrors)) continue;
      LanesI visible = ~shadows.Hidden(from, block, mirrors, rays);
      // The path itself has shown that its start is seen.
      if (source.block == block) visible[source.lane] = -1;
      joined[block] = mirrors & visible;
      const Lanes geometry = facing / squared;
      const Lanes found =
          joined[block] ? geometry * Min(seen.coat->GlintPdf(seen.lanes(), direction), kPathsOfWeight * lobe)
                        : Lanes{};
      sent[block] = end.To(direction * Broadcast(-1));
      mirrored[block] = lobe * geometry;
      sum += found;
      sum_on += joined[block] ? found * sent[block].density : Lanes{};
    }
    float total = 0, total_on = 0;
    for (int i = 0; i < kLanes; ++i) {
      total += sum[i];
      total_on += sum_on[i];
    }
    // Rounding can turn the path's own start away; then nothing is seen from where it ended.
    if (!(total > 0)) return;
    const Lanes of_guide = Broadcast(1 / total), of_walls = Broadcast(total_on > 0 ? 1 / total_on : 0);
    for (int block = 0; block < kBlocks; ++block) {
      if (!Any(joined[block])) continue;
      const Lanes3 arriving = sent[block].of_guide * of_guide + sent[block].of_walls * of_walls;
      light[block] = light[block] + Select(joined[block], arriving * mirrored[block], Lanes3{});
    }
  }

  const RayScene& wall_;
  const BouncePaths<true, kTissue> paths_;
  const BouncePairs pairs_;
};

}  // namespace lumen
