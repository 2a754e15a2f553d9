#include "sim/imaging/subsurface.h"

#include <algorithm>
#include <cmath>
#include <limits>

namespace lumen {
namespace {

constexpr float kFar = 1e30f;
constexpr Range kCoefficients{0, 1000};

// Random numbers of a step.
enum : uint32_t { kChannel, kPath, kHeight, kAngle, kRoulette, kDoublingRoulette, kNumbersPerStep };

constexpr uint32_t kPatience = 1024, kMostSteps = 1u << 20;
// Below the first, walks survive with a probability that lifts them to the second: most have left by then.
constexpr float kLittle = 0.1f, kEnough = 0.5f;

// Shares of the carried light that are in the path's density: how likely each channel is drawn.
Vec3f Shares(const Vec3f& carried) { return carried / carried.sum(); }

Vec3f Attenuation(const Vec3f& extinction, float path_mm) {
  return {std::exp(-extinction[0] * path_mm), std::exp(-extinction[1] * path_mm),
          std::exp(-extinction[2] * path_mm)};
}

Vec3f EvenDirection(float first, float second) {
  const float z = 1 - 2 * first, radius = std::sqrt(std::max(0.0f, 1 - z * z));
  const float angle = static_cast<float>(2 * kPi) * second;
  return {radius * std::cos(angle), radius * std::sin(angle), z};
}

struct Place {
  Vec3f point, normal;  // normal by the right-hand rule
};

Place PlaceOf(const RayScene& wall, const RayHit& hit, float time) {
  const auto [a, b, c] = wall.Corners(hit.face, time);
  const Vec3d ab = b - a, ac = c - a;
  return {(a - wall.anchor() + double(hit.u) * ab + double(hit.v) * ac).cast<float>(),
          ab.cross(ac).normalized().cast<float>()};
}

// The wall, asked from inside the tissue.
struct Inside {
  const RayScene& wall;
  float time;
  float turn;  // ±1: what turns the faces' normals to the lumen

  Inside(const RayScene& scene, const WalkEntry& entry) : wall(scene), time(entry.time) {
    const auto [a, b, c] = wall.Corners(entry.face, time);
    turn = (b - a).cross(c - a).dot(entry.normal.cast<double>()) < 0 ? -1 : 1;
  }

  // Where a ray leaves the tissue. What it meets from the lumen's side is passed: rounding had put the ray's
  // origin, a place on the wall or beside it, before the wall.
  RayHit Leave(const Vec3f& origin, const Vec3f& direction, float tfar, Place* place, int64_t* rays) const {
    float tnear = 0;
    while (true) {
      const RayHit hit = wall.Intersect(origin, direction, tnear, tfar, time);
      ++*rays;
      if (!hit.hit()) return hit;
      *place = PlaceOf(wall, hit, time);
      place->normal *= turn;
      if (place->normal.dot(direction) > 0) return hit;
      // Beyond what rounds where distances are compared, or the ray would meet the same face for ever.
      tnear = hit.t * (1 + 0x1p-20f) + 0x1p-40f;
      if (!(tnear < tfar)) return {};
    }
  }
};

// Chandrasekhar's H for isotropic scattering as an integral (Stibbs and Weir 1959, "On the H-functions for
// isotropic scattering"), by the midpoint rule.
double ChandrasekharH(double albedo, double cosine) {
  constexpr int kSteps = 400;
  double sum = 0;
  for (int i = 0; i < kSteps; ++i) {
    const double angle = (i + 0.5) / kSteps * kPi / 2, across = cosine * std::sin(angle);
    sum += std::log(1 - albedo * angle / std::tan(angle)) /
           (std::cos(angle) * std::cos(angle) + across * across) / kSteps;
  }
  return std::exp(-cosine / 2 * sum);
}

}  // namespace

SubsurfaceOptions ReadSubsurface(const ConfigTable& table) {
  SubsurfaceOptions options;
  options.absorption_per_mm = table.Vector("absorption_per_mm", options.absorption_per_mm, kCoefficients);
  options.scattering_per_mm = table.Vector("scattering_per_mm", options.scattering_per_mm, kCoefficients);
  return options;
}

Subsurface::Subsurface(const SubsurfaceOptions& options)
    : scattering_(options.scattering_per_mm.cast<float>()),
      extinction_((options.absorption_per_mm + options.scattering_per_mm).cast<float>()) {}

Vec3f Subsurface::EvenReflectance() const {
  constexpr int kSteps = 50;
  Vec3f reflectance;
  for (int c = 0; c < 3; ++c) {
    const double albedo = extinction_[c] > 0 ? double(scattering_[c]) / extinction_[c] : 0;
    double moment = 0;
    for (int i = 0; i < kSteps; ++i) {
      const double cosine = (i + 0.5) / kSteps;
      moment += ChandrasekharH(albedo, cosine) * cosine / kSteps;
    }
    reflectance[c] = static_cast<float>(1 - 2 * std::sqrt(1 - albedo) * moment);
  }
  return reflectance;
}

float Subsurface::FreePath(const Vec3f& carried, float choice, float random) const {
  const float threshold = choice * carried.sum();
  // Adds up in the order of the sum; where choice · sum rounds up to it, the last that carries anything.
  int channel = 0;
  float below = 0;
  for (int c = 0; c < 3; ++c) {
    if (carried[c] == 0) continue;
    channel = c;
    below += carried[c];
    if (threshold < below) break;
  }
  return extinction_[channel] > 0 ? -std::log1p(-random) / extinction_[channel]
                                  : std::numeric_limits<float>::infinity();
}

void Subsurface::Scatter(float path_mm, Vec3f* carried) const {
  const Vec3f attenuation = Attenuation(extinction_, path_mm);
  const float density = Shares(*carried).cwiseProduct(extinction_).dot(attenuation);
  *carried = carried->cwiseProduct(scattering_).cwiseProduct(attenuation) / density;
}

void Subsurface::Cross(float path_mm, Vec3f* carried) const {
  const Vec3f attenuation = Attenuation(extinction_, path_mm);
  *carried = carried->cwiseProduct(attenuation) / Shares(*carried).dot(attenuation);
}

WalkExit Subsurface::Walk(const RayScene& wall, const WalkEntry& entry, const SampleStream& random,
                          int64_t* rays) const {
  constexpr WalkExit (*kLost)() = [] { return WalkExit{false, {}, {}, {}, Vec3f::Zero()}; };
  const Inside inside(wall, entry);
  Vec3f point = entry.point, direction = entry.direction;
  Vec3f carried(1, 1, 1);
  uint32_t next_halving = kPatience;
  for (uint32_t step = 0; step < kMostSteps; ++step) {
    const auto number = [&](uint32_t use) { return random.Uniform(step * kNumbersPerStep + use); };
    const float path = FreePath(carried, number(kChannel), number(kPath));
    Place place;
    const RayHit hit = inside.Leave(point, direction, std::min(path, kFar), &place, rays);
    if (hit.hit()) {
      Cross(hit.t, &carried);
      return {true, hit, place.point, place.normal, carried};
    }
    if (!(path < kFar)) return kLost();
    Scatter(path, &carried);
    const float most = carried.maxCoeff();
    if (most < kLittle) {
      const float survival = most / kEnough;
      if (!(number(kRoulette) < survival)) return kLost();
      carried /= survival;
    }
    if (step == next_halving) {
      if (number(kDoublingRoulette) < 0.5f) return kLost();
      carried *= 2;
      next_halving *= 2;
    }
    point += path * direction;
    direction = EvenDirection(number(kHeight), number(kAngle));
  }
  return kLost();
}

}  // namespace lumen
