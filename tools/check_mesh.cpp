#include <algorithm>
#include <map>
#include <numeric>
#include <set>

#include "tools/findings.h"

namespace lumen {
namespace {

std::string Counted(size_t count, const std::string& singular) {
  return std::to_string(count) + " " + singular + (count == 1 ? "" : "s");
}

// How often an edge is run through from its lower vertex to its higher one, and back.
struct EdgeUse {
  int forward = 0;
  int backward = 0;
};

struct EdgeCounts {
  size_t boundary = 0;
  size_t non_manifold = 0;
  size_t inconsistent = 0;  // two faces run through it the same way
};

bool RepeatsVertex(const Vec3i& face) {
  return face[0] == face[1] || face[1] == face[2] || face[2] == face[0];
}

EdgeCounts CountEdges(const Mesh& mesh) {
  std::map<std::pair<int, int>, EdgeUse> edges;
  for (const Vec3i& face : mesh.faces) {
    if (RepeatsVertex(face)) continue;
    for (int c = 0; c < 3; ++c) {
      const int from = face[c], to = face[(c + 1) % 3];
      EdgeUse& use = edges[std::minmax(from, to)];
      ++(from < to ? use.forward : use.backward);
    }
  }
  EdgeCounts counts;
  for (const auto& [edge, use] : edges) {
    const int faces = use.forward + use.backward;
    counts.boundary += faces == 1;
    counts.non_manifold += faces > 2;
    counts.inconsistent += faces == 2 && use.forward != 1;
  }
  return counts;
}

size_t CountDoubles(const Mesh& mesh) {
  std::set<std::array<int, 3>> seen;
  size_t doubles = 0;
  for (const Vec3i& face : mesh.faces) {
    std::array<int, 3> corners = {face[0], face[1], face[2]};
    std::ranges::sort(corners);
    doubles += !seen.insert(corners).second;
  }
  return doubles;
}

size_t CountRepeatedVertices(const Mesh& mesh) {
  std::vector<std::array<double, 3>> points;
  for (const Vec3d& vertex : mesh.vertices) points.push_back({vertex.x(), vertex.y(), vertex.z()});
  std::ranges::sort(points);
  return points.size() - static_cast<size_t>(std::ranges::unique(points).begin() - points.begin());
}

// Faces that share a vertex belong together; vertices without faces don't count.
size_t CountComponents(const Mesh& mesh) {
  std::vector<int> parent(mesh.vertices.size());
  std::iota(parent.begin(), parent.end(), 0);
  const auto root = [&](int v) {
    while (parent[v] != v) v = parent[v] = parent[parent[v]];
    return v;
  };
  for (const Vec3i& face : mesh.faces) {
    parent[root(face[1])] = root(face[0]);
    parent[root(face[2])] = root(face[0]);
  }
  std::set<int> roots;
  for (const Vec3i& face : mesh.faces) roots.insert(root(face[0]));
  return roots.size();
}

// By the divergence theorem, from the middle of the bounds, where rounding is least. Positive: normals point
// out.
double SignedVolume(const Mesh& mesh) {
  const Vec3d middle = Bounds(mesh).center();
  double volume = 0;
  for (const Vec3i& face : mesh.faces) {
    const Vec3d a = mesh.vertices[face[0]] - middle;
    const Vec3d b = mesh.vertices[face[1]] - middle;
    const Vec3d c = mesh.vertices[face[2]] - middle;
    volume += a.dot(b.cross(c)) / 6;
  }
  return volume;
}

}  // namespace

std::vector<std::string> Findings::errors() const {
  std::vector<std::string> errors;
  for (const Finding& finding : all_) {
    if (finding.severity == Finding::Severity::kError) errors.push_back(finding.text);
  }
  return errors;
}

nlohmann::json CheckMesh(const std::string& name, const Mesh& mesh, Findings* findings) {
  const EdgeCounts edges = CountEdges(mesh);
  size_t degenerate = 0;
  for (size_t i = 0; i < mesh.faces.size(); ++i) {
    degenerate += RepeatsVertex(mesh.faces[i]) || FaceArea(mesh, static_cast<int>(i)) == 0;
  }
  const size_t doubles = CountDoubles(mesh);
  const size_t repeated = CountRepeatedVertices(mesh);
  const size_t components = CountComponents(mesh);
  std::vector<bool> used(mesh.vertices.size());
  for (const Vec3i& face : mesh.faces) {
    for (int corner : face) used[corner] = true;
  }
  const auto unused = static_cast<size_t>(std::ranges::count(used, false));

  const auto error = [&](const std::string& text) { findings->Error(name + ": " + text); };
  const auto warn = [&](const std::string& text) { findings->Warn(name + ": " + text); };
  if (edges.boundary) error("not closed: " + Counted(edges.boundary, "edge") + " with one face only");
  if (edges.non_manifold) error(Counted(edges.non_manifold, "edge") + " with more than two faces");
  if (edges.inconsistent)
    error(Counted(edges.inconsistent, "edge") + " between faces of opposite orientation");
  if (degenerate) error(Counted(degenerate, "face") + " without area");
  if (doubles) error(Counted(doubles, "face") + " with the vertices of another");
  if (repeated) warn(Counted(repeated, "vertex position") + " used twice; merge them");
  if (unused) warn(Counted(unused, "vertex position") + " without a face");
  if (components > 1) warn("falls into " + Counted(components, "component"));
  const bool closed = edges.boundary == 0 && edges.non_manifold == 0;
  const double volume = SignedVolume(mesh);
  if (closed && volume < 0)
    warn("normals point inwards; lumen's own point into the wall, away from the lumen");
  return {{"vertices", mesh.vertices.size()},
          {"faces", mesh.faces.size()},
          {"closed", closed},
          {"boundary_edges", edges.boundary},
          {"components", components},
          {"non_manifold_edges", edges.non_manifold},
          {"volume_mm3", volume},
          {"inconsistent_edges", edges.inconsistent},
          {"degenerate_faces", degenerate},
          {"double_faces", doubles}};
}

}  // namespace lumen
