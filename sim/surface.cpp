#include "sim/surface.h"

#include <algorithm>
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

// One of Perlin's twelve gradients, from the middle of a cube to its edges, times the offset.
float GradientDot(uint32_t hash, float x, float y, float z) {
  const uint32_t h = hash & 15;
  const float u = h < 8 ? x : y;
  const float v = h < 4 ? y : h == 12 || h == 14 ? x : z;
  return (h & 1 ? -u : u) + (h & 2 ? -v : v);
}

float Quintic(float t) { return t * t * t * (t * (t * 6 - 15) + 10); }

float Lerp(float a, float b, float t) { return a + t * (b - a); }

// Two octaves, scaled to stay within ±1.
float Clouds(uint64_t seed, const Vec3f& point) {
  return (GradientNoise(seed, point) + 0.5f * GradientNoise(seed + 1, 2 * point)) / 1.5f;
}

// 1 on the middle of a vessel, 0 beyond its width. The noise field is bent by another one, so that vessels wind; near
// its zero it changes by about one a lattice step, which turns its value into a distance.
float VesselAt(const Vessels& vessels, uint64_t seed, const Vec3f& place) {
  const Vec3f p = place / static_cast<float>(vessels.spacing_mm);
  const float bend = 0.35f * GradientNoise(seed + 3, 2 * p);
  const float field = GradientNoise(seed + 2, p + Vec3f(bend, -bend, bend));
  const float distance = std::abs(field) * static_cast<float>(vessels.spacing_mm / vessels.width_mm);
  return distance < 1 ? Quintic(1 - distance) : 0.0f;
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
  return surface;
}

float GradientNoise(uint64_t seed, const Vec3f& point) {
  const Vec3f floor(std::floor(point[0]), std::floor(point[1]), std::floor(point[2]));
  const Vec3f f = point - floor;
  const int x = static_cast<int>(floor[0]), y = static_cast<int>(floor[1]), z = static_cast<int>(floor[2]);
  const uint32_t s = static_cast<uint32_t>(Mix64(seed));
  float corner[8];
  for (int c = 0; c < 8; ++c) {
    const int dx = c & 1, dy = (c >> 1) & 1, dz = c >> 2;
    corner[c] = GradientDot(LatticeHash(s, x + dx, y + dy, z + dz), f[0] - static_cast<float>(dx),
                            f[1] - static_cast<float>(dy), f[2] - static_cast<float>(dz));
  }
  const float u = Quintic(f[0]), v = Quintic(f[1]), w = Quintic(f[2]);
  const float low = Lerp(Lerp(corner[0], corner[1], u), Lerp(corner[2], corner[3], u), v);
  const float high = Lerp(Lerp(corner[4], corner[5], u), Lerp(corner[6], corner[7], u), v);
  return std::clamp(Lerp(low, high, w), -1.0f, 1.0f);  // its maximum is 1.04
}

Vec3f AlbedoAt(const Surface& surface, uint64_t seed, const Vec3f& place_mm) {
  Vec3f albedo = surface.albedo.cast<float>();
  if (surface.mottling) {
    const Mottling& mottling = *surface.mottling;
    const float noise = Clouds(seed, place_mm / static_cast<float>(mottling.scale_mm));
    albedo *= std::exp(static_cast<float>(mottling.contrast) * noise);
  }
  if (surface.vessels) {
    const float inside = VesselAt(*surface.vessels, seed, place_mm);
    if (inside > 0) albedo = albedo.array() * (-inside * surface.vessels->absorption.cast<float>().array()).exp();
  }
  return albedo.cwiseMin(1.0f);
}

namespace lambert {

Vec3f Sample(const Vec3f& normal, const Vec2f& random) {
  // A point on the unit disc, lifted to the hemisphere (Malley), in a frame about the normal (Duff et al. 2017,
  // "Building an orthonormal basis, revisited").
  const float radius = std::sqrt(random[0]);
  const float angle = static_cast<float>(2 * kPi) * random[1];
  const float x = radius * std::cos(angle), y = radius * std::sin(angle);
  const float z = std::sqrt(std::max(0.0f, 1 - random[0]));
  const float sign = std::copysign(1.0f, normal[2]);
  const float a = -1 / (sign + normal[2]), b = normal[0] * normal[1] * a;
  const Vec3f tangent(1 + sign * normal[0] * normal[0] * a, sign * b, -sign * normal[0]);
  const Vec3f bitangent(b, sign + normal[1] * normal[1] * a, -normal[1]);
  return x * tangent + y * bitangent + z * normal;
}

}  // namespace lambert
}  // namespace lumen
