#include "recon/surface/mucus_coat.h"

#include <cmath>

#include "recon/surface/shading.h"
#include "recon/surface/volume.h"

namespace lumen {
namespace {

constexpr double kLeastRoughness = 0.15, kLargestIor = 2;
// Half a coat, of a mucosa's roughness.
constexpr double kStartWeight = 0.5, kStartRoughness = 0.5;

double Logit(double x) { return std::log(x / (1 - x)); }

// Schlick's reflectance at one cosine, and its derivatives.
template <class T>
struct Fresnel {
  T value, by_cosine, by_ior;

  Fresnel(T ior, T cosine) {
    const T root = (ior - 1) / (ior + 1), facing = root * root;
    const T squared = (1 - cosine) * (1 - cosine), fourth = squared * squared, fifth = fourth * (1 - cosine);
    value = facing + (1 - facing) * fifth;
    by_cosine = -5 * (1 - facing) * fourth;
    by_ior = 4 * root / ((ior + 1) * (ior + 1)) * (1 - fifth);
  }
};

// GGX's part of the lobe, BRDF times cosine over F, and its derivatives.
template <class T>
struct Lobe {
  T value, by_alpha_squared;
  Vec3<T> by_normal;

  // Both cosines are positive. The formulas hold for a normal of any length, so that all of their derivatives
  // are what finite differences say.
  Lobe(T alpha_squared, const Vec3<T>& normal, const Vec3<T>& to_light, const Vec3<T>& to_camera,
       const Vec3<T>& half) {
    const T cos_light = normal.dot(to_light), cos_view = normal.dot(to_camera), cos_half = normal.dot(half);
    // D = α²/(π q²); the sine by the cross product, as 1 − cos² is lost in rounding where α is small.
    const T q = alpha_squared * cos_half * cos_half + normal.cross(half).squaredNorm();
    // G₂/(4 (n·l)(n·v)) = 1/(2 s).
    const T rest = 1 - alpha_squared;
    const T long_view = std::sqrt(alpha_squared + rest * cos_view * cos_view);
    const T long_light = std::sqrt(alpha_squared + rest * cos_light * cos_light);
    const T s = cos_light * long_view + cos_view * long_light;
    value = alpha_squared / (static_cast<T>(kPi) * q * q) * cos_light / (2 * s);
    const Vec3<T> q_by_normal =
        2 * alpha_squared * cos_half * half + 2 * (normal * half.squaredNorm() - cos_half * half);
    const Vec3<T> s_by_normal = (long_view + cos_view * rest * cos_light / long_light) * to_light +
                                (long_light + cos_light * rest * cos_view / long_view) * to_camera;
    by_normal = value * (to_light / cos_light - 2 / q * q_by_normal - s_by_normal / s);
    const T s_by_alpha_squared = cos_light * (1 - cos_view * cos_view) / (2 * long_view) +
                                 cos_view * (1 - cos_light * cos_light) / (2 * long_light);
    by_alpha_squared = value * (1 / alpha_squared - 2 * cos_half * cos_half / q - s_by_alpha_squared / s);
  }
};

}  // namespace

template <class T>
Shading<T> ShadeCoated(const MucusCoat<T>& coat, const Vec3<T>& output, const Vec3<T>& normal,
                       const FrameLight<T>& light, const Vec3<T>& point, const Vec3<T>& ambient,
                       ByCoat<T>* by_coat) {
  Shading<T> result;
  *by_coat = {};
  const T weight = coat.weight, alpha = coat.roughness * coat.roughness, alpha_squared = alpha * alpha;
  const Vec3<T> to_camera = (light.camera - point).normalized();
  const T cos_view = normal.dot(to_camera);
  const bool seen = cos_view > 0;  // from behind, as from the edge
  const Fresnel<T> out(coat.ior, seen ? cos_view : T(0));
  const T leaves = 1 - weight * out.value;
  const Vec3<T> leaves_by_normal = seen ? Vec3<T>(-weight * out.by_cosine * to_camera) : Vec3<T>::Zero();
  // Irradiance that the wall below scatters: Σ intensity · passed.
  Vec3<T> scattered = Vec3<T>::Zero(), scattered_by_weight = Vec3<T>::Zero(),
          scattered_by_ior = Vec3<T>::Zero(), glint_over_weight = Vec3<T>::Zero();
  Mat3<T> scattered_by_normal = Mat3<T>::Zero(), glint_by_normal = Mat3<T>::Zero();
  for (const auto& source : light.sources) {
    const Irradiance<T> irradiance = IrradianceAt(source.position, source.direction, source.spread, point);
    const T cosine = normal.dot(irradiance.toward);
    if (cosine <= 0) continue;
    const Vec3<T> incident = irradiance.per_intensity * source.intensity;
    const Fresnel<T> in(coat.ior, cosine);
    const T enters = 1 - weight * in.value;
    scattered += irradiance.per_intensity * cosine * source.intensity * (enters * leaves);
    scattered_by_weight -= cosine * (in.value * leaves + enters * out.value) * incident;
    scattered_by_ior -= weight * cosine * (in.by_ior * leaves + enters * out.by_ior) * incident;
    const Vec3<T> passed_by_normal = (enters - weight * cosine * in.by_cosine) * leaves * irradiance.toward +
                                     cosine * enters * leaves_by_normal;
    scattered_by_normal += incident * passed_by_normal.transpose();
    if (!seen) continue;
    // Both lie above the place: their sum has a length.
    const Vec3<T> half = (irradiance.toward + to_camera).normalized();
    const Fresnel<T> mirrored(coat.ior, half.dot(to_camera));
    const Lobe<T> lobe(alpha_squared, normal, irradiance.toward, to_camera, half);
    glint_over_weight += mirrored.value * lobe.value * incident;
    glint_by_normal += weight * mirrored.value * incident * lobe.by_normal.transpose();
    by_coat->roughness += weight * mirrored.value * lobe.by_alpha_squared * incident;
    by_coat->ior += weight * mirrored.by_ior * lobe.value * incident;
  }
  by_coat->weight = glint_over_weight;
  by_coat->roughness *= 4 * coat.roughness * alpha;
  for (int c = 0; c < 3; ++c) {
    const T reflected = std::exp(output[c]) * T(1 / kPi);
    result.ambient[c] = reflected * ambient[c] * leaves;
    result.by_output[c] = reflected * scattered[c] + result.ambient[c];
    result.radiance[c] = result.by_output[c] + weight * glint_over_weight[c];
    result.by_normal.row(c) =
        reflected * (scattered_by_normal.row(c) + ambient[c] * leaves_by_normal.transpose()) +
        glint_by_normal.row(c);
    by_coat->weight[c] += reflected * (scattered_by_weight[c] - ambient[c] * out.value);
    by_coat->ior[c] += reflected * (scattered_by_ior[c] - ambient[c] * weight * out.by_ior);
  }
  return result;
}

template <class T>
void InitialiseCoat(const MucusCoatOptions& options, T* parameters) {
  parameters[0] = static_cast<T>(Logit(kStartWeight));
  parameters[1] = static_cast<T>(Logit((kStartRoughness - kLeastRoughness) / (1 - kLeastRoughness)));
  if (options.learn_ior) parameters[2] = static_cast<T>(Logit((options.ior - 1) / (kLargestIor - 1)));
}

template <class T>
MucusCoat<T> LearntCoat(const MucusCoatOptions& options, const T* parameters) {
  MucusCoat<T> coat;
  coat.weight = Sigmoid(parameters[0]);
  coat.roughness = T(kLeastRoughness) + T(1 - kLeastRoughness) * Sigmoid(parameters[1]);
  coat.ior = options.learn_ior ? 1 + T(kLargestIor - 1) * Sigmoid(parameters[2]) : T(options.ior);
  return coat;
}

template <class T>
void LearntCoatBackward(const MucusCoatOptions& options, const T* parameters, const MucusCoat<T>& delta,
                        T* gradient) {
  const auto slope = [&](int i) { return Sigmoid(parameters[i]) * Sigmoid(-parameters[i]); };
  gradient[0] += delta.weight * slope(0);
  gradient[1] += delta.roughness * T(1 - kLeastRoughness) * slope(1);
  if (options.learn_ior) gradient[2] += delta.ior * T(kLargestIor - 1) * slope(2);
}

#define LUMEN_INSTANTIATE(T)                                                                            \
  template Shading<T> ShadeCoated<T>(const MucusCoat<T>&, const Vec3<T>&, const Vec3<T>&,               \
                                     const FrameLight<T>&, const Vec3<T>&, const Vec3<T>&, ByCoat<T>*); \
  template void InitialiseCoat<T>(const MucusCoatOptions&, T*);                                         \
  template MucusCoat<T> LearntCoat<T>(const MucusCoatOptions&, const T*);                               \
  template void LearntCoatBackward<T>(const MucusCoatOptions&, const T*, const MucusCoat<T>&, T*);
LUMEN_INSTANTIATE(float)
LUMEN_INSTANTIATE(double)
#undef LUMEN_INSTANTIATE

}  // namespace lumen
