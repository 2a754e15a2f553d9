#include "recon/surface/shading.h"

#include "recon/surface/volume.h"

namespace lumen {

template <class T>
FrameLight<T> LightOfFrame(const Light& light, const Pose& world_from_camera, const Vec3d& origin) {
  FrameLight<T> result;
  result.camera = (world_from_camera.translation() - origin).cast<T>();
  result.camera_from_field = world_from_camera.linear().transpose().cast<T>();
  for (const LightSource& source : light.sources) {
    result.sources.push_back({(world_from_camera * source.position - origin).cast<T>(),
                              (world_from_camera.linear() * source.direction).cast<T>(),
                              static_cast<T>(source.spread), source.intensity.cast<T>()});
  }
  return result;
}

template <class T>
Shading<T> Shade(Reflectance reflectance, const Vec3<T>& output, const Vec3<T>& normal,
                 const FrameLight<T>& light, const Vec3<T>& point, const Vec3<T>& ambient) {
  Shading<T> result;
  result.by_normal.setZero();
  result.ambient.setZero();
  if (reflectance == Reflectance::kUnlit) {
    for (int c = 0; c < 3; ++c) {
      const T value = Sigmoid(output[c]);
      result.radiance[c] = value;
      result.by_output[c] = value * (1 - value);
    }
    return result;
  }
  const bool has_albedo = HasAlbedo(reflectance);
  Vec3<T> incident = Vec3<T>::Zero();
  for (const auto& source : light.sources) {
    const Irradiance<T> irradiance = IrradianceAt(source.position, source.direction, source.spread, point);
    if (!has_albedo) {
      incident += irradiance.per_intensity * source.intensity;
      continue;
    }
    const T cosine = normal.dot(irradiance.toward);
    if (cosine <= 0) continue;
    incident += irradiance.per_intensity * cosine * source.intensity;
    result.by_normal += irradiance.per_intensity * source.intensity * irradiance.toward.transpose();
  }
  for (int c = 0; c < 3; ++c) {
    const T reflected = std::exp(output[c]) * (has_albedo ? T(1 / kPi) : T(1));
    if (has_albedo) result.ambient[c] = reflected * ambient[c];
    result.radiance[c] = reflected * incident[c] + result.ambient[c];
    result.by_normal.row(c) *= reflected;
  }
  result.by_output = result.radiance;
  return result;
}

#define LUMEN_INSTANTIATE(T)                                                                      \
  template FrameLight<T> LightOfFrame<T>(const Light&, const Pose&, const Vec3d&);                \
  template Shading<T> Shade<T>(Reflectance, const Vec3<T>&, const Vec3<T>&, const FrameLight<T>&, \
                               const Vec3<T>&, const Vec3<T>&);
LUMEN_INSTANTIATE(float)
LUMEN_INSTANTIATE(double)
#undef LUMEN_INSTANTIATE

}  // namespace lumen
