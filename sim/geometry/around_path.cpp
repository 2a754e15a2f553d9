#include "sim/geometry/around_path.h"

#include <algorithm>
#include <cmath>

#include "common/error.h"
#include "common/random.h"
#include "sim/geometry/centreline.h"
#include "sim/geometry/clearance.h"
#include "sim/geometry/colon_keys.h"
#include "sim/geometry/colon_mesh.h"
#include "sim/geometry/tube_middle.h"

namespace lumen {
namespace {

// What a random number is drawn for.
enum Draw : uint64_t { kVariant = 1, kShiftSide, kBendSide };

// So wide that a short path aslant to the view leaves the lumen along the view: the camera is off-centre
// then.
constexpr double kDepthSigma_mm = 20;
// Of the mean view (1 = all cameras look the same way): cameras within 60° of a direction have half at least.
constexpr double kLeastAgreement = 0.5;
// What a camera at rest counts for.
constexpr double kRest_mm = 0.05;
// Largest curvature times the wall's radius: CheckColonWall refuses 0.9.
constexpr double kMostBend = 0.85;
constexpr double kFirstSigma_mm = 8, kLastSigma_mm = 60, kSigmaStep = 1.25;

// Diameters of the wall stand so far apart, and a camera near the wall widens it so far along.
constexpr double kDiameterSpacing_mm = 15, kWidening_mm = 15;
constexpr int kWideningRounds = 24;
// While the wall is widened its triangles are this far from it at most; cameras nearer to each other than
// kApart_mm count as one. The clearance that is asked for has both on top.
constexpr double kCoarse_mm = 0.1, kApart_mm = 0.5;

// Depth of every camera, and what it counts for.
struct Depths {
  Vec3d view, origin;
  std::vector<double> depth_mm, weight;
  double low_mm, high_mm;
};

Depths DepthsOf(const std::vector<Pose>& path) {
  Depths depths;
  Vec3d view = Vec3d::Zero();
  for (const Pose& pose : path) view += pose.linear().col(2) / static_cast<double>(path.size());
  if (view.norm() < kLeastAgreement) {
    throw InputError("the cameras look all ways: a lumen can't be built around their path");
  }
  depths.view = view.normalized();
  depths.origin = path.front().translation();
  for (size_t i = 0; i < path.size(); ++i) {
    const Vec3d place = path[i].translation();
    depths.depth_mm.push_back(depths.view.dot(place - depths.origin));
    const double travelled = i > 0 ? (place - path[i - 1].translation()).norm() : 0;
    depths.weight.push_back(travelled + kRest_mm);
  }
  const auto [low, high] = std::minmax_element(depths.depth_mm.begin(), depths.depth_mm.end());
  depths.low_mm = *low;
  depths.high_mm = *high;
  return depths;
}

// Mean over the cameras about a depth.
template <class Quantity>
Vec3d MeanAt(const Depths& depths, double depth_mm, const Quantity& quantity) {
  Vec3d sum = Vec3d::Zero();
  double weights = 0;
  for (size_t i = 0; i < depths.depth_mm.size(); ++i) {
    const double away = (depths.depth_mm[i] - depth_mm) / kDepthSigma_mm;
    const double weight = depths.weight[i] * std::exp(-0.5 * away * away);
    sum += weight * quantity(i);
    weights += weight;
  }
  return sum / weights;
}

// A direction across the view, by the seed.
Vec3d SideOf(const Vec3d& view, uint64_t seed, Draw draw) {
  const Vec3d across = view.unitOrthogonal();
  const double angle = 2 * kPi * UniformDouble(RandomBits(seed, draw));
  return std::cos(angle) * across + std::sin(angle) * view.cross(across);
}

// SmoothedCurve that treats the ends as if the curve went on straight.
std::vector<Vec3d> SmoothedThroughEnds(const std::vector<Vec3d>& points, double sigma_mm) {
  const double beyond_mm = std::ceil(3 * sigma_mm);
  std::vector<Vec3d> longer = {points.front() + beyond_mm * (points.front() - points[1]).normalized()};
  longer.insert(longer.end(), points.begin(), points.end());
  longer.push_back(points.back() + beyond_mm * (points.back() - points[points.size() - 2]).normalized());
  const std::vector<Vec3d> smooth = SmoothedCurve(longer, sigma_mm);
  const auto cut = static_cast<ptrdiff_t>(beyond_mm);
  return {smooth.begin() + cut, smooth.end() - cut};
}

// Smoothed more and more, until the wall fits round it or smoothing has had its turn.
std::vector<Vec3d> Gentle(const std::vector<Vec3d>& points, double radius_mm) {
  for (double sigma_mm = kFirstSigma_mm;; sigma_mm *= kSigmaStep) {
    const std::vector<Vec3d> smooth = SmoothedThroughEnds(points, sigma_mm);
    if (sigma_mm > kLastSigma_mm || Centreline(smooth).MaxCurvature() * radius_mm < kMostBend) return smooth;
  }
}

std::vector<Vec3d> DistinctPlaces(const std::vector<Pose>& path) {
  std::vector<Vec3d> places;
  for (const Pose& pose : path) {
    const Vec3d place = pose.translation();
    const bool known = std::any_of(places.begin(), places.end(),
                                   [&](const Vec3d& other) { return (place - other).norm() < kApart_mm; });
    if (!known) places.push_back(place);
  }
  return places;
}

// The shape's diameters at even places not farther apart than kDiameterSpacing_mm.
std::vector<double> FineDiameters(const std::vector<double>& diameters_mm, double length_mm) {
  const auto count = static_cast<size_t>(std::ceil(length_mm / kDiameterSpacing_mm)) + 1;
  std::vector<double> fine(count);
  for (size_t i = 0; i < count; ++i) {
    const double place = static_cast<double>(i) / static_cast<double>(count - 1) *
                         static_cast<double>(diameters_mm.size() - 1);
    const size_t before = std::min(static_cast<size_t>(place), diameters_mm.size() - 1);
    const size_t after = std::min(before + 1, diameters_mm.size() - 1);
    const double t = place - static_cast<double>(before);
    fine[i] = diameters_mm[before] * (1 - t) + diameters_mm[after] * t;
  }
  return fine;
}

// By how much each place is too near to the wall, mm; at most 0 where it isn't.
std::vector<double> Missing(const Mesh& mesh, const std::vector<Vec3d>& places, double clearance_mm) {
  std::vector<double> missing = Clearance(mesh).WithinBy(places);
  for (double& value : missing) value = clearance_mm - value;
  return missing;
}

// Widens the shape's diameters until every place keeps the clearance.
void Widen(const ConfigTable& geometry, const Centreline& centreline, const std::vector<Vec3d>& places,
           double clearance_mm, ColonShape* shape) {
  const ArcFinder arc(centreline);
  const double spacing_mm = centreline.length_mm() / static_cast<double>(shape->diameters_mm.size() - 1);
  for (int round = 0; round < kWideningRounds; ++round) {
    const Mesh mesh = ColonMesh(*shape, ColonWall(*shape, centreline), kCoarse_mm);
    const std::vector<double> missing = Missing(mesh, places, clearance_mm + kCoarse_mm + kApart_mm);
    std::vector<double> wider(shape->diameters_mm.size(), 0);
    for (size_t i = 0; i < places.size(); ++i) {
      if (missing[i] <= 0) continue;
      const double at_mm = arc(places[i]);
      for (size_t k = 0; k < wider.size(); ++k) {
        const double away = (static_cast<double>(k) * spacing_mm - at_mm) / kWidening_mm;
        wider[k] = std::max(wider[k], 2 * missing[i] * std::exp(-0.5 * away * away));
      }
    }
    if (*std::max_element(missing.begin(), missing.end()) <= 0) return;
    for (size_t k = 0; k < wider.size(); ++k) shape->diameters_mm[k] += wider[k];
  }
  geometry.Fail("clearance_mm", "no wall around this path can be had that keeps it: allow less");
}

}  // namespace

std::vector<Vec3d> CentrelineAroundPath(const std::vector<Pose>& path, const CentrelineRule& rule,
                                        uint64_t seed) {
  const Depths depths = DepthsOf(path);
  const Vec3d shift = rule.off_centre_mm * SideOf(depths.view, seed, kShiftSide);
  const auto place_of = [&](size_t i) -> Vec3d { return path[i].translation() - depths.origin; };
  const auto view_of = [&](size_t i) -> Vec3d { return path[i].linear().col(2); };
  const auto middle = [&](double depth_mm) -> Vec3d {
    const Vec3d mean = MeanAt(depths, depth_mm, place_of);
    return depths.origin + shift + mean + (depth_mm - depths.view.dot(mean)) * depths.view;
  };

  std::vector<Vec3d> points;
  const Vec3d back = MeanAt(depths, depths.low_mm, view_of).normalized();
  points.push_back(middle(depths.low_mm) - rule.behind_mm * back);
  // Cameras that hardly move in depth are one place.
  const int steps = static_cast<int>(std::lround(depths.high_mm - depths.low_mm));
  for (int i = 0; i <= steps; ++i) {
    const double part = steps > 0 ? static_cast<double>(i) / steps : 0.5;
    points.push_back(middle(depths.low_mm + (depths.high_mm - depths.low_mm) * part));
  }
  Mat3d axes;
  axes.col(2) = MeanAt(depths, depths.high_mm, view_of).normalized();
  const Vec3d side = SideOf(axes.col(2), seed, kBendSide);
  axes.col(0) = side;
  axes.col(1) = axes.col(2).cross(side);
  const Vec3d deepest = points.back();
  const std::vector<Vec3d> ahead = BentCurve(rule.ahead_mm, rule.bend_rad, 0);
  for (size_t i = 1; i < ahead.size(); ++i) points.push_back(deepest + axes * ahead[i]);
  return Gentle(points, rule.widest_radius_mm);
}

Geometry BuildAroundPath(const ConfigTable& geometry, const std::vector<Pose>& path, uint64_t seed) {
  if (path.empty()) {
    geometry.Fail("kind", "\"around_path\" needs a [trajectory] of kind \"file\" that isn't anchored");
  }
  const uint64_t own_seed =
      RandomBits(seed, kVariant, static_cast<uint64_t>(geometry.Integer("variant", 0, Range{0, 1e6})));
  const SegmentDefaults& segment = ReadSegment(geometry);
  ColonShape shape = ReadColonShape(geometry, segment, own_seed);
  CentrelineRule rule;
  rule.ahead_mm = geometry.Number("ahead_mm", rule.ahead_mm, Range{20, 500});
  rule.behind_mm = geometry.Number("behind_mm", rule.behind_mm, Range{5, 500});
  rule.bend_rad = geometry.Number("bend_rad", segment.bend_rad, Range{0, 3});
  rule.off_centre_mm = geometry.Number("off_centre_mm", rule.off_centre_mm, Range{0, 50});
  const double clearance_mm = geometry.Number("clearance_mm", 5, Range{0, 50});
  const double tolerance_mm = geometry.Number("tolerance_mm", 0.015, Range{1e-4, 1});
  const std::vector<Vec3d> places = DistinctPlaces(path);

  // The centreline must be gentle enough for the wall as it is after being widened.
  const std::vector<double> diameters_mm = shape.diameters_mm;
  for (int round = 0;; ++round) {
    const double widest_mm = *std::max_element(shape.diameters_mm.begin(), shape.diameters_mm.end());
    shape.diameters_mm = {widest_mm};
    rule.widest_radius_mm = ColonWall(shape, Centreline({Vec3d::Zero(), Vec3d::UnitZ()})).OuterRadius();
    const Centreline centreline(CentrelineAroundPath(path, rule, own_seed));
    shape.diameters_mm = FineDiameters(diameters_mm, centreline.length_mm());
    Widen(geometry, centreline, places, clearance_mm, &shape);
    const ColonWall wall(shape, centreline);
    if (round > 0 || wall.OuterRadius() <= rule.widest_radius_mm) {
      CheckColonWall(geometry, shape, wall, "bend_rad");
      return {ColonMesh(shape, wall, tolerance_mm), centreline.Points(1.0)};
    }
  }
}

}  // namespace lumen
