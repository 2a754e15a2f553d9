#include "recon/surface/continuation.h"

#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>
#include <limits>

namespace lumen {
namespace {

// So much of the wall the tube is fitted to: as long as from fold to fold, so that it isn't narrow or wide by
// one of them, and long enough to tell how it bends. This, kRear_mm and kSeam_mm were chosen on nine
// transverse and four sigmoid lumens, where the error beyond what is seen changes by a tenth between 30 and
// 60, 5 and 20, 3 and 10.
constexpr double kBand_mm = 30;

// Of all points so many in a thousand may lie where no wall is.
constexpr double kStray = 0.002;
constexpr int kFewInSector = 8;
// Sectors that show less than that along the band, as behind a fold of a bend, don't tell of the tube; of the
// others so many are needed.
constexpr double kLeastAround = 0.75;

// The cameras that say along which way the lumen goes on, behind the rest. A lumen bends, and the wall that
// is seen lies too far ahead to tell; those who withdraw a camera look along the lumen.
constexpr double kRear_mm = 20;
constexpr double kLeastAgreement = 0.5;  // length of the mean of all cameras' viewing directions

// Beyond it a point counts by its distance rather than by the square: folds aren't the tube.
constexpr double kHuber_mm = 1.5;
constexpr int kRounds = 12;
// Pull of all but the mean radius and place to nothing, in parts of all points' weight.
constexpr double kRidge = 0.01;

// How far a bend has taken the middle of a section, in parts of what it takes it over kBand_mm: a parabola
// that leaves the axis gently where what is seen begins, and nothing behind that.
double BendAt(double along) {
  const double ahead = std::max(along / kBand_mm, 0.0);
  return ahead * ahead;
}

double Smoothstep(double x) {
  x = std::clamp(x, 0.0, 1.0);
  return x * x * (3 - 2 * x);
}

}  // namespace

Vec2d Continuation::Middle(double along) const { return middle_ + BendAt(along) * bend_; }

Continuation::Cylindrical Continuation::In(const Vec3d& place) const {
  const Vec3d from = place - origin_;
  const double along = from.dot(frame_[2]);
  const Vec2d across = Vec2d(from.dot(frame_[0]), from.dot(frame_[1])) - Middle(along);
  return {along, across.norm(), std::atan2(across.y(), across.x())};
}

double Continuation::Radius(double azimuth_rad) const {
  return shape_[0] + shape_[1] * std::cos(2 * azimuth_rad) + shape_[2] * std::sin(2 * azimuth_rad) +
         shape_[3] * std::cos(3 * azimuth_rad) + shape_[4] * std::sin(3 * azimuth_rad);
}

// At the sectors' middles; in between linear.
double Continuation::Frontier(double azimuth_rad) const {
  const auto [i, part] = SectorOf(azimuth_rad);
  return (1 - part) * frontier_[i] + part * frontier_[(i + 1) % kSectors];
}

std::pair<int, double> Continuation::SectorOf(double azimuth_rad) {
  const double at = (azimuth_rad / (2 * kPi) + 1) * kSectors - 0.5, whole = std::floor(at);
  return {static_cast<int>(whole) % kSectors, at - whole};
}

double Continuation::Blend(const Vec3d& place, double learnt) const {
  const auto [along, off, azimuth] = In(place);
  const double behind = Frontier(azimuth) - along;
  if (behind <= 0) return learnt;
  const double weight = Smoothstep(behind / kSeam_mm);
  const double beyond_end = std::max(0.0, -kReach_mm - along);
  const double cylinder = Radius(azimuth) - std::hypot(off, beyond_end);
  return (1 - weight) * learnt + weight * cylinder;
}

// Huber's estimate, by weighted least squares again and again about the middle found so far.
void Continuation::FitTube(const std::vector<WallPoint>& points) {
  std::vector<double> trust(points.size(), 1.0);
  for (int round = 0; round < kRounds; ++round) {
    Eigen::Matrix<double, kNumbers, kNumbers> squares;
    squares.setZero();
    Vector right = Vector::Zero();
    double weight = 0;
    for (size_t i = 0; i < points.size(); ++i) {
      const auto [along, off, azimuth] = In(points[i].place);
      const double c = std::cos(azimuth), s = std::sin(azimuth), bend = BendAt(along);
      Vector row;
      row << 1, std::cos(2 * azimuth), std::sin(2 * azimuth), std::cos(3 * azimuth), std::sin(3 * azimuth), c,
          s, bend * c, bend * s;
      const double share = points[i].area * trust[i];
      squares += share * row * row.transpose();
      right += share * (off + Middle(along).dot(Vec2d(c, s))) * row;
      weight += share;
    }
    for (int k = 1; k < kNumbers; ++k)
      if (k < kShapes || k >= kShapes + 2) squares(k, k) += kRidge * weight;
    const Vector numbers = squares.ldlt().solve(right);
    std::copy_n(numbers.data(), kShapes, shape_.begin());
    middle_ = numbers.segment<2>(kShapes);
    bend_ = numbers.segment<2>(kShapes + 2);
    for (size_t i = 0; i < points.size(); ++i) {
      const auto [along, off, azimuth] = In(points[i].place);
      trust[i] = kHuber_mm / std::max(kHuber_mm, std::abs(off - Radius(azimuth)));
    }
  }
}

// Each point counts for both middles beside it, so that in between, too, none lies behind the frontier.
bool Continuation::FindFrontier(const std::vector<WallPoint>& points) {
  std::array<int, kSectors> count{};
  frontier_.fill(kBand_mm);
  for (const WallPoint& point : points) {
    const Cylindrical at = In(point.place);
    const int sector = SectorOf(at.azimuth).first;
    for (const int s : {sector, (sector + 1) % kSectors}) {
      frontier_[s] = std::min(frontier_[s], at.along);
      ++count[s];
    }
  }
  const auto told =
      std::ranges::count_if(count, [](int points_there) { return points_there >= kFewInSector; });
  return double(told) >= kLeastAround * kSectors;
}

std::optional<Continuation> Continuation::Fit(const std::vector<WallPoint>& points,
                                              const std::vector<Pose>& cameras) {
  if (points.empty() || cameras.empty()) return std::nullopt;
  Vec3d ahead = Vec3d::Zero(), axis = Vec3d::Zero();
  for (const Pose& camera : cameras) ahead += camera.linear().col(2);
  if (ahead.norm() < kLeastAgreement * double(cameras.size())) return std::nullopt;
  ahead.normalize();
  double rear = std::numeric_limits<double>::infinity();
  for (const Pose& camera : cameras) rear = std::min(rear, ahead.dot(camera.translation()));
  for (const Pose& camera : cameras)
    if (ahead.dot(camera.translation()) <= rear + kRear_mm) axis += camera.linear().col(2);
  if (!(axis.norm() > 0)) return std::nullopt;
  axis.normalize();

  Continuation tube;
  std::vector<double> along;
  for (const WallPoint& point : points) along.push_back(point.place.dot(axis));
  const auto first = along.begin() + static_cast<std::ptrdiff_t>(kStray * double(along.size()));
  std::nth_element(along.begin(), first, along.end());
  const double begin = *first;
  std::vector<WallPoint> band;
  Vec3d middle = Vec3d::Zero();
  double area = 0;
  for (const WallPoint& point : points) {
    const double z = point.place.dot(axis);
    if (z < begin || z > begin + kBand_mm) continue;
    band.push_back(point);
    middle += point.area * point.place;
    area += point.area;
  }
  middle /= area;
  tube.origin_ = middle + (begin - middle.dot(axis)) * axis;
  const Vec3d across = axis.unitOrthogonal();
  tube.frame_ = {across, axis.cross(across), axis};
  tube.FitTube(band);
  if (!tube.FindFrontier(band)) return std::nullopt;
  for (const Pose& camera : cameras) {
    const Cylindrical at = tube.In(camera.translation());
    if (at.along < tube.Frontier(at.azimuth) && at.off >= tube.Radius(at.azimuth)) return std::nullopt;
  }
  return tube;
}

}  // namespace lumen
