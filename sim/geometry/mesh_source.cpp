#include "sim/geometry/mesh_source.h"

#include <algorithm>
#include <charconv>
#include <cmath>
#include <optional>
#include <sstream>
#include <string>
#include <utility>

#include "common/error.h"
#include "common/files.h"
#include "common/parallel.h"
#include "common/progress.h"
#include "sim/geometry/centreline.h"
#include "sim/geometry/clearance.h"
#include "sim/geometry/mesh_repair.h"
#include "sim/geometry/tube_middle.h"

namespace lumen {
namespace {

// Of the Gaussian that smooths a centreline: no steps in a camera's direction, no corner of the lumen cut.
constexpr double kSigma_mm = 4;

struct MeshOptions {
  std::filesystem::path path;
  double scale = 1;  // to mm
  bool reverse = false, close = true;
  int smooth_iterations = 0;
  double refine_mm = 0;
  std::optional<std::pair<double, double>> between_mm;
};

MeshOptions ReadOptions(const ConfigTable& table) {
  MeshOptions options;
  options.path = table.Path("path");
  const std::string unit = table.Choice("unit", "mm", {"mm", "m", "um"});
  options.scale = table.Number("scale", 1, kPositive) * (unit == "m" ? 1000 : unit == "um" ? 1e-3 : 1);
  options.reverse = table.Flag("reverse", false);
  options.close = table.Flag("close", true);
  options.smooth_iterations = static_cast<int>(table.Integer("smooth_iterations", 0, Range{0, 1000}));
  options.refine_mm = table.Number("refine_mm", 0, kNotNegative);
  if (table.Has("between")) {
    const std::vector<double> between = table.Numbers("between", 2, kNotNegative);
    if (between[1] - between[0] < 5) table.Fail("between", "needs [from, to] in mm, at least 5 mm apart");
    options.between_mm = {between[0], between[1]};
  }
  return options;
}

// "x y z" a line, mm, from the near to the deep end; '#' starts a comment.
std::vector<Vec3d> ReadCentreline(const std::filesystem::path& file) {
  std::istringstream text(ReadFile(file));
  std::vector<Vec3d> points;
  std::string line;
  for (int number = 1; std::getline(text, line); ++number) {
    line = line.substr(0, line.find('#'));
    if (line.find_first_not_of(" \t\r") == std::string::npos) continue;
    std::istringstream fields(line);
    Vec3d point;
    std::string rest;
    if (!(fields >> point.x() >> point.y() >> point.z()) || fields >> rest || !point.allFinite())
      throw InputError(file.string() + ":" + std::to_string(number) + ": expected \"x y z\" in mm");
    if (points.empty() || (point - points.back()).norm() > 1e-6) points.push_back(point);
  }
  if (points.size() < 2) throw InputError(file.string() + ": a centreline needs two different points");
  return points;
}

[[noreturn]] void Refuse(const ConfigTable& table, const MeshOptions& options, const std::string& why) {
  table.Fail("path", "can't use " + options.path.string() + ": " + why);
}

// The longest run of points that the mesh encloses.
std::vector<Vec3d> InsidePart(const Mesh& mesh, const std::vector<Vec3d>& points) {
  const Clearance wall(mesh);
  std::vector<char> inside(points.size());
  ParallelFor(0, points.size(), [&](int64_t i) { inside[i] = wall.Encloses(points[i]); });
  size_t best_begin = 0, best_length = 0;
  for (size_t i = 0; i < inside.size();) {
    size_t end = i;
    while (end < inside.size() && inside[end]) ++end;
    if (end - i > best_length) best_begin = i, best_length = end - i;
    i = std::max(end, i + 1);
  }
  return {points.begin() + best_begin, points.begin() + best_begin + best_length};
}

Centreline FindCentreline(const ConfigTable& table, const MeshOptions& options, const Mesh& mesh) {
  std::vector<Vec3d> points =
      table.Has("centreline") ? ReadCentreline(table.Path("centreline")) : MiddleOfTube(mesh);
  if (points.size() < 2)
    Refuse(table, options, "no centreline could be found in it; name one with centreline");
  if (options.reverse) std::reverse(points.begin(), points.end());
  return Centreline(SmoothedCurve(points, kSigma_mm));
}

}  // namespace

Geometry LoadMeshSource(const ConfigTable& table) {
  const MeshOptions options = ReadOptions(table);
  Mesh mesh = ReadMesh(options.path);
  for (Vec3d& v : mesh.vertices) v *= options.scale;

  RepairLog log;
  RepairLog ignored;
  if (OneSided(Weld(mesh, &ignored))) Refuse(table, options, "it has one side only, so it bounds no volume");
  mesh = MakeManifold(mesh, &log);
  if (mesh.faces.empty()) Refuse(table, options, "no face has an area");
  const Centreline middle = FindCentreline(table, options, mesh);
  std::vector<Vec3d> centreline = middle.Points(1.0);
  if (options.between_mm) {
    const auto [from_mm, to_mm] = *options.between_mm;
    if (to_mm > middle.length_mm())
      table.Fail("between", "the centreline ends at " + std::to_string(middle.length_mm()) + " mm");
    mesh = CutTube(mesh, middle, from_mm, to_mm);
    if (mesh.faces.empty())
      table.Fail("between", "the mesh has no part there: look at it and its centreline");
    const size_t begin = static_cast<size_t>(std::ceil(from_mm)),
                 end = static_cast<size_t>(std::floor(to_mm));
    centreline = {centreline.begin() + begin, centreline.begin() + std::min(end + 1, centreline.size())};
  }
  if (options.close) mesh = FillHoles(mesh, &log);
  mesh = SmoothMesh(mesh, options.smooth_iterations);
  if (options.close) mesh = RemoveSelfIntersections(mesh, &log);
  if (options.refine_mm > 0) mesh = SubdivideMesh(mesh, options.refine_mm);
  if (const auto problem = Problem(mesh))
    Refuse(table, options, *problem + (options.close ? ", after repair" : "; close = true fills holes"));

  centreline = InsidePart(mesh, centreline);
  if (centreline.size() < 5)
    Refuse(table, options, "its centreline runs outside of it: check that both use the same axes and unit");
  for (const std::string& line : log) Say("repaired " + options.path.filename().string() + ": " + line);
  return {std::move(mesh), std::move(centreline)};
}

}  // namespace lumen
