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

// The noise's maximum is 1.04.
float Cut(float noise) { return std::clamp(noise, -1.0f, 1.0f); }

// A lattice point's gradients by the low four bits of its hash: components are ±1 or 0.
const Lanes3 kSlopes = [] {
  Lanes3 slopes;
  // A gradient is that of a linear function, read off at unit steps.
  for (uint32_t hash = 0; hash < kLanes; ++hash) {
    slopes.Set(static_cast<int>(hash),
               {GradientDot(hash, 1, 0, 0), GradientDot(hash, 0, 1, 0), GradientDot(hash, 0, 0, 1)});
  }
  return slopes;
}();

Lanes3 SlopesOf(const LanesU& hash) {
  const LanesI entry = (LanesI)(hash & (kLanes - 1));
  return {__builtin_shuffle(kSlopes.x, entry), __builtin_shuffle(kSlopes.y, entry),
          __builtin_shuffle(kSlopes.z, entry)};
}

Lanes Quintic(const Lanes& t) { return t * t * t * (t * (t * 6.0f - 15.0f) + 10.0f); }
Lanes Lerp(const Lanes& a, const Lanes& b, const Lanes& t) { return a + t * (b - a); }

LanesU LatticeHash(uint32_t seed, const LanesI& x, const LanesI& y, const LanesI& z) {
  LanesU h = seed + (LanesU)x * 0x8da6b343u + (LanesU)y * 0xd8163841u + (LanesU)z * 0xcb1ab31fu;
  h = (h ^ (h >> 16)) * 0x85ebca6bu;
  h = (h ^ (h >> 13)) * 0xc2b2ae35u;
  return h ^ (h >> 16);
}

// Where points lie in the noise's lattice: their cells, and where in them.
struct Cells {
  explicit Cells(const Lanes3& point) : x(FloorInt(point.x)), y(FloorInt(point.y)), z(FloorInt(point.z)) {
    offset = {point.x - ToFloat(x), point.y - ToFloat(y), point.z - ToFloat(z)};
    one = !Any((x ^ x[0]) | (y ^ y[0]) | (z ^ z[0]));
  }
  Lanes3 Offset(int corner) const {
    return {offset.x - static_cast<float>(corner & 1), offset.y - static_cast<float>(corner >> 1 & 1),
            offset.z - static_cast<float>(corner >> 2)};
  }

  LanesI x, y, z;
  Lanes3 offset;
  bool one;
};

// Gradients of the eight corners of each lane's cell: corner i lies (i & 1, i >> 1 & 1, i >> 2) on from the
// lowest.
class ManyCells {
 public:
  ManyCells(uint32_t seed, const Cells& cells) : seed_(seed), cells_(cells) {}
  Lanes3 operator[](int corner) const {
    return SlopesOf(
        LatticeHash(seed_, cells_.x + (corner & 1), cells_.y + (corner >> 1 & 1), cells_.z + (corner >> 2)));
  }

 private:
  const uint32_t seed_;
  const Cells& cells_;
};

// The same where all lanes lie in one cell, as those of one pixel's rays mostly do: its corners are looked up
// at once, a lane for each.
class OneCell {
 public:
  OneCell(uint32_t seed, const Cells& cells) {
    constexpr LanesI kCorner = {0, 1, 2, 3, 4, 5, 6, 7};
    Store3(SlopesOf(LatticeHash(seed, cells.x[0] + (kCorner & 1), cells.y[0] + (kCorner >> 1 & 1),
                                cells.z[0] + (kCorner >> 2))),
           slopes_);
  }
  Lanes3 operator[](int corner) const {
    return {Broadcast(slopes_[0][corner]), Broadcast(slopes_[1][corner]), Broadcast(slopes_[2][corner])};
  }

 private:
  alignas(64) float slopes_[3][kLanes];
};

template <class Slopes>
Lanes NoiseIn(const Cells& cells, const Slopes& slopes) {
  Lanes corners[8];
  for (int i = 0; i < 8; ++i) corners[i] = Dot(slopes[i], cells.Offset(i));
  const Lanes u = Quintic(cells.offset.x), v = Quintic(cells.offset.y), w = Quintic(cells.offset.z);
  const Lanes low = Lerp(Lerp(corners[0], corners[1], u), Lerp(corners[2], corners[3], u), v);
  const Lanes high = Lerp(Lerp(corners[4], corners[5], u), Lerp(corners[6], corners[7], u), v);
  return Min(Max(Lerp(low, high, w), Broadcast(-1)), Broadcast(1));
}

Lanes Noise(uint32_t seed, const Lanes3& point) {
  const Cells cells(point);
  return cells.one ? NoiseIn(cells, OneCell(seed, cells)) : NoiseIn(cells, ManyCells(seed, cells));
}

template <class Slopes>
Lanes3 NoiseGradientIn(const Cells& cells, const Slopes& corner_slopes) {
  const Lanes3& t = cells.offset;
  const auto slope_of_quintic = [](const Lanes& t) { return 30.0f * t * t * (t - 1.0f) * (t - 1.0f); };
  const Lanes3 weight = {Quintic(t.x), Quintic(t.y), Quintic(t.z)};
  const Lanes3 steepness = {slope_of_quintic(t.x), slope_of_quintic(t.y), slope_of_quintic(t.z)};
  Lanes3 gradient{};
  for (int i = 0; i < 8; ++i) {
    const int dx = i & 1, dy = i >> 1 & 1, dz = i >> 2;
    const Lanes3 slopes = corner_slopes[i];
    const Lanes value = Dot(slopes, cells.Offset(i));
    const Lanes3 share = {dx ? weight.x : 1.0f - weight.x, dy ? weight.y : 1.0f - weight.y,
                          dz ? weight.z : 1.0f - weight.z};
    const Lanes3 growth = {dx ? steepness.x : -steepness.x, dy ? steepness.y : -steepness.y,
                           dz ? steepness.z : -steepness.z};
    gradient =
        gradient + slopes * (share.x * share.y * share.z) +
        Lanes3{growth.x * share.y * share.z, share.x * growth.y * share.z, share.x * share.y * growth.z} *
            value;
  }
  return gradient;
}

// Two octaves, scaled to stay within ±1: the noise in clouds.
Lanes Clouds(uint64_t seed, float scale_mm, const Lanes3& place) {
  const Lanes3 scaled = place * Broadcast(1 / scale_mm);
  return (Noise(NoiseSeed(seed), scaled) + 0.5f * Noise(NoiseSeed(seed + 1), scaled * Broadcast(2))) / 1.5f;
}

}  // namespace

Surface ReadSurface(const ConfigTable& table, const Mesh& wall, uint64_t vessel_seed) {
  Surface surface;
  surface.albedo = table.Vector("albedo", surface.albedo, kFraction);
  if (const auto mottling = table.Optional("mottling")) {
    surface.mottling.emplace();
    surface.mottling->contrast = mottling->Number("contrast", surface.mottling->contrast, {0, 3});
    surface.mottling->scale_mm = mottling->Number("scale_mm", surface.mottling->scale_mm, {1e-3, 1e6});
  }
  if (const auto vessels = table.Optional("vessels")) {
    surface.vessels.emplace(ReadVessels(*vessels, wall, vessel_seed));
  }
  if (const auto subsurface = table.Optional("subsurface")) {
    surface.subsurface.emplace(ReadSubsurface(*subsurface));
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
  const uint32_t noise_seed = NoiseSeed(seed);
  const Vec3f floor = point.array().floor(), f = point - floor;
  const int x = static_cast<int>(floor[0]), y = static_cast<int>(floor[1]), z = static_cast<int>(floor[2]);
  const auto corner = [&](int dx, int dy, int dz) {
    return GradientDot(LatticeHash(noise_seed, x + dx, y + dy, z + dz), f[0] - static_cast<float>(dx),
                       f[1] - static_cast<float>(dy), f[2] - static_cast<float>(dz));
  };
  const float u = Quintic(f[0]), v = Quintic(f[1]), w = Quintic(f[2]);
  const float low =
      Lerp(Lerp(corner(0, 0, 0), corner(1, 0, 0), u), Lerp(corner(0, 1, 0), corner(1, 1, 0), u), v);
  const float high =
      Lerp(Lerp(corner(0, 0, 1), corner(1, 0, 1), u), Lerp(corner(0, 1, 1), corner(1, 1, 1), u), v);
  return Cut(Lerp(low, high, w));
}

Lanes GradientNoise(uint64_t seed, const Lanes3& points) { return Noise(NoiseSeed(seed), points); }

Lanes3 NoiseGradient(uint64_t seed, const Lanes3& points) {
  const uint32_t noise_seed = NoiseSeed(seed);
  const Cells cells(points);
  return cells.one ? NoiseGradientIn(cells, OneCell(noise_seed, cells))
                   : NoiseGradientIn(cells, ManyCells(noise_seed, cells));
}

Lanes3 AlbedoAt(const Surface& surface, uint64_t seed, const Lanes3& places_mm) {
  Lanes3 albedo = Broadcast(Vec3f(surface.albedo.cast<float>()));
  if (surface.mottling) {
    const float contrast = static_cast<float>(surface.mottling->contrast);
    albedo = albedo * Exp(contrast * Clouds(seed, static_cast<float>(surface.mottling->scale_mm), places_mm));
  }
  if (surface.vessels) {
    const Lanes blood = surface.vessels->BloodAt(places_mm);
    if (Any(blood > 0.0f)) {
      const Vec3f absorption = surface.vessels->options().absorption.cast<float>();
      albedo.x *= Exp(-absorption[0] * blood);
      albedo.y *= Exp(-absorption[1] * blood);
      albedo.z *= Exp(-absorption[2] * blood);
    }
  }
  const Lanes one = Broadcast(1);
  return {Min(albedo.x, one), Min(albedo.y, one), Min(albedo.z, one)};
}

Vec3f AlbedoAt(const Surface& surface, uint64_t seed, const Vec3f& place_mm) {
  return AlbedoAt(surface, seed, Broadcast(place_mm))[0];
}

Vec3f PalestAlbedo(const Surface& surface) {
  const double lift = surface.mottling ? std::exp(surface.mottling->contrast) : 1;
  return (surface.albedo * lift).cwiseMin(1).cast<float>();
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
