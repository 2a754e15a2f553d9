#include "sim/geometry/tube_middle.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <map>
#include <queue>
#include <set>
#include <utility>

#include "sim/geometry/centreline.h"

namespace lumen {
namespace {

constexpr double kSlice_mm = 5;

// Length of the shortest way along the mesh's edges to each vertex from the nearest of the given ones;
// infinity where there is none.
std::vector<double> DistanceAlongEdges(const Mesh& mesh, const std::vector<int>& from) {
  std::vector<std::vector<int>> neighbours(mesh.vertices.size());
  for (const Vec3i& f : mesh.faces) {
    for (int i = 0; i < 3; ++i) {
      neighbours[f[i]].push_back(f[(i + 1) % 3]);
      neighbours[f[(i + 1) % 3]].push_back(f[i]);
    }
  }
  std::vector<double> distance(mesh.vertices.size(), std::numeric_limits<double>::infinity());
  using Entry = std::pair<double, int>;
  std::priority_queue<Entry, std::vector<Entry>, std::greater<>> queue;
  for (const int v : from) {
    distance[v] = 0;
    queue.push({0, v});
  }
  while (!queue.empty()) {
    const auto [length, v] = queue.top();
    queue.pop();
    if (length > distance[v]) continue;
    for (const int n : neighbours[v]) {
      const double next = length + (mesh.vertices[n] - mesh.vertices[v]).norm();
      if (next >= distance[n]) continue;
      distance[n] = next;
      queue.push({next, n});
    }
  }
  return distance;
}

Vec3d FaceCentre(const Mesh& mesh, const Vec3i& face) {
  return (mesh.vertices[face[0]] + mesh.vertices[face[1]] + mesh.vertices[face[2]]) / 3;
}

// Centroids of the faces by slice, weighted by area so that the mesh's density doesn't count. Slices with
// less than half of the median slice's area are left out: an end's, which aren't whole.
std::vector<Vec3d> SliceCentroids(const Mesh& mesh, const std::vector<double>& along_mm) {
  const double longest = *std::max_element(along_mm.begin(), along_mm.end());
  const size_t slices = static_cast<size_t>(longest / kSlice_mm) + 1;
  std::vector<Vec3d> sum(slices, Vec3d::Zero());
  std::vector<double> area(slices, 0);
  for (size_t f = 0; f < mesh.faces.size(); ++f) {
    const size_t slice = static_cast<size_t>(along_mm[f] / kSlice_mm);
    const double face_area = FaceArea(mesh, static_cast<int>(f));
    area[slice] += face_area;
    sum[slice] += face_area * FaceCentre(mesh, mesh.faces[f]);
  }
  std::vector<double> sorted = area;
  std::nth_element(sorted.begin(), sorted.begin() + slices / 2, sorted.end());
  std::vector<Vec3d> points;
  for (size_t i = 0; i < slices; ++i) {
    if (area[i] > sorted[slices / 2] / 2) points.push_back(sum[i] / area[i]);
  }
  return points;
}

int Farthest(const std::vector<double>& distance) {
  int vertex = 0;
  double record = -1;
  for (size_t v = 0; v < distance.size(); ++v) {
    if (std::isfinite(distance[v]) && distance[v] > record) {
      record = distance[v];
      vertex = static_cast<int>(v);
    }
  }
  return vertex;
}

// The whole rim that a vertex lies on; a vertex that lies on none, alone.
std::vector<int> RimOf(const Mesh& mesh, int vertex) {
  std::set<std::pair<int, int>> directed;
  for (const Vec3i& f : mesh.faces) {
    for (int i = 0; i < 3; ++i) directed.insert({f[i], f[(i + 1) % 3]});
  }
  std::map<int, int> next;  // along the rims: the edges that only one face has
  for (const auto& [a, b] : directed) {
    if (!directed.count({b, a})) next[b] = a;
  }
  std::vector<int> rim = {vertex};
  for (auto step = next.find(vertex);
       step != next.end() && step->second != vertex && rim.size() <= next.size();
       step = next.find(rim.back()))
    rim.push_back(step->second);
  return rim;
}

}  // namespace

std::vector<Vec3d> MiddleOfTube(const Mesh& mesh) {
  if (mesh.faces.empty()) return {};
  const int end = Farthest(DistanceAlongEdges(mesh, {mesh.faces[0][0]}));
  // From a whole rim, equal distances are cross-sections; from one place of it they would slant.
  const std::vector<double> distance = DistanceAlongEdges(mesh, RimOf(mesh, end));
  std::vector<double> along;
  for (const Vec3i& f : mesh.faces) along.push_back((distance[f[0]] + distance[f[1]] + distance[f[2]]) / 3);
  const std::vector<Vec3d> points = SliceCentroids(mesh, along);
  return points.size() < 3 ? std::vector<Vec3d>{} : points;
}

std::vector<Vec3d> SmoothedCurve(const std::vector<Vec3d>& points, double sigma_mm) {
  const std::vector<Vec3d> even = Centreline(points).Points(1.0);
  const int count = static_cast<int>(even.size());
  std::vector<Vec3d> smooth(even.size());
  for (int i = 0; i < count; ++i) {
    // A window that fits on both sides keeps the ends in place.
    const int reach = std::min({i, count - 1 - i, static_cast<int>(3 * sigma_mm)});
    Vec3d sum = Vec3d::Zero();
    double weights = 0;
    for (int k = -reach; k <= reach; ++k) {
      const double weight = std::exp(-0.5 * k * k / (sigma_mm * sigma_mm));
      sum += weight * even[i + k];
      weights += weight;
    }
    smooth[i] = sum / weights;
  }
  return smooth;
}

}  // namespace lumen
