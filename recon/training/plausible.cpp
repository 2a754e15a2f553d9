#include "recon/training/plausible.h"

#include <fmt/core.h>

#include <algorithm>
#include <cmath>
#include <string>

#include "common/error.h"
#include "common/progress.h"
#include "common/statistics.h"

namespace lumen {
namespace {

// A colon is 1.5 m long, a stretched one 2; the reconstruction's box would grow without bound with the poses.
constexpr double kLongest_mm = 2000;

// A tip that is moved at all moves farther. A withdrawal given in metres comes to a fifth of it.
constexpr double kClosest_mm = 0.5;

// Irradiance falls with the square of the distance: this is a wall five times as near in all of a frame.
constexpr double kOddGain = 25;

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

}  // namespace lumen
