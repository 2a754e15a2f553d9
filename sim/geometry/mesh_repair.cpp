#include "sim/geometry/mesh_repair.h"

#include <CGAL/Exact_predicates_inexact_constructions_kernel.h>
#include <CGAL/Polygon_mesh_processing/border.h>
#include <CGAL/Polygon_mesh_processing/connected_components.h>
#include <CGAL/Polygon_mesh_processing/orient_polygon_soup.h>
#include <CGAL/Polygon_mesh_processing/orientation.h>
#include <CGAL/Polygon_mesh_processing/polygon_soup_to_polygon_mesh.h>
#include <CGAL/Polygon_mesh_processing/repair_polygon_soup.h>
#include <CGAL/Polygon_mesh_processing/self_intersections.h>
#include <CGAL/Polygon_mesh_processing/stitch_borders.h>
#include <CGAL/Polygon_mesh_processing/triangulate_hole.h>
#include <CGAL/Surface_mesh.h>
#include <CGAL/subdivision_method_3.h>

#include <algorithm>
#include <cmath>
#include <map>
#include <utility>

namespace lumen {
namespace {

using Kernel = CGAL::Exact_predicates_inexact_constructions_kernel;
using Point = Kernel::Point_3;
using SurfaceMesh = CGAL::Surface_mesh<Point>;
using FacePairs = std::vector<std::pair<SurfaceMesh::Face_index, SurfaceMesh::Face_index>>;
namespace pmp = CGAL::Polygon_mesh_processing;

Point ToPoint(const Vec3d& v) { return {v.x(), v.y(), v.z()}; }
Vec3d ToVector(const Point& p) { return {p.x(), p.y(), p.z()}; }

// A manifold as CGAL's halfedges. Throws where it isn't one; callers have made it so.
SurfaceMesh ToSurface(const Mesh& mesh) {
  SurfaceMesh surface;
  surface.reserve(mesh.vertices.size(), mesh.faces.size() * 3 / 2, mesh.faces.size());
  for (const Vec3d& v : mesh.vertices) surface.add_vertex(ToPoint(v));
  using Vertex = SurfaceMesh::Vertex_index;
  for (const Vec3i& f : mesh.faces) {
    if (surface.add_face(Vertex(f[0]), Vertex(f[1]), Vertex(f[2])) == SurfaceMesh::null_face())
      throw std::logic_error("mesh repair: not a manifold");
  }
  return surface;
}

Mesh FromSurface(SurfaceMesh surface) {
  surface.collect_garbage();
  Mesh mesh;
  for (const auto v : surface.vertices()) mesh.vertices.push_back(ToVector(surface.point(v)));
  for (const auto f : surface.faces()) {
    Vec3i face;
    int i = 0;
    for (const auto v : surface.vertices_around_face(surface.halfedge(f))) face[i++] = static_cast<int>(v);
    mesh.faces.push_back(face);
  }
  return mesh;
}

// What CGAL calls a polygon soup.
void AsSoup(const Mesh& mesh, std::vector<Point>* points, std::vector<std::vector<size_t>>* polygons) {
  for (const Vec3d& v : mesh.vertices) points->push_back(ToPoint(v));
  for (const Vec3i& f : mesh.faces)
    polygons->push_back({static_cast<size_t>(f[0]), static_cast<size_t>(f[1]), static_cast<size_t>(f[2])});
}

std::string Count(size_t count, const std::string& singular, const std::string& plural) {
  return std::to_string(count) + " " + (count == 1 ? singular : plural);
}

void KeepLargest(SurfaceMesh* surface, RepairLog* log) {
  const size_t before = surface->number_of_faces();
  const size_t dropped = pmp::keep_largest_connected_components(*surface, 1);
  if (dropped > 0 && log)
    log->push_back("left out " + Count(dropped, "smaller piece", "smaller pieces") + " of " +
                   Count(before - surface->number_of_faces(), "face", "faces") + " in all");
}

// What lies behind a plane (normal·x < offset), faces that it crosses cut in two. Where two faces share an
// edge, both get bitwise the same corner on it, so that welding joins them again.
Mesh BehindPlane(const Mesh& mesh, const Vec3d& normal, double offset) {
  Mesh behind = {mesh.vertices, {}, {}};
  const auto height = [&](int v) { return normal.dot(mesh.vertices[v]) - offset; };
  const auto crossing = [&](int a, int b) {
    if (a > b) std::swap(a, b);
    const double t = height(a) / (height(a) - height(b));
    behind.vertices.push_back(mesh.vertices[a] + t * (mesh.vertices[b] - mesh.vertices[a]));
    return static_cast<int>(behind.vertices.size()) - 1;
  };
  for (const Vec3i& face : mesh.faces) {
    std::vector<int> corners;
    for (int i = 0; i < 3; ++i) {
      const int a = face[i], b = face[(i + 1) % 3];
      if (height(a) < 0) corners.push_back(a);
      if ((height(a) < 0) != (height(b) < 0)) corners.push_back(crossing(a, b));
    }
    for (size_t i = 2; i < corners.size(); ++i)
      behind.faces.emplace_back(corners[0], corners[i - 1], corners[i]);
  }
  return behind;
}

}  // namespace

Mesh Weld(const Mesh& soup, RepairLog* log) {
  std::vector<Point> points;
  std::vector<std::vector<size_t>> polygons;
  AsSoup(soup, &points, &polygons);
  const size_t points_before = points.size(), faces_before = polygons.size();
  pmp::repair_polygon_soup(points, polygons);
  // A face whose corners lie exactly on one line has no normal.
  std::erase_if(polygons,
                [&](const auto& f) { return CGAL::collinear(points[f[0]], points[f[1]], points[f[2]]); });
  if (points.size() < points_before)
    log->push_back("welded or left out " + Count(points_before - points.size(), "vertex", "vertices"));
  if (polygons.size() < faces_before)
    log->push_back("left out " + Count(faces_before - polygons.size(), "degenerate or doubled face",
                                       "degenerate or doubled faces"));
  Mesh welded;
  for (const Point& p : points) welded.vertices.push_back(ToVector(p));
  for (const auto& f : polygons)
    welded.faces.emplace_back(static_cast<int>(f[0]), static_cast<int>(f[1]), static_cast<int>(f[2]));
  return welded;
}

bool OneSided(const Mesh& welded) {
  std::map<std::pair<int, int>, std::vector<int>> faces_of;
  for (size_t f = 0; f < welded.faces.size(); ++f) {
    for (int i = 0; i < 3; ++i)
      faces_of[std::minmax(welded.faces[f][i], welded.faces[f][(i + 1) % 3])].push_back(static_cast<int>(f));
  }
  const auto runs = [&](int face, int a, int b) {
    const Vec3i& f = welded.faces[face];
    return (f[0] == a && f[1] == b) || (f[1] == a && f[2] == b) || (f[2] == a && f[0] == b);
  };
  // Spreads an orientation, +1 or −1 of that which the file gives, from face to face.
  std::vector<int> sign(welded.faces.size(), 0);
  for (size_t seed = 0; seed < sign.size(); ++seed) {
    if (sign[seed] != 0) continue;
    sign[seed] = 1;
    std::vector<int> open = {static_cast<int>(seed)};
    while (!open.empty()) {
      const int face = open.back();
      open.pop_back();
      for (int i = 0; i < 3; ++i) {
        const int a = welded.faces[face][i], b = welded.faces[face][(i + 1) % 3];
        const std::vector<int>& both = faces_of[std::minmax(a, b)];
        if (both.size() != 2) continue;  // a border, or an edge of several sheets, which will be taken apart
        const int other = both[0] == face ? both[1] : both[0];
        const int expected = runs(other, b, a) ? sign[face] : -sign[face];
        if (sign[other] == -expected) return true;
        if (sign[other] == 0) open.push_back(other);
        sign[other] = expected;
      }
    }
  }
  return false;
}

Mesh MakeManifold(const Mesh& soup, RepairLog* log) {
  const Mesh welded_soup = Weld(soup, log);
  std::vector<Point> points;
  std::vector<std::vector<size_t>> polygons;
  AsSoup(welded_soup, &points, &polygons);
  if (polygons.empty()) return {};
  const size_t welded = points.size();
  pmp::orient_polygon_soup(points, polygons);
  if (points.size() > welded)
    log->push_back("took apart " + Count(points.size() - welded, "place", "places") +
                   " where more than one sheet meets");
  SurfaceMesh surface;
  pmp::polygon_soup_to_polygon_mesh(points, polygons, surface);
  const size_t stitched = pmp::stitch_borders(surface);
  if (stitched > 0) log->push_back("stitched " + Count(stitched, "edge", "edges"));
  KeepLargest(&surface, log);
  return FromSurface(std::move(surface));
}

Mesh FillHoles(const Mesh& mesh, RepairLog* log) {
  SurfaceMesh surface = ToSurface(mesh);
  std::vector<SurfaceMesh::Halfedge_index> borders;
  pmp::extract_boundary_cycles(surface, std::back_inserter(borders));
  size_t edges = 0;
  for (const auto border : borders) {
    for ([[maybe_unused]] const auto h : CGAL::halfedges_around_face(border, surface)) ++edges;
    std::vector<SurfaceMesh::Face_index> faces;
    std::vector<SurfaceMesh::Vertex_index> vertices;
    pmp::triangulate_refine_and_fair_hole(surface, border, std::back_inserter(faces),
                                          std::back_inserter(vertices));
  }
  if (!borders.empty())
    log->push_back("filled " + Count(borders.size(), "hole", "holes") + " of " +
                   Count(edges, "edge", "edges") + " in all");
  if (CGAL::is_closed(surface) && !pmp::is_outward_oriented(surface)) pmp::reverse_face_orientations(surface);
  return FromSurface(std::move(surface));
}

Mesh CutTube(const Mesh& mesh, const Centreline& centreline, double from_mm, double to_mm) {
  constexpr double kMargin_mm = 10;
  const ArcFinder arc_of(centreline);
  Mesh part = {mesh.vertices, {}, {}};
  for (const Vec3i& f : mesh.faces) {
    const double arc = arc_of((mesh.vertices[f[0]] + mesh.vertices[f[1]] + mesh.vertices[f[2]]) / 3);
    if (arc > from_mm - kMargin_mm && arc < to_mm + kMargin_mm) part.faces.push_back(f);
  }
  const CentrelineFrame from = centreline.At(from_mm), to = centreline.At(to_mm);
  part = BehindPlane(part, -from.tangent, -from.tangent.dot(from.point));
  part = BehindPlane(part, to.tangent, to.tangent.dot(to.point));
  RepairLog ignored;  // welding what was cut apart and dropping the margins' rest is no repair
  return MakeManifold(part, &ignored);
}

Mesh SmoothMesh(const Mesh& mesh, int iterations) {
  std::vector<std::vector<int>> neighbours(mesh.vertices.size());
  for (const Vec3i& f : mesh.faces) {
    for (int i = 0; i < 3; ++i)
      neighbours[f[i]].push_back(f[(i + 1) % 3]);  // closed: each edge once from each end
  }
  Mesh smooth = mesh;
  // Taubin's pair: a step towards the neighbours' mean, a slightly larger one back; keeps wave-lengths beyond
  // that of 1/0.5 − 1/0.53 = 0.11.
  for (int step = 0; step < 2 * iterations; ++step) {
    const double factor = step % 2 == 0 ? 0.5 : -0.53;
    std::vector<Vec3d> moved = smooth.vertices;
    for (size_t v = 0; v < neighbours.size(); ++v) {
      if (neighbours[v].empty()) continue;
      Vec3d mean = Vec3d::Zero();
      for (const int n : neighbours[v]) mean += smooth.vertices[n];
      moved[v] += factor * (mean / static_cast<double>(neighbours[v].size()) - smooth.vertices[v]);
    }
    smooth.vertices = std::move(moved);
  }
  return smooth;
}

Mesh SubdivideMesh(const Mesh& mesh, double edge_mm) {
  SurfaceMesh surface = ToSurface(mesh);
  const auto mean_edge = [&] {
    double sum = 0;
    for (const auto h : surface.halfedges())
      sum +=
          (ToVector(surface.point(target(h, surface))) - ToVector(surface.point(source(h, surface)))).norm();
    return sum / surface.number_of_halfedges();
  };
  while (mean_edge() > edge_mm)
    CGAL::Subdivision_method_3::Loop_subdivision(surface, CGAL::parameters::number_of_iterations(1));
  return FromSurface(std::move(surface));
}

Mesh RemoveSelfIntersections(const Mesh& mesh, RepairLog* log) {
  constexpr int kAttempts = 6;  // each cuts one more ring of faces out than the one before
  Mesh repaired = mesh;
  for (int attempt = 0; attempt < kAttempts; ++attempt) {
    const SurfaceMesh surface = ToSurface(repaired);
    FacePairs pairs;
    pmp::self_intersections(surface, std::back_inserter(pairs));
    if (pairs.empty()) break;
    log->push_back("cut out and filled places where " + Count(pairs.size(), "pair", "pairs") +
                   " of faces went through each other");
    std::vector<bool> bad_face(repaired.faces.size(), false), bad_vertex(repaired.vertices.size(), false);
    for (const auto& [a, b] : pairs) bad_face[a] = bad_face[b] = true;
    for (int ring = 0; ring <= attempt; ++ring) {
      for (size_t f = 0; f < bad_face.size(); ++f) {
        for (const int corner : repaired.faces[f]) bad_vertex[corner] = bad_vertex[corner] || bad_face[f];
      }
      for (size_t f = 0; f < bad_face.size(); ++f) {
        for (const int corner : repaired.faces[f]) bad_face[f] = bad_face[f] || bad_vertex[corner];
      }
    }
    Mesh rest = {repaired.vertices, {}, {}};
    for (size_t f = 0; f < bad_face.size(); ++f) {
      if (!bad_face[f]) rest.faces.push_back(repaired.faces[f]);
    }
    if (rest.faces.empty()) break;
    RepairLog ignored;
    repaired = FillHoles(MakeManifold(rest, &ignored), &ignored);
  }
  return repaired;
}

std::optional<std::string> Problem(const Mesh& mesh) {
  if (mesh.faces.empty()) return "no face has an area";
  const SurfaceMesh surface = ToSurface(mesh);
  if (!CGAL::is_closed(surface)) {
    std::vector<SurfaceMesh::Halfedge_index> borders;
    pmp::extract_boundary_cycles(surface, std::back_inserter(borders));
    return "it has " + Count(borders.size(), "hole", "holes");
  }
  FacePairs pairs;
  pmp::self_intersections(surface, std::back_inserter(pairs));
  if (!pairs.empty()) {
    const Vec3d place = ToVector(surface.point(target(surface.halfedge(pairs.front().first), surface)));
    return Count(pairs.size(), "pair of faces goes", "pairs of faces go") +
           " through each other, the first near (" + std::to_string(place.x()) + ", " +
           std::to_string(place.y()) + ", " + std::to_string(place.z()) + ") mm";
  }
  if (!pmp::is_outward_oriented(surface)) return "it bounds no volume";
  return std::nullopt;
}

}  // namespace lumen
