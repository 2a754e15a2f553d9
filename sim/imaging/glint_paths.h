// Light from other walls that the coat of what is seen mirrors. Its lobe is too narrow for paths that come to
// it from elsewhere, so they leave in its own directions; it sends on so little that only some of the pixels
// look, and their paths wait for others of the tile until they fill a packet.
#pragma once

#include <algorithm>
#include <cstdint>

#include "sim/imaging/bounce_paths.h"

namespace lumen {

class GlintPaths {
 public:
  // first_pair: of the random numbers of these paths; light: of each of a tile's blocks, to be added to.
  GlintPaths(const BouncePaths<true>& paths, uint32_t first_pair, Lanes3* light)
      : paths_(paths), pairs_(first_pair), light_(light) {}

  // Starts the paths of those of a block's places that look. sampler_of(i): the sampler of lane i.
  template <class SamplerOf>
  void Start(const Eye& eye, int block, const CoatedPlaces& places, const SamplerOf& sampler_of,
             int64_t* rays) {
    const Lanes3 origin = OffsetOrigin(places.point, places.normal);
    for (int i = 0; i < kLanes; ++i) {
      if (!places.alive[i]) continue;
      const Sampler sampler = sampler_of(i);
      const Coat::Glint glint =
          places.coat->SampleGlint(places.lanes()[i], sampler.Pair(pairs_.Direction(1)));
      // Roulette: the light of those that look is equally bright, which is least noise for their number.
      const float survival = std::min(1.0f, kPathsOfWeight * glint.weight);
      if (!(sampler.Pair(pairs_.Roulette(1))[0] < survival)) continue;
      start_.on[count_] = -1;
      start_.origin.Set(count_, origin[i]);
      start_.direction.Set(count_, glint.incoming);
      start_.weight.Set(count_, Vec3f::Constant(glint.weight / survival));
      start_.samplers[count_].emplace(sampler);
      block_[count_] = static_cast<int16_t>(block);
      lane_[count_] = static_cast<int16_t>(i);
      if (++count_ == kLanes) Trace(eye, rays);
    }
  }

  // Adds the light that waiting paths bring; then none waits.
  void Trace(const Eye& eye, int64_t* rays) {
    if (count_ == 0) return;
    FarEnds<true> ends = paths_.End(eye, start_, pairs_, rays);
    paths_.AddRest(eye, start_, pairs_, &ends, rays);
    const Lanes3 light = start_.weight * ends.RadianceTo(start_.direction * Broadcast(-1));
    for (int i = 0; i < count_; ++i) {
      if (!ends.places.alive[i]) continue;
      Lanes3& block = light_[block_[i]];
      block.Set(lane_[i], block[lane_[i]] + light[i]);
    }
    count_ = 0;
    start_.on = LanesI{};
  }

 private:
  // The pixels that look for each that the coat sends on all light of; least time to a given noise, of 1, 3,
  // 6 and 12.
  static constexpr float kPathsOfWeight = 6;

  const BouncePaths<true>& paths_;
  const BouncePairs pairs_;
  BounceStart start_;
  int count_ = 0;
  int16_t block_[kLanes], lane_[kLanes];  // whose the paths are
  Lanes3* light_;
};

}  // namespace lumen
