#include "sim/geometry/colon.h"

#include <string>

#include "sim/geometry/centreline.h"
#include "sim/geometry/colon_keys.h"
#include "sim/geometry/colon_mesh.h"
#include "sim/geometry/colon_wall.h"

namespace lumen {
namespace {

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

}  // namespace

Geometry BuildColon(const ConfigTable& geometry, uint64_t seed) {
  const SegmentDefaults& segment = ReadSegment(geometry);
  const ColonShape shape = ReadColonShape(geometry, segment, seed);
  const double tolerance_mm = geometry.Number("tolerance_mm", 0.015, Range{1e-4, 1});
  const ColonWall wall(shape, Centreline(ReadCurve(geometry, segment)));
  CheckColonWall(geometry, shape, wall, geometry.Has("control_points") ? "control_points" : "bend_rad");
  return {ColonMesh(shape, wall, tolerance_mm), wall.centreline().Points(1.0)};
}

}  // namespace lumen
