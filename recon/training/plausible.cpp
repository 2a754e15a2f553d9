#include "recon/training/plausible.h"

#include <fmt/core.h>

#include <algorithm>
#include <cmath>
#include <string>

#include "common/error.h"
#include "common/progress.h"
#include "common/statistics.h"
#include "recon/training/meet_surface.h"

namespace lumen {
namespace {

// A colon is 1.5 m long, a stretched one 2; the reconstruction's box would grow without bound with the poses.
constexpr double kLongest_mm = 2000;

// A tip that is moved at all moves farther. A withdrawal given in metres comes to a fifth of it.
constexpr double kClosest_mm = 0.5;

// Irradiance falls with the square of the distance: this is a wall five times as near in all of a frame.
constexpr double kOddGain = 25;

// Of 60 runs at 10 and 30 times the default learning rate those whose surface left had 99% and more of the
// pixels at the bounds, within 100 iterations and for good, all others none. Where a fisheye of 73° looks out
// of an open end, the share of its pixels that see no wall is 38% one radius before it, and 87% a tenth of a
// radius before it; a lumen 63 mm wide that goes on beyond bounds 100 mm ahead makes 6%.
constexpr double kMostBeyond = 0.95;
constexpr double kManyBeyond = 0.4;

// In a tube of radius R half of such a fisheye's pixels look more than 52° off its axis, where the wall
// is 1.27 R away; a caecum of 90 mm counts as dilated.
constexpr double kWidest_mm = 60;

// Logarithms of an albedo lie within ±10, where a float's step is 1e-6.
constexpr float kSameColor = 1e-5f;

// Training takes the photometric loss to a fifth of its start within seconds. Where half is left, what was
// learnt explains little: colours that are stuck, poses or a light that fit nothing.
constexpr double kMuchLeft = 0.5;
// And where colours are stuck for good, a tenth: runs like those above with 1% and 7% of the loss left ended
// within 1.3 mm of the truth, those with 15 to 89% were off by 5 mm or more.
constexpr double kMuchLeftOfOneColor = 0.1;

Vec3f Column(const Panel<float>& panel, int sample) {
  return {panel.At(0, sample), panel.At(1, sample), panel.At(2, sample)};
}

}  // namespace

void CheckPoses(const std::filesystem::path& folder, const std::vector<int>& numbers,
                const std::vector<Pose>& world_from_camera) {
  const std::string file = (folder / "pose.txt").string();
  std::vector<double> along[3];
  for (size_t i = 0; i < numbers.size(); ++i) {
    if (!world_from_camera[i].matrix().allFinite())
      throw InputError(fmt::format("{}: the pose of frame {} is not finite", file, numbers[i]));
    for (int d = 0; d < 3; ++d) along[d].push_back(world_from_camera[i].translation()[d]);
  }
  // The median, so that a single one far off is the one that is named.
  const Vec3d middle(MedianOf(along[0]), MedianOf(along[1]), MedianOf(along[2]));
  double farthest = 0;
  size_t which = 0;
  for (size_t i = 0; i < numbers.size(); ++i) {
    const double distance = (world_from_camera[i].translation() - middle).norm();
    if (distance > farthest) which = i;
    farthest = std::max(farthest, distance);
  }
  if (farthest > kLongest_mm) {
    throw InputError(fmt::format(
        "{}: the camera of frame {} is {:.3g} mm away from the others', but a colon is at most {} mm "
        "long; poses must be in mm",
        file, numbers[which], farthest, kLongest_mm));
  }
  if (numbers.size() > 1 && farthest < kClosest_mm) {
    Say(fmt::format(
        "{}: all cameras lie within {:.2g} mm of each other: no parallax, shading alone will tell the "
        "shape; if the poses are in metres, bring them to mm",
        file, 2 * farthest));
  }
}

void CheckGains(const std::filesystem::path& folder, const std::vector<int>& numbers,
                const std::vector<double>& radiance) {
  const double middle = MedianOf(radiance);
  if (!(middle > 0)) return;  // most frames are black
  std::string odd;
  for (size_t i = 0; i < numbers.size(); ++i) {
    const double ratio = radiance[i] / middle;
    // A black frame has no gain to doubt.
    if (!(ratio > 0) || (ratio < kOddGain && ratio > 1 / kOddGain)) continue;
    odd += fmt::format("{}{} ({:.2g} times)", odd.empty() ? "" : ", ", numbers[i], ratio);
  }
  if (odd.empty()) return;
  Say(fmt::format(
      "{}: by their gains these frames are far brighter or darker than the others; check their gains, "
      "or leave them out of the file to have them estimated: {}",
      (folder / "sequence.toml").string(), odd));
}

std::vector<size_t> PlacesOutside(const Field<float>& field, const float* parameters,
                                  const std::vector<Vec3d>& places) {
  const int count = static_cast<int>(places.size());
  Field<float>::ValuePass pass;
  pass.positions.Resize(3, TilesFor(count));
  for (int i = 0; i < TilesFor(count) * kTile; ++i) {
    const Vec3d& place = places[std::min(i, count - 1)];
    for (int d = 0; d < 3; ++d) pass.positions.At(d, i) = static_cast<float>(place[d]);
  }
  field.Value(parameters, &pass);
  std::vector<size_t> outside;
  for (int i = 0; i < count; ++i)
    if (!(pass.value.At(0, i) > 0)) outside.push_back(i);
  return outside;
}

WallSeen LookAtWall(const Field<float>& field, const float* parameters,
                    const TrainOptions::Sampling& sampling, RayBatch<float>* batch) {
  const int rays = static_cast<int>(batch->rays.size());
  const SurfaceMet met = LookAtSurface(field, parameters, sampling, 0, batch);
  WallSeen wall;
  std::vector<double> distances_mm;
  Vec3f low = Column(met.color, 0), high = low;
  for (int r = 0; r < rays; ++r) {
    distances_mm.push_back((Column(met.positions, r) - batch->rays[r].origin).norm());
    wall.beyond += met.free.At(0, r) == 0 ? 1.0 / rays : 0.0;
    low = low.cwiseMin(Column(met.color, r));
    high = high.cwiseMax(Column(met.color, r));
  }
  wall.median_mm = MedianOf(distances_mm);
  wall.one_color = (high - low).maxCoeff() < kSameColor;
  return wall;
}

std::string WhyHopeless(const WallSeen& wall) {
  if (wall.beyond <= kMostBeyond) return "";
  return fmt::format("{:.0f}% of the pixels see no wall within the bounds", 100 * wall.beyond);
}

std::string WhyUseless(const WallSeen& wall, double left) {
  const std::string hopeless = WhyHopeless(wall);
  if (!hopeless.empty() || !wall.one_color || left <= kMuchLeftOfOneColor) return hopeless;
  return fmt::format(
      "the wall has one colour, whatever the frames show, and {:.0f}% of the photometric loss is left",
      100 * left);
}

std::string WhatIsOdd(const WallSeen& wall, double left) {
  if (wall.beyond > kManyBeyond)
    return fmt::format("{:.0f}% of the pixels see no wall within the bounds", 100 * wall.beyond);
  if (wall.median_mm > kWidest_mm) {
    return fmt::format("half of the pixels see the wall more than {:.0f} mm away: no colon is that wide",
                       wall.median_mm);
  }
  if (wall.one_color) return "the wall has one colour, whatever the frames show";
  if (left > kMuchLeft)
    return fmt::format("training has learnt little: {:.0f}% of the photometric loss is left", 100 * left);
  return "";
}

}  // namespace lumen
