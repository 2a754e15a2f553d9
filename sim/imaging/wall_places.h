// Places scattered over a wall, and the finding of those that are near.
#pragma once

#include <cstdint>
#include <unordered_map>
#include <vector>

#include "common/math.h"
#include "common/mesh.h"

namespace lumen {

// A place of a wall with its smooth normal.
struct WallPlace {
  Vec3d place_mm, normal;
  uint64_t rank = 0;  // random
};

// Through a fold the wall turns its back.
inline bool FacesAlike(const Vec3d& a, const Vec3d& b) { return a.dot(b) > 0; }

// The part of a direction that goes along the plane across a unit normal.
inline Vec3d Along(const Vec3d& normal, const Vec3d& direction) {
  return direction - normal * normal.dot(direction);
}

// The cube of a lattice that a place lies in, and such a cube as one number: its own within 2^20 of the
// middle.
inline Vec3i CubeOf(const Vec3d& place_mm, double side_mm) {
  return (place_mm / side_mm).array().floor().cast<int>();
}
inline uint64_t KeyOf(const Vec3i& cube) {
  constexpr uint64_t kMask = (1 << 21) - 1;
  return (static_cast<uint64_t>(cube[0]) & kMask) << 42 | (static_cast<uint64_t>(cube[1]) & kMask) << 21 |
         (static_cast<uint64_t>(cube[2]) & kMask);
}

// Items by the cubes that they lie in.
class CubeMap {
 public:
  explicit CubeMap(double reach_mm) : side_mm_(2 * reach_mm) {}

  void Add(const Vec3d& place_mm, int item) { items_[KeyOf(CubeOf(place_mm, side_mm_))].push_back(item); }

  // Calls body with every item within reach of a place, and with some others: those of the eight cubes around
  // the lattice's corner that is nearest to it.
  template <class Body>
  void ForEachNear(const Vec3d& place_mm, const Body& body) const {
    const Vec3i lowest = CubeOf(place_mm - Vec3d::Constant(side_mm_ / 2), side_mm_);
    for (int i = 0; i < 8; ++i) {
      const auto found = items_.find(KeyOf(lowest + Vec3i(i & 1, i >> 1 & 1, i >> 2)));
      if (found == items_.end()) continue;
      for (const int item : found->second) body(item);
    }
  }

 private:
  double side_mm_;
  std::unordered_map<uint64_t, std::vector<int>> items_;
};

// Places of the wall, from the middle of its bounds and by rank, about a pitch apart: one for each cube of
// the pitch's side that the wall goes through, of those looked at the nearest to a random point of the cube,
// so that another mesh of the same wall gives nearly the same places. Functions of wall and seed.
std::vector<WallPlace> SampleWall(const Mesh& wall, double pitch_mm, uint64_t seed);

// The least pitch for which that looks at no more places than memory and time allow.
double LeastPitch(const Mesh& wall);

// The first of the places, and whichever of the later ones are no nearer than a distance to those before, on
// the same side of a fold.
std::vector<WallPlace> Scatter(const std::vector<WallPlace>& places, double distance_mm);

}  // namespace lumen
