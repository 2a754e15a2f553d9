// Random numbers by name, directions and triangles: what the tests of ray casting share.
#pragma once

#include <cmath>
#include <cstdint>

#include "common/math.h"
#include "common/mesh.h"
#include "common/random.h"

namespace lumen::test {

inline double Between(double low, double high, uint64_t seed, uint64_t a, uint64_t b = 0) {
  return low + (high - low) * UniformDouble(RandomBits(seed, a, b));
}

// Unit but for rounding, all ways alike; from the numbers (seed, i, first) and the next.
inline Vec3f RandomDirection(uint64_t seed, uint64_t i, uint64_t first) {
  const double z = Between(-1, 1, seed, i, first), turn = Between(0, 2 * kPi, seed, i, first + 1);
  const double across = std::sqrt(1 - z * z);
  return Vec3d(across * std::cos(turn), across * std::sin(turn), z).cast<float>();
}

// Triangles whose middles lie within ±30 mm and their corners within ±reach_mm of these.
inline Mesh TriangleSoup(int faces, double reach_mm) {
  Mesh mesh;
  for (int face = 0; face < faces; ++face) {
    Vec3d middle;
    for (int i = 0; i < 3; ++i) middle[i] = Between(-30, 30, 1, face, i);
    for (int corner = 0; corner < 3; ++corner) {
      Vec3d vertex;
      for (int i = 0; i < 3; ++i) {
        vertex[i] = middle[i] + Between(-reach_mm, reach_mm, 2, face, 3 * corner + i);
      }
      mesh.vertices.push_back(vertex);
    }
    mesh.faces.push_back({3 * face, 3 * face + 1, 3 * face + 2});
  }
  return mesh;
}

}  // namespace lumen::test
