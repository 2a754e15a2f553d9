// What the places that a tile's pixels see can be seen from, by packets of shadow rays.
#pragma once

#include <cstdint>

#include "common/lanes.h"
#include "common/ray_scene.h"
#include "sim/imaging/offset_origin.h"
#include "sim/imaging/tile.h"

namespace lumen {

class TileShadows {
 public:
  // time: of a wall that moves, whose places the tile has.
  template <bool kCoat>
  TileShadows(const RayScene& wall, float time, const TileSample<kCoat>& tile) : wall_(wall), time_(time) {
    for (int block = 0; block < kBlocks; ++block) {
      origins_[block] = OffsetOrigin(tile.places[block].point, tile.places[block].normal);
    }
  }

  // Where rays to and from a block's places start.
  const Lanes3& origins(int block) const { return origins_[block]; }

  // −1 in those of the asked lanes whose places can't be seen from a point (one for all lanes). Rays are
  // counted.
  LanesI Hidden(const Lanes3& from, int block, const LanesI& asked, int64_t* rays) const {
    RayPacket packet;
    Store3(from, packet.origin);
    Store3(origins_[block] - from, packet.direction);
    Store(Lanes{}, packet.tnear);
    Store(asked ? Broadcast(1) : Broadcast(-1), packet.tfar);
    packet.time = time_;
    *rays += Count(asked);
    return wall_.Occluded(packet);
  }

 private:
  const RayScene& wall_;
  const float time_;
  Lanes3 origins_[kBlocks];
};

}  // namespace lumen
