// Camera models: which ray a pixel sees, and which pixel sees a point. Camera axes are OpenCV's (+x right, +y
// down, +z forward); the centre of the upper left pixel is (0, 0).
#pragma once

#include <array>
#include <concepts>
#include <optional>
#include <string>

#include "common/lanes.h"
#include "common/math.h"

namespace lumen {

enum class CameraModel { kPinhole, kKannalaBrandt, kScaramuzza };

// What calibration gives, in double and in px; which members count depends on the model.
struct CameraIntrinsics {
  CameraModel model = CameraModel::kPinhole;
  int width = 0;
  int height = 0;
  double cx = 0;
  double cy = 0;
  double fx = 0;  // pinhole, Kannala–Brandt
  double fy = 0;
  std::array<double, 4> k{};  // Kannala–Brandt: r = θ + k1 θ³ + k2 θ⁵ + k3 θ⁷ + k4 θ⁹
  std::array<double, 5> a{};  // Scaramuzza: z = a0 + a1 ρ + a2 ρ² + a3 ρ³ + a4 ρ⁴, a1 = 0
  std::array<double, 3> stretch{1, 0, 0};  // Scaramuzza: c, d, e of S = [[c, e], [d, 1]]
};

// C3VD's official calibration (CF-HQ190L, 1350×1080).
CameraIntrinsics C3vdIntrinsics();
// EndoMapper's Endoscope_01 (1440×1080), whose polynomial folds back at 94.25°.
CameraIntrinsics EndomapperIntrinsics();

// The same camera with an image of another size: pixel edges, not centres, are scaled. Throws InputError for
// a size below 1.
CameraIntrinsics Resized(const CameraIntrinsics& intrinsics, int width, int height);

// Projection and unprojection in T = float or double.
template <class T>
class Camera {
 public:
  // Throws InputError where the parameters describe no camera (fx ≤ 0, S singular or mirrored, a1 ≠ 0, …).
  explicit Camera(const CameraIntrinsics& intrinsics);

  // Unit direction in camera axes that the pixel sees. Nothing where the pixel has no ray: beyond the fold of
  // the model's polynomial, or not a number. Pixels outside the image are answered by the model all the same.
  std::optional<Vec3<T>> Unproject(const Vec2<T>& pixel) const;

  // The same for sixteen pixels at once, to rounding. Returns −1 in the lanes whose pixel has a ray; the
  // others' direction is +z.
  LanesI Unproject(const Lanes& x, const Lanes& y, Lanes3* direction) const requires std::same_as<T, float>;

  // Pixel that sees a point in camera axes (any length, mm or unit). Nothing where none does: the origin,
  // behind a pinhole, beyond the fold, straight behind a fisheye. The pixel may lie outside the image.
  std::optional<Vec2<T>> Project(const Vec3<T>& point) const;

  // How much of the image a small cone about a ray fills, px² per sr, where `point` (camera axes, any length)
  // is on the ray of the pixel: the inverse of the determinant of Unproject's derivative. Infinite at the
  // fold.
  T AreaPerSteradian(const Vec2<T>& pixel, const Vec3<T>& point) const;

  // Largest angle to the axis, rad, at which the model is one-to-one.
  T max_angle_rad() const { return max_angle_rad_; }
  const CameraIntrinsics& intrinsics() const { return intrinsics_; }

 private:
  CameraIntrinsics intrinsics_;
  // pixel = centre_ + pixel_from_plane_ · (the model's image plane: tanθ, r(θ) or ρ/a0 from the axis
  // outwards)
  Vec2<T> centre_;
  Eigen::Matrix<T, 2, 2> pixel_from_plane_;
  Eigen::Matrix<T, 2, 2> plane_from_pixel_;
  std::array<T, 5> polynomial_{};  // Kannala–Brandt: r/θ in powers of θ²; Scaramuzza: z/a0 in powers of ρ/a0
  T max_angle_rad_;
  T max_radius_;  // in the model's image plane, where max_angle_rad_ lands; infinite for some
};

}  // namespace lumen
