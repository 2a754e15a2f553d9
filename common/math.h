// Names for the vectors and transforms used everywhere, and nothing more.
#pragma once

#include <Eigen/Core>
#include <Eigen/Geometry>
#include <numbers>

namespace lumen {

template <class T>
using Vec2 = Eigen::Matrix<T, 2, 1>;
template <class T>
using Vec3 = Eigen::Matrix<T, 3, 1>;
template <class T>
using Mat3 = Eigen::Matrix<T, 3, 3>;

using Vec2f = Vec2<float>;
using Vec2d = Vec2<double>;
using Vec3f = Vec3<float>;
using Vec3d = Vec3<double>;
using Vec3i = Vec3<int>;
using Mat3d = Mat3<double>;

// A rigid motion. Named by what it maps: Pose world_from_camera takes camera axes (OpenCV's: +x right, +y
// down, +z forward) to world axes, both in mm.
using Pose = Eigen::Isometry3d;

inline constexpr double kPi = std::numbers::pi;

}  // namespace lumen
