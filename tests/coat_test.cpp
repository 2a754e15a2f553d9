#include "sim/imaging/coat.h"

#include <gtest/gtest.h>

#include <cmath>
#include <functional>
#include <vector>

#include "common/error.h"
#include "common/random.h"
#include "sim/imaging/surface.h"

namespace lumen {
namespace {

Vec2f RandomPair(uint64_t seed, uint64_t i) {
  return {UniformFloat(RandomBits(seed, i, 0)), UniformFloat(RandomBits(seed, i, 1))};
}

// At an angle to z, turned about it.
Vec3f Direction(double cosine, double turn = 0) {
  const double sine = std::sqrt(1 - cosine * cosine);
  return Vec3d(sine * std::cos(turn), sine * std::sin(turn), cosine).cast<float>();
}

Coat Plain(double roughness, double ior = 1.37) { return Coat({ior, roughness, 1, 0}); }

CoatedPlace Place(const Coat& coat, const Vec3f& outgoing, const Vec3f& albedo = Vec3f::Ones(),
                  const Vec3f& coat_normal = Vec3f::UnitZ()) {
  return {Vec3f::UnitZ(), albedo, outgoing, coat_normal, coat.Reflectance(outgoing.dot(coat_normal))};
}

// ∫ of a function of direction over the sphere's part z > lowest, by the midpoint rule in z and the turn.
double OverSphere(const std::function<double(const Vec3f&)>& f, double lowest = 0, int steps = 400) {
  double sum = 0;
  for (int i = 0; i < steps; ++i) {
    const double z = lowest + (1 - lowest) * (i + 0.5) / steps;
    for (int j = 0; j < 2 * steps; ++j) sum += f(Direction(z, kPi * (j + 0.5) / steps));
  }
  return sum * (1 - lowest) * kPi / (double(steps) * steps);
}

TEST(Coat, FresnelMatchesWorkedNumbers) {
  // ((n − 1)/(n + 1))² at normal incidence, 1 at grazing, only the part across the plane at Brewster's angle:
  // there tan θ = n and r = (n² − 1)/(n² + 1).
  for (const double n : {1.33, 1.37, 1.5}) {
    EXPECT_NEAR(FresnelDielectric(float(n), 1), std::pow((n - 1) / (n + 1), 2), 1e-7);
    EXPECT_NEAR(FresnelDielectric(float(n), 0), 1, 1e-6);
    const double across = (n * n - 1) / (n * n + 1), cosine = 1 / std::sqrt(1 + n * n);
    EXPECT_NEAR(FresnelDielectric(float(n), float(cosine)), across * across / 2, 1e-6);
  }
  EXPECT_NEAR(FresnelDielectric(1.5f, 0.5f), 0.0891867, 1e-6);  // 60° on glass: (.17658 + .00179) / 2
}

// Normals of a microsurface project onto the plane that it stands on: ∫ D cos = 1.
TEST(Coat, DistributionIsNormalised) {
  for (const float alpha : {0.05f, 0.3f, 1.0f}) {
    // D is even in tan; the substitution tan² = α² u/(1 − u) makes the integrand constant where D is right.
    double sum = 0;
    const int steps = 1000;
    for (int i = 0; i < steps; ++i) {
      const double u = (i + 0.5) / steps, tan2 = alpha * alpha * u / (1 - u), cos2 = 1 / (1 + tan2);
      const double dtan2_du = alpha * alpha / ((1 - u) * (1 - u));
      // dω cos = π d(sin²) = π cos⁴ d(tan²)
      sum += ggx::Distribution(alpha, float(std::sqrt(cos2)), float(1 - cos2)) * kPi * cos2 * cos2 *
             dtan2_du / steps;
    }
    EXPECT_NEAR(sum, 1, 1e-5) << alpha;
  }
}

// Height-correlated masking in double: 1 / (1 + Λ(i) + Λ(o)), Λ = (√(1 + α² tan²) − 1)/2.
TEST(Coat, VisibilityIsSmithsHeightCorrelated) {
  for (const double alpha : {0.01, 0.2, 0.9}) {
    for (const double in : {0.05, 0.4, 1.0}) {
      for (const double out : {0.02, 0.7, 1.0}) {
        const auto lambda = [&](double c) {
          return (std::sqrt(1 + alpha * alpha * (1 - c * c) / (c * c)) - 1) / 2;
        };
        const double expected = 1 / (1 + lambda(in) + lambda(out)) / (4 * in * out);
        EXPECT_NEAR(ggx::Visibility(float(alpha), float(in), float(out)) / expected, 1, 1e-5);
      }
    }
  }
}

// The weak white furnace (Heitz 2014): without shadowing, and with Fresnel's reflectance at 1,
// everything comes back: the density of reflected directions integrates to 1 over the whole sphere. With
// shadowing, what is lost is what Visibility takes and what goes down.
TEST(Coat, WeakWhiteFurnaceIsOne) {
  for (const float alpha : {0.2f, 0.5f, 1.0f}) {
    for (const double cosine : {0.1, 0.5, 0.95}) {
      const Vec3f out = Direction(cosine);
      const auto density = [&](const Vec3f& in) {
        const Vec3f half = (in + out).normalized();
        const float d = ggx::Distribution(alpha, half.z(), 1 - half.z() * half.z());
        return double(ggx::ReflectedPdf(alpha, d, out.z()));
      };
      const auto lobe = [&](const Vec3f& in) {
        const Vec3f half = (in + out).normalized();
        const float d = ggx::Distribution(alpha, half.z(), 1 - half.z() * half.z());
        return in.z() <= 0 ? 0.0 : double(d * ggx::Visibility(alpha, in.z(), out.z()) * in.z());
      };
      EXPECT_NEAR(OverSphere(density, -1), 1, 2e-3) << alpha << ' ' << cosine;
      const double energy = OverSphere(lobe);
      EXPECT_LT(energy, 1) << alpha << ' ' << cosine;
      // At α = 1 the distribution is 1/π everywhere and Visibility 1/(2 (i·s + o·s)): single scattering sends
      // back ∫ i/(i + o) di.
      if (alpha == 1) {
        EXPECT_NEAR(energy, 1 - cosine * std::log(1 + 1 / cosine), 1e-4);
      }
    }
  }
}

TEST(Coat, ReflectanceIsTheLobesIntegral) {
  for (const double roughness : {0.45, 0.7, 1.0}) {
    const Coat coat = Plain(roughness);
    double mean = 0;
    for (const double cosine : {0.05, 0.3, 0.77, 1.0}) {
      const CoatedPlace place = Place(coat, Direction(cosine));
      const double integral = OverSphere([&](const Vec3f& in) { return double(coat.Eval(place, in).glint); });
      // The horizon cuts some 64 of the table's 64 × 64 cells: at most half of their part is at stake.
      EXPECT_NEAR(coat.Reflectance(float(cosine)), integral, integral / 128 + 1e-4)
          << roughness << ' ' << cosine;
    }
    const int steps = 1000;
    for (int i = 0; i < steps; ++i) {
      const double c = (i + 0.5) / steps;
      mean += 2 * c * coat.Reflectance(float(c)) / steps;
    }
    EXPECT_NEAR(coat.mean_reflectance(), mean, 1e-5);
  }
  // A mirror's reflectance is Fresnel's.
  for (const float cosine : {0.2f, 0.6f, 1.0f}) {
    EXPECT_NEAR(Plain(0).Reflectance(cosine), FresnelDielectric(1.37f, cosine), 5e-4);
  }
}

// White wall, no relief: all that comes goes. Coloured wall: the coat's part, and of the rest the albedo.
// The tolerance is the midpoint rule's.
TEST(Coat, WhiteFurnaceGivesBackEverything) {
  for (const double roughness : {0.4, 0.7, 1.0}) {
    const Coat coat = Plain(roughness);
    for (const double cosine : {0.05, 0.4, 0.9}) {
      const CoatedPlace white = Place(coat, Direction(cosine));
      const CoatedPlace red = Place(coat, Direction(cosine), {0.8f, 0.3f, 0});
      const auto sum = [&](const CoatedPlace& place, int channel) {
        return OverSphere([&](const Vec3f& in) {
          const CoatLobes lobes = coat.Eval(place, in);
          return double(lobes.base[channel] + lobes.glint);
        });
      };
      EXPECT_NEAR(sum(white, 0), 1, 1e-3) << roughness << ' ' << cosine;
      for (int c = 0; c < 3; ++c) {
        EXPECT_NEAR(sum(red, c), red.reflectance + (1 - red.reflectance) * red.albedo[c], 1e-3);
      }
    }
  }
}

// Any roughness, down to the least, any tilt of the relief: sampled, what leaves never exceeds what came, to
// five standard errors.
TEST(Coat, NeverCreatesEnergy) {
  for (const double roughness : {0.0, 0.05, 0.2, 0.5, 1.0}) {
    const Coat coat = Plain(roughness);
    for (const double tilt : {0.0, 0.3, 0.8}) {
      for (const double cosine : {0.02, 0.3, 0.7, 1.0}) {
        for (const double turn : {0.0, kPi / 2, kPi}) {
          const CoatedPlace place =
              Place(coat, Direction(cosine), Vec3f::Ones(), Direction(std::cos(tilt), turn));
          const int count = 4000;
          double sum = 0, squares = 0;
          for (int i = 0; i < count; ++i) {
            const float choice = UniformFloat(RandomBits(3, i, 2));
            const Vec3f in = coat.Sample(place, RandomPair(3, i), choice);
            if (!(in.z() > 0)) continue;
            const CoatLobes lobes = coat.Eval(place, in);
            const double weight = (lobes.base[0] + lobes.glint) / coat.Pdf(place, in);
            ASSERT_TRUE(std::isfinite(weight) && weight >= 0) << roughness << ' ' << tilt << ' ' << cosine;
            sum += weight / count;
            squares += weight * weight / count;
          }
          const double error = std::sqrt(std::max(0.0, squares - sum * sum) / count);
          EXPECT_LT(sum, 1 + 5 * error + 1e-3) << roughness << ' ' << tilt << ' ' << cosine << ' ' << turn;
          if (tilt == 0) {
            EXPECT_GT(sum, 1 - 5 * error - 2e-3) << roughness << ' ' << cosine;
          }
        }
      }
    }
  }
}

TEST(Coat, IsReciprocal) {
  const Coat coat = Plain(0.4);
  const Vec3f tilted = Direction(std::cos(0.2), 1);
  for (int i = 0; i < 1000; ++i) {
    const Vec2f a = RandomPair(5, i), b = RandomPair(6, i);
    const Vec3f in = Direction(0.02 + 0.97 * a[0], 2 * kPi * a[1]);
    const Vec3f out = Direction(0.02 + 0.97 * b[0], 2 * kPi * b[1]);
    const Vec3f albedo(0.8f, 0.4f, 0.2f);
    const CoatLobes there = coat.Eval(Place(coat, out, albedo, tilted), in);
    const CoatLobes back = coat.Eval(Place(coat, in, albedo, tilted), out);
    // Eval holds the cosine, which is to the wall's normal for the base and to the relief's for the glint.
    EXPECT_NEAR(there.base[1] / in.z(), back.base[1] / out.z(), 1e-5 * there.base[1] / in.z());
    const double glint = there.glint / in.dot(tilted), glint_back = back.glint / out.dot(tilted);
    EXPECT_NEAR(glint, glint_back, 1e-4 * std::abs(glint) + 1e-6);
  }
}

// χ² of sampled directions against Pdf, integrated over cells of (z, turn) by 12 × 12 midpoints; z > −1 since
// the coat's part may go down. Cells that expect fewer than 10 are taken together.
double ChiSquareDeviation(const Coat& sampled, const Coat& tested, const CoatedPlace& place) {
  const int zs = 24, turns = 24, count = 60000, fine = 12;
  std::vector<double> found(zs * turns, 0);
  for (int i = 0; i < count; ++i) {
    const Vec3f in = sampled.Sample(place, RandomPair(7, i), UniformFloat(RandomBits(7, i, 2)));
    EXPECT_NEAR(in.norm(), 1, 1e-5);
    const double turn = std::atan2(in.y(), in.x()) / (2 * kPi) + 0.5;
    ++found[std::clamp(int((in.z() + 1) / 2 * zs), 0, zs - 1) * turns +
            std::clamp(int(turn * turns), 0, turns - 1)];
  }
  double sum = 0, rest_found = 0, rest_expected = 0;
  int cells = 0;
  for (int cell = 0; cell < zs * turns; ++cell) {
    double expected = 0;
    for (int k = 0; k < fine * fine; ++k) {
      const double z = -1 + 2 * (cell / turns + (k / fine + 0.5) / fine) / zs;
      const double turn = 2 * kPi * ((cell % turns + (k % fine + 0.5) / fine) / turns - 0.5);
      expected += tested.Pdf(place, Direction(z, turn)) * 4 * kPi / (zs * turns * fine * fine);
    }
    expected *= count;
    if (expected < 10) {
      rest_expected += expected;
      rest_found += found[cell];
      continue;
    }
    sum += (found[cell] - expected) * (found[cell] - expected) / expected;
    ++cells;
  }
  if (rest_expected > 5) {
    sum += (rest_found - rest_expected) * (rest_found - rest_expected) / rest_expected;
    ++cells;
  }
  return (sum - cells) / std::sqrt(2.0 * cells);
}

TEST(Coat, IsSampledWithItsDensity) {
  // A high index: half of the samples are the coat's.
  for (const double roughness : {0.5, 0.7, 1.0}) {
    const Coat coat = Plain(roughness, 3), other = Plain(1.15 * roughness + 0.05, 3);
    for (const double cosine : {0.15, 0.6, 0.99}) {
      const Vec3f tilted = Direction(std::cos(0.15), 2);
      const CoatedPlace place = Place(coat, Direction(cosine, 0.5), Vec3f::Constant(0.3f), tilted);
      EXPECT_LT(ChiSquareDeviation(coat, coat, place), 5) << roughness << ' ' << cosine;
      EXPECT_GT(ChiSquareDeviation(coat, other, place), 10) << roughness << ' ' << cosine;
    }
  }
}

// The relief's normal against finite differences of its height, in double precision of the differences only.
TEST(Coat, ReliefFollowsItsHeight) {
  const CoatOptions options{1.37, 0.2, 0.5, 0.04};
  const Coat coat(options);
  const uint64_t seed = 9;
  const auto height = [&](const Vec3f& place) {
    const Vec3f p = place / float(options.relief_mm);
    return options.relief_height_mm *
           (GradientNoise(seed + kReliefSeeds, p) + 0.5 * GradientNoise(seed + kReliefSeeds + 1, 2 * p)) /
           1.5;
  };
  double tilts = 0;
  const float step = 2e-3f;
  for (int i = 0; i < 300; ++i) {
    const Vec2f a = RandomPair(10, i), b = RandomPair(11, i);
    const Vec3f place(8 * a[0] - 4, 8 * a[1] - 4, 8 * b[0] - 4), smooth = Direction(2 * b[1] - 1, 7 * a[0]);
    Vec3d slope;
    for (int d = 0; d < 3; ++d) {
      const Vec3f along = step * Vec3f::Unit(d);
      slope[d] = (height(place + along) - height(place - along)) / (2 * step);
    }
    const Vec3d n = smooth.cast<double>(), expected = (n - slope + slope.dot(n) * n).normalized();
    const Vec3d found = coat.ReliefNormal(seed, Broadcast(place), Broadcast(smooth))[3].cast<double>();
    EXPECT_LT((found - expected).norm(), 2e-3) << i;
    tilts += found.cross(n).norm() / 300;
  }
  EXPECT_GT(tilts, 0.02);
  const Coat flat({1.37, 0.2, 0.5, 0});
  EXPECT_EQ(flat.ReliefNormal(seed, Broadcast(Vec3f(1, 2, 3)), Broadcast(Vec3f::UnitX()))[0], Vec3f::UnitX());
}

// Lanes against one place at a time; the glint's own sampling against its lobe over its density.
TEST(Coat, LanesAndGlintsAreTheLobes) {
  for (const double roughness : {0.05, 0.3, 1.0}) {
    const Coat coat({1.37, roughness, 0.5, 0.05});
    CoatedLanes places;
    Lanes3 incoming;
    int glints = 0;
    for (int i = 0; i < 200; ++i) {
      for (int lane = 0; lane < kLanes; ++lane) {
        const Vec2f a = RandomPair(20, i * kLanes + lane), b = RandomPair(21, i * kLanes + lane);
        const Vec3f out = Direction(a[0], 6 * a[1]);
        const Vec3f mirror(-out[0], -out[1], out[2]);
        places.normal.Set(lane, Vec3f::UnitZ());
        places.albedo.Set(lane, {0.8f, 0.4f, 0.3f});
        places.outgoing.Set(lane, out);
        places.coat_normal.Set(lane, Direction(1 - 0.05 * b[0], 6 * b[1]));
        incoming.Set(lane, (mirror + 0.3f * Direction(2 * b[1] - 1, 6 * b[0])).normalized());
        places.reflectance[lane] = coat.Reflectance(places.coat_normal[lane].dot(out));
      }
      const CoatLobesLanes lobes = coat.Eval(places, incoming);
      const Lanes densities = coat.Pdf(places, incoming);
      for (int lane = 0; lane < kLanes; ++lane) {
        const CoatLobes expected = coat.Eval(places[lane], incoming[lane]);
        EXPECT_LT((lobes.base[lane] - expected.base).norm(), 1e-5f * (1 + expected.base.norm()));
        EXPECT_NEAR(lobes.glint[lane], expected.glint, 1e-3f * expected.glint + 1e-6f);
        const float density_there = coat.Pdf(places[lane], incoming[lane]);
        EXPECT_NEAR(densities[lane], density_there, 1e-3f * density_there + 1e-6f);
        const Coat::Glint glint = coat.SampleGlint(places[lane], RandomPair(22, i * kLanes + lane));
        EXPECT_LE(glint.weight, 1);
        if (glint.weight == 0) continue;
        // Pdf of the glint alone: its share is what the mixture's density has beyond the wall's.
        const CoatLobes sampled = coat.Eval(places[lane], glint.incoming);
        const Vec3f half = (glint.incoming + places.outgoing[lane]).normalized();
        const Vec3f& s = places.coat_normal[lane];
        const float density = ggx::ReflectedPdf(
            coat.alpha(), ggx::Distribution(coat.alpha(), half.dot(s), half.cross(s).squaredNorm()),
            places.outgoing[lane].dot(s));
        EXPECT_NEAR(sampled.glint / density, glint.weight, 2e-3f * glint.weight);
        ++glints;
      }
    }
    EXPECT_GT(glints, 1000) << roughness;
  }
}

// Roughness 0 with the light in the mirror direction, the worst there is: the documented least α.
TEST(Coat, MirrorStaysFinite) {
  const Coat mirror = Plain(0), least = Plain(std::sqrt(1e-3));
  EXPECT_FLOAT_EQ(mirror.alpha(), 1e-3f);
  EXPECT_FLOAT_EQ(Plain(0.1).alpha(), 0.01f);
  for (const double cosine : {1.0, 0.999999, 0.5, 1e-4, 1e-7, 0.0}) {
    for (const double turn : {0.0, kPi}) {
      const Vec3f out = Direction(cosine), in = Direction(cosine, turn);
      const CoatLobes lobes = mirror.Eval(Place(mirror, out), in), same = least.Eval(Place(least, out), in);
      EXPECT_TRUE(std::isfinite(lobes.glint) && lobes.glint >= 0) << cosine;
      EXPECT_FLOAT_EQ(lobes.glint, same.glint);
      EXPECT_TRUE(std::isfinite(mirror.Pdf(Place(mirror, out), in)));
    }
  }
  // F0 / (4 π α²) at the peak.
  EXPECT_NEAR(mirror.Eval(Place(mirror, Vec3f::UnitZ()), Vec3f::UnitZ()).glint,
              std::pow(0.37 / 2.37, 2) / (4 * kPi * 1e-6), 10);
}

TEST(Coat, ReadsItsTable) {
  const auto read = [](const std::string& text) {
    const Config config = Config::Parse(text, "scene.toml");
    const Surface surface = ReadSurface(config.root(), {}, 0);
    config.RejectUnknown();
    return surface;
  };
  EXPECT_FALSE(read("").coat);
  EXPECT_FLOAT_EQ(read("[coat]").coat->alpha(), 0.04f);
  EXPECT_FLOAT_EQ(read("[coat]\nroughness = 0.5").coat->alpha(), 0.25f);
  for (const char* text : {"[coat]\nior = 0.9", "[coat]\nroughness = 1.1", "[coat]\nrelief_mm = 0",
                           "[coat]\nrelief_height_mm = -1", "[coat]\nthickness_mm = 1"}) {
    EXPECT_THROW(read(text), InputError) << text;
  }
}

}  // namespace
}  // namespace lumen
