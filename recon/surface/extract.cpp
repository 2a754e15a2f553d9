#include "recon/surface/extract.h"

#include <array>
#include <cmath>
#include <set>
#include <unordered_map>

#include "common/error.h"
#include "common/parallel.h"
#include "recon/surface/wall_around.h"

namespace lumen {
namespace {

constexpr int kBlock = 8;            // cells along a block's edge
constexpr int kPoints = kBlock + 1;  // lattice points along it

// The signed distance may be steeper than 1 where the eikonal term hasn't reached; the search that follows
// the surface from block to block finds what a first look with this allowance misses.
constexpr double kSteepest = 2;

// A vertex keeps this part of an edge's length away from the edge's ends: no triangle collapses, and it moves
// by no more than that.
constexpr double kEndMargin = 0.01;

using Index3 = std::array<int, 3>;

class Extractor {
 public:
  Extractor(const Field<float>& field, const float* parameters, const ExtractOptions& options)
      : field_(field), parameters_(parameters), continuation_(options.continuation), cell_(options.cell_mm) {
    for (int d = 0; d < 3; ++d) {
      // One cell of margin, where the field is negative for certain.
      low_[d] = field.box().min()[d] - cell_;
      blocks_[d] = static_cast<int>(std::ceil((field.box().sizes()[d] + 2 * cell_) / (cell_ * kBlock)));
    }
  }

  Mesh Run() {
    std::set<Index3> done;
    std::vector<Index3> wave = BlocksNearSurface();
    while (!wave.empty()) {
      std::vector<std::vector<float>> values(wave.size());
      ParallelFor(0, static_cast<int64_t>(wave.size()), [&](int64_t i) { values[i] = BlockValues(wave[i]); });
      std::set<Index3> next;
      for (size_t i = 0; i < wave.size(); ++i) {
        done.insert(wave[i]);
        MeshBlock(wave[i], values[i]);
        for (const Index3& neighbour : CrossedNeighbours(wave[i], values[i])) next.insert(neighbour);
      }
      wave.clear();
      for (const Index3& block : next)
        if (!done.count(block)) wave.push_back(block);
    }
    return std::move(mesh_);
  }

 private:
  std::vector<float> Values(const std::vector<Vec3d>& points) const {
    std::vector<float> values = FieldValues(points);
    if (continuation_) ContinueValues(points, &values);
    return values;
  }

  void ContinueValues(const std::vector<Vec3d>& points, std::vector<float>* values) const {
    for (size_t i = 0; i < points.size(); ++i) {
      // As the field itself, negative from its bounds on.
      const double bound =
          std::min((field_.box().max() - points[i]).minCoeff(), (points[i] - field_.box().min()).minCoeff());
      const double value = continuation_->Blend(points[i], (*values)[i]);
      (*values)[i] = static_cast<float>(std::min(value, bound));
    }
  }

  std::vector<float> FieldValues(const std::vector<Vec3d>& points) const {
    const int count = static_cast<int>(points.size());
    Field<float>::ValuePass pass;
    pass.positions.Resize(3, TilesFor(count));
    for (int i = 0; i < TilesFor(count) * kTile; ++i) {
      const Vec3d& point = points[std::min(i, count - 1)];
      for (int d = 0; d < 3; ++d) pass.positions.At(d, i) = static_cast<float>(point[d]);
    }
    field_.Value(parameters_, &pass);
    std::vector<float> values(count);
    for (int i = 0; i < count; ++i) {
      values[i] = pass.value.At(0, i);
      if (!std::isfinite(values[i]))
        throw InputError("the trained field is not finite: no mesh can be made of it");
    }
    return values;
  }

  Vec3d PointAt(const Index3& lattice) const {
    return Vec3d(low_[0] + cell_ * lattice[0], low_[1] + cell_ * lattice[1], low_[2] + cell_ * lattice[2]);
  }

  std::vector<Index3> BlocksNearSurface() const {
    const double reach = kSteepest * cell_ * kBlock * std::sqrt(3.0) / 2;
    std::vector<std::vector<Index3>> near(blocks_[2]);
    ParallelFor(0, blocks_[2], [&](int64_t z) {
      std::vector<Index3> blocks;
      std::vector<Vec3d> centers;
      for (int y = 0; y < blocks_[1]; ++y) {
        for (int x = 0; x < blocks_[0]; ++x) {
          blocks.push_back({x, y, static_cast<int>(z)});
          centers.push_back(PointAt({x * kBlock, y * kBlock, static_cast<int>(z) * kBlock}) +
                            Vec3d::Constant(cell_ * kBlock / 2));
        }
      }
      const std::vector<float> values = Values(centers);
      for (size_t i = 0; i < blocks.size(); ++i)
        if (std::abs(values[i]) < reach) near[z].push_back(blocks[i]);
    });
    std::vector<Index3> all;
    for (const auto& slice : near) all.insert(all.end(), slice.begin(), slice.end());
    return all;
  }

  static int At(int x, int y, int z) { return x + kPoints * (y + kPoints * z); }

  std::vector<float> BlockValues(const Index3& block) const {
    std::vector<Vec3d> points;
    points.reserve(kPoints * kPoints * kPoints);
    for (int z = 0; z < kPoints; ++z)
      for (int y = 0; y < kPoints; ++y)
        for (int x = 0; x < kPoints; ++x)
          points.push_back(PointAt({block[0] * kBlock + x, block[1] * kBlock + y, block[2] * kBlock + z}));
    return Values(points);
  }

  // Blocks that share a side on which the sign changes.
  std::vector<Index3> CrossedNeighbours(const Index3& block, const std::vector<float>& values) const {
    std::vector<Index3> result;
    for (int d = 0; d < 3; ++d) {
      for (int side = 0; side < 2; ++side) {
        Index3 neighbour = block;
        neighbour[d] += side ? 1 : -1;
        if (neighbour[d] < 0 || neighbour[d] >= blocks_[d]) continue;
        bool positive = false, negative = false;
        for (int a = 0; a < kPoints; ++a) {
          for (int b = 0; b < kPoints; ++b) {
            Index3 at;
            at[d] = side ? kBlock : 0;
            at[(d + 1) % 3] = a;
            at[(d + 2) % 3] = b;
            (values[At(at[0], at[1], at[2])] > 0 ? positive : negative) = true;
          }
        }
        if (positive && negative) result.push_back(neighbour);
      }
    }
    return result;
  }

  // The vertex on the edge between two lattice points, one inside and one outside.
  int VertexOn(const Index3& inside, float inside_value, const Index3& outside, float outside_value) {
    const Index3& lower = std::min(inside, outside);
    const Index3& upper = std::max(inside, outside);
    uint64_t key = 0;
    for (int d = 0; d < 3; ++d) key = key << 20 | static_cast<uint64_t>(lower[d]);
    // Corners of a tetrahedron differ by 0 or 1 along each axis and, ordered, never by −1.
    for (int d = 0; d < 3; ++d) key = key << 1 | static_cast<uint64_t>(upper[d] - lower[d]);
    const auto [entry, is_new] = vertices_.try_emplace(key, static_cast<int>(mesh_.vertices.size()));
    if (is_new) {
      const double t = std::clamp(double(inside_value) / (double(inside_value) - double(outside_value)),
                                  kEndMargin, 1 - kEndMargin);
      mesh_.vertices.push_back((1 - t) * PointAt(inside) + t * PointAt(outside));
    }
    return entry->second;
  }

  void MeshBlock(const Index3& block, const std::vector<float>& values) {
    for (int z = 0; z < kBlock; ++z) {
      for (int y = 0; y < kBlock; ++y) {
        for (int x = 0; x < kBlock; ++x) {
          int inside = 0;
          for (int c = 0; c < 8; ++c) inside += values[At(x + (c & 1), y + ((c >> 1) & 1), z + (c >> 2))] > 0;
          if (inside != 0 && inside != 8) MeshCube(block, {x, y, z}, values);
        }
      }
    }
  }

  // Kuhn's six tetrahedra: from corner 000 to 111 along the axes in each order. Odd orders are mirror images.
  void MeshCube(const Index3& block, const Index3& cell, const std::vector<float>& values) {
    static constexpr int kOrders[6][3] = {{0, 1, 2}, {1, 2, 0}, {2, 0, 1}, {0, 2, 1}, {2, 1, 0}, {1, 0, 2}};
    for (int order = 0; order < 6; ++order) {
      Index3 local = cell;
      std::array<Index3, 4> corner;
      std::array<float, 4> value;
      for (int k = 0; k < 4; ++k) {
        if (k > 0) ++local[kOrders[order][k - 1]];
        value[k] = values[At(local[0], local[1], local[2])];
        for (int d = 0; d < 3; ++d) corner[k][d] = block[d] * kBlock + local[d];
      }
      if (order >= 3) {
        std::swap(corner[2], corner[3]);
        std::swap(value[2], value[3]);
      }
      MeshTetrahedron(corner, value);
    }
  }

  // corner: positively oriented, (c1 − c0) × (c2 − c0) · (c3 − c0) > 0.
  void MeshTetrahedron(const std::array<Index3, 4>& corner, const std::array<float, 4>& value) {
    // Even permutations of the corners, by which one or two to set apart come first.
    static constexpr int kSingle[4][4] = {{0, 1, 2, 3}, {1, 0, 3, 2}, {2, 3, 0, 1}, {3, 2, 1, 0}};
    static constexpr int kPair[6][4] = {{0, 1, 2, 3}, {0, 2, 3, 1}, {0, 3, 1, 2},
                                        {1, 2, 0, 3}, {1, 3, 2, 0}, {2, 3, 0, 1}};
    int mask = 0;
    for (int k = 0; k < 4; ++k) mask |= (value[k] > 0) << k;
    const int count = __builtin_popcount(mask);
    auto vertex = [&](int inside, int outside) {
      return VertexOn(corner[inside], value[inside], corner[outside], value[outside]);
    };
    if (count == 1) {
      const auto& p = kSingle[__builtin_ctz(mask)];
      mesh_.faces.emplace_back(vertex(p[0], p[1]), vertex(p[0], p[2]), vertex(p[0], p[3]));
    } else if (count == 3) {
      const auto& p = kSingle[__builtin_ctz(~mask)];
      mesh_.faces.emplace_back(vertex(p[1], p[0]), vertex(p[3], p[0]), vertex(p[2], p[0]));
    } else if (count == 2) {
      for (const auto& p : kPair) {
        if (mask != (1 << p[0] | 1 << p[1])) continue;
        const int a = vertex(p[0], p[2]), b = vertex(p[0], p[3]), c = vertex(p[1], p[3]),
                  d = vertex(p[1], p[2]);
        mesh_.faces.emplace_back(a, b, c);
        mesh_.faces.emplace_back(a, c, d);
      }
    }
  }

  const Field<float>& field_;
  const float* parameters_;
  const Continuation* continuation_;
  double cell_;
  double low_[3];
  int blocks_[3];
  Mesh mesh_;
  std::unordered_map<uint64_t, int> vertices_;
};

}  // namespace

Mesh ExtractMesh(const Field<float>& field, const float* parameters, const Vec3d& origin,
                 const ExtractOptions& options) {
  Mesh mesh = WallAround(options.inside, Extractor(field, parameters, options).Run());
  for (Vec3d& vertex : mesh.vertices) vertex += origin;
  return mesh;
}

}  // namespace lumen
