// A curve through the middle of the lumen, by arc length, with frames that don't twist about it.
#pragma once

#include <vector>

#include "common/math.h"

namespace lumen {

struct CentrelineFrame {
  Vec3d point;                      // mm
  Vec3d tangent, normal, binormal;  // unit, right-handed: tangent = normal × binormal
};

// A smooth curve through given points: cubic Hermite pieces between them. Frames are rotation-minimising
// (Wang, Jüttler, Zheng, Liu, "Computation of rotation minimizing frames", TOG 2008, double reflection).
class Centreline {
 public:
  // Points in mm, consecutive ones apart (0.25–2 mm of spacing suit a colon). Throws InputError for fewer
  // than two points or two equal neighbours.
  explicit Centreline(const std::vector<Vec3d>& points);

  double length_mm() const { return arc_mm_.back(); }

  // The frame at an arc length in mm; beyond the ends the curve goes on straight.
  CentrelineFrame At(double s_mm) const;

  // Largest curvature, 1/mm, from one given point to the next.
  double MaxCurvature() const;

  // Points spaced evenly, about `spacing_mm` apart, both ends included.
  std::vector<Vec3d> Points(double spacing_mm) const;

 private:
  std::vector<Vec3d> points_, tangents_, normals_;
  std::vector<double> arc_mm_;
};

// Points of a curve that starts at the origin along +z and bends: curvature is even over the middle three
// fifths and fades to 0 towards both ends, so that straight ends fit on. bend_rad is its integral; the plane
// of the bend turns by torsion_rad from end to end.
std::vector<Vec3d> BentCurve(double length_mm, double bend_rad, double torsion_rad);

// Points, about 0.5 mm apart, of a smooth curve through three or more control points (centripetal
// Catmull-Rom). Two give a straight line. Throws InputError as Centreline does.
std::vector<Vec3d> CurveThrough(const std::vector<Vec3d>& control_points);

// Distance in mm between the nearest two places of the curve that are more than `apart_mm` of arc from each
// other; infinity where it is too short for that. O(n²) over points 1 mm apart.
double NearestPass(const Centreline& centreline, double apart_mm);

// Arc length, to about 0.5 mm, of the point of a curve that is nearest to a place.
class ArcFinder {
 public:
  explicit ArcFinder(const Centreline& centreline);
  double operator()(const Vec3d& place) const;

 private:
  std::vector<Vec3d> samples_;
  double step_mm_;
};

}  // namespace lumen
