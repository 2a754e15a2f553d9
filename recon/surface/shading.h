// What the colour network's outputs send to the camera under the endoscope's light. Only co-located light is
// seen from where it comes from; every source's own place, direction and distance count here. Shadows of
// sources off the axis are not modelled.
#pragma once

#include <optional>
#include <vector>

#include "common/light.h"
#include "common/math.h"
#include "recon/surface/direction_map.h"
#include "recon/surface/field.h"

namespace lumen {

// The sources at one frame, in the field's axes (mm, relative to its origin).
template <class T>
struct FrameLight {
  struct Source {
    Vec3<T> position, direction;
    T spread;
    Vec3<T> intensity;
  };
  std::vector<Source> sources;
  Vec3<T> camera;                           // its place, in the field's axes
  Mat3<T> camera_from_field;                // rotation
  Vec3<T> mean_radiance = Vec3<T>::Zero();  // over the frame's pixels, at gain 1
  // Irradiance from the rest of the wall by direction in camera axes, at gain 1; where it is modelled so.
  std::optional<DirectionMap<T>> surroundings;
};
template <class T>
FrameLight<T> LightOfFrame(const Light& light, const Pose& world_from_camera, const Vec3d& origin);

// Radiance (RGB) of one sample and its derivatives.
template <class T>
struct Shading {
  Vec3<T> radiance;
  Vec3<T> by_output;  // ∂radiance_c/∂output_c; the others are 0
  Mat3<T> by_normal;  // row c: ∂radiance_c/∂normal
  Vec3<T> ambient;    // the part of the radiance that goes back to `ambient`
};

// Without the glints of a coat (recon/surface/mucus_coat.h): kLambertian and kCoat: exp(output)/π · (Σ
// intensity · irradiance · max(0, n·l) + ambient); kFree: exp(output) · Σ intensity · irradiance; kUnlit:
// 1/(1 + e^−output). normal: unit, into the lumen. ambient: irradiance from the rest of the wall, where there
// is an albedo.
template <class T>
Shading<T> Shade(Reflectance reflectance, const Vec3<T>& output, const Vec3<T>& normal,
                 const FrameLight<T>& light, const Vec3<T>& point, const Vec3<T>& ambient);

}  // namespace lumen
