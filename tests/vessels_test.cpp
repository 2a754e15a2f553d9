#include "sim/imaging/vessels.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <functional>
#include <vector>

#include "common/config.h"
#include "common/error.h"
#include "common/random.h"
#include "sim/imaging/surface.h"
#include "tests/path_stage.h"

namespace lumen {
namespace {

constexpr double kRadius_mm = 18, kHalfLength_mm = 30;

Mesh Wall() { return test::Tube(kRadius_mm, kHalfLength_mm, 60, 120); }

double WallArea_mm2() { return 2 * kPi * kRadius_mm * 2 * kHalfLength_mm; }

double Uniform(uint64_t i, uint64_t dimension) { return UniformDouble(RandomBits(31, i, dimension)); }

// s² by its definition, from every segment.
double SquaredBlood(const Vessels& vessels, const Vec3d& place_mm, double width_factor = 1) {
  double most = 0;
  for (const VesselSegment& segment : vessels.segments()) {
    const Vec3d offset = place_mm - segment.from_mm, way = segment.to_mm - segment.from_mm;
    if (std::abs(offset.dot(segment.normal)) > vessels.depth_mm()) continue;
    const double t = std::clamp(offset.dot(way) / way.squaredNorm(), 0.0, 1.0);
    const Vec3d aside = offset - t * way;
    const double squared = aside.squaredNorm() - std::pow(aside.dot(segment.normal), 2);
    most = std::max(most, std::pow(width_factor * segment.width_mm, 2) - 4 * squared);
  }
  return most / std::pow(vessels.options().width_mm, 2);
}

// Places around the segments, from beside them to beyond their depth; some on the faces of whole cubes of 1
// mm.
Lanes3 PlacesAround(const Vessels& vessels, int packet) {
  Lanes3 places;
  for (int i = 0; i < kLanes; ++i) {
    const uint64_t number = uint64_t(packet) * kLanes + i;
    const auto& segments = vessels.segments();
    const VesselSegment& segment =
        segments[static_cast<size_t>(Uniform(number, 0) * double(segments.size()))];
    const Vec3d way = segment.to_mm - segment.from_mm;
    Vec3d place = segment.from_mm + (1.5 * Uniform(number, 1) - 0.25) * way;
    place += (1.5 * Uniform(number, 2) - 0.75) * segment.width_mm * segment.normal.cross(way.normalized());
    place += (2.4 * Uniform(number, 3) - 1.2) * vessels.depth_mm() * segment.normal;
    if (i % 3 == 0) place[i % 2] = std::round(place[i % 2]);
    places.Set(i, place.cast<float>());
  }
  return places;
}

// Every place sees what all segments together show it: the lists of its cube miss none. Cubes are as wide as
// the widest vessel where that is more than a step, here 1 mm.
TEST(Vessels, AreTheWayThroughEverySegment) {
  for (const double width_mm : {0.4, 1.0}) {
    const Vessels vessels({5, width_mm, Vec3d::Ones()}, Wall(), 3);
    double largest = 0, largest_if_wider = 0;
    int inside = 0;
    for (int packet = 0; packet < 300; ++packet) {
      const Lanes3 places = PlacesAround(vessels, packet);
      const Lanes blood = vessels.BloodAt(places);
      for (int i = 0; i < kLanes; ++i) {
        const Vec3d place = places[i].cast<double>();
        const double found = std::pow(blood[i], 2), expected = SquaredBlood(vessels, place);
        inside += expected > 0;
        // A place within rounding of a segment's depth may count or not.
        const bool at_depth =
            std::any_of(vessels.segments().begin(), vessels.segments().end(), [&](const VesselSegment& s) {
              return std::abs(std::abs((place - s.from_mm).dot(s.normal)) - vessels.depth_mm()) < 1e-5;
            });
        if (at_depth) continue;
        largest = std::max(largest, std::abs(found - expected));
        largest_if_wider = std::max(largest_if_wider, std::abs(found - SquaredBlood(vessels, place, 1.01)));
      }
    }
    EXPECT_GT(inside, 1000);
    // Coordinates of 30 mm in float, 2^-20 mm off by rounding, change 4ρ²/w² by 8 · 2^-20 / w at most.
    EXPECT_LT(largest, 4e-5);
    EXPECT_GT(largest_if_wider, 0.01);
  }
}

TEST(Vessels, ForkByMurraysLaw) {
  const Vessels vessels({6, 0.5, Vec3d::Ones()}, Wall(), 5);
  const std::vector<VesselSegment>& segments = vessels.segments();
  std::vector<double> cubes(segments.size(), 0);
  std::vector<int> children(segments.size(), 0);
  double widest = 0;
  for (size_t i = 0; i < segments.size(); ++i) {
    widest = std::max(widest, segments[i].width_mm);
    EXPECT_NEAR(segments[i].normal.norm(), 1, 1e-12);
    EXPECT_NEAR(segments[i].normal.dot(segments[i].to_mm - segments[i].from_mm), 0, 1e-12);
    const int parent = segments[i].parent;
    if (parent < 0) continue;
    ASSERT_LT(parent, static_cast<int>(i));  // so there is no cycle
    EXPECT_EQ(segments[parent].to_mm, segments[i].from_mm);
    EXPECT_LE(segments[i].width_mm, segments[parent].width_mm);
    cubes[parent] += std::pow(segments[i].width_mm, 3);
    ++children[parent];
  }
  EXPECT_EQ(widest, 0.5);
  int forks = 0;
  for (size_t i = 0; i < segments.size(); ++i) {
    if (children[i] == 0) continue;
    EXPECT_NEAR(cubes[i], std::pow(segments[i].width_mm, 3), 1e-14);
    forks += children[i] == 2;
    EXPECT_LE(children[i], 2);
  }
  // Trees fork some ten times each: twigs are a third of the trunk.
  const auto trunks = std::count_if(segments.begin(), segments.end(), [](auto& s) { return s.parent < 0; });
  EXPECT_GT(trunks, 3);
  EXPECT_GT(forks, 5 * trunks);
  EXPECT_LT(std::min_element(segments.begin(), segments.end(),
                             [](auto& a, auto& b) { return a.width_mm < b.width_mm; })
                ->width_mm,
            0.2);
}

// How often the wall, cut along the vessels, comes apart: closed loops of the mask. Pixels of the unrolled
// tube.
int ClosedLoops(const std::function<Lanes(const Lanes3&)>& blood, int* vessel_pixels) {
  constexpr int kAround = 928, kAlong = 496;  // 0.12 mm
  std::vector<uint8_t> free(kAround * kAlong);
  for (int first = 0; first < kAround * kAlong; first += kLanes) {
    Lanes3 places;
    for (int i = 0; i < kLanes; ++i) {
      const double turn = 2 * kPi * ((first + i) % kAround) / kAround;
      const double along = (first + i) / kAround;
      places.Set(i, Vec3d(kRadius_mm * std::cos(turn), kRadius_mm * std::sin(turn),
                          2 * kHalfLength_mm * (along / kAlong - 0.5))
                        .cast<float>());
    }
    const Lanes found = blood(places);
    for (int i = 0; i < kLanes; ++i) free[first + i] = found[i] == 0;
  }
  *vessel_pixels = static_cast<int>(std::count(free.begin(), free.end(), 0));
  int pieces = 0;
  std::vector<int> next;
  for (int start = 0; start < kAround * kAlong; ++start) {
    if (!free[start]) continue;
    int pixels = 0;
    free[start] = 0;
    next = {start};
    while (!next.empty()) {
      const int pixel = next.back(), x = pixel % kAround, y = pixel / kAround;
      next.pop_back();
      ++pixels;
      for (const auto& [dx, dy] : {std::pair(1, 0), {-1, 0}, {0, 1}, {0, -1}}) {
        if (y + dy < 0 || y + dy >= kAlong) continue;
        const int other = (y + dy) * kAround + (x + dx + kAround) % kAround;
        if (!free[other]) continue;
        free[other] = 0;
        next.push_back(other);
      }
    }
    pieces += pixels > 70;  // 1 mm²
  }
  return pieces - 1;
}

// Where noise crosses 0, curves are closed.
TEST(Vessels, AreTreesNotRings) {
  const Vessels vessels({6, 0.5, Vec3d::Ones()}, Wall(), 7);
  int vessel_pixels = 0, ring_pixels = 0;
  const int loops =
      ClosedLoops([&](const Lanes3& places) { return vessels.BloodAt(places); }, &vessel_pixels);
  const int rings = ClosedLoops(
      [](const Lanes3& places) {
        const Lanes field = Abs(GradientNoise(7, places * Broadcast(1.0f / 6)));
        return field < 0.03f ? Broadcast(1) : Lanes{};
      },
      &ring_pixels);
  EXPECT_GT(vessel_pixels, 15000);
  EXPECT_GT(ring_pixels, 15000);
  EXPECT_LE(loops, 1);
  EXPECT_GE(rings, 15);
}

// How far apart: their length is about the wall's area over the spacing.
TEST(Vessels, LieSpacedOverTheWall) {
  for (const double spacing_mm : {4.0, 8.0}) {
    const Vessels vessels({spacing_mm, 0.3, Vec3d::Ones()}, Wall(), 2);
    double length_mm = 0;
    for (const VesselSegment& segment : vessels.segments()) {
      length_mm += (segment.to_mm - segment.from_mm).norm();
      // On the wall, which the tube's 120 facets cut by up to R (1 − cos(π/120)) = 0.006 mm; a step's second
      // order leaves less than a thirtieth of the way to the wall's tangent, step²/(2R).
      const double off_mm = std::hypot(segment.to_mm.x(), segment.to_mm.y()) - kRadius_mm;
      EXPECT_LT(std::abs(off_mm), 0.012) << spacing_mm;
    }
    const double part = length_mm * spacing_mm / WallArea_mm2();
    EXPECT_GT(part, 0.8) << spacing_mm;
    EXPECT_LT(part, 1.5) << spacing_mm;
  }
}

// A fold 2 mm thick, as two plates back to back.
TEST(Vessels, StayOnTheirSideOfAFold) {
  Mesh fold;
  test::AddPlate(&fold, -20, 20, -20, 20, 1);
  test::AddPlate(&fold, -20, 20, -20, 20, -1);
  for (size_t f = 2; f < 4; ++f) std::swap(fold.faces[f][0], fold.faces[f][1]);
  const Vessels vessels({6, 0.5, Vec3d::Ones()}, fold, 4);
  int above = 0;
  for (const VesselSegment& segment : vessels.segments()) {
    EXPECT_NEAR(std::abs(segment.from_mm.z()), 1, 1e-6);
    EXPECT_EQ(segment.from_mm.z() > 0, segment.to_mm.z() > 0);
    above += segment.from_mm.z() > 0;
  }
  const auto count = static_cast<int>(vessels.segments().size());
  EXPECT_GT(above, count / 4);
  EXPECT_LT(above, 3 * count / 4);
}

TEST(Vessels, AreAFunctionOfSeedAndPlace) {
  const VesselOptions options{6, 1, Vec3d::Ones()};
  const Vessels one(options, Wall(), 1), again(options, Wall(), 1), other(options, Wall(), 2);
  int in_one = 0, in_both = 0;
  for (int packet = 0; packet < 400; ++packet) {
    const Lanes3 places = PlacesAround(one, packet);
    const Lanes blood = one.BloodAt(places), twice = again.BloodAt(places), elsewhere = other.BloodAt(places);
    for (int i = 0; i < kLanes; ++i) {
      ASSERT_EQ(blood[i], one.BloodAt(Broadcast(places[i]))[i]);  // whichever places are asked for with it
      ASSERT_EQ(blood[i], twice[i]);
      in_one += blood[i] > 0;
      in_both += blood[i] > 0 && elsewhere[i] > 0;
    }
  }
  EXPECT_GT(in_one, 1500);
  EXPECT_LT(in_both, in_one / 5);
}

// Growth decides by comparing; what a mesh's rounding changes must not be among it. (No distance that is
// looked for is a multiple of this tube's regular steps.)
TEST(Vessels, GrowAlikeOnAWallThatIsRoundedOtherwise) {
  const VesselOptions options{5.7, 0.5, Vec3d::Ones()};
  Mesh rounded = Wall();
  for (size_t i = 0; i < rounded.vertices.size(); ++i) {
    for (int c = 0; c < 3; ++c) rounded.vertices[i][c] += 1e-9 * Uniform(i, 4 + c);
  }
  const Vessels there(options, Wall(), 1), here(options, rounded, 1);
  ASSERT_EQ(there.segments().size(), here.segments().size());
  for (size_t i = 0; i < here.segments().size(); ++i) {
    EXPECT_LT((here.segments()[i].to_mm - there.segments()[i].to_mm).norm(), 1e-6);
    EXPECT_EQ(here.segments()[i].width_mm, there.segments()[i].width_mm);
  }
}

TEST(Vessels, RefuseWhatTheWallCannotBear) {
  const auto message = [](const std::string& text) -> std::string {
    try {
      ReadVessels(Config::Parse(text, "scene.toml").root(), Wall(), 1);
    } catch (const InputError& error) {
      return error.what();
    }
    return "";
  };
  EXPECT_EQ(message("spacing_mm = 0.01"), "scene.toml:1: width_mm: vessels are wider than they are apart");
  EXPECT_EQ(message("spacing_mm = 0.01\nwidth_mm = 0.001"),
            "scene.toml:1: spacing_mm: there would be too many vessels on this wall; choose 0.59 or more");
  EXPECT_EQ(message("spacing_mm = 9\nwidth_mm = 9"), "");
  // A wall far smaller than the spacing has a root.
  EXPECT_EQ(message("spacing_mm = 1e6"), "");
}

}  // namespace
}  // namespace lumen
