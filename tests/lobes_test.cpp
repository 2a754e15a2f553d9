// Samplers against their densities, and lobes against energy's conservation, over all their parameters.
#include <gtest/gtest.h>

#include <cmath>
#include <functional>
#include <vector>

#include "common/random.h"
#include "sim/imaging/noise.h"
#include "sim/imaging/surface.h"

namespace lumen {
namespace {

Vec2f RandomPair(uint64_t seed, uint64_t i) {
  return {UniformFloat(RandomBits(seed, i, 0)), UniformFloat(RandomBits(seed, i, 1))};
}

// χ² of counts against what is expected of each cell, in standard deviations from its mean. Cells of which
// fewer than 10 are expected are taken together.
double ChiSquareDeviation(const std::vector<double>& found, const std::vector<double>& expected) {
  double sum = 0, rest_found = 0, rest_expected = 0;
  int cells = -1;  // the total is given
  const auto add = [&](double f, double e) {
    sum += (f - e) * (f - e) / e;
    ++cells;
  };
  for (size_t i = 0; i < found.size(); ++i) {
    if (expected[i] >= 10) {
      add(found[i], expected[i]);
    } else {
      rest_found += found[i];
      rest_expected += expected[i];
    }
  }
  if (rest_expected >= 5) add(rest_found, rest_expected);
  return (sum - cells) / std::sqrt(2.0 * cells);
}

// Visible normals of roughness α, seen along o, are those of α = 1 seen along the stretched o, squeezed back:
// slopes scale. There the distribution of normals is the same in all directions, and that of the visible ones
// 2 max(0, o·h)/(π (1 + cos o)). So one density tests every α, down to where cells of directions would need
// to be as fine as the lobe. `seen` draws, `tested` is what is expected.
double VisibleNormalDeviation(float alpha, float cosine, float tested_alpha) {
  constexpr int kHeights = 16, kTurns = 24, kCount = 60000, kFine = 16;
  const auto stretched = [&](const Vec3f& v, float by) {
    return Vec3d(by * v[0], by * v[1], v[2]).normalized();
  };
  const Vec3f out(std::sqrt(1 - cosine * cosine), 0, cosine);
  std::vector<double> found(kHeights * kTurns, 0), expected(kHeights * kTurns, 0);
  for (int i = 0; i < kCount; ++i) {
    const Vec3f half = ggx::SampleVisibleNormal(alpha, out, RandomPair(21, i));
    EXPECT_NEAR(half.norm(), 1, 1e-5);
    EXPECT_GE(half[2], 0);
    const Vec3d h = stretched(half, 1 / tested_alpha);
    const double turn = std::atan2(h.y(), h.x()) / (2 * kPi) + 0.5;
    ++found[std::min(int(h.z() * kHeights), kHeights - 1) * kTurns +
            std::min(int(turn * kTurns), kTurns - 1)];
  }
  const Vec3d o = stretched(out, tested_alpha);
  for (size_t cell = 0; cell < expected.size(); ++cell) {
    for (int k = 0; k < kFine * kFine; ++k) {
      const double z = (cell / kTurns + (k / kFine + 0.5) / kFine) / kHeights;
      const double turn = 2 * kPi * ((cell % kTurns + (k % kFine + 0.5) / kFine) / kTurns - 0.5);
      const double across = std::sqrt(1 - z * z);
      const double along = o.dot(Vec3d(across * std::cos(turn), across * std::sin(turn), z));
      expected[cell] += 2 * std::max(0.0, along) / (kPi * (1 + o.z())) * 2 * kPi / (kHeights * kTurns) /
                        (kFine * kFine) * kCount;
    }
  }
  return ChiSquareDeviation(found, expected);
}

TEST(Lobes, VisibleNormalsHaveTheirDensity) {
  for (const float alpha : {1e-3f, 0.04f, 0.3f, 1.0f}) {
    for (const float cosine : {0.02f, 0.3f, 0.8f, 1.0f}) {
      EXPECT_LT(VisibleNormalDeviation(alpha, cosine, alpha), 5) << alpha << ' ' << cosine;
    }
    // A lobe wider by a tenth would be noticed.
    EXPECT_GT(VisibleNormalDeviation(alpha, 0.8f, 1.1f * alpha), 10) << alpha;
  }
}

// Large counts of photons are drawn from the normal distribution: cells of like probability, whose borders
// are the error function's.
TEST(Lobes, NormalNumbersHaveTheirDensity) {
  constexpr int kCells = 100, kCount = 100000;
  const auto deviation = [](double spread) {
    std::vector<double> found(kCells, 0), expected(kCells, double(kCount) / kCells);
    for (int i = 0; i < kCount; ++i) {
      const double number = (PoissonNumber(1e12, RandomBits(22, i)) - 1e12) / 1e6 * spread;
      const double below = std::erfc(-number / std::sqrt(2.0)) / 2;
      ++found[std::min(int(below * kCells), kCells - 1)];
    }
    return ChiSquareDeviation(found, expected);
  };
  EXPECT_LT(deviation(1), 5);
  EXPECT_GT(deviation(1.05), 10);
}

struct Sweep {
  double most = 0;    // of what leaves over what came, less five standard errors
  double least = 10;  // the same and five of them, over places without relief
};

// A white wall under coats of every roughness, index and tilt of the relief, seen from everywhere: what is
// sampled, weighed by its density, never exceeds what came.
Sweep SweepCoats(float gained, int coats) {
  Sweep sweep;
  for (int coat_index = 0; coat_index < coats; ++coat_index) {
    const auto draw = [&](int use) { return UniformDouble(RandomBits(23, coat_index, use)); };
    const Coat coat({1 + 2 * draw(0), draw(1), 1, 0, std::nullopt});
    for (int view = 0; view < 6; ++view) {
      const auto turn = [&](int use) { return UniformDouble(RandomBits(24, coat_index, view * 8 + use)); };
      const double cosine = view == 0 ? 1e-3 : turn(0), tilt = view % 2 ? turn(1) : 0;
      const float sine = static_cast<float>(std::sqrt(1 - cosine * cosine));
      const double phi = 2 * kPi * turn(2);
      const Vec3f relief =
          Vec3d(std::sin(tilt) * std::cos(phi), std::sin(tilt) * std::sin(phi), std::cos(tilt)).cast<float>();
      CoatedPlace place{Vec3f::UnitZ(), Vec3f::Ones(), {sine, 0, static_cast<float>(cosine)}, relief, 0};
      place.reflectance = coat.Reflectance(place.outgoing.dot(relief));
      const int count = 2000;
      double sum = 0, squares = 0;
      for (int i = 0; i < count; ++i) {
        const Vec3f in = coat.Sample(place, RandomPair(25, i), UniformFloat(RandomBits(25, i, 2)));
        if (!(in.z() > 0)) continue;
        const CoatLobes lobes = coat.Eval(place, in);
        const double weight = gained * (lobes.base[0] + lobes.glint) / coat.Pdf(place, in);
        EXPECT_TRUE(std::isfinite(weight) && weight >= 0) << coat_index << ' ' << view;
        sum += weight / count;
        squares += weight * weight / count;
      }
      const double interval = 5 * std::sqrt(std::max(0.0, squares - sum * sum) / count);
      sweep.most = std::max(sweep.most, sum - interval);
      if (tilt == 0) sweep.least = std::min(sweep.least, sum + interval);
    }
  }
  return sweep;
}

// The slack is the reflectance table's own: some 1e-3 (Coat.ReflectanceIsTheLobesIntegral).
TEST(Lobes, NoRoughnessCreatesEnergy) {
  const Sweep sweep = SweepCoats(1, 24);
  EXPECT_LT(sweep.most, 1 + 2e-3);
  EXPECT_GT(sweep.least, 1 - 2e-3);
  EXPECT_GT(SweepCoats(1.02f, 4).most, 1 + 2e-3);  // two hundredths too much would be noticed
}

}  // namespace
}  // namespace lumen
