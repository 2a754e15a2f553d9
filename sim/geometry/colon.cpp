#include "sim/geometry/colon.h"

#include <algorithm>
#include <cmath>
#include <string>
#include <utility>

#include "sim/geometry/centreline.h"
#include "sim/geometry/colon_wall.h"
#include "sim/geometry/refine.h"

namespace lumen {
namespace {

// What a named segment takes where the scene doesn't say otherwise.
struct SegmentDefaults {
  const char* name;
  std::vector<double> diameters_mm;
  double haustra_spacing_mm, fold_height_mm, taenia_depth_mm, bend_rad;
};

// Lumen diameters of the ascending and the descending colon are measured means; those of the others lie
// beside them. Taeniae show most on the right and flatten out towards the sigmoid, whose lumen is round.
const SegmentDefaults kSegments[] = {
    {"cecum", {46, 54}, 45, 6, 1.5, 0.3},  {"ascending", {46}, 50, 6, 1.5, 0.4},
    {"transverse", {40}, 40, 6, 1.5, 0.8}, {"descending", {29}, 40, 3.5, 0.8, 0.5},
    {"sigmoid", {32}, 35, 3.5, 0.4, 1.2},
};

// Folds of this length at least, whatever their centreline: two of the coarsest mesh's edges across a fold's
// flank.
constexpr double kEdgesPerFold = 4;

std::string Millimetres(double value) {
  const long tenths = std::lround(value * 10);
  return std::to_string(tenths / 10) + "." + std::to_string(std::abs(tenths % 10)) + " mm";
}

std::vector<Polyp> ReadPolyps(const ConfigTable& geometry) {
  std::vector<Polyp> polyps;
  for (const ConfigTable& table : geometry.Tables("polyps")) {
    Polyp polyp;
    const std::string paris = table.Choice("paris", {"Ip", "Is", "IIa"});
    polyp.paris = paris == "Ip" ? Polyp::Paris::kIp : paris == "Is" ? Polyp::Paris::kIs : Polyp::Paris::kIIa;
    polyp.at_mm = table.Number("at_mm", kNotNegative);
    polyp.angle_rad = table.Number("angle_rad", Range{-2 * kPi, 2 * kPi});
    polyp.size_mm = table.Number("size_mm", Range{1, 30});
    polyps.push_back(polyp);
  }
  return polyps;
}

ColonShape ReadShape(const ConfigTable& geometry, const SegmentDefaults& segment, uint64_t seed) {
  ColonShape shape;
  shape.diameters_mm = segment.diameters_mm;
  if (geometry.Has("diameters_mm")) {
    shape.diameters_mm = geometry.Numbers("diameters_mm", 0, Range{5, 120});
    if (geometry.Has("diameter_mm")) geometry.Fail("diameter_mm", "give either diameter_mm or diameters_mm");
    if (shape.diameters_mm.empty()) geometry.Fail("diameters_mm", "needs at least one diameter");
  } else if (geometry.Has("diameter_mm")) {
    shape.diameters_mm = {geometry.Number("diameter_mm", Range{5, 120})};
  }
  shape.haustra_spacing_mm = geometry.Number("haustra_spacing_mm", segment.haustra_spacing_mm, Range{5, 200});
  shape.haustra_depth_mm = geometry.Number("haustra_depth_mm", 2, Range{0, 20});
  shape.fold_height_mm = geometry.Number("fold_height_mm", segment.fold_height_mm, Range{0, 30});
  shape.fold_thickness_mm = geometry.Number("fold_thickness_mm", 5, Range{1, 50});
  shape.taenia_width_mm = geometry.Number("taenia_width_mm", 10, Range{1, 30});
  shape.taenia_depth_mm = geometry.Number("taenia_depth_mm", segment.taenia_depth_mm, Range{0, 10});
  shape.irregularity_mm = geometry.Number("irregularity_mm", 0.3, Range{0, 3});
  shape.polyps = ReadPolyps(geometry);
  shape.seed = seed;
  return shape;
}

std::vector<Vec3d> ReadCurve(const ConfigTable& geometry, const SegmentDefaults& segment) {
  if (!geometry.Has("control_points")) {
    return BentCurve(geometry.Number("length_mm", 90, Range{10, 2000}),
                     geometry.Number("bend_rad", segment.bend_rad, Range{0, 20}),
                     geometry.Number("torsion_rad", 0, Range{-20, 20}));
  }
  for (const char* key : {"length_mm", "bend_rad", "torsion_rad"}) {
    if (geometry.Has(key))
      geometry.Fail(key, "give either control_points or length_mm, bend_rad and torsion_rad");
  }
  const std::vector<double> numbers = geometry.Numbers("control_points");
  if (numbers.size() < 6 || numbers.size() % 3 != 0)
    geometry.Fail("control_points", "needs x, y, z of two or more points, one after the other");
  std::vector<Vec3d> points;
  for (size_t i = 0; i < numbers.size(); i += 3) {
    points.emplace_back(numbers[i], numbers[i + 1], numbers[i + 2]);
    if (i > 0 && (points.back() - points[points.size() - 2]).norm() < 1)
      geometry.Fail("control_points", "points " + std::to_string(i / 3 - 1) + " and " +
                                          std::to_string(i / 3) + " (from 0) are less than 1 mm apart");
  }
  return CurveThrough(points);
}

// Refuses a wall that would meet itself. A tube of distance r from a curve of curvature k is one-to-one where
// k·r < 1 and no two places of the curve come nearer than 2r.
void CheckShape(const ConfigTable& geometry, const ColonShape& shape, const ColonWall& wall) {
  const double outer = wall.OuterRadius(), inner = wall.InnerRadius();
  const double narrowest = *std::min_element(shape.diameters_mm.begin(), shape.diameters_mm.end());
  const std::string curve_key = geometry.Has("control_points") ? "control_points" : "bend_rad";
  if (inner < narrowest / 8)
    geometry.Fail("fold_height_mm", "folds, taeniae and irregularity may leave only " +
                                        Millimetres(std::max(0.0, inner)) + " of a radius of " +
                                        Millimetres(narrowest / 2) + " open: lower them or widen the colon");
  const double bend_radius = 1 / wall.centreline().MaxCurvature();
  if (bend_radius * 0.9 < outer)
    geometry.Fail(curve_key, "bends with a radius of " + Millimetres(bend_radius) +
                                 ", too sharp for a wall that reaches " + Millimetres(outer) +
                                 " from the centreline: bend less, lengthen or narrow the colon");
  const double pass = NearestPass(wall.centreline(), kPi * outer);
  if (pass < 2 * outer)
    geometry.Fail(curve_key, "the centreline comes within " + Millimetres(pass) +
                                 " of itself, the wall needs " + Millimetres(2 * outer) +
                                 ": move the loops apart");
  if (shape.fold_thickness_mm > shape.haustra_spacing_mm / 2)
    geometry.Fail("fold_thickness_mm", "more than half of haustra_spacing_mm: folds would merge");
  const double taeniae_mm = 3 * shape.taenia_width_mm;
  if (taeniae_mm > kPi * narrowest / 2)
    geometry.Fail("taenia_width_mm", "three taeniae would cover more than half of the circumference");
}

Vec3d TopOf(const Polyp& polyp, const ColonWall& wall) {
  return wall.At({std::cos(polyp.angle_rad), std::sin(polyp.angle_rad), polyp.at_mm});
}

void CheckPolyps(const ConfigTable& geometry, const std::vector<Polyp>& polyps, const ColonWall& wall) {
  const std::vector<ConfigTable> tables = geometry.Tables("polyps");
  for (size_t i = 0; i < polyps.size(); ++i) {
    const double foot = ColonWall::FootRadius(polyps[i]), clear = std::max(foot, polyps[i].size_mm / 2);
    if (polyps[i].at_mm < clear || polyps[i].at_mm > wall.length_mm() - clear)
      tables[i].Fail("at_mm", "the polyp reaches over an end of the tube: keep it between " +
                                  Millimetres(clear) + " and " + Millimetres(wall.length_mm() - clear));
    // On its own side of the centreline a polyp can't touch the opposite wall; its neighbourhood has no
    // folds.
    const CentrelineFrame frame = wall.centreline().At(polyps[i].at_mm);
    const Vec3d at = TopOf(polyps[i], wall);
    const double beyond_middle = (at - frame.point)
                                     .dot(std::cos(polyps[i].angle_rad) * frame.normal +
                                          std::sin(polyps[i].angle_rad) * frame.binormal);
    if (beyond_middle < 2 || clear > 0.5 * (beyond_middle + ColonWall::Height(polyps[i])))
      tables[i].Fail("size_mm", "the polyp would fill the lumen: make it smaller");
    for (size_t k = 0; k < i; ++k) {
      const double apart = 1.3 * (clear + std::max(ColonWall::FootRadius(polyps[k]), polyps[k].size_mm / 2));
      if ((at - TopOf(polyps[k], wall)).norm() < apart)
        tables[i].Fail("at_mm", "the polyp touches polyp " + std::to_string(k) + " (from 0): move them " +
                                    Millimetres(apart) + " apart");
    }
  }
}

// Corner indices of one ring of the capsule, all the way round: column `count` is column 0.
struct Ring {
  int first, count;
  int At(int column) const { return first + column % count; }
};

// A rounded end as half an octahedron, subdivided: ring m of n has 4m corners, the pole being ring 0.
// `outward` says which way the faces turn.
void AddCap(const std::vector<Ring>& rings, bool deep, Mesh* mesh) {
  const auto add = [&](int a, int b, int c) {
    mesh->faces.push_back(deep ? Vec3i(a, b, c) : Vec3i(a, c, b));
  };
  for (size_t m = 0; m + 1 < rings.size(); ++m) {
    const int size = static_cast<int>(m);
    for (int quadrant = 0; quadrant < 4; ++quadrant) {
      for (int i = 0; i <= size; ++i) {
        const int inner = quadrant * size + i, outer = quadrant * (size + 1) + i;
        const int inner_corner = size == 0 ? rings[0].first : rings[m].At(inner);
        add(inner_corner, rings[m + 1].At(outer), rings[m + 1].At(outer + 1));
        if (i < size) add(rings[m].At(inner), rings[m + 1].At(outer + 1), rings[m].At(inner + 1));
      }
    }
  }
}

// Triangles of the wall's capsule, about `spacing_mm` apart on the wall.
Mesh CapsuleMesh(const ColonWall& wall, double spacing_mm) {
  Mesh mesh;
  const double radius = std::max(wall.NearCapHeight(), wall.DeepCapHeight());
  const int quarter = std::max(2, static_cast<int>(std::ceil(kPi / 2 * radius / spacing_mm)));
  const int rows = std::max(1, static_cast<int>(std::ceil(wall.length_mm() / spacing_mm)));
  const auto add_ring = [&](int count, double scale, double s) {
    const Ring ring = {static_cast<int>(mesh.vertices.size()), count};
    for (int i = 0; i < count; ++i) {
      const double angle = 2 * kPi * i / count;
      mesh.vertices.emplace_back(scale * std::cos(angle), scale * std::sin(angle), s);
    }
    return ring;
  };
  std::vector<Ring> near, tube, deep;
  for (int m = 0; m < quarter; ++m) {
    const double turn = kPi / 2 * m / quarter;
    const int count = std::max(1, 4 * m);
    near.push_back(add_ring(count, std::sin(turn), -wall.NearCapHeight() * std::cos(turn)));
    deep.push_back(add_ring(count, std::sin(turn), wall.length_mm() + wall.DeepCapHeight() * std::cos(turn)));
  }
  for (int row = 0; row <= rows; ++row)
    tube.push_back(add_ring(4 * quarter, 1, wall.length_mm() * row / rows));
  near.push_back(tube.front());
  deep.push_back(tube.back());
  AddCap(near, false, &mesh);
  AddCap(deep, true, &mesh);
  for (int row = 0; row < rows; ++row) {
    for (int i = 0; i < 4 * quarter; ++i) {
      mesh.faces.emplace_back(tube[row].At(i), tube[row].At(i + 1), tube[row + 1].At(i + 1));
      mesh.faces.emplace_back(tube[row].At(i), tube[row + 1].At(i + 1), tube[row + 1].At(i));
    }
  }
  return mesh;
}

}  // namespace

Geometry BuildColon(const ConfigTable& geometry, uint64_t seed) {
  std::vector<std::string> names;
  for (const SegmentDefaults& segment : kSegments) names.push_back(segment.name);
  const std::string name = geometry.Choice("segment", "transverse", names);
  const SegmentDefaults& segment = *std::find_if(std::begin(kSegments), std::end(kSegments),
                                                 [&](const auto& s) { return s.name == name; });

  const ColonShape shape = ReadShape(geometry, segment, seed);
  const double tolerance_mm = geometry.Number("tolerance_mm", 0.015, Range{1e-4, 1});
  const ColonWall wall(shape, Centreline(ReadCurve(geometry, segment)));
  CheckShape(geometry, shape, wall);
  CheckPolyps(geometry, shape.polyps, wall);

  double spacing_mm = std::min(shape.fold_thickness_mm / kEdgesPerFold, wall.InnerRadius() / 4);
  for (const Polyp& polyp : shape.polyps) spacing_mm = std::min(spacing_mm, ColonWall::FootRadius(polyp) / 4);
  const ParametricSurface surface = {[&](const Vec3d& near) { return wall.OntoCapsule(near); },
                                     [&](const Vec3d& capsule) { return wall.At(capsule); }};
  return {Refine(CapsuleMesh(wall, spacing_mm), surface, tolerance_mm), wall.centreline().Points(1.0)};
}

}  // namespace lumen
