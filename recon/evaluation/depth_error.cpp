#include "recon/evaluation/depth_error.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <nlohmann/json.hpp>

#include "common/error.h"
#include "common/parallel.h"
#include "common/ray_scene.h"

namespace lumen {
namespace {

// Of one frame's pixels: z in mm, or the guess in any unit.
struct Depths {
  std::vector<double> truth, reconstruction, constant, brightness;
  int64_t missing = 0;

  void Append(const Depths& other) {
    const auto append = [](std::vector<double>* to, const std::vector<double>& from) {
      to->insert(to->end(), from.begin(), from.end());
    };
    append(&truth, other.truth);
    append(&reconstruction, other.reconstruction);
    append(&constant, other.constant);
    append(&brightness, other.brightness);
    missing += other.missing;
  }
};

class Comparison {
 public:
  Comparison(const Mesh& reconstruction, const Sequence& sequence)
      : sequence_(sequence),
        calibration_(sequence.calibration),
        scene_(reconstruction),
        camera_(calibration_.camera),
        valid_(ValidPixels(calibration_)) {}

  FrameDepthError Compare(const SequenceFrame& frame) const {
    const Image16 stored = ReadImage16(frame.depth, 1);
    if (stored.width != valid_.width || stored.height != valid_.height) {
      throw InputError(fmt::format("{}: has {}×{} pixels, the camera {}×{}", frame.depth.string(),
                                   stored.width, stored.height, valid_.width, valid_.height));
    }
    const ImageF truth = DecodeDepth(stored);
    const Image8 color = ReadColor(sequence_, frame);
    std::vector<Depths> rows(valid_.height);
    ParallelFor(0, valid_.height, [&](int64_t y) {
      for (int x = 0; x < valid_.width; ++x) {
        if (*valid_.Pixel(x, int(y)) != 0) Add(frame.world_from_camera, truth, color, x, int(y), &rows[y]);
      }
    });
    Depths all;
    for (const Depths& row : rows) all.Append(row);
    FrameDepthError result;
    result.number = frame.number;
    result.pixels = static_cast<int64_t>(all.truth.size());
    result.missing = all.missing;
    result.reconstruction = ScaleInvariantLogError(all.reconstruction, all.truth);
    result.constant = ScaleInvariantLogError(all.constant, all.truth);
    result.brightness = ScaleInvariantLogError(all.brightness, all.truth);
    return result;
  }

 private:
  void Add(const Pose& world_from_camera, const ImageF& truth, const Image8& color, int x, int y,
           Depths* depths) const {
    const double z = *truth.Pixel(x, y);
    const Vec3d ray = camera_.Unproject(Vec2d(x, y)).value();
    // A ray at or beyond 90° to the axis has no z that a scale could turn into another.
    if (!(z > 0) || std::isinf(z) || !(ray.z() > 0)) return;
    const Vec3d direction = world_from_camera.linear() * ray;
    const Vec3f origin = scene_.ToLocal(world_from_camera.translation());
    const RayHit hit = scene_.Intersect(origin, direction.cast<float>(), 0, INFINITY);
    if (!hit.hit() || !(hit.t > 0)) {
      ++depths->missing;
      return;
    }
    depths->truth.push_back(z);
    depths->reconstruction.push_back(hit.t * ray.z());
    depths->constant.push_back(1);
    depths->brightness.push_back(ray.z() / std::sqrt(Brightness(color.Pixel(x, y), ray)));
  }

  // Linear value at distance 1, in any unit.
  double Brightness(const uint8_t* rgb, const Vec3d& ray) const {
    double linear = 0;
    // Black is darker than half a step, nobody knows by how much.
    for (int c = 0; c < 3; ++c)
      linear += Decode(calibration_.response, rgb[c] == 0 ? kHalfStep8 : rgb[c] / 255.0);
    double pattern = 0;
    for (const LightSource& source : calibration_.light.sources)
      pattern += source.intensity.mean() * std::exp(-source.spread * (1 - source.direction.dot(ray)));
    return linear / (Vignetting(calibration_.response, ray.z()) * pattern);
  }

  const Sequence& sequence_;
  const Calibration& calibration_;
  RayScene scene_;
  Camera<double> camera_;
  Image8 valid_;
};

}  // namespace

ScaleInvariantError ScaleInvariantLogError(const std::vector<double>& depth,
                                           const std::vector<double>& truth) {
  if (depth.empty()) return {};
  const auto count = static_cast<double>(depth.size());
  double mean = 0, squares = 0;
  for (size_t i = 0; i < depth.size(); ++i) mean += std::log(depth[i] / truth[i]) / count;
  for (size_t i = 0; i < depth.size(); ++i) {
    const double off = std::log(depth[i] / truth[i]) - mean;
    squares += off * off;
  }
  return {std::sqrt(squares / count), std::exp(-mean)};
}

std::vector<FrameDepthError> DepthErrors(const Mesh& reconstruction, const Sequence& sequence) {
  const Comparison comparison(reconstruction, sequence);
  std::vector<FrameDepthError> errors;
  for (const SequenceFrame& frame : sequence.frames) {
    if (!frame.depth.empty()) errors.push_back(comparison.Compare(frame));
  }
  if (errors.empty())
    throw InputError(sequence.folder.string() + ": no frame has a depth file to compare with");
  return errors;
}

std::string ToTable(const std::vector<FrameDepthError>& frames) {
  std::string table =
      "scale-invariant error of log depth, after one scale a frame\n"
      "frame         pixels   missing  reconstruction  constant depth  brightness alone     scale\n";
  double sums[3] = {};
  for (const FrameDepthError& f : frames) {
    table +=
        fmt::format("{:04d}     {:>11} {:>8.2f}%  {:>14.4f}  {:>14.4f}  {:>16.4f}  {:>8.4f}\n", f.number,
                    f.pixels, 100.0 * double(f.missing) / double(std::max<int64_t>(1, f.pixels + f.missing)),
                    f.reconstruction.error, f.constant.error, f.brightness.error, f.reconstruction.scale);
    sums[0] += f.reconstruction.error;
    sums[1] += f.constant.error;
    sums[2] += f.brightness.error;
  }
  const auto count = static_cast<double>(frames.size());
  return table + fmt::format("mean                           {:>14.4f}  {:>14.4f}  {:>16.4f}\n",
                             sums[0] / count, sums[1] / count, sums[2] / count);
}

nlohmann::json ToJson(const std::vector<FrameDepthError>& frames) {
  nlohmann::json list = nlohmann::json::array();
  for (const FrameDepthError& f : frames) {
    list.push_back({{"frame", f.number},
                    {"pixels", f.pixels},
                    {"missing", f.missing},
                    {"scale", f.reconstruction.scale},
                    {"reconstruction", f.reconstruction.error},
                    {"constant", f.constant.error},
                    {"brightness", f.brightness.error}});
  }
  return list;
}

}  // namespace lumen
