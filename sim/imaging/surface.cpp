#include "sim/imaging/surface.h"

#include <algorithm>
#include <bit>
#include <cmath>

namespace lumen {
namespace {

// 32 well-mixed bits of a lattice point (the finaliser of MurmurHash3 on a product with large primes).
uint32_t LatticeHash(uint32_t seed, int x, int y, int z) {
  uint32_t h = seed + static_cast<uint32_t>(x) * 0x8da6b343u + static_cast<uint32_t>(y) * 0xd8163841u +
               static_cast<uint32_t>(z) * 0xcb1ab31fu;
  h = (h ^ (h >> 16)) * 0x85ebca6bu;
  h = (h ^ (h >> 13)) * 0xc2b2ae35u;
  return h ^ (h >> 16);
}

// One of Perlin's twelve gradients, from the middle of a cube to its edges, times the offset. Signs are
// flipped by their bits: no branches, so that a loop over lanes becomes vector instructions.
float GradientDot(uint32_t hash, float x, float y, float z) {
  const uint32_t h = hash & 15;
  const float u = h < 8 ? x : y;
  const float v = h < 4 ? y : (h & 13) == 12 ? x : z;
  return std::bit_cast<float>(std::bit_cast<uint32_t>(u) ^ (h << 31)) +
         std::bit_cast<float>(std::bit_cast<uint32_t>(v) ^ ((h & 2) << 30));
}

float Quintic(float t) { return t * t * t * (t * (t * 6 - 15) + 10); }

float Lerp(float a, float b, float t) { return a + t * (b - a); }

uint32_t NoiseSeed(uint64_t seed) { return static_cast<uint32_t>(Mix64(seed)); }

[[gnu::always_inline]] inline float Noise(uint32_t seed, float px, float py, float pz) {
  const float floor_x = std::floor(px), floor_y = std::floor(py), floor_z = std::floor(pz);
  const float fx = px - floor_x, fy = py - floor_y, fz = pz - floor_z;
  const int x = static_cast<int>(floor_x), y = static_cast<int>(floor_y), z = static_cast<int>(floor_z);
  const auto corner = [=](int dx, int dy, int dz) {
    return GradientDot(LatticeHash(seed, x + dx, y + dy, z + dz), fx - static_cast<float>(dx),
                       fy - static_cast<float>(dy), fz - static_cast<float>(dz));
  };
  const float u = Quintic(fx), v = Quintic(fy), w = Quintic(fz);
  const float low =
      Lerp(Lerp(corner(0, 0, 0), corner(1, 0, 0), u), Lerp(corner(0, 1, 0), corner(1, 1, 0), u), v);
  const float high =
      Lerp(Lerp(corner(0, 0, 1), corner(1, 0, 1), u), Lerp(corner(0, 1, 1), corner(1, 1, 1), u), v);
  const float value = Lerp(low, high, w);
  // The noise's maximum is 1.04.
  const float cut = value < 1 ? value : 1.0f;
  return cut > -1 ? cut : -1.0f;
}

// Two octaves, scaled to stay within ±1: the noise in clouds.
template <int kLanes>
void Clouds(uint64_t seed, float scale_mm, const float (*place)[kLanes], float* clouds) {
  const uint32_t coarse = NoiseSeed(seed), fine = NoiseSeed(seed + 1);
  for (int i = 0; i < kLanes; ++i) {
    const float x = place[0][i] / scale_mm, y = place[1][i] / scale_mm, z = place[2][i] / scale_mm;
    clouds[i] = (Noise(coarse, x, y, z) + 0.5f * Noise(fine, 2 * x, 2 * y, 2 * z)) / 1.5f;
  }
}

// 1 on the middle of a vessel, 0 beyond its width. The noise field is bent by another one, so that vessels
// wind; near its zero it changes by about one a lattice step, which turns its value into a distance.
template <int kLanes>
void InsideVessels(const Vessels& vessels, uint64_t seed, const float (*place)[kLanes], float* inside) {
  const uint32_t field_seed = NoiseSeed(seed + 2), bend_seed = NoiseSeed(seed + 3);
  const float spacing = static_cast<float>(vessels.spacing_mm);
  const float steepness = static_cast<float>(vessels.spacing_mm / vessels.width_mm);
  for (int i = 0; i < kLanes; ++i) {
    const float x = place[0][i] / spacing, y = place[1][i] / spacing, z = place[2][i] / spacing;
    const float bend = 0.35f * Noise(bend_seed, 2 * x, 2 * y, 2 * z);
    const float distance = std::abs(Noise(field_seed, x + bend, y - bend, z + bend)) * steepness;
    const float to_middle = Quintic(1 - distance);
    inside[i] = distance < 1 ? to_middle : 0.0f;
  }
}

// One source for one place and for many, so that both give the same bits.
template <int kLanes>
void Albedos(const Surface& surface, uint64_t seed, const float (*place)[kLanes], float (*albedo)[kLanes]) {
  for (int c = 0; c < 3; ++c) std::fill_n(albedo[c], kLanes, static_cast<float>(surface.albedo[c]));
  alignas(64) float texture[kLanes];
  if (surface.mottling) {
    const float contrast = static_cast<float>(surface.mottling->contrast);
    Clouds<kLanes>(seed, static_cast<float>(surface.mottling->scale_mm), place, texture);
    for (int i = 0; i < kLanes; ++i) {
      const float factor = std::exp(contrast * texture[i]);
      for (int c = 0; c < 3; ++c) albedo[c][i] *= factor;
    }
  }
  if (surface.vessels) {
    const Vec3f absorption = surface.vessels->absorption.cast<float>();
    InsideVessels<kLanes>(*surface.vessels, seed, place, texture);
    for (int i = 0; i < kLanes; ++i) {
      if (texture[i] <= 0) continue;
      for (int c = 0; c < 3; ++c) albedo[c][i] *= std::exp(-texture[i] * absorption[c]);
    }
  }
  for (int c = 0; c < 3; ++c) {
    for (int i = 0; i < kLanes; ++i) albedo[c][i] = std::min(albedo[c][i], 1.0f);
  }
}

}  // namespace

Surface ReadSurface(const ConfigTable& table) {
  Surface surface;
  surface.albedo = table.Vector("albedo", surface.albedo, kFraction);
  if (const auto mottling = table.Optional("mottling")) {
    surface.mottling.emplace();
    surface.mottling->contrast = mottling->Number("contrast", surface.mottling->contrast, {0, 3});
    surface.mottling->scale_mm = mottling->Number("scale_mm", surface.mottling->scale_mm, {1e-3, 1e6});
  }
  if (const auto vessels = table.Optional("vessels")) {
    surface.vessels.emplace();
    surface.vessels->spacing_mm = vessels->Number("spacing_mm", surface.vessels->spacing_mm, {1e-3, 1e6});
    surface.vessels->width_mm = vessels->Number("width_mm", surface.vessels->width_mm, {1e-4, 1e6});
    surface.vessels->absorption = vessels->Vector("absorption", surface.vessels->absorption, {0, 50});
  }
  if (const auto coat = table.Optional("coat")) {
    CoatOptions options = ReadCoat(*coat);
    surface.coat.emplace(options);
    if (options.bounced_roughness) {
      options.roughness = *options.bounced_roughness;
      surface.bounced_coat.emplace(options);
    }
  }
  return surface;
}

float GradientNoise(uint64_t seed, const Vec3f& point) {
  return Noise(NoiseSeed(seed), point[0], point[1], point[2]);
}

Vec3f NoiseGradient(uint64_t seed, const Vec3f& point) {
  const uint32_t noise_seed = NoiseSeed(seed);
  const Vec3f floor = point.array().floor(), offset = point - floor;
  Vec3f weight, weight_slope;
  for (int d = 0; d < 3; ++d) {
    const float t = offset[d];
    weight[d] = Quintic(t);
    weight_slope[d] = 30 * t * t * (t - 1) * (t - 1);
  }
  Vec3f gradient = Vec3f::Zero();
  for (int corner = 0; corner < 8; ++corner) {
    const int at[3] = {corner & 1, corner >> 1 & 1, corner >> 2 & 1};
    const uint32_t hash = LatticeHash(noise_seed, static_cast<int>(floor[0]) + at[0],
                                      static_cast<int>(floor[1]) + at[1], static_cast<int>(floor[2]) + at[2]);
    // The lattice point's gradient is that of a linear function, read off at unit steps.
    const Vec3f slope(GradientDot(hash, 1, 0, 0), GradientDot(hash, 0, 1, 0), GradientDot(hash, 0, 0, 1));
    const float value = slope.dot(offset - Vec3f(float(at[0]), float(at[1]), float(at[2])));
    Vec3f share, share_slope;
    for (int d = 0; d < 3; ++d) {
      share[d] = at[d] ? weight[d] : 1 - weight[d];
      share_slope[d] = at[d] ? weight_slope[d] : -weight_slope[d];
    }
    gradient += share.prod() * slope + value * Vec3f(share_slope[0] * share[1] * share[2],
                                                     share[0] * share_slope[1] * share[2],
                                                     share[0] * share[1] * share_slope[2]);
  }
  return gradient;
}

Vec3f AlbedoAt(const Surface& surface, uint64_t seed, const Vec3f& place_mm) {
  const float place[3][1] = {{place_mm[0]}, {place_mm[1]}, {place_mm[2]}};
  float albedo[3][1];
  Albedos<1>(surface, seed, place, albedo);
  return {albedo[0][0], albedo[1][0], albedo[2][0]};
}

void AlbedoAt(const Surface& surface, uint64_t seed, const Lanes3& place_mm, Lanes3* albedo) {
  Albedos<Lanes3::kSize>(surface, seed, place_mm.c, albedo->c);
}

TangentFrame::TangentFrame(const Vec3f& normal) {
  const float sign = std::copysign(1.0f, normal[2]);
  const float a = -1 / (sign + normal[2]), b = normal[0] * normal[1] * a;
  tangent = Vec3f(1 + sign * normal[0] * normal[0] * a, sign * b, -sign * normal[0]);
  bitangent = Vec3f(b, sign + normal[1] * normal[1] * a, -normal[1]);
}

namespace lambert {

Vec3f Sample(const Vec3f& normal, const Vec2f& random) {
  // A point on the unit disc, lifted to the hemisphere (Malley).
  const float radius = std::sqrt(random[0]);
  const float angle = static_cast<float>(2 * kPi) * random[1];
  const float x = radius * std::cos(angle), y = radius * std::sin(angle);
  const float z = std::sqrt(std::max(0.0f, 1 - random[0]));
  const TangentFrame frame(normal);
  return x * frame.tangent + y * frame.bitangent + z * normal;
}

}  // namespace lambert
}  // namespace lumen
