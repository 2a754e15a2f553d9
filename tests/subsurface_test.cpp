// The random walk of subsurface scattering, against Chandrasekhar's closed form, a plain walk in double, and
// media in which the answer is known.
#include "sim/imaging/subsurface.h"

#include <gtest/gtest.h>

#include <cmath>
#include <functional>
#include <limits>
#include <optional>
#include <vector>

#include "common/parallel.h"
#include "sim/imaging/surface.h"
#include "tests/support.h"
#include "tests/tissue_means.h"

namespace lumen {
namespace {

using test::AddSquare;
using test::ExpectAgree;
using test::ExpectMean;
using test::kBound;
using test::Mean;
using test::WithAlbedos;

// Tissue below z = 0. Walks of the tests are a hundredth of its width at most.
Mesh HalfSpace() {
  Mesh mesh;
  AddSquare(2000, 0, true, &mesh);
  return mesh;
}

// Normals outward: tissue is inside. Or inward: a cavity in tissue.
Mesh Sphere(double radius_mm, int rings, bool outward) {
  Mesh mesh;
  for (int i = 0; i <= rings; ++i) {
    for (int j = 0; j < 2 * rings; ++j) {
      const double polar = kPi * i / rings, turn = kPi * j / rings;
      mesh.vertices.push_back(radius_mm * Vec3d(std::sin(polar) * std::cos(turn),
                                                std::sin(polar) * std::sin(turn), std::cos(polar)));
    }
  }
  const auto add = [&](int a, int b, int c) {
    mesh.faces.push_back(outward ? Vec3i(a, b, c) : Vec3i(a, c, b));
  };
  for (int i = 0; i < rings; ++i) {
    for (int j = 0; j < 2 * rings; ++j) {
      const int a = i * 2 * rings + j, b = i * 2 * rings + (j + 1) % (2 * rings);
      add(a, a + 2 * rings, b);
      add(b, a + 2 * rings, b + 2 * rings);
    }
  }
  return mesh;
}

// A wall, and a place on it where light comes in.
struct Stage {
  Mesh mesh;
  RayScene wall{mesh};
  WalkEntry place;

  Stage(const Mesh& walls, const Vec3f& above, const Vec3f& down) : mesh(walls) {
    const RayHit hit = wall.Intersect(above, down, 0, 1e9f);
    Vec3f normal = FaceNormal(mesh, int(hit.face)).cast<float>();
    place = {hit.face, above + hit.t * down, normal, -normal};
  }
  static Stage OnHalfSpace() { return {HalfSpace(), {0.3f, 0.1f, 1}, -Vec3f::UnitZ()}; }

  SampleStream Stream(int i, uint64_t seed = 1) const { return {seed, 7, uint64_t(i)}; }
  WalkEntry Diffuse(int i, uint64_t seed = 1) const {
    WalkEntry entry = place;
    const SampleStream other(seed + 1000, 8, uint64_t(i));
    entry.direction = lambert::Sample(-place.normal, Vec2f(other.Uniform(0), other.Uniform(1)));
    return entry;
  }
};

// Tissue between two planes, which the lumen is on both sides of.
Stage OnFold(double thickness_mm) {
  Mesh mesh;
  AddSquare(2000, 0, true, &mesh);
  AddSquare(2000, -thickness_mm, false, &mesh);
  return {mesh, {0.3f, 0.1f, float(thickness_mm)}, -Vec3f::UnitZ()};
}

using Visit = std::function<void(const WalkExit&)>;

void WalkDiffusely(const Stage& stage, const Subsurface& tissue, int count, const Visit& visit) {
  int64_t rays = 0;
  for (int i = 0; i < count; ++i) {
    visit(tissue.Walk(stage.wall, stage.Diffuse(i), stage.Stream(i), &rays));
  }
}

// Chandrasekhar's H for isotropic scattering, by iterating 1/H(μ) = √(1−a) + a/2 ∫ μ′ H(μ′)/(μ + μ′) dμ′
// (Radiative Transfer, 1950, §§ 38, 41) at the midpoints of equal steps.
class ChandrasekharH {
 public:
  explicit ChandrasekharH(double albedo) : albedo_(albedo), values_(kSteps, 1) {
    for (int round = 0; round < 200; ++round) {
      std::vector<double> next(kSteps);
      // The mean of two rounds converges where the last one alone would swing.
      for (int i = 0; i < kSteps; ++i) next[i] = (values_[i] + At((i + 0.5) / kSteps)) / 2;
      values_ = next;
    }
  }
  double At(double cosine) const {
    double sum = 0;
    for (int j = 0; j < kSteps; ++j) {
      const double other = (j + 0.5) / kSteps;
      sum += other * values_[j] / (cosine + other) / kSteps;
    }
    return 1 / (std::sqrt(1 - albedo_) + albedo_ / 2 * sum);
  }
  // Share of the light that a half-space sends back: come from one direction, or from all alike.
  double Reflectance(double cosine) const { return 1 - std::sqrt(1 - albedo_) * At(cosine); }
  double DiffuseReflectance() const {
    double sum = 0;
    for (int i = 0; i < kSteps; ++i) {
      const double cosine = (i + 0.5) / kSteps;
      sum += 2 * cosine * Reflectance(cosine) / kSteps;
    }
    return sum;
  }

 private:
  static constexpr int kSteps = 150;
  double albedo_;
  std::vector<double> values_;
};

// The same function as an integral (Stibbs and Weir 1959, "On the H-functions for isotropic scattering"), and
// its value for conservative scattering at normal incidence: the reference itself must be right.
TEST(Subsurface, ReferenceIsChandrasekharsFunction) {
  const auto integral = [](double albedo, double cosine) {
    constexpr int kSteps = 4000;
    double sum = 0;
    for (int i = 0; i < kSteps; ++i) {
      const double angle = (i + 0.5) / kSteps * kPi / 2, across = cosine * std::sin(angle);
      sum += std::log(1 - albedo * angle / std::tan(angle)) /
             (std::cos(angle) * std::cos(angle) + across * across) / kSteps;
    }
    return std::exp(-cosine / 2 * sum);
  };
  EXPECT_NEAR(integral(1, 1), 2.9078, 5e-4);
  for (const double albedo : {0.1, 0.5, 0.95}) {
    const ChandrasekharH reference(albedo);
    for (const double cosine : {0.1, 0.6, 1.0}) {
      EXPECT_NEAR(reference.At(cosine), integral(albedo, cosine), 1e-4) << albedo << " " << cosine;
    }
  }
}

// Channels whose free paths are up to 6 times apart share a walk.
TEST(Subsurface, HalfSpaceReflectsAsInClosedForm) {
  const Stage stage = Stage::OnHalfSpace();
  for (const Vec3d& albedos : {Vec3d(0.6, 0.3, 0.1), Vec3d(0.95, 0.8, 0.4)}) {
    const Subsurface tissue(WithAlbedos(albedos, {1.0, 0.5, 3.0}));
    const int count = 60000;
    Mean diffuse[3], straight[3], slanting[3];
    WalkDiffusely(stage, tissue, count, [&](const WalkExit& exit) {
      for (int c = 0; c < 3; ++c) diffuse[c].Add(exit.weight[c]);
    });
    int64_t rays = 0;
    for (int i = 0; i < count; ++i) {
      WalkEntry entry = stage.place;
      const WalkExit from_above = tissue.Walk(stage.wall, entry, stage.Stream(i, 2), &rays);
      entry.direction = Vec3f(0.8f, 0, -0.6f);
      const WalkExit from_aside = tissue.Walk(stage.wall, entry, stage.Stream(i, 3), &rays);
      for (int c = 0; c < 3; ++c) {
        straight[c].Add(from_above.weight[c]);
        slanting[c].Add(from_aside.weight[c]);
      }
    }
    for (int c = 0; c < 3; ++c) {
      const ChandrasekharH reference(albedos[c]);
      ExpectMean(diffuse[c], reference.DiffuseReflectance());
      ExpectMean(straight[c], reference.Reflectance(1));
      ExpectMean(slanting[c], reference.Reflectance(0.6));
    }
    // The comparison tells albedos apart.
    const double wrong = ChandrasekharH(albedos[0] - 0.03).DiffuseReflectance();
    EXPECT_GT(std::abs(diffuse[0].value() - wrong), 2 * kBound * diffuse[0].error());
  }
}

TEST(Subsurface, EvenReflectanceIsTheClosedForm) {
  for (const Vec3d& albedos : {Vec3d(0, 0.1, 0.5), Vec3d(0.9, 0.99, 1)}) {
    const Vec3f reflectance = Subsurface(WithAlbedos(albedos, {2, 0.1, 7})).EvenReflectance();
    for (int c = 0; c < 3; ++c) {
      EXPECT_NEAR(reflectance[c], ChandrasekharH(albedos[c]).DiffuseReflectance(), 2e-4) << albedos[c];
    }
  }
  EXPECT_NEAR(Subsurface({Vec3d::Zero(), Vec3d::Zero()}).EvenReflectance().norm(), 0, 1e-6);
  // The head's figures.
  EXPECT_TRUE(Subsurface(SubsurfaceOptions{}).EvenReflectance().isApprox(Vec3f(0.23f, 0.16f, 0.11f), 0.02f));
  const SubsurfaceOptions perfused{{0.06, 1.1, 1.6}, SubsurfaceOptions{}.scattering_per_mm};
  EXPECT_TRUE(Subsurface(perfused).EvenReflectance().isApprox(Vec3f(0.54f, 0.12f, 0.10f), 0.02f));
}

// A walk in double of one channel, by its absorption's own chance, with walls given by a formula.
struct PlainWalk {
  double extinction, albedo;
  std::function<double(const Vec3d&, const Vec3d&)> to_wall;  // distance; ∞: never

  // Nothing where the light stays.
  std::optional<Vec3d> Exit(Vec3d point, Vec3d direction, uint64_t seed) const {
    for (uint64_t step = 0;; ++step) {
      const auto number = [&](uint64_t use) { return UniformDouble(RandomBits(seed, step, use)); };
      const double path = -std::log(1 - number(0)) / extinction, wall = to_wall(point, direction);
      if (wall < path) return Vec3d(point + wall * direction);
      if (number(1) >= albedo) return {};
      point += path * direction;
      const double z = 2 * number(2) - 1, turn = 2 * kPi * number(3), radius = std::sqrt(1 - z * z);
      direction = {radius * std::cos(turn), radius * std::sin(turn), z};
    }
  }
};

constexpr double kNever = std::numeric_limits<double>::infinity();

// Where light leaves: how many, how far on the average, and in rings, by both walks.
struct Profile {
  Mean all, distance, square, rings[4];
  void Add(double weight, double distance_mm) {
    all.Add(weight);
    distance.Add(weight * distance_mm);
    square.Add(weight * distance_mm * distance_mm);
    const double edges[] = {0.2, 0.6, 1.5, 1e9};
    bool found = false;
    for (int i = 0; i < 4; ++i) {
      const bool here = !found && distance_mm < edges[i];
      rings[i].Add(here ? weight : 0);
      found = found || here;
    }
  }
};

void ExpectAgree(const Profile& a, const Profile& b) {
  ExpectAgree(a.all, b.all);
  ExpectAgree(a.distance, b.distance);
  ExpectAgree(a.square, b.square);
  for (int i = 0; i < 4; ++i) ExpectAgree(a.rings[i], b.rings[i]);
}

TEST(Subsurface, LightLeavesAsFarAwayAsInAPlainWalk) {
  const Stage stage = Stage::OnHalfSpace();
  const Vec3d albedos(0.66, 0.9, 0.4), extinctions(1.2, 1.7, 2.5);
  const Subsurface tissue(WithAlbedos(albedos, extinctions));
  const int count = 60000;
  Profile found[3];
  WalkDiffusely(stage, tissue, count, [&](const WalkExit& exit) {
    const double distance = exit.found ? (exit.point - stage.place.point).norm() : 0;
    for (int c = 0; c < 3; ++c) found[c].Add(exit.weight[c], distance);
    if (!exit.found) return;
    EXPECT_NEAR(exit.point[2], 0, 1e-6);
    EXPECT_EQ(exit.normal, Vec3f(0, 0, 1));
  });
  for (int c = 0; c < 3; ++c) {
    const PlainWalk plain{extinctions[c], albedos[c], [](const Vec3d& point, const Vec3d& direction) {
                            return direction[2] > 0 ? -point[2] / direction[2] : kNever;
                          }};
    Profile expected;
    for (int i = 0; i < count; ++i) {
      const Vec3d start(0, 0, 0);
      const auto exit = plain.Exit(start, stage.Diffuse(i, 50).direction.cast<double>(), uint64_t(i + 1));
      expected.Add(exit ? 1 : 0, exit ? exit->norm() : 0);
    }
    ExpectAgree(found[c], expected);
  }
}

// A fold 1.5 mm thin: what crosses it leaves on its other side, and faces the lumen there.
TEST(Subsurface, LightCrossesAFoldAsInAPlainWalk) {
  const Stage stage = OnFold(1.5);
  const double z0 = stage.place.point[2];  // the fold's middle is the origin
  const Vec3d albedos(0.9, 0.66, 0.97), extinctions(1.0, 1.2, 0.6);
  const Subsurface tissue(WithAlbedos(albedos, extinctions));
  const int count = 40000;
  Mean back[3], through[3];
  WalkDiffusely(stage, tissue, count, [&](const WalkExit& exit) {
    const bool crossed = exit.found && exit.point[2] < 0;
    if (exit.found) {
      EXPECT_EQ(exit.normal[2], crossed ? -1 : 1);
    }
    for (int c = 0; c < 3; ++c) {
      back[c].Add(crossed ? 0 : exit.weight[c]);
      through[c].Add(crossed ? exit.weight[c] : 0);
    }
  });
  for (int c = 0; c < 3; ++c) {
    const PlainWalk plain{extinctions[c], albedos[c], [&](const Vec3d& point, const Vec3d& direction) {
                            return direction[2] > 0   ? (z0 - point[2]) / direction[2]
                                   : direction[2] < 0 ? (z0 - 1.5 - point[2]) / direction[2]
                                                      : kNever;
                          }};
    Mean plain_back, plain_through;
    for (int i = 0; i < count; ++i) {
      const auto exit =
          plain.Exit({0, 0, z0}, stage.Diffuse(i, 50).direction.cast<double>(), uint64_t(i + 1));
      plain_back.Add(exit && (*exit)[2] > 0);
      plain_through.Add(exit && (*exit)[2] < 0);
    }
    ExpectAgree(back[c], plain_back);
    ExpectAgree(through[c], plain_through);
  }
}

// Tissue that absorbs nothing, with an end: everything comes out, whatever the channels' free paths.
TEST(Subsurface, WhiteFurnace) {
  const Stage stage(Sphere(3, 40, true), {0.2f, 0.3f, 9}, -Vec3f::UnitZ());
  const Subsurface tissue({Vec3d::Zero(), Vec3d(0.3, 1, 4)});
  Mean weights[3];
  WalkDiffusely(stage, tissue, 30000, [&](const WalkExit& exit) {
    EXPECT_TRUE(exit.found || exit.weight.isZero(0));
    for (int c = 0; c < 3; ++c) weights[c].Add(exit.weight[c]);
  });
  for (const Mean& weight : weights) ExpectMean(weight, 1);

  const Subsurface even({Vec3d::Zero(), Vec3d(2, 2, 2)});
  WalkDiffusely(stage, even, 3000, [&](const WalkExit& exit) {
    if (exit.weight[0] < 1.5f) {  // no doubling
      EXPECT_NEAR(exit.weight[0], exit.found ? 1 : 0, 1e-4);
    }
  });
}

// In a fold that absorbs and scatters nothing light goes straight through: exp(−μa · length).
TEST(Subsurface, WithoutScatteringLightGoesStraight) {
  const double thickness = 1.5;
  const Stage stage = OnFold(thickness);
  const Vec3d absorption(0, 0.2, 0.7);
  const Subsurface tissue({absorption, Vec3d::Zero()});
  Mean surplus[3];
  int64_t rays = 0;
  for (int i = 0; i < 20000; ++i) {
    const WalkEntry entry = stage.Diffuse(i);
    const WalkExit exit = tissue.Walk(stage.wall, entry, stage.Stream(i), &rays);
    const double length = thickness / -double(entry.direction[2]);
    if (length > 1000) continue;  // out of the fold's end
    for (int c = 0; c < 3; ++c) surplus[c].Add(exit.weight[c] - std::exp(-absorption[c] * length));
    if (!exit.found) continue;
    EXPECT_EQ(exit.normal, Vec3f(0, 0, -1));
    // Barycentric coordinates have steps of 2⁻²⁴, of 4000 mm here; both ends and the length round.
    EXPECT_LT((exit.point - entry.point - float(length) * entry.direction).norm(), 1e-3 + 1e-6 * length);
  }
  for (const Mean& mean : surplus) ExpectMean(mean, 0);

  // With no other channel that could end its path, clear tissue lets all through.
  const Subsurface clear({Vec3d::Zero(), Vec3d::Zero()});
  for (int i = 0; i < 100; ++i) {
    EXPECT_EQ(clear.Walk(stage.wall, stage.Diffuse(i), stage.Stream(i), &rays).weight, Vec3f::Ones());
  }
}

// A cavity in endless tissue, as the lumen is one: rounding puts half the walks' starts before the curved
// wall. Against a plain walk, whose wall is the sphere itself: 0.1% for the triangles.
TEST(Subsurface, CavityInTissueAsInAPlainWalk) {
  const double radius = 4;
  const Stage stage(Sphere(radius, 100, false), Vec3f::Zero(), Vec3f(0.3f, 0.5f, 0.7f).normalized());
  ASSERT_LT(stage.place.normal.dot(stage.place.point), 0);
  const Vec3d albedos(0.66, 0.95, 0.4), extinctions(0.8, 1.2, 1.6);
  const Subsurface tissue(WithAlbedos(albedos, extinctions));
  const int count = 60000;
  Mean found[3], along[3];
  const Vec3f start = stage.place.point.normalized();
  WalkDiffusely(stage, tissue, count, [&](const WalkExit& exit) {
    if (exit.found) {
      EXPECT_LT(exit.normal.dot(exit.point), 0);
    }
    for (int c = 0; c < 3; ++c) {
      found[c].Add(exit.weight[c]);
      along[c].Add(exit.found ? exit.weight[c] * (1 - start.dot(exit.point.normalized())) : 0);
    }
  });
  const auto to_sphere = [&](const Vec3d& point, const Vec3d& direction) {
    const double b = point.dot(direction), c = point.squaredNorm() - radius * radius;
    const double root = b * b - c;
    return b < 0 && root > 0 ? std::max(0.0, -b - std::sqrt(root)) : kNever;
  };
  for (int c = 0; c < 3; ++c) {
    const PlainWalk plain{extinctions[c], albedos[c], to_sphere};
    Mean plain_found, plain_along;
    for (int i = 0; i < count; ++i) {
      const Vec3d entry = (radius * (1 + 1e-12)) * start.cast<double>();
      const auto exit = plain.Exit(entry, stage.Diffuse(i, 50).direction.cast<double>(), uint64_t(i + 1));
      plain_found.Add(exit.has_value());
      plain_along.Add(exit ? 1 - start.cast<double>().dot(exit->normalized()) : 0);
    }
    EXPECT_LT(std::abs(found[c].value() - plain_found.value()),
              kBound * std::hypot(found[c].error(), plain_found.error()) + 1e-3);
    EXPECT_LT(std::abs(along[c].value() - plain_along.value()),
              kBound * std::hypot(along[c].error(), plain_along.error()) + 1e-3);
  }
}

// Tissue without absorption or end around a large cavity: the light that never comes back diffuses away. By
// the diffusion equation with the exact half-space's boundary (a place lit evenly, F, holds 4F behind it; the
// density vanishes 0.7104 free paths before the wall) it is 4/3 / (R μ + 0.71), up to terms in 1/(R μ)².
TEST(Subsurface, EndlessTissueLosesWhatDiffusesAway) {
  const double radius = 10;
  const Stage stage(Sphere(radius, 60, false), Vec3f::Zero(), Vec3f(0.3f, 0.5f, 0.7f).normalized());
  const Subsurface tissue({Vec3d::Zero(), Vec3d::Ones()});
  Mean lost;
  WalkDiffusely(stage, tissue, 10000, [&](const WalkExit& exit) { lost.Add(1 - exit.weight[0]); });
  EXPECT_NEAR(lost.value(), 4.0 / 3 / (radius + 0.7104), kBound * lost.error() + 1.0 / (radius * radius));
  EXPECT_GT(lost.value(), kBound * lost.error());
}

TEST(Subsurface, ExtremeTissueGivesFiniteWeights) {
  const Stage cavity(Sphere(20, 30, false), Vec3f::Zero(), Vec3f(0.3f, 0.5f, 0.7f).normalized());
  const Stage ball(Sphere(20, 30, true), {0.2f, 0.3f, 90}, -Vec3f::UnitZ());
  const double values[] = {0, 1e-40, 1e-6, 1, 1000, 1e30};
  for (const double absorption : values) {
    for (const double scattering : values) {
      const Subsurface tissue({Vec3d(absorption, 0.5, 0), Vec3d(scattering, scattering, 0.7)});
      for (const Stage* stage : {&cavity, &ball}) {
        WalkDiffusely(*stage, tissue, 8, [&](const WalkExit& exit) {
          EXPECT_TRUE(exit.weight.allFinite());
          EXPECT_GE(exit.weight.minCoeff(), 0);
          if (exit.found) {
            EXPECT_TRUE(exit.point.allFinite() && exit.hit.face < stage->mesh.faces.size());
            EXPECT_NEAR(exit.normal.norm(), 1, 1e-6);
          } else {
            EXPECT_EQ(exit.weight, Vec3f::Zero());
          }
        });
      }
    }
  }
}

// Where everything is absorbed at once, nothing comes back; without tissue to meet, neither.
TEST(Subsurface, BlackAndClearTissueKeepTheLight) {
  const Stage stage = Stage::OnHalfSpace();
  for (const SubsurfaceOptions& options :
       {SubsurfaceOptions{Vec3d::Constant(1e6), Vec3d::Ones()}, {Vec3d::Zero(), Vec3d::Zero()}}) {
    double sum = 0;
    WalkDiffusely(stage, Subsurface(options), 500, [&](const WalkExit& exit) { sum += exit.weight.sum(); });
    EXPECT_LT(sum, 500 * 1e-5);
  }
}

TEST(Subsurface, AnyNumberOfThreadsGivesTheSameWalks) {
  const Stage stage(Sphere(4, 30, false), Vec3f::Zero(), Vec3f(0.3f, 0.5f, 0.7f).normalized());
  const Subsurface tissue(SubsurfaceOptions{});
  const auto walks = [&](int threads) {
    SetThreadCount(threads);
    std::vector<float> numbers(3000 * 8);
    ParallelFor(0, 3000, [&](int64_t i) {
      int64_t rays = 0;
      const WalkExit exit = tissue.Walk(stage.wall, stage.Diffuse(int(i)), stage.Stream(int(i)), &rays);
      float* to = &numbers[size_t(i) * 8];
      std::copy_n(exit.point.data(), exit.found ? 3 : 0, to);
      std::copy_n(exit.weight.data(), 3, to + 3);
      to[6] = float(exit.hit.face);
      to[7] = float(rays);
    });
    SetThreadCount(0);
    return numbers;
  };
  const std::vector<float> one = walks(1);
  EXPECT_EQ(one, walks(2));
  EXPECT_EQ(one, walks(5));
}

// From places as rays find them, on a plane that rounding doesn't keep to, and along it: every walk ends.
TEST(Subsurface, EveryWalkEndsWhereverItStarts) {
  Mesh mesh;
  AddSquare(300, 0, true, &mesh);
  for (Vec3d& vertex : mesh.vertices) {
    vertex = Eigen::AngleAxisd(0.7, Vec3d(1, 2, 3).normalized()) * vertex + Vec3d(70, -3, 11);
  }
  const RayScene wall(mesh);
  const Vec3f normal = FaceNormal(mesh, 0).cast<float>(), across = TangentFrame(normal).tangent;
  const Subsurface tissue(WithAlbedos({0.9, 0.6, 0.3}, {1, 2, 0.7}));
  Mean weight;
  int64_t rays = 0;
  const int count = 20000;
  for (int i = 0; i < count; ++i) {
    const SampleStream random(12, 0, uint64_t(i)), other(12, 1, uint64_t(i));
    const Vec3f eye = 20 * normal + (other.Uniform(2) - 0.5f) * 30 * across;
    const Vec3f down = lambert::Sample(-normal, Vec2f(other.Uniform(0) / 4, other.Uniform(1)));
    const RayHit hit = wall.Intersect(eye, down, 0, 1e9f);
    ASSERT_TRUE(hit.hit());
    const float slant = i % 4 == 0 ? 1e-4f : 1.0f;
    const Vec3f inward =
        (slant * lambert::Sample(-normal, Vec2f(other.Uniform(3), other.Uniform(4))) + (1 - slant) * across)
            .normalized();
    const WalkExit exit = tissue.Walk(wall, {hit.face, eye + hit.t * down, normal, inward}, random, &rays);
    EXPECT_TRUE(exit.weight.allFinite());
    if (i % 4 != 0) weight.Add(exit.weight[0]);
  }
  ExpectMean(weight, tissue.EvenReflectance()[0]);
  EXPECT_LT(double(rays), 100.0 * count);
}

// Faces turned the other way round mean the same wall: the side that light comes from is the lumen's.
TEST(Subsurface, FacesMayBeOrientedEitherWay) {
  const Vec3f aim = Vec3f(0.3f, 0.5f, 0.7f).normalized();
  const Stage stage(Sphere(4, 30, false), Vec3f::Zero(), aim);
  Stage turned(Sphere(4, 30, true), Vec3f::Zero(), aim);
  turned.place.normal = -turned.place.normal;
  Mean one, other;
  const Subsurface tissue(SubsurfaceOptions{});
  WalkDiffusely(stage, tissue, 5000, [&](const WalkExit& exit) { one.Add(exit.weight[0]); });
  WalkDiffusely(turned, tissue, 5000, [&](const WalkExit& exit) { other.Add(exit.weight[0]); });
  EXPECT_NEAR(one.value(), other.value(), 1e-4);
  EXPECT_GT(one.value(), 0.1);
}

TEST(Subsurface, SceneIsReadStrictly) {
  const auto read = [](const std::string& text) {
    const Config config = Config::Parse(text, "scene.toml");
    const SubsurfaceOptions options = ReadSubsurface(config.root());
    config.RejectUnknown();
    return options;
  };
  EXPECT_EQ(read("").absorption_per_mm, SubsurfaceOptions{}.absorption_per_mm);
  EXPECT_EQ(read("scattering_per_mm = [1, 2, 3]").scattering_per_mm, Vec3d(1, 2, 3));
  EXPECT_NE(test::ErrorOf([&] { read("absorption_per_mm = [1, 2, -3]"); }).find("scene.toml:1"),
            std::string::npos);
  EXPECT_NE(test::ErrorOf([&] { read("scattering_per_mm = [1, 2, 1001]"); }), "");
  EXPECT_NE(test::ErrorOf([&] { read("scattering = [1, 2, 3]"); }), "");
}

}  // namespace
}  // namespace lumen
