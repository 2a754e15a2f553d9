// Sixteen samples of neighbouring pixels, which are traced as one packet.
#pragma once

#include <cstdint>

#include "common/lanes.h"
#include "sim/imaging/sampler.h"
#include "sim/imaging/tile.h"

namespace lumen {

// The samples of a block of pixels in packets: each holds `each` samples (1, 4 or 16) of 16/each of its
// pixels. The closer together a packet's rays are, the less of the wall they have to be held against.
struct PixelSamples {
  LanesI on;          // −1: of a pixel that is rendered
  Lanes x, y;         // of the pixels' centres
  LanesU sample;      // which of the pixel's own
  int pixel[kLanes];  // of the block
  uint64_t key[kLanes];
  SamplerLanes sampler;

  // So many samples of a pixel can be in a packet when that is how many there are of it in all.
  static constexpr int EachOf(int samples) { return samples % 16 == 0 ? 16 : samples % 4 == 0 ? 4 : 1; }

  // The first samples of the group-th pixels, of `each` groups. key_of(x, y): of a pixel's random numbers;
  // sampler_of(keys): of sixteen such keys.
  template <class KeyOf, class SamplerOf>
  PixelSamples(const TilePixels& pixels, int block, int each, int group, const KeyOf& key_of,
               const SamplerOf& sampler_of) {
    for (int i = 0; i < kLanes; ++i) {
      // Four groups are the block's quarters, sixteen its pixels.
      const int quarter_x = group % 2 * 2 + i % 2, quarter_y = group / 2 * 2 + i / 2 % 2;
      pixel[i] = each == 1 ? i : each == 4 ? quarter_y * kBlockEdge + quarter_x : group;
      sample[i] = static_cast<uint32_t>(each == 1 ? 0 : each == 4 ? i / 4 : i);
      on[i] = pixels.on[block][pixel[i]];
      x[i] = pixels.x[block][pixel[i]];
      y[i] = pixels.y[block][pixel[i]];
      key[i] = key_of(pixels.X(block, pixel[i]), pixels.Y(block, pixel[i]));
    }
    sampler = sampler_of(key);
  }
};

}  // namespace lumen
