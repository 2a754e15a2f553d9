#include "sim/geometry/refine.h"

#include <algorithm>
#include <unordered_map>
#include <unordered_set>

#include "common/parallel.h"

namespace lumen {
namespace {

struct Edge {
  int a, b;
  bool split = false;
  Vec3d middle_of_domain = Vec3d::Zero(), middle = Vec3d::Zero();
  int vertex = -1;  // of the middle, where it is split
};

uint64_t Key(int a, int b) {
  return static_cast<uint64_t>(std::min(a, b)) << 32 | static_cast<uint64_t>(std::max(a, b));
}

class Refiner {
 public:
  Refiner(const Mesh& domain, const ParametricSurface& surface, double tolerance_mm)
      : surface_(surface), tolerance_mm_(tolerance_mm), domain_(domain.vertices) {
    mesh_.faces = domain.faces;
    mesh_.vertices.resize(domain_.size());
    ParallelChunks(0, domain_.size(), 256, [&](int64_t first, int64_t last) {
      for (int64_t i = first; i < last; ++i) mesh_.vertices[i] = surface_.at(domain_[i]);
    });
  }

  Mesh Run() {
    do {
      CollectEdges();
    } while (MarkEdges() && Split());
    return std::move(mesh_);
  }

 private:
  // Edge e of a face joins its corners e and e + 1.
  void CollectEdges() {
    edges_.clear();
    edges_of_.resize(mesh_.faces.size());
    std::unordered_map<uint64_t, int> index;
    index.reserve(mesh_.faces.size() * 2);
    for (size_t f = 0; f < mesh_.faces.size(); ++f) {
      for (int e = 0; e < 3; ++e) {
        const int a = mesh_.faces[f][e], b = mesh_.faces[f][(e + 1) % 3];
        const auto [entry, is_new] = index.try_emplace(Key(a, b), static_cast<int>(edges_.size()));
        if (is_new) edges_.push_back({.a = a, .b = b});
        edges_of_[f][e] = entry->second;
      }
    }
  }

  double LengthSquared(const Edge& edge) const {
    return (mesh_.vertices[edge.a] - mesh_.vertices[edge.b]).squaredNorm();
  }

  // The longest edge of a face. Equal ones are told apart by their index, so that both sides agree.
  int Longest(size_t face) const {
    int longest = edges_of_[face][0];
    for (int edge : edges_of_[face]) {
      const double length = LengthSquared(edges_[edge]), record = LengthSquared(edges_[longest]);
      if (length > record || (length == record && edge < longest)) longest = edge;
    }
    return longest;
  }

  void FindMiddle(Edge* edge) const {
    edge->middle_of_domain = surface_.onto_domain(0.5 * (domain_[edge->a] + domain_[edge->b]));
    edge->middle = surface_.at(edge->middle_of_domain);
  }

  // Marks the edges to be split; false when there are none.
  bool MarkEdges() {
    // The error inside a triangle of a quadratic surface is at most 4/3 of that at its edges' middles; half
    // the tolerance leaves room for what isn't quadratic.
    const double bound = 0.5 * tolerance_mm_;
    ParallelChunks(0, edges_.size(), 256, [&](int64_t first, int64_t last) {
      for (int64_t i = first; i < last; ++i) {
        Edge& edge = edges_[i];
        if (fine_.count(Key(edge.a, edge.b))) continue;
        FindMiddle(&edge);
        const Vec3d along = (mesh_.vertices[edge.b] - mesh_.vertices[edge.a]).normalized();
        const Vec3d off = edge.middle - mesh_.vertices[edge.a];
        edge.split = (off - along * along.dot(off)).norm() > bound;
      }
    });
    bool any = false;
    for (const Edge& edge : edges_) {
      any |= edge.split;
      if (!edge.split) fine_.insert(Key(edge.a, edge.b));
    }
    if (any) SpreadToLongest();
    return any;
  }

  void SpreadToLongest() {
    for (bool changed = true; changed;) {
      changed = false;
      for (size_t f = 0; f < mesh_.faces.size(); ++f) {
        bool any = false;
        for (int edge : edges_of_[f]) any |= edges_[edge].split;
        if (!any) continue;
        Edge& longest = edges_[Longest(f)];
        if (longest.split) continue;
        FindMiddle(&longest);
        longest.split = changed = true;
      }
    }
  }

  bool Split() {
    for (Edge& edge : edges_) {
      if (!edge.split) continue;
      edge.vertex = static_cast<int>(mesh_.vertices.size());
      mesh_.vertices.push_back(edge.middle);
      domain_.push_back(edge.middle_of_domain);
    }
    std::vector<Vec3i> faces;
    faces.reserve(mesh_.faces.size() * 2);
    for (size_t f = 0; f < mesh_.faces.size(); ++f) SplitFace(f, &faces);
    mesh_.faces = std::move(faces);
    return true;
  }

  void SplitFace(size_t f, std::vector<Vec3i>* faces) const {
    const Vec3i& face = mesh_.faces[f];
    const int longest = Longest(f);
    if (!edges_[longest].split) {
      faces->push_back(face);
      return;
    }
    int first = 0;
    while (edges_of_[f][first] != longest) ++first;
    const int a = face[first], b = face[(first + 1) % 3], c = face[(first + 2) % 3];
    const int ab = edges_[longest].vertex;
    const int bc = edges_[edges_of_[f][(first + 1) % 3]].vertex,
              ca = edges_[edges_of_[f][(first + 2) % 3]].vertex;
    if (bc >= 0) {
      faces->push_back({ab, b, bc});
      faces->push_back({ab, bc, c});
    } else {
      faces->push_back({ab, b, c});
    }
    if (ca >= 0) {
      faces->push_back({ab, c, ca});
      faces->push_back({ab, ca, a});
    } else {
      faces->push_back({ab, c, a});
    }
  }

  const ParametricSurface& surface_;
  double tolerance_mm_;
  std::vector<Vec3d> domain_;  // of each vertex
  Mesh mesh_;
  std::vector<Edge> edges_;
  std::vector<Vec3i> edges_of_;        // of each face
  std::unordered_set<uint64_t> fine_;  // edges known to be near enough to the surface
};

}  // namespace

Mesh Refine(const Mesh& domain, const ParametricSurface& surface, double tolerance_mm) {
  return Refiner(domain, surface, tolerance_mm).Run();
}

}  // namespace lumen
