#include "sim/geometry/centreline.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "common/error.h"

namespace lumen {
namespace {

constexpr double kSpacing_mm = 0.5;

Vec3d AnyPerpendicular(const Vec3d& direction) { return direction.unitOrthogonal(); }

Vec3d Reflected(const Vec3d& v, const Vec3d& plane_normal) {
  return v - plane_normal * (2 * plane_normal.dot(v) / plane_normal.squaredNorm());
}

// Rises from 0 at t = 0 to 1 at t = 1, flat at both.
double Smoothstep(double t) {
  t = std::clamp(t, 0.0, 1.0);
  return t * t * (3 - 2 * t);
}

// Catmull-Rom with knots spaced by the square root of the distances (Barry and Goldman's pyramid); t in [0,
// 1] runs from p1 to p2.
Vec3d CatmullRom(const Vec3d& p0, const Vec3d& p1, const Vec3d& p2, const Vec3d& p3, double t) {
  const double t0 = 0, t1 = t0 + std::sqrt((p1 - p0).norm());
  const double t2 = t1 + std::sqrt((p2 - p1).norm()), t3 = t2 + std::sqrt((p3 - p2).norm());
  const double x = t1 + t * (t2 - t1);
  const auto mix = [x](const Vec3d& a, const Vec3d& b, double ta, double tb) -> Vec3d {
    return (a * (tb - x) + b * (x - ta)) / (tb - ta);
  };
  const Vec3d a = mix(p0, p1, t0, t1), b = mix(p1, p2, t1, t2), c = mix(p2, p3, t2, t3);
  return mix(mix(a, b, t0, t2), mix(b, c, t1, t3), t1, t2);
}

}  // namespace

Centreline::Centreline(const std::vector<Vec3d>& points) : points_(points) {
  const size_t count = points_.size();
  if (count < 2) throw InputError("a centreline needs at least two points");
  arc_mm_.assign(count, 0);
  for (size_t i = 1; i < count; ++i) {
    const double step = (points_[i] - points_[i - 1]).norm();
    if (!(step > 0))
      throw InputError("the centreline's points " + std::to_string(i - 1) + " and " + std::to_string(i) +
                       " (from 0) are equal: remove one");
    arc_mm_[i] = arc_mm_[i - 1] + step;
  }
  // Tangents of the parabola through each point and its neighbours, one-sided at the ends.
  const auto slope = [&](size_t i) -> Vec3d {
    return (points_[i + 1] - points_[i]) / (arc_mm_[i + 1] - arc_mm_[i]);
  };
  tangents_.resize(count);
  for (size_t i = 0; i < count; ++i) {
    Vec3d tangent;
    if (count == 2) {
      tangent = slope(0);
    } else if (i == 0) {
      tangent = 1.5 * slope(0) - 0.5 * slope(1);
    } else if (i == count - 1) {
      tangent = 1.5 * slope(i - 1) - 0.5 * slope(i - 2);
    } else {
      const double before = arc_mm_[i] - arc_mm_[i - 1], after = arc_mm_[i + 1] - arc_mm_[i];
      tangent = (slope(i - 1) * after + slope(i) * before) / (before + after);
    }
    if (!(tangent.norm() > 0.1))
      throw InputError("the centreline turns back at its point " + std::to_string(i) + " (from 0)");
    tangents_[i] = tangent.normalized();
  }
  normals_.resize(count);
  normals_[0] = AnyPerpendicular(tangents_[0]);
  for (size_t i = 0; i + 1 < count; ++i) {
    const Vec3d chord = points_[i + 1] - points_[i];
    const Vec3d turned = tangents_[i + 1] - Reflected(tangents_[i], chord);
    normals_[i + 1] = Reflected(Reflected(normals_[i], chord), turned);
  }
}

CentrelineFrame Centreline::At(double s_mm) const {
  const double inside = std::clamp(s_mm, 0.0, length_mm());
  const auto above = std::upper_bound(arc_mm_.begin(), arc_mm_.end(), inside);
  const size_t i = std::min<size_t>(std::max<ptrdiff_t>(above - arc_mm_.begin(), 1), points_.size() - 1) - 1;
  const double h = arc_mm_[i + 1] - arc_mm_[i], t = (inside - arc_mm_[i]) / h;
  const Vec3d &p = points_[i], &q = points_[i + 1], &v = tangents_[i], &w = tangents_[i + 1];
  CentrelineFrame frame;
  frame.point =
      p + (q - p) * (t * t * (3 - 2 * t)) + v * (h * t * (1 - t) * (1 - t)) - w * (h * t * t * (1 - t));
  const Vec3d derivative =
      (q - p) * (6 * t * (1 - t) / h) + v * ((1 - t) * (1 - 3 * t)) - w * (t * (2 - 3 * t));
  frame.tangent = derivative.normalized();
  const Vec3d between = normals_[i] * (1 - t) + normals_[i + 1] * t;
  frame.normal = (between - frame.tangent * frame.tangent.dot(between)).normalized();
  frame.binormal = frame.tangent.cross(frame.normal);
  frame.point += frame.tangent * (s_mm - inside);
  return frame;
}

double Centreline::MaxCurvature() const {
  double largest = 0;
  for (size_t i = 0; i + 1 < points_.size(); ++i) {
    const double turn = 2 * std::asin(std::min(1.0, (tangents_[i + 1] - tangents_[i]).norm() / 2));
    largest = std::max(largest, turn / (arc_mm_[i + 1] - arc_mm_[i]));
  }
  return largest;
}

std::vector<Vec3d> Centreline::Points(double spacing_mm) const {
  const int steps = std::max(1, static_cast<int>(std::lround(length_mm() / spacing_mm)));
  std::vector<Vec3d> points(steps + 1);
  for (int i = 0; i <= steps; ++i) points[i] = At(length_mm() * i / steps).point;
  return points;
}

std::vector<Vec3d> BentCurve(double length_mm, double bend_rad, double torsion_rad) {
  const int steps = std::max(8, static_cast<int>(std::ceil(length_mm / kSpacing_mm)));
  const double h = length_mm / steps;
  // Smoothsteps over a fifth of the length at each end leave 4/5 of an even curvature's integral.
  const double ramp = length_mm / 5, curvature = bend_rad / (length_mm * 0.8);
  Mat3d frame = Mat3d::Identity();  // columns: two normals that don't twist, the tangent
  Vec3d point = Vec3d::Zero();
  std::vector<Vec3d> points = {point};
  for (int i = 0; i < steps; ++i) {
    const double s = (i + 0.5) * h, plane = torsion_rad * s / length_mm;
    const double turn = curvature * Smoothstep(s / ramp) * Smoothstep((length_mm - s) / ramp) * h;
    // In frames that don't twist (Bishop's), curvature has a component along each normal.
    const Vec3d axis = frame.col(1) * std::cos(plane) - frame.col(0) * std::sin(plane);
    const Mat3d half = Eigen::AngleAxisd(turn / 2, axis).toRotationMatrix();
    point += half * frame.col(2) * h;
    frame = half * half * frame;
    points.push_back(point);
  }
  return points;
}

std::vector<Vec3d> CurveThrough(const std::vector<Vec3d>& control_points) {
  const size_t count = control_points.size();
  Centreline check(control_points);  // refuses what isn't a curve
  std::vector<Vec3d> points;
  for (size_t i = 0; i + 1 < count; ++i) {
    const Vec3d &p1 = control_points[i], &p2 = control_points[i + 1];
    const Vec3d p0 = i > 0 ? control_points[i - 1] : Vec3d(2 * p1 - p2);
    const Vec3d p3 = i + 2 < count ? control_points[i + 2] : Vec3d(2 * p2 - p1);
    const int steps = std::max(1, static_cast<int>(std::ceil((p2 - p1).norm() / kSpacing_mm)));
    for (int k = 0; k < steps; ++k)
      points.push_back(CatmullRom(p0, p1, p2, p3, static_cast<double>(k) / steps));
  }
  points.push_back(control_points.back());
  return points;
}

double NearestPass(const Centreline& centreline, double apart_mm) {
  const std::vector<Vec3d> points = centreline.Points(1.0);
  const double step = centreline.length_mm() / (points.size() - 1);
  double nearest = std::numeric_limits<double>::infinity();
  for (size_t i = 0; i < points.size(); ++i) {
    for (size_t k = i + 1 + static_cast<size_t>(apart_mm / step); k < points.size(); ++k)
      nearest = std::min(nearest, (points[i] - points[k]).norm());
  }
  return nearest;
}

ArcFinder::ArcFinder(const Centreline& centreline)
    : samples_(centreline.Points(1.0)), step_mm_(centreline.length_mm() / (samples_.size() - 1)) {}

double ArcFinder::operator()(const Vec3d& place) const {
  const auto nearer = [&](const Vec3d& a, const Vec3d& b) {
    return (a - place).squaredNorm() < (b - place).squaredNorm();
  };
  return step_mm_ * (std::min_element(samples_.begin(), samples_.end(), nearer) - samples_.begin());
}

}  // namespace lumen
