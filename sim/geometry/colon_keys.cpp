#include "sim/geometry/colon_keys.h"

#include <algorithm>
#include <cmath>

#include "sim/geometry/centreline.h"

namespace lumen {
namespace {

// Lumen diameters of the ascending and the descending colon are measured means; those of the others lie
// beside them. Taeniae show most on the right and flatten out towards the sigmoid, whose lumen is round.
const SegmentDefaults kSegments[] = {
    {"cecum", {46, 54}, 45, 6, 1.5, 0.3},  {"ascending", {46}, 50, 6, 1.5, 0.4},
    {"transverse", {40}, 40, 6, 1.5, 0.8}, {"descending", {29}, 40, 3.5, 0.8, 0.5},
    {"sigmoid", {32}, 35, 3.5, 0.4, 1.2},
};

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

void CheckShape(const ConfigTable& geometry, const ColonShape& shape, const ColonWall& wall,
                const std::string& curve_key) {
  const double outer = wall.OuterRadius(), inner = wall.InnerRadius();
  const double narrowest = *std::min_element(shape.diameters_mm.begin(), shape.diameters_mm.end());
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

}  // namespace

const SegmentDefaults& ReadSegment(const ConfigTable& geometry) {
  std::vector<std::string> names;
  for (const SegmentDefaults& segment : kSegments) names.push_back(segment.name);
  const std::string name = geometry.Choice("segment", "transverse", names);
  return *std::find_if(std::begin(kSegments), std::end(kSegments),
                       [&](const SegmentDefaults& segment) { return segment.name == name; });
}

ColonShape ReadColonShape(const ConfigTable& geometry, const SegmentDefaults& segment, uint64_t seed) {
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

void CheckColonWall(const ConfigTable& geometry, const ColonShape& shape, const ColonWall& wall,
                    const std::string& curve_key) {
  CheckShape(geometry, shape, wall, curve_key);
  CheckPolyps(geometry, shape.polyps, wall);
}

}  // namespace lumen
