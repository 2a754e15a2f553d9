// A function of direction, as values on an octahedral grid (Engelhardt and Dachsbacher 2008, "Octahedron
// environment maps"): the sphere's directions folded onto a square. The middle of the square is +z, its rim
// −z. Cells' solid angles differ by up to 3√3, largest in the middles of the octahedron's faces.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>

#include "common/math.h"

namespace lumen {

template <class T>
class DirectionMap {
 public:
  static constexpr int kEdge = 32, kCells = kEdge * kEdge;

  // Unit direction of the middle of a cell.
  static Vec3<T> Direction(int cell) {
    return Unfold((T(cell % kEdge) + T(0.5)) / kEdge, (T(cell / kEdge) + T(0.5)) / kEdge);
  }

  // Solid angle of a cell, sr, by the midpoint rule, scaled so that all add up to 4π.
  static T SolidAngle(int cell) { return Weights()[static_cast<size_t>(cell)]; }

  std::array<Vec3<T>, kCells> values;

  // In between the cells' middles linear. direction: of any length but 0.
  Vec3<T> At(const Vec3<T>& direction) const {
    const auto [u, v] = Fold(direction);
    // Beyond the outermost middles, straight behind, the map is held constant.
    const T x = std::clamp(u * kEdge - T(0.5), T(0), T(kEdge - 1));
    const T y = std::clamp(v * kEdge - T(0.5), T(0), T(kEdge - 1));
    const int i = std::min(static_cast<int>(x), kEdge - 2), j = std::min(static_cast<int>(y), kEdge - 2);
    const T a = x - T(i), b = y - T(j);
    const Vec3<T>* row = &values[static_cast<size_t>(j * kEdge + i)];
    return (1 - b) * ((1 - a) * row[0] + a * row[1]) + b * ((1 - a) * row[kEdge] + a * row[kEdge + 1]);
  }

 private:
  static std::array<T, 2> Fold(const Vec3<T>& d) {
    const T scale = 1 / (std::abs(d[0]) + std::abs(d[1]) + std::abs(d[2]));
    T x = d[0] * scale, y = d[1] * scale;
    if (d[2] < 0) {
      const T kept = x;
      x = std::copysign(1 - std::abs(y), x);
      y = std::copysign(1 - std::abs(kept), y);
    }
    return {(x + 1) / 2, (y + 1) / 2};
  }
  static Vec3<T> Unfold(T u, T v) {
    T x = 2 * u - 1, y = 2 * v - 1;
    const T z = 1 - std::abs(x) - std::abs(y);
    if (z < 0) {
      const T kept = x;
      x = std::copysign(1 - std::abs(y), x);
      y = std::copysign(1 - std::abs(kept), y);
    }
    return Vec3<T>(x, y, z).normalized();
  }
  // dω of a cell is its area on the octahedron, seen from the middle: that is proportional to 1/r³, r the
  // distance of the octahedron's surface there.
  static const std::array<T, kCells>& Weights() {
    static const std::array<T, kCells> weights = [] {
      std::array<T, kCells> result;
      T sum = 0;
      for (int cell = 0; cell < kCells; ++cell) {
        const Vec3<T> d = Direction(cell);
        const T inverse = d.cwiseAbs().sum();  // 1/r
        sum += result[static_cast<size_t>(cell)] = inverse * inverse * inverse;
      }
      for (T& weight : result) weight *= static_cast<T>(4 * kPi) / sum;
      return result;
    }();
    return weights;
  }
};

}  // namespace lumen
