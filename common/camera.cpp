#include "common/camera.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "common/error.h"
#include "common/polynomial.h"

namespace lumen {
namespace {

constexpr double kInfinity = std::numeric_limits<double>::infinity();

// Where a radial model stops being one-to-one.
struct Fold {
  double angle_rad;
  double radius;
};

void Require(bool condition, const std::string& what) {
  if (!condition) throw InputError("camera: " + what);
}

void CheckIntrinsics(const CameraIntrinsics& in) {
  Require(in.width > 0 && in.height > 0, "width and height must be at least 1");
  Require(std::isfinite(in.cx) && std::isfinite(in.cy), "cx and cy must be finite");
  if (in.model == CameraModel::kScaramuzza) {
    for (const double a : in.a) Require(std::isfinite(a), "a must be finite");
    Require(in.a[0] > 0, "a[0] must be positive (z points forward), not " + std::to_string(in.a[0]));
    Require(in.a[1] == 0, "a[1] must be 0, not " + std::to_string(in.a[1]));
    const double determinant = in.stretch[0] - in.stretch[1] * in.stretch[2];
    Require(determinant > 0 && std::isfinite(determinant),
            "stretch must have c - d*e > 0, not " + std::to_string(determinant));
  } else {
    Require(in.fx > 0 && in.fy > 0 && std::isfinite(in.fx) && std::isfinite(in.fy),
            "fx and fy must be positive, not " + std::to_string(in.fx) + " and " + std::to_string(in.fy));
    for (const double k : in.k) Require(std::isfinite(k), "k must be finite");
  }
}

// r(θ) = θ · p(θ²), p's coefficients 1, k1, …: grows up to the first zero of dr/dθ, or up to straight behind.
Fold FoldOfKannalaBrandt(const std::array<double, 5>& p) {
  std::vector<double> slope;  // in powers of θ²
  for (size_t i = 0; i < p.size(); ++i) slope.push_back(double(2 * i + 1) * p[i]);
  const std::vector<double> zeros = SignChanges(slope, 0, kPi * kPi);
  const double angle = zeros.empty() ? kPi : std::sqrt(zeros.front());
  return {angle, angle * EvaluatePolynomial(p, angle * angle).value};
}

// The angle atan2(w, p(w)) of the ray at w = ρ/a0 grows as long as p − w p′ = 1 − b2 w² − 2 b3 w³ − 3 b4 w⁴ >
// 0. If that has no zero, the highest coefficient is negative and the angle tends to 180°; or all are 0 and
// the model is a pinhole.
Fold FoldOfScaramuzza(const std::array<double, 5>& b) {
  std::vector<double> growth;
  double largest = 0, highest = 0;
  for (size_t i = 0; i < b.size(); ++i) {
    growth.push_back((1 - double(i)) * b[i]);
    largest = std::max(largest, std::abs(growth[i]));
    if (growth[i] != 0) highest = std::abs(growth[i]);
  }
  const double cauchy_bound = 1 + largest / highest;  // no zero lies beyond
  const std::vector<double> zeros = SignChanges(growth, 0, cauchy_bound);
  if (!zeros.empty()) return {std::atan2(zeros[0], EvaluatePolynomial(b, zeros[0]).value), zeros[0]};
  return {b[2] == 0 && b[3] == 0 && b[4] == 0 ? kPi / 2 : kPi, kInfinity};
}

}  // namespace

CameraIntrinsics C3vdIntrinsics() {
  CameraIntrinsics in;
  in.model = CameraModel::kScaramuzza;
  in.width = 1350;
  in.height = 1080;
  in.cx = 678.544839263292;
  in.cy = 542.975887548343;
  in.a = {769.243600037458, 0.0, -0.000812770624150226, 6.25674244578925e-07, -1.19662182144280e-09};
  in.stretch = {0.999986882249990, 0.00288273829525059, -0.00296316513429569};
  return in;
}

CameraIntrinsics EndomapperIntrinsics() {
  CameraIntrinsics in;
  in.model = CameraModel::kKannalaBrandt;
  in.width = 1440;
  in.height = 1080;
  in.fx = 717.6911;
  in.fy = 718.0214;
  in.cx = 734.7278;
  in.cy = 552.0724;
  in.k = {-0.1396589, -0.0003139987, 0.001505504, -0.0001316715};
  return in;
}

CameraIntrinsics Resized(const CameraIntrinsics& intrinsics, int width, int height) {
  Require(std::min({width, height, intrinsics.width, intrinsics.height}) > 0,
          "width and height must be at least 1");
  const double scale_x = double(width) / intrinsics.width;
  const double scale_y = double(height) / intrinsics.height;
  CameraIntrinsics out = intrinsics;
  out.width = width;
  out.height = height;
  out.cx = (intrinsics.cx + 0.5) * scale_x - 0.5;
  out.cy = (intrinsics.cy + 0.5) * scale_y - 0.5;
  out.fx = intrinsics.fx * scale_x;
  out.fy = intrinsics.fy * scale_y;
  // Scaramuzza: ρ scales with y, whose row of S holds the fixed 1; what x scales otherwise goes into its row.
  for (size_t i = 0; i < out.a.size(); ++i) out.a[i] = intrinsics.a[i] * std::pow(scale_y, 1 - double(i));
  out.stretch[0] = intrinsics.stretch[0] * (scale_x / scale_y);
  out.stretch[2] = intrinsics.stretch[2] * (scale_x / scale_y);
  return out;
}

template <class T>
Camera<T>::Camera(const CameraIntrinsics& intrinsics) : intrinsics_(intrinsics) {
  CheckIntrinsics(intrinsics);
  Eigen::Matrix2d pixel_from_plane;
  std::array<double, 5> polynomial{};
  Fold fold{kPi / 2, kInfinity};
  if (intrinsics.model == CameraModel::kScaramuzza) {
    const auto& [c, d, e] = intrinsics.stretch;
    const double a0 = intrinsics.a[0];
    pixel_from_plane << c, e, d, 1;
    pixel_from_plane *= a0;
    for (int i = 0; i < 5; ++i) polynomial[i] = intrinsics.a[i] * std::pow(a0, i - 1);
    fold = FoldOfScaramuzza(polynomial);
  } else {
    pixel_from_plane << intrinsics.fx, 0, 0, intrinsics.fy;
    const auto& k = intrinsics.k;
    polynomial = {1, k[0], k[1], k[2], k[3]};
    if (intrinsics.model == CameraModel::kKannalaBrandt) fold = FoldOfKannalaBrandt(polynomial);
  }
  centre_ = Vec2d(intrinsics.cx, intrinsics.cy).cast<T>();
  pixel_from_plane_ = pixel_from_plane.cast<T>();
  plane_from_pixel_ = Eigen::Matrix2d(pixel_from_plane.inverse()).cast<T>();
  for (size_t i = 0; i < polynomial.size(); ++i) polynomial_[i] = static_cast<T>(polynomial[i]);
  max_angle_rad_ = static_cast<T>(fold.angle_rad);
  max_radius_ = static_cast<T>(fold.radius);
}

template <class T>
std::optional<Vec3<T>> Camera<T>::Unproject(const Vec2<T>& pixel) const {
  const Vec2<T> plane = plane_from_pixel_ * (pixel - centre_);
  const T radius = plane.norm();
  if (!(radius <= max_radius_)) return std::nullopt;
  switch (intrinsics_.model) {
    case CameraModel::kPinhole:
      return Vec3<T>(plane.x(), plane.y(), 1).normalized();
    case CameraModel::kScaramuzza:
      return Vec3<T>(plane.x(), plane.y(), EvaluatePolynomial(polynomial_, radius).value).normalized();
    case CameraModel::kKannalaBrandt:
      break;
  }
  if (radius == 0) return Vec3<T>(0, 0, 1);
  const auto excess = [&](T angle) {
    const T squared = angle * angle;
    const ValueAndSlope<T> p = EvaluatePolynomial(polynomial_, squared);
    return ValueAndSlope<T>{angle * p.value - radius, p.value + 2 * squared * p.slope};
  };
  const T angle = SolveIncreasing<T>(excess, 0, max_angle_rad_, radius);
  const Vec2<T> sideways = plane * (std::sin(angle) / radius);
  return Vec3<T>(sideways.x(), sideways.y(), std::cos(angle));
}

template <class T>
LanesI Camera<T>::Unproject(const Lanes& x, const Lanes& y,
                            Lanes3* direction) const requires std::same_as<T, float> {
  if (intrinsics_.model == CameraModel::kKannalaBrandt) {  // solves for the angle, pixel by pixel
    LanesI seen{};
    for (int i = 0; i < kLanes; ++i) {
      const std::optional<Vec3f> ray = Unproject(Vec2f(x[i], y[i]));
      direction->Set(i, ray.value_or(Vec3f(0, 0, 1)));
      seen[i] = ray ? -1 : 0;
    }
    return seen;
  }
  const auto& from_pixel = plane_from_pixel_;
  const Lanes dx = x - centre_.x(), dy = y - centre_.y();
  const Lanes plane_x = from_pixel(0, 0) * dx + from_pixel(0, 1) * dy;
  const Lanes plane_y = from_pixel(1, 0) * dx + from_pixel(1, 1) * dy;
  const Lanes radius = Sqrt(plane_x * plane_x + plane_y * plane_y);
  const LanesI seen = radius <= max_radius_;
  Lanes z = Broadcast(1);
  if (intrinsics_.model == CameraModel::kScaramuzza) {
    z = Broadcast(polynomial_.back());
    for (size_t i = polynomial_.size() - 1; i-- > 0;) z = z * radius + polynomial_[i];
  }
  *direction = Select(seen, Normalized({plane_x, plane_y, z}), Broadcast(Vec3f(0, 0, 1)));
  return seen;
}

template <class T>
std::optional<Vec2<T>> Camera<T>::Project(const Vec3<T>& point) const {
  const T sideways = point.template head<2>().norm();
  const T z = point.z();
  if (sideways == 0) return z > 0 ? std::optional(centre_) : std::nullopt;
  if (intrinsics_.model == CameraModel::kPinhole) {
    if (!(z > 0) || std::isnan(sideways)) return std::nullopt;
    return centre_ + pixel_from_plane_ * Vec2<T>(point.template head<2>() / z);
  }
  const T angle = std::atan2(sideways, z);
  if (!(angle <= max_angle_rad_)) return std::nullopt;
  T radius;
  if (intrinsics_.model == CameraModel::kKannalaBrandt) {
    radius = angle * EvaluatePolynomial(polynomial_, angle * angle).value;
  } else {
    // |(w, p(w))| · sin(angle of w − angle sought), which has the sign of the difference all along the
    // branch.
    const T length = std::hypot(sideways, z);
    const T sin_angle = sideways / length, cos_angle = z / length;
    const auto excess = [&](T w) {
      const ValueAndSlope<T> p = EvaluatePolynomial(polynomial_, w);
      return ValueAndSlope<T>{w * cos_angle - p.value * sin_angle, cos_angle - p.slope * sin_angle};
    };
    // The branch may have no end: the first power of two that lies beyond. A pinhole's angles end at 90°.
    T high = 1;
    while (high < max_radius_ && excess(high).value < 0) high *= 2;
    if (std::isinf(high)) return std::nullopt;
    high = std::min(high, max_radius_);
    radius = SolveIncreasing<T>(excess, 0, high, std::min(high, angle));
  }
  return centre_ + pixel_from_plane_ * Vec2<T>(point.template head<2>() * (radius / sideways));
}

// With the model's radius w(θ) in its image plane, whose area scales by the matrix's determinant, an annulus
// of 2π sinθ dθ sr fills 2π w dw: w w′/sinθ.
template <class T>
T Camera<T>::AreaPerSteradian(const Vec2<T>& pixel, const Vec3<T>& point) const {
  const T area = pixel_from_plane_.determinant();
  if (intrinsics_.model == CameraModel::kPinhole) {  // tanθ
    const T cosine = point.z() / point.norm();
    return area / (cosine * cosine * cosine);
  }
  if (intrinsics_.model == CameraModel::kKannalaBrandt) {  // θ · p(θ²)
    const T sideways = point.template head<2>().norm(), angle = std::atan2(sideways, point.z());
    const ValueAndSlope<T> p = EvaluatePolynomial(polynomial_, angle * angle);
    const T over_sine = angle > 0 ? angle * point.norm() / sideways : T(1);
    return area * p.value * (p.value + 2 * angle * angle * p.slope) * over_sine;
  }
  // θ = atan2(w, p(w)), so that sinθ = w/|(w, p)| and dθ/dw = (p − w p′)/|(w, p)|².
  const T radius = (plane_from_pixel_ * (pixel - centre_)).norm();
  const ValueAndSlope<T> p = EvaluatePolynomial(polynomial_, radius);
  const T length = std::hypot(radius, p.value);
  return area * length * length * length / (p.value - radius * p.slope);
}

template class Camera<float>;
template class Camera<double>;

}  // namespace lumen
