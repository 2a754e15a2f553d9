#include "sim/geometry/peristalsis.h"

#include <gtest/gtest.h>

#include <cmath>
#include <string>
#include <vector>

#include "common/random.h"
#include "sim/geometry/clearance.h"
#include "sim/geometry/colon.h"
#include "sim/geometry/mesh_source.h"
#include "tests/mesh_checks.h"
#include "tests/support.h"

namespace lumen {
namespace {

using test::BoundsOneVolume;
using test::ErrorOf;
using test::SharedData;

constexpr double kLength_mm = 90;

std::vector<Vec3d> StraightLine() { return {Vec3d(1, 2, 3), Vec3d(1, 2, 3 + kLength_mm)}; }

// An arc of a circle of radius 60 mm about the y axis.
constexpr double kBend_mm = 60;
std::vector<Vec3d> Arc() {
  std::vector<Vec3d> points;
  for (int i = 0; i <= 90; ++i) {
    const double angle = i / kBend_mm;
    points.emplace_back(kBend_mm * std::cos(angle), 0, kBend_mm * std::sin(angle));
  }
  return points;
}

// Bends and twists; its ends come near each other.
std::vector<Vec3d> Coil() {
  std::vector<Vec3d> points;
  for (int i = 0; i <= 300; ++i) {
    const double angle = i / 52.0;
    points.emplace_back(50 * std::cos(angle), 40 * std::sin(angle), 10 * std::sin(0.7 * angle) + 4 * angle);
  }
  return points;
}

// A closed tube with round sections about z: `rows` rings of `columns` corners and a fan at each end.
Mesh Tube(double radius_mm, int columns, int rows) {
  Mesh mesh;
  for (int row = 0; row <= rows; ++row) {
    for (int column = 0; column < columns; ++column) {
      const double angle = 2 * kPi * column / columns;
      mesh.vertices.emplace_back(1 + radius_mm * std::cos(angle), 2 + radius_mm * std::sin(angle),
                                 3 + kLength_mm * row / rows);
    }
  }
  const int near = static_cast<int>(mesh.vertices.size()), deep = near + 1, top = rows * columns;
  mesh.vertices.push_back(Vec3d(1, 2, 3));
  mesh.vertices.push_back(Vec3d(1, 2, 3 + kLength_mm));
  for (int column = 0; column < columns; ++column) {
    const int next = (column + 1) % columns;
    for (int row = 0; row < rows; ++row) {
      const int a = row * columns + column, b = row * columns + next;
      mesh.faces.emplace_back(a, b, b + columns);
      mesh.faces.emplace_back(a, b + columns, a + columns);
    }
    mesh.faces.emplace_back(near, next, column);
    mesh.faces.emplace_back(deep, top + column, top + next);
  }
  return mesh;
}

Geometry Around(const std::vector<Vec3d>& centreline) { return {Tube(10, 12, 10), centreline}; }

double Wave(const Peristalsis& p, double s_mm, double frame) {
  const double cosine =
      std::cos(kPi * (s_mm + p.speed_mm_s * frame / p.rate_hz) / p.wavelength_mm - p.phase_rad / 2);
  return cosine * cosine;
}

Vec3d Moved(const PeristalticWave& wave, const Vec3d& place, double frame) {
  return wave.Moved(place, wave.FootOf(place), frame);
}

Vec3d RandomPlace(uint64_t index, double half_size_mm) {
  Vec3d place;
  for (int d = 0; d < 3; ++d) place[d] = half_size_mm * (2 * UniformDouble(RandomBits(7, index, d)) - 1);
  return place;
}

// The determinant of the map's derivative, by central differences.
double Jacobian(const PeristalticWave& wave, const Vec3d& place, double frame) {
  constexpr double kStep_mm = 1e-4;
  Mat3d derivative;
  for (int d = 0; d < 3; ++d) {
    const Vec3d step = kStep_mm * Vec3d::Unit(d);
    derivative.col(d) =
        (Moved(wave, place + step, frame) - Moved(wave, place - step, frame)) / (2 * kStep_mm);
  }
  return derivative.determinant();
}

TEST(Peristalsis, ReadsItsKeys) {
  const Config config = Config::Parse("amplitude = 0.5\nspeed_mm_s = -20\n", "scene");
  const Peristalsis p = ReadPeristalsis(config.root());
  config.RejectUnknown();
  EXPECT_EQ(p.amplitude, 0.5);
  EXPECT_EQ(p.speed_mm_s, -20);
  EXPECT_EQ(p.wavelength_mm, 50);
  for (const std::string bad : {"amplitude = 1.0", "amplitude = -0.1", "rate_hz = 0", "wavelength_mm = 0"}) {
    const Config refused = Config::Parse(bad, "scene");
    EXPECT_NE(ErrorOf([&] { ReadPeristalsis(refused.root()); }).find("scene:1"), std::string::npos) << bad;
  }
}

TEST(Peristalsis, SqueezesAStraightTubeAsTheFormulaSays) {
  const Peristalsis p = {0.6, 40, 15, 25, 0.8};
  const PeristalticWave wave(p, Around(StraightLine()));
  for (uint64_t i = 0; i < 200; ++i) {
    const Vec3d place = Vec3d(1, 2, 3 + kLength_mm / 2) + RandomPlace(i, 45);
    for (const double frame : {0.0, 3.0, 17.5, 200.0}) {
      const double left = 1 - p.amplitude * Wave(p, place.z() - 3, frame);
      const Vec3d expected(1 + left * (place.x() - 1), 2 + left * (place.y() - 2), place.z());
      EXPECT_LT((Moved(wave, place, frame) - expected).norm(), 1e-9);
    }
  }
}

// Frame 0 with phase 0: tightest at the near end, and every wavelength from there; rings come nearer.
TEST(Peristalsis, TravelsTowardsTheNearEnd) {
  const Peristalsis p = {0.5, 30, 12, 10, 0};
  const PeristalticWave wave(p, Around(StraightLine()));
  const auto radius = [&](double s, double frame) { return Moved(wave, Vec3d(9, 2, 3 + s), frame).x() - 1; };
  EXPECT_NEAR(radius(0, 0), 4, 1e-12);
  EXPECT_NEAR(radius(15, 0), 8, 1e-12);
  EXPECT_NEAR(radius(30, 0), 4, 1e-12);
  EXPECT_NEAR(radius(30 - 12, 10), 4, 1e-12);  // a second later
}

// Within half the reach of a bend, in cylindrical coordinates about the bend's axis.
TEST(Peristalsis, SqueezesABendAcrossItsCentreline) {
  const Peristalsis p = {0.7, 50, 10, 30, 0};
  const PeristalticWave wave(p, Around(Arc()));
  for (uint64_t i = 0; i < 300; ++i) {
    const double angle = 0.1 + 1.3 * UniformDouble(RandomBits(3, i, 0));
    const double radius = 24 * UniformDouble(RandomBits(3, i, 1));
    const double turn = 2 * kPi * UniformDouble(RandomBits(3, i, 2));
    const auto at = [&](double r) -> Vec3d {
      const double out = kBend_mm + r * std::cos(turn);
      return {out * std::cos(angle), r * std::sin(turn), out * std::sin(angle)};
    };
    const double squeezed = radius * (1 - p.amplitude * Wave(p, kBend_mm * angle, 7));
    // Arc length is measured along chords of 1 mm, each shorter than the arc by κ²/24 of it: 1e-3 mm in all.
    // The radius follows it by at most radius · amplitude · π/wavelength.
    const double short_mm = angle * kBend_mm / (24 * kBend_mm * kBend_mm);
    EXPECT_LT((Moved(wave, at(radius), 7) - at(squeezed)).norm(),
              1e-4 + short_mm * radius * p.amplitude * kPi / p.wavelength_mm);
    const double det = std::pow(squeezed / radius, 2) * (kBend_mm + squeezed * std::cos(turn)) /
                       (kBend_mm + radius * std::cos(turn));
    EXPECT_NEAR(Jacobian(wave, at(radius), 7), det, 1e-3 * det);
  }
}

TEST(Peristalsis, ReachIsTheRadiusOfTheBend) {
  const PeristalticWave wave({}, Around(Arc()));
  for (const double s : {30.0, 45.0, 60.0}) EXPECT_NEAR(wave.Reach_mm(s), 0.9 * kBend_mm, 0.05);
  // Two lengths of a hairpin, 24 mm from each other: half of that.
  std::vector<Vec3d> hairpin;
  for (int i = 0; i <= 80; ++i) hairpin.emplace_back(-12, 0, 80 - i);
  for (int i = 1; i < 38; ++i)
    hairpin.emplace_back(-12 * std::cos(i * kPi / 38), 0, -12 * std::sin(i * kPi / 38));
  for (int i = 0; i <= 80; ++i) hairpin.emplace_back(12, 0, i);
  const PeristalticWave narrow({}, Around(hairpin));
  EXPECT_NEAR(narrow.Reach_mm(40), 0.9 * 12, 0.05);
}

// Nowhere does space fold over, up to the largest amplitude that a scene may ask for, and nothing moves
// beyond the reach.
TEST(Peristalsis, FoldsNowhere) {
  for (const std::vector<Vec3d>& centreline : {Arc(), Coil()}) {
    for (const double amplitude : {0.3, 0.9}) {
      const PeristalticWave wave({amplitude, 20, 10, 29.97, 0.3}, Around(centreline));
      double least = 1;
      int moved = 0, fading = 0;
      for (uint64_t i = 0; i < 4000; ++i) {
        const Vec3d& near = centreline[RandomBits(5, i) % centreline.size()];
        const Vec3d place = near + RandomPlace(i, 40);
        const PeristalticWave::Foot foot = wave.FootOf(place);
        const double det = Jacobian(wave, place, 4);
        // The formula's factors, the last more than a half; beyond both ends of all a ball shrinks.
        EXPECT_GT(det, 0.5 * std::pow(1 - amplitude, 3)) << place.transpose();
        least = std::min(least, det);
        moved += det < 0.99;
        fading += foot.yields > 0.05 && foot.yields < 0.95;
        if (foot.yields == 0) {
          EXPECT_EQ(Moved(wave, place, 4), place);
        }
      }
      EXPECT_GT(moved, 500);
      EXPECT_GT(fading, 200);
      EXPECT_LT(least, 1.2 * std::pow(1 - amplitude, 2));  // some place is in a ring
    }
  }
}

// Two places of the resting wall never meet: along a ray from the centreline distances keep their order.
TEST(Peristalsis, KeepsTheOrderAlongARadius) {
  const PeristalticWave wave({0.9, 20, 10, 29.97, 0}, Around(Arc()));
  for (const double angle : {0.3, 0.7, 1.2}) {
    const Vec3d middle(kBend_mm * std::cos(angle), 0, kBend_mm * std::sin(angle));
    const Vec3d out = (middle.normalized() + Vec3d::UnitY()).normalized();
    double last = 0;
    for (int step = 1; step <= 600; ++step) {
      const double radius = (Moved(wave, middle + 0.1 * step * out, 2) - middle).norm();
      EXPECT_GT(radius, last);
      last = radius;
    }
  }
}

TEST(Peristalsis, TubeHasTheFormulasVolume) {
  const Geometry geometry = {Tube(14, 64, 180), StraightLine()};
  const Peristalsis p = {0.5, 30, 10, 30, 0.4};
  const PeristalticWall wall(p, geometry);
  for (const double frame : {0.0, 11.0}) {
    const Mesh mesh = wall.At(frame);
    EXPECT_TRUE(BoundsOneVolume(mesh));
    double length = 0;  // ∫ (1 − amplitude·wave)² ds by the midpoint rule
    for (int i = 0; i < 9000; ++i)
      length +=
          std::pow(1 - p.amplitude * Wave(p, (i + 0.5) * kLength_mm / 9000, frame), 2) * kLength_mm / 9000;
    const double section = 32 * 14 * 14 * std::sin(2 * kPi / 64);  // of the 64-gon
    // Rings half a millimetre apart, joined straight: (0.5 mm)²/12 of the radius' second derivative at most.
    EXPECT_NEAR(test::Volume(mesh), section * length, 1e-3 * section * length);
    EXPECT_LT(test::Volume(mesh), 0.8 * test::Volume(geometry.mesh));
  }
}

// What the checks would say of a wall that the wave turns inside out.
TEST(Peristalsis, ChecksRejectAWallThatGoesThroughItself) {
  const Geometry geometry = {Tube(14, 64, 180), StraightLine()};
  EXPECT_FALSE(BoundsOneVolume(PeristalticWall({1.5, 30, 10, 30, 0}, geometry).At(0)));
}

TEST(Peristalsis, NoAmplitudeMovesNothing) {
  const Geometry geometry = {Tube(14, 20, 30), StraightLine()};
  EXPECT_EQ(PeristalticWall({0, 30, 10, 30, 0}, geometry).At(5).vertices, geometry.mesh.vertices);
}

void ExpectSound(const PeristalticWall& wall, const Geometry& geometry) {
  for (const double frame : {0.0, 40.0, 80.0}) {
    const Mesh mesh = wall.At(frame);
    EXPECT_EQ(mesh.faces, geometry.mesh.faces);
    EXPECT_TRUE(BoundsOneVolume(mesh)) << frame;
    const Clearance clearance(mesh);
    for (size_t i = 5; i + 5 < geometry.centreline.size(); i += 10)
      EXPECT_TRUE(clearance.Encloses(geometry.centreline[i]));
  }
}

TEST(Peristalsis, ColonStaysOneClosedSurface) {
  const Config config = Config::Parse(R"(length_mm = 85
bend_rad = 0.9
torsion_rad = 0.5
diameter_mm = 44
haustra_spacing_mm = 28
tolerance_mm = 0.05
polyps = [{paris = "Ip", at_mm = 40, angle_rad = 0.5, size_mm = 8}])",
                                      "colon");
  const Geometry geometry = BuildColon(config.root(), 3);
  ExpectSound(PeristalticWall({0.5, 40, 10, 29.97, 0}, geometry), geometry);
}

TEST(Peristalsis, ColonFromCtStaysOneClosedSurface) {
  LUMEN_NEEDS_DATA("colon_ct");
  const Config config = Config::Parse("path = \"" + SharedData("colon_ct/EdinGCA00020_SF+-HF-.obj").string() +
                                          "\"\ncentreline = \"" +
                                          SharedData("colon_ct/EdinGCA00020_centreline_mm.txt").string() +
                                          "\"\nbetween = [1815, 1930]\nsmooth_iterations = 6\n",
                                      "scene");
  const Geometry geometry = LoadMeshSource(config.root());
  ExpectSound(PeristalticWall({0.5, 50, 10, 29.97, 0}, geometry), geometry);
}

}  // namespace
}  // namespace lumen
