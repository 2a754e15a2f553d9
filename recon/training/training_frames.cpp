#include "recon/training/training_frames.h"

#include <algorithm>
#include <atomic>
#include <cmath>

#include "common/error.h"
#include "common/parallel.h"
#include "common/random.h"
#include "recon/training/hue_slope.h"
#include "recon/training/plausible.h"

namespace lumen {
namespace {

constexpr double kHalfStep = 0.5 / 255;  // what 8 bits can't tell from black

// L_e along a ray from the camera's centre: what the sources would send there from a common place, channels
// averaged.
double PatternAlong(const Light& light, const Vec3d& ray) {
  double sum = 0;
  for (const LightSource& source : light.sources) {
    sum += source.intensity.mean() * std::exp(-source.spread * (1 - source.direction.dot(ray)));
  }
  return sum;
}

}  // namespace

std::vector<size_t> SpreadEvenly(size_t available, size_t kept) {
  kept = std::min(kept, available);
  std::vector<size_t> places(kept);
  for (size_t i = 0; i < kept; ++i) {
    const size_t begin = available * i / kept, end = available * (i + 1) / kept;
    places[i] = begin + RandomBits(0x7370726561640aull, i) % (end - begin);
  }
  return places;
}

TrainingFrames::TrainingFrames(const Sequence& sequence, int count, bool lit, size_t bytes)
    : calibration_(sequence.calibration), lit_(lit) {
  const int available = static_cast<int>(sequence.frames.size());
  const int taken = std::min(count, available);
  const size_t bytes_a_pixel = sizeof(Vec3f) + 2 * sizeof(float) + 3 * static_cast<size_t>(taken);
  const std::vector<size_t> pixels = FindPixels(std::max<size_t>(1, bytes / bytes_a_pixel));
  if (pixels.empty()) throw InputError(sequence.folder.string() + ": no pixel carries image; check the mask");
  for (int i = 0; i < 256; ++i) decoded_[i] = static_cast<float>(Decode(calibration_.response, i / 255.0));

  const Image8 valid = ValidPixels(calibration_);
  HueSlope hue;
  for (int i = 0; i < taken; ++i) {
    const int index =
        taken > 1 ? static_cast<int>(std::lround(double(i) * (available - 1) / (taken - 1))) : 0;
    const SequenceFrame& source = sequence.frames[index];
    const Image8 color = ReadColor(sequence, source);
    if (lit_) hue.Add(color, valid, calibration_.response);
    Frame frame;
    frame.gain = source.gain.value_or(1.0);
    frame.log_gain_reach = source.gain ? source.log_gain_error.value_or(0.0) : INFINITY;
    gains_known_ = gains_known_ && source.gain.has_value() && !source.log_gain_error;
    frame.rgb.reserve(pixels.size() * 3);
    for (size_t pixel : pixels) {
      frame.rgb.insert(frame.rgb.end(), color.data.begin() + 3 * pixel, color.data.begin() + 3 * pixel + 3);
    }
    frames_.push_back(std::move(frame));
    numbers_.push_back(source.number);
    poses_.push_back(source.world_from_camera);
  }
  hue_slope_ = hue.Slope();
  CheckPoses(sequence.folder, numbers_, poses_);
  if (lit_) FindScale(sequence);
}

std::vector<size_t> TrainingFrames::FindPixels(size_t most) {
  const Camera<double> camera(calibration_.camera);
  const Light& light = calibration_.light;
  // Where the light's pattern is so dark that a wall which saturates the middle is black there, nothing is
  // told; and far enough off its axis a narrow beam's exponential is no float at all.
  double brightest = 0;
  for (const LightSource& source : light.sources)
    brightest = std::max(brightest, PatternAlong(light, source.direction));
  const double darkest = lit_ ? brightest * std::pow(kHalfStep, 1 / inverse_gamma()) : 0;

  Image8 valid = ValidPixels(calibration_);
  const auto unproject = [&](size_t pixel) {
    return camera.Unproject(Vec2d(double(pixel % valid.width), double(pixel / valid.width)));
  };
  std::atomic<size_t> count = 0;
  ParallelFor(0, valid.height, [&](int64_t y) {
    size_t of_row = 0;
    for (size_t pixel = size_t(y) * valid.width; pixel < size_t(y + 1) * valid.width; ++pixel) {
      if (valid.data[pixel] == 0) continue;
      const auto ray = unproject(pixel);
      // Where vignetting leaves less than half a step, a pixel is black whatever is there.
      const bool tells = ray && Vignetting(calibration_.response, ray->z()) >= kHalfStep &&
                         PatternAlong(light, *ray) >= darkest;
      if (!tells) valid.data[pixel] = 0;
      of_row += tells;
    }
    count += of_row;
  });
  std::vector<size_t> pixels = SpreadEvenly(count, most);  // among those that are left, so far
  size_t place = 0, kept = 0;
  for (size_t pixel = 0; kept < pixels.size(); ++pixel) {
    if (valid.data[pixel] == 0 || place++ != pixels[kept]) continue;
    pixels[kept++] = pixel;
    const Vec3d ray = *unproject(pixel);
    rays_.push_back(ray.cast<float>());
    vignetting_.push_back(static_cast<float>(Vignetting(calibration_.response, ray.z())));
    pattern_.push_back(static_cast<float>(PatternAlong(light, ray)));
  }
  return pixels;
}

double TrainingFrames::inverse_gamma() const {
  return 1 / (calibration_.response.srgb ? 2.2 : calibration_.response.gamma);
}

double TrainingFrames::Normaliser(size_t pixel) const { return double(vignetting_[pixel]) * pattern_[pixel]; }

void TrainingFrames::FindScale(const Sequence& sequence) {
  double sum = 0;
  size_t count = 0, saturated = 0;
  std::vector<double> radiance;  // a frame: the mean of what its pixels show at gain 1
  for (const Frame& frame : frames_) {
    double shown = 0;
    const size_t before = count;
    for (size_t pixel = 0; pixel < rays_.size(); pixel += 97) {
      for (int c = 0; c < 3; ++c, ++count) {
        const uint8_t value = frame.rgb[3 * pixel + c];
        const double linear = decoded_[value] / (frame.gain * Normaliser(pixel));
        sum += std::pow(linear, inverse_gamma());
        shown += decoded_[value] / frame.gain;
        saturated += value == 255;
      }
    }
    radiance.push_back(shown / static_cast<double>(count - before));
  }
  const std::string folder = sequence.folder.string();
  if (calibration_.light.sources.empty()) throw InputError(folder + ": no light source");
  if (!(sum > 0)) throw InputError(folder + ": all frames are black");
  if (saturated == count) {
    throw InputError(folder + ": all frames are white: saturated pixels say nothing of the wall's distance");
  }
  if (gains_known_) CheckGains(folder, numbers_, radiance);
  scale_ = std::pow(2 * sum / static_cast<double>(count), 1 / inverse_gamma());
}

double TrainingFrames::LogGainReach(int frame) const { return frames_[frame].log_gain_reach; }

Vec3d TrainingFrames::MeanRadiance(int frame) const {
  Vec3d sum = Vec3d::Zero();
  for (size_t pixel = 0; pixel < rays_.size(); ++pixel) {
    for (int c = 0; c < 3; ++c) sum[c] += decoded_[frames_[frame].rgb[3 * pixel + c]] / vignetting_[pixel];
  }
  return sum / (frames_[frame].gain * static_cast<double>(rays_.size()));
}

void TrainingFrames::Draw(uint64_t draw, const Vec3d& origin, RayBatch<float>::Ray* ray) const {
  // Two independent numbers from the upper and the lower half.
  const size_t frame_index = ((draw >> 32) * frames_.size()) >> 32;
  const size_t pixel = ((draw & 0xffffffffull) * rays_.size()) >> 32;
  const Frame& frame = frames_[frame_index];
  const Pose& pose = poses_[frame_index];
  ray->origin = (pose.translation() - origin).cast<float>();
  ray->direction = (pose.linear() * rays_[pixel].cast<double>()).cast<float>();
  ray->frame = static_cast<int>(frame_index);
  const float normaliser = static_cast<float>(frame.gain * Normaliser(pixel) * scale_);
  ray->exposure = lit_ ? 1 / (pattern_[pixel] * static_cast<float>(scale_)) : 1.0f;
  const float gamma = static_cast<float>(1 / inverse_gamma());
  ray->floor = std::pow(static_cast<float>(kHalfStep), gamma) / normaliser;
  for (int c = 0; c < 3; ++c) {
    const uint8_t value = frame.rgb[3 * pixel + c];
    ray->bound[c] = value == 255 ? PixelBound::kAtLeast
                    : value == 0 ? PixelBound::kAtMost
                                 : PixelBound::kExact;
    const float seen = value == 0 ? static_cast<float>(kHalfStep) : value / 255.0f;
    if (lit_) {
      const float linear = value == 0 ? std::pow(static_cast<float>(kHalfStep), gamma) : decoded_[value];
      ray->observed[c] = std::pow(linear / normaliser, 1 / gamma);
    } else {
      ray->observed[c] = seen;
    }
  }
}

}  // namespace lumen
