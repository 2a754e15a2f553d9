#include "sim/imaging/coat.h"

#include <algorithm>
#include <cmath>

#include "sim/imaging/surface.h"

namespace lumen {
namespace {

constexpr float kLeastAlpha = 1e-3f;
constexpr float kInversePi = static_cast<float>(1 / kPi);

// √(α² + (1 − α²) c²): the cosine c times √(1 + α² tan²).
float Slant(float alpha, float cosine) {
  return std::sqrt(alpha * alpha + (1 - alpha * alpha) * cosine * cosine);
}
Lanes Slant(float alpha, const Lanes& cosine) {
  const Lanes squared = Broadcast(alpha * alpha);
  return Sqrt(squared + (1.0f - squared) * cosine * cosine);
}

// ggx::Distribution of half vectors about normals.
Lanes Distribution(float alpha, const Lanes3& half, const Lanes3& normal) {
  const Lanes along = Dot(half, normal), squared = Broadcast(alpha * alpha);
  const Lanes3 across = Cross(half, normal);
  const Lanes spread = squared * along * along + Dot(across, across);
  return along > 0.0f ? squared * kInversePi / (spread * spread) : Lanes{};
}

}  // namespace

CoatOptions ReadCoat(const ConfigTable& table) {
  CoatOptions options;
  options.ior = table.Number("ior", options.ior, {1, 3});
  options.roughness = table.Number("roughness", options.roughness, kFraction);
  options.relief_mm = table.Number("relief_mm", options.relief_mm, {1e-3, 1e6});
  options.relief_height_mm = table.Number("relief_height_mm", options.relief_height_mm, {0, 1e6});
  if (table.Has("bounced_roughness")) {
    options.bounced_roughness = table.Number("bounced_roughness", kFraction);
  }
  return options;
}

float FresnelDielectric(float ior, float cosine) {
  const float refracted = std::sqrt(1 - (1 - cosine * cosine) / (ior * ior));
  const float parallel = (ior * cosine - refracted) / (ior * cosine + refracted);
  const float across = (cosine - ior * refracted) / (cosine + ior * refracted);
  return 0.5f * (parallel * parallel + across * across);
}

namespace ggx {

float Distribution(float alpha, float cosine, float sin_squared) {
  if (!(cosine > 0)) return 0;
  const float squared = alpha * alpha, spread = squared * cosine * cosine + sin_squared;
  return squared * kInversePi / (spread * spread);
}

float Visibility(float alpha, float cos_in, float cos_out) {
  return 0.5f / (cos_out * Slant(alpha, cos_in) + cos_in * Slant(alpha, cos_out));
}

float ReflectedPdf(float alpha, float distribution, float cos_out) {
  return distribution / (2 * (cos_out + Slant(alpha, cos_out)));
}

Vec3f SampleVisibleNormal(float alpha, const Vec3f& out, const Vec2f& random) {
  // Stretched, the microsurface is a hemisphere.
  const Vec3f view = Vec3f(alpha * out[0], alpha * out[1], out[2]).normalized();
  const float length_squared = view[0] * view[0] + view[1] * view[1];
  const Vec3f across =
      length_squared > 0 ? Vec3f(Vec3f(-view[1], view[0], 0) / std::sqrt(length_squared)) : Vec3f(1, 0, 0);
  const Vec3f up = view.cross(across);
  // A point of the hemisphere's projection along the view: a disc, its lower part foreshortened.
  const float radius = std::sqrt(random[0]), angle = static_cast<float>(2 * kPi) * random[1];
  const float x = radius * std::cos(angle), half = 0.5f * (1 + view[2]);
  const float y = (1 - half) * std::sqrt(std::max(0.0f, 1 - x * x)) + half * radius * std::sin(angle);
  const Vec3f normal = x * across + y * up + std::sqrt(std::max(0.0f, 1 - x * x - y * y)) * view;
  return Vec3f(alpha * normal[0], alpha * normal[1], std::max(0.0f, normal[2])).normalized();
}

}  // namespace ggx

Coat::Coat(const CoatOptions& options)
    : ior_(static_cast<float>(options.ior)),
      alpha_(std::max(kLeastAlpha, static_cast<float>(options.roughness * options.roughness))),
      relief_mm_(static_cast<float>(options.relief_mm)),
      relief_height_mm_(static_cast<float>(options.relief_height_mm)) {
  for (int i = 0; i < kEntries; ++i) {
    const float root = static_cast<float>(i) / (kEntries - 1);
    reflectance_[i] = QuadratureOfReflectance(root * root);
  }
  // Ē = 2 ∫ E(c) c dc = 4 ∫ E r³ dr with c = r², E linear in r between entries: Simpson's rule is exact for
  // such a quartic's integral to (step)⁴/120.
  double sum = 0;
  for (int i = 0; i + 1 < kEntries; ++i) {
    const double a = double(i) / (kEntries - 1), b = double(i + 1) / (kEntries - 1), middle = (a + b) / 2;
    sum += (b - a) / 6 *
           (reflectance_[i] * a * a * a + reflectance_[i + 1] * b * b * b +
            2 * (double(reflectance_[i]) + reflectance_[i + 1]) * middle * middle * middle);
  }
  mean_reflectance_ = static_cast<float>(4 * sum);
}

// The mean over visible normals of F·G₂/G₁, by the midpoint rule in their two numbers.
float Coat::QuadratureOfReflectance(float cosine) const {
  constexpr int kSteps = 64;
  const Vec3f out(std::sqrt(std::max(0.0f, 1 - cosine * cosine)), 0, cosine);
  double sum = 0;
  for (int i = 0; i < kSteps; ++i) {
    for (int j = 0; j < kSteps; ++j) {
      const Vec2f random((float(i) + 0.5f) / kSteps, (float(j) + 0.5f) / kSteps);
      const Vec3f half = ggx::SampleVisibleNormal(alpha_, out, random);
      const float along = out.dot(half), cos_in = 2 * along * half[2] - cosine;
      if (!(cos_in > 0)) continue;
      // G₂/G₁ = Visibility · cos_in / (density/D): D falls out.
      const float masking =
          ggx::Visibility(alpha_, cos_in, cosine) * cos_in / ggx::ReflectedPdf(alpha_, 1, cosine);
      sum += FresnelDielectric(ior_, std::clamp(along, 0.0f, 1.0f)) * masking;
    }
  }
  return static_cast<float>(sum / (kSteps * kSteps));
}

float Coat::Reflectance(float cosine) const {
  const float place = std::sqrt(std::clamp(cosine, 0.0f, 1.0f)) * (kEntries - 1);
  const int below = std::min(static_cast<int>(place), kEntries - 2);
  return reflectance_[below] +
         (place - static_cast<float>(below)) * (reflectance_[below + 1] - reflectance_[below]);
}

Lanes Coat::Reflectance(const Lanes& cosine) const {
  const Lanes zero = Broadcast(0), one = Broadcast(1);
  const Lanes place = Sqrt(Min(Max(cosine, zero), one)) * float(kEntries - 1);
  const LanesI whole = Truncate(place), below = whole > kEntries - 2 ? BroadcastI(kEntries - 2) : whole;
  const Lanes low = Gather(reflectance_.data(), below), high = Gather(reflectance_.data(), below + 1);
  return low + (place - ToFloat(below)) * (high - low);
}

Lanes3 Coat::ReliefNormal(uint64_t seed, const Lanes3& places_mm, const Lanes3& smooth) const {
  if (relief_height_mm_ == 0) return smooth;
  // Height h·(noise(p/l) + noise(2p/l)/2)/1.5, as the mottling's clouds: both octaves have like slopes.
  const Lanes3 place = places_mm * Broadcast(1 / relief_mm_);
  const Lanes3 slope = (NoiseGradient(seed + kReliefSeeds, place) +
                        NoiseGradient(seed + kReliefSeeds + 1, place * Broadcast(2))) *
                       Broadcast(relief_height_mm_ / (1.5f * relief_mm_));
  return Normalized(smooth - (slope - smooth * Dot(slope, smooth)));
}

float Coat::GlintBrdf(const Vec3f& normal, const Vec3f& incoming, const Vec3f& outgoing) const {
  const float cos_in = incoming.dot(normal), cos_out = outgoing.dot(normal);
  if (!(cos_in > 0 && cos_out > 0)) return 0;
  const Vec3f half = (incoming + outgoing).normalized();
  const float distribution = ggx::Distribution(alpha_, half.dot(normal), half.cross(normal).squaredNorm());
  return FresnelDielectric(ior_, std::clamp(half.dot(outgoing), 0.0f, 1.0f)) * distribution *
         ggx::Visibility(alpha_, cos_in, cos_out);
}

CoatLobes Coat::Eval(const CoatedPlace& place, const Vec3f& incoming) const {
  const float cosine = incoming.dot(place.normal), coat_cosine = incoming.dot(place.coat_normal);
  if (!(cosine > 0)) return {Vec3f::Zero(), 0};
  return {Transmission(place, incoming) * cosine * lambert::Eval(place.albedo),
          coat_cosine > 0 ? coat_cosine * GlintBrdf(place.coat_normal, incoming, place.outgoing) : 0.0f};
}

float Coat::Transmission(const CoatedPlace& place, const Vec3f& incoming) const {
  return (1 - place.reflectance) * (1 - Reflectance(incoming.dot(place.coat_normal))) /
         (1 - mean_reflectance_);
}

Lanes Coat::Transmission(const CoatedLanes& places, const Lanes3& incoming) const {
  return (1.0f - places.reflectance) * (1.0f - Reflectance(Dot(incoming, places.coat_normal))) *
         (1 / (1 - mean_reflectance_));
}

Lanes3 Coat::EvalBase(const CoatedLanes& places, const Lanes3& incoming) const {
  const Lanes cosine = Dot(incoming, places.normal);
  return places.albedo * (cosine > 0.0f ? Transmission(places, incoming) * cosine * kInversePi : Lanes{});
}

Lanes Coat::EvalGlint(const CoatedLanes& places, const Lanes3& incoming) const {
  const Lanes zero{};
  const Lanes cos_in = Dot(incoming, places.coat_normal), cos_out = Dot(places.outgoing, places.coat_normal);
  const LanesI mirrors = (Dot(incoming, places.normal) > 0.0f) & (cos_in > 0.0f) & (cos_out > 0.0f);
  if (!Any(mirrors)) return zero;
  const Lanes3 half = Normalized(incoming + places.outgoing);
  const Lanes visibility = 0.5f / (cos_out * Slant(alpha_, cos_in) + cos_in * Slant(alpha_, cos_out));
  const Lanes c = Min(Max(Dot(half, places.outgoing), zero), Broadcast(1));
  const Lanes refracted = Sqrt(1.0f - (1.0f - c * c) * (1 / (ior_ * ior_)));
  const Lanes parallel = (ior_ * c - refracted) / (ior_ * c + refracted);
  const Lanes perpendicular = (c - ior_ * refracted) / (c + ior_ * refracted);
  const Lanes fresnel = 0.5f * (parallel * parallel + perpendicular * perpendicular);
  const Lanes glint = cos_in * fresnel * visibility * Distribution(alpha_, half, places.coat_normal);
  return mirrors ? glint : zero;
}

CoatLobesLanes Coat::Eval(const CoatedLanes& places, const Lanes3& incoming) const {
  return {EvalBase(places, incoming), EvalGlint(places, incoming)};
}

float Coat::GlintShare(const CoatedPlace& place) const {
  if (!(place.outgoing.dot(place.coat_normal) > 0)) return 0;
  const float both = place.reflectance + (1 - place.reflectance) * place.albedo.maxCoeff();
  return both > 0 ? place.reflectance / both : 0;  // a coat of index 1 on a black wall sends nothing
}

Lanes Coat::GlintShare(const CoatedLanes& places) const {
  const Lanes both = places.reflectance + (1.0f - places.reflectance) * MaxOf(places.albedo);
  const LanesI sends = (Dot(places.outgoing, places.coat_normal) > 0.0f) & (both > 0.0f);
  return sends ? places.reflectance / both : Lanes{};
}

float Coat::Pdf(const CoatedPlace& place, const Vec3f& incoming) const {
  const float share = GlintShare(place);
  float pdf = (1 - share) * lambert::Pdf(incoming.dot(place.normal));
  if (share > 0) {
    const Vec3f half = (incoming + place.outgoing).normalized();
    const float distribution =
        ggx::Distribution(alpha_, half.dot(place.coat_normal), half.cross(place.coat_normal).squaredNorm());
    pdf += share * ggx::ReflectedPdf(alpha_, distribution, place.outgoing.dot(place.coat_normal));
  }
  return pdf;
}

Lanes Coat::GlintPdf(const CoatedLanes& places, const Lanes3& incoming) const {
  const Lanes cos_out = Dot(places.outgoing, places.coat_normal);
  const Lanes distribution = Distribution(alpha_, Normalized(incoming + places.outgoing), places.coat_normal);
  return cos_out > 0.0f ? distribution / (2.0f * (cos_out + Slant(alpha_, cos_out))) : Lanes{};
}

Lanes Coat::Pdf(const CoatedLanes& places, const Lanes3& incoming) const {
  const Lanes share = GlintShare(places), cosine = Dot(incoming, places.normal);
  return (1.0f - share) * (cosine > 0.0f ? cosine * kInversePi : Lanes{}) +
         share * GlintPdf(places, incoming);
}

Vec3f Coat::Mirrored(const CoatedPlace& place, const Vec2f& random) const {
  const TangentFrame frame(place.coat_normal);
  const Vec3f& out = place.outgoing;
  const Vec3f local = ggx::SampleVisibleNormal(
      alpha_, {out.dot(frame.tangent), out.dot(frame.bitangent), out.dot(place.coat_normal)}, random);
  const Vec3f half = local[0] * frame.tangent + local[1] * frame.bitangent + local[2] * place.coat_normal;
  return (2 * out.dot(half) * half - out).normalized();
}

Vec3f Coat::Sample(const CoatedPlace& place, const Vec2f& random, float choice) const {
  if (!(choice < GlintShare(place))) return lambert::Sample(place.normal, random);
  return Mirrored(place, random);
}

Coat::Glint Coat::SampleGlint(const CoatedPlace& place, const Vec2f& random) const {
  const float cos_out = place.outgoing.dot(place.coat_normal);
  if (!(cos_out > 0)) return {Vec3f::Zero(), 0};
  const Vec3f incoming = Mirrored(place, random);
  const float cos_in = incoming.dot(place.coat_normal);
  if (!(cos_in > 0 && incoming.dot(place.normal) > 0)) return {Vec3f::Zero(), 0};
  // F·G₂/G₁: the distribution is in lobe and density and falls out.
  const float along = std::clamp((incoming + place.outgoing).normalized().dot(incoming), 0.0f, 1.0f);
  const float masking =
      ggx::Visibility(alpha_, cos_in, cos_out) * cos_in / ggx::ReflectedPdf(alpha_, 1, cos_out);
  return {incoming, FresnelDielectric(ior_, along) * masking};
}

}  // namespace lumen
