#include "sim/geometry/peristalsis.h"

#include <algorithm>
#include <cmath>

#include "common/parallel.h"

namespace lumen {
namespace {

constexpr double kSpacing_mm = 1;
// A straight centreline has no largest distance; this one is beyond every colon.
constexpr double kStraightReach_mm = 1000;
// The reach is measured from sample to sample; this part of it is used.
constexpr double kSafety = 0.9;
// The reach may change along the curve as little as its mean over ± this many samples does.
constexpr int kSmoothing = 10;

// 1 up to a half, 0 from 1 on, twice continuously differentiable.
double Yielding(double part_of_reach) {
  const double v = std::clamp(2 * part_of_reach - 1, 0.0, 1.0);
  return 1 - v * v * v * (10 + v * (6 * v - 15));
}

// How far straight ends must go on so that they pass every vertex that is nearest to an end.
void Overhangs(const Mesh& mesh, const Centreline& centreline, double* before_mm, double* behind_mm) {
  const CentrelineFrame near = centreline.At(0), deep = centreline.At(centreline.length_mm());
  const ArcFinder arc(centreline);
  const auto count = static_cast<int64_t>(mesh.vertices.size());
  std::vector<double> before(count, 0), behind(count, 0);
  ParallelFor(0, count, [&](int64_t i) {
    const Vec3d& vertex = mesh.vertices[i];
    const double s = arc(vertex);
    if (s < kSpacing_mm) before[i] = -(vertex - near.point).dot(near.tangent);
    if (s > centreline.length_mm() - kSpacing_mm) behind[i] = (vertex - deep.point).dot(deep.tangent);
  });
  // One spacing more than the last vertex needs.
  *before_mm = std::max(0.0, *std::max_element(before.begin(), before.end())) + kSpacing_mm;
  *behind_mm = std::max(0.0, *std::max_element(behind.begin(), behind.end())) + kSpacing_mm;
}

std::vector<Vec3d> Lengthened(const Centreline& centreline, double before_mm, double behind_mm) {
  std::vector<Vec3d> points;
  const int before = static_cast<int>(std::ceil(before_mm / kSpacing_mm));
  const int behind = static_cast<int>(std::ceil(behind_mm / kSpacing_mm));
  for (int i = before; i > 0; --i) points.push_back(centreline.At(-before_mm * i / before).point);
  for (const Vec3d& point : centreline.Points(kSpacing_mm)) points.push_back(point);
  for (int i = 1; i <= behind; ++i)
    points.push_back(centreline.At(centreline.length_mm() + behind_mm * i / behind).point);
  return points;
}

// For each sample the radius of the smallest ball that touches the curve there and passes through another of
// its points: every ball that touches it there and is smaller holds no point of the curve (Federer's reach, a
// place at a time).
std::vector<double> TouchingRadii(const Centreline& centreline, int steps) {
  std::vector<CentrelineFrame> frames(steps + 1);
  for (int i = 0; i <= steps; ++i) frames[i] = centreline.At(centreline.length_mm() * i / steps);
  std::vector<double> radii(frames.size(), kStraightReach_mm);
  ParallelFor(0, steps + 1, [&](int64_t i) {
    const CentrelineFrame& frame = frames[i];
    for (const CentrelineFrame& other : frames) {
      const Vec3d to = other.point - frame.point;
      const double across = (to - frame.tangent * frame.tangent.dot(to)).norm();
      if (to.squaredNorm() < 2 * radii[i] * across) radii[i] = to.squaredNorm() / (2 * across);
    }
  });
  return radii;
}

// A smooth function below a given one: the mean over a window of the least over a window as wide. Every
// window of the mean's holds the place itself.
std::vector<double> SmoothLowerBound(const std::vector<double>& values) {
  const int last = static_cast<int>(values.size()) - 1;
  const auto clamped = [&](int i) { return std::clamp(i, 0, last); };
  std::vector<double> least(values.size()), bound(values.size());
  for (int i = 0; i <= last; ++i) {
    least[i] = *std::min_element(values.begin() + clamped(i - kSmoothing),
                                 values.begin() + clamped(i + kSmoothing) + 1);
  }
  for (int i = 0; i <= last; ++i) {
    double sum = 0, weights = 0;
    for (int k = -kSmoothing; k <= kSmoothing; ++k) {
      const double weight = 1 + std::cos(kPi * k / (kSmoothing + 1));
      sum += weight * least[clamped(i + k)];
      weights += weight;
    }
    bound[i] = sum / weights;
  }
  return bound;
}

Centreline WithStraightEnds(const Geometry& geometry, double* before_mm) {
  const Centreline centreline(geometry.centreline);
  double behind_mm;
  Overhangs(geometry.mesh, centreline, before_mm, &behind_mm);
  return Centreline(Lengthened(centreline, *before_mm, behind_mm));
}

}  // namespace

Peristalsis ReadPeristalsis(const ConfigTable& table) {
  Peristalsis peristalsis;
  peristalsis.amplitude = table.Number("amplitude", peristalsis.amplitude, {0, 0.9});
  peristalsis.wavelength_mm = table.Number("wavelength_mm", peristalsis.wavelength_mm, {10, 10000});
  peristalsis.speed_mm_s = table.Number("speed_mm_s", peristalsis.speed_mm_s, {-1000, 1000});
  peristalsis.rate_hz = table.Number("rate_hz", peristalsis.rate_hz, kPositive);
  peristalsis.phase_rad = table.Number("phase_rad", peristalsis.phase_rad, {-2 * kPi, 2 * kPi});
  return peristalsis;
}

PeristalticWave::PeristalticWave(const Peristalsis& peristalsis, const Geometry& geometry)
    : peristalsis_(peristalsis),
      centreline_(WithStraightEnds(geometry, &before_mm_)),
      samples_(centreline_.Points(kSpacing_mm)),
      step_mm_(centreline_.length_mm() / (samples_.size() - 1)) {
  reach_mm_ = SmoothLowerBound(TouchingRadii(centreline_, static_cast<int>(samples_.size()) - 1));
  for (double& reach : reach_mm_) reach *= kSafety;
}

double PeristalticWave::Reach_mm(double s_mm) const {
  const double at = std::clamp((s_mm + before_mm_) / step_mm_, 0.0, double(reach_mm_.size() - 1));
  const size_t i = std::min(static_cast<size_t>(at), reach_mm_.size() - 2);
  return reach_mm_[i] + (at - i) * (reach_mm_[i + 1] - reach_mm_[i]);
}

PeristalticWave::Foot PeristalticWave::FootOf(const Vec3d& place) const {
  const auto nearer = [&](const Vec3d& a, const Vec3d& b) {
    return (a - place).squaredNorm() < (b - place).squaredNorm();
  };
  const auto nearest = std::min_element(samples_.begin(), samples_.end(), nearer) - samples_.begin();
  // How far before the place along the curve a point of it is, as the curve's tangent there sees it. Within
  // the reach it falls along the curve, and a sample that is the nearest is within three steps of the foot:
  // the square of a point's distance grows from the foot on at least by 1 − kSafety of its square from the
  // foot.
  const auto ahead = [&](double s) {
    const CentrelineFrame frame = centreline_.At(s);
    return (place - frame.point).dot(frame.tangent);
  };
  double s = std::min(centreline_.length_mm(), (nearest + 3) * step_mm_), value = ahead(s);
  double border = std::max(0.0, (nearest - 3) * step_mm_), at_border = ahead(border);
  // The secant's zero, where a border that stays counts half (the Illinois method). Beyond the reach there
  // may be no zero; whatever is found there moves nothing.
  if (!(at_border * value < 0)) s = nearest * step_mm_;
  for (int step = 0; step < 100 && at_border * value < 0 && std::abs(value) > 1e-12; ++step) {
    const double next = (border * value - s * at_border) / (value - at_border), at_next = ahead(next);
    if (at_next * value < 0) {
      border = s;
      at_border = value;
    } else {
      at_border *= 0.5;
    }
    s = next;
    value = at_next;
  }
  Foot foot;
  foot.s_mm = s - before_mm_;
  foot.point = centreline_.At(s).point;
  foot.yields = Yielding((place - foot.point).norm() / Reach_mm(foot.s_mm));
  return foot;
}

Vec3d PeristalticWave::Moved(const Vec3d& place, const Foot& foot, double frame) const {
  const double travelled_mm = peristalsis_.speed_mm_s * frame / peristalsis_.rate_hz;
  const double wave =
      std::cos(kPi * (foot.s_mm + travelled_mm) / peristalsis_.wavelength_mm - 0.5 * peristalsis_.phase_rad);
  return place - peristalsis_.amplitude * wave * wave * foot.yields * (place - foot.point);
}

double PeristalticWave::OffChord_mm(double yielding_mm, double frames) const {
  const double turn =
      kPi * peristalsis_.speed_mm_s * frames / peristalsis_.rate_hz / peristalsis_.wavelength_mm;
  return peristalsis_.amplitude * yielding_mm * turn * turn / 4;
}

PeristalticWall::PeristalticWall(const Peristalsis& peristalsis, const Geometry& geometry)
    : rest_(geometry.mesh), wave_(peristalsis, geometry), feet_(rest_.vertices.size()) {
  ParallelFor(0, static_cast<int64_t>(feet_.size()),
              [&](int64_t i) { feet_[i] = wave_.FootOf(rest_.vertices[i]); });
}

Mesh PeristalticWall::At(double frame) const {
  Mesh mesh = rest_;
  for (size_t i = 0; i < feet_.size(); ++i) {
    mesh.vertices[i] = wave_.Moved(rest_.vertices[i], feet_[i], frame);
  }
  return mesh;
}

double PeristalticWall::StretchesOver(double frames) const {
  double yielding_mm = 0;
  for (size_t i = 0; i < feet_.size(); ++i) {
    yielding_mm = std::max(yielding_mm, feet_[i].yields * (rest_.vertices[i] - feet_[i].point).norm());
  }
  // The distance from the chord falls with the square of the number of stretches.
  return std::ceil(std::sqrt(wave_.OffChord_mm(yielding_mm, frames) / kOffTheWay_mm));
}

}  // namespace lumen
