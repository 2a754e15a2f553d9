// How a lumen goes on where no frame looks: behind the cameras, where training leaves the surface as it
// began. A colon is a tube, so the wall that the frames show last is taken to go on along its axis: as a
// generalised cylinder, closed by half a ball.
#pragma once

#include <array>
#include <optional>
#include <utility>
#include <vector>

#include "common/math.h"

namespace lumen {

// A place on the wall that a frame sees.
struct WallPoint {
  Vec3d place;      // mm
  double area = 1;  // of wall that it stands for, in any unit
};

class Continuation {
 public:
  // As far as the extended region reaches (EvaluateOptions::extended_mm).
  static constexpr double kReach_mm = 20;
  // Over so much the learnt wall gives way to the cylinder.
  static constexpr double kSeam_mm = 6;

  // points: thousands, of what all frames see, in the axes of the poses. Nothing where the cameras have no
  // direction in common, where the points don't go all round them or leave a camera outside: there is no tube
  // to go on.
  static std::optional<Continuation> Fit(const std::vector<WallPoint>& points,
                                         const std::vector<Pose>& cameras);

  // The signed distance at a place, mm, of which the field itself says `learnt`.
  double Blend(const Vec3d& place, double learnt) const;

 private:
  static constexpr int kSectors = 32, kShapes = 5, kNumbers = kShapes + 4;
  using Vector = Eigen::Matrix<double, kNumbers, 1>;

  struct Cylindrical {
    double along, off, azimuth;  // mm, mm from the middle of the section there, rad
  };
  Cylindrical In(const Vec3d& place) const;
  Vec2d Middle(double along) const;  // of a section, across the axis
  double Radius(double azimuth_rad) const;
  double Frontier(double azimuth_rad) const;
  // The sector whose middle is the last before that azimuth, and the part of the way to the next one's.
  static std::pair<int, double> SectorOf(double azimuth_rad);
  bool FindFrontier(const std::vector<WallPoint>& points);
  void FitTube(const std::vector<WallPoint>& points);

  Vec3d origin_;
  std::array<Vec3d, 3> frame_;  // two directions across the axis, and the axis, into what is seen
  Vec2d middle_ = Vec2d::Zero(), bend_ = Vec2d::Zero();  // see Middle
  std::array<double, kShapes> shape_{};      // the radius, mm: 1, cos 2φ, sin 2φ, cos 3φ, sin 3φ
  std::array<double, kSectors> frontier_{};  // along the axis, where what is seen begins, mm
};

}  // namespace lumen
