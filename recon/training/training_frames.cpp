#include "recon/training/training_frames.h"

#include <algorithm>
#include <cmath>
#include <numeric>
#include <optional>

#include "common/binning.h"
#include "common/error.h"
#include "common/parallel.h"
#include "common/random.h"
#include "recon/training/hue_slope.h"
#include "recon/training/plausible.h"
#include "recon/training/pose_noise.h"

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

std::vector<uint32_t> SpreadEvenly(size_t available, size_t kept) {
  kept = std::min(kept, available);
  std::vector<uint32_t> places(kept);
  for (size_t i = 0; i < kept; ++i) {
    const size_t begin = available * i / kept, end = available * (i + 1) / kept;
    places[i] = static_cast<uint32_t>(begin + RandomBits(0x7370726561640aull, i) % (end - begin));
  }
  return places;
}

TrainingFrames::TrainingFrames(const Sequence& sequence, int count, bool lit, size_t bytes)
    : calibration_{sequence.calibration.camera,
                   {},
                   sequence.calibration.light,
                   sequence.calibration.response},
      lit_(lit) {
  const int available = static_cast<int>(sequence.frames.size());
  const int taken = std::min(count, available);
  const size_t bytes_a_pixel =
      sizeof(Vec3f) + 2 * sizeof(float) + sizeof(uint32_t) + 3 * static_cast<size_t>(taken);
  const size_t mask_bytes = std::min(sequence.calibration.mask.data.size(), bytes / 2);
  const std::vector<uint32_t> places =
      FindPixels(sequence.calibration, std::max<size_t>(1, (bytes - mask_bytes) / bytes_a_pixel));
  if (places.empty()) throw InputError(sequence.folder.string() + ": no pixel carries image; check the mask");
  for (int i = 0; i < 256; ++i) decoded_[i] = static_cast<float>(Decode(calibration_.response, i / 255.0));
  ReadFrames(sequence, UniformFrames(available, taken), places);
  CheckPoses(sequence.folder, numbers_, poses_);
  if (lit_) FindScale(sequence);
}

void TrainingFrames::ReadFrames(const Sequence& sequence, const std::vector<int>& indices,
                                const std::vector<uint32_t>& places) {
  const CameraIntrinsics& intrinsics = calibration_.camera;
  const Camera<double> camera(intrinsics);
  std::optional<HueSlope> hue;
  if (lit_) {
    hue.emplace(calibration_.response, intrinsics.width, intrinsics.height,
                [&](int y) { return ValidPixelsOfRow(sequence.calibration, camera, y); });
  }
  for (const int index : indices) {
    const SequenceFrame& source = sequence.frames[index];
    Frame frame;
    frame.gain = source.gain.value_or(1.0);
    frame.log_gain_reach = source.gain ? source.log_gain_error.value_or(0.0) : INFINITY;
    gains_known_ = gains_known_ && source.gain.has_value() && !source.log_gain_error;
    std::vector<uint8_t>& shown = pixels_->rgb.emplace_back();
    shown.reserve(places.size() * 3);
    auto place = places.begin();
    ReadColorRows(sequence, source, [&](int y, const uint8_t* rgb) {
      if (hue) hue->AddRow(y, rgb);
      const size_t row = size_t(y) * intrinsics.width;
      for (; place != places.end() && *place < row + intrinsics.width; ++place) {
        const uint8_t* kept = rgb + 3 * (*place - row);
        shown.insert(shown.end(), kept, kept + 3);
      }
    });
    frames_.push_back(frame);
    numbers_.push_back(source.number);
    poses_.push_back(source.world_from_camera);
  }
  if (hue) hue_slope_ = hue->Slope();
}

std::vector<uint32_t> TrainingFrames::FindPixels(const Calibration& calibration, size_t most) {
  const Camera<double> camera(calibration.camera);
  const Light& light = calibration.light;
  // Where the light's pattern is so dark that a wall which saturates the middle is black there, nothing is
  // told; and far enough off its axis a narrow beam's exponential is no float at all.
  double brightest = 0;
  for (const LightSource& source : light.sources)
    brightest = std::max(brightest, PatternAlong(light, source.direction));
  const double darkest = lit_ ? brightest * std::pow(kHalfStep, 1 / inverse_gamma()) : 0;
  // Where vignetting leaves less than half a step, a pixel is black whatever is there.
  const auto tells = [&](const Vec3d& ray) {
    return Vignetting(calibration.response, ray.z()) >= kHalfStep && PatternAlong(light, ray) >= darkest;
  };

  const int width = calibration.camera.width, height = calibration.camera.height;
  std::vector<std::vector<bool>> rows(height);
  std::vector<size_t> begin(height + 1, 0);  // of a row's pixels among all that tell something
  ParallelFor(0, height, [&](int64_t y) {
    const std::vector<uint8_t> valid = ValidPixelsOfRow(calibration, camera, static_cast<int>(y));
    rows[y].resize(width);
    for (int x = 0; x < width; ++x)
      rows[y][x] = valid[x] != 0 && tells(*camera.Unproject(Vec2d(x, double(y))));
    begin[y + 1] = static_cast<size_t>(std::ranges::count(rows[y], true));
  });
  std::partial_sum(begin.begin(), begin.end(), begin.begin());

  std::vector<uint32_t> places = SpreadEvenly(begin.back(), most);  // among those that tell something, so far
  Pixels& pixels = *pixels_;
  pixels.rays.resize(places.size());
  pixels.vignetting.resize(places.size());
  pixels.pattern.resize(places.size());
  // A row looks up and replaces its own places only.
  std::vector<size_t> first(height + 1);
  for (int y = 0; y <= height; ++y)
    first[y] = static_cast<size_t>(std::ranges::lower_bound(places, begin[y]) - places.begin());
  ParallelFor(0, height, [&](int64_t y) {
    size_t kept = first[y], place = begin[y];
    for (int x = 0; x < width && kept < first[y + 1]; ++x) {
      if (!rows[y][x] || place++ != places[kept]) continue;
      const Vec3d ray = *camera.Unproject(Vec2d(x, double(y)));
      pixels.rays[kept] = ray.cast<float>();
      pixels.vignetting[kept] = static_cast<float>(Vignetting(calibration.response, ray.z()));
      pixels.pattern[kept] = static_cast<float>(PatternAlong(light, ray));
      places[kept++] = static_cast<uint32_t>(y * width + x);
    }
  });
  return places;
}

double TrainingFrames::inverse_gamma() const {
  return 1 / (calibration_.response.srgb ? 2.2 : calibration_.response.gamma);
}

void TrainingFrames::FindScale(const Sequence& sequence) {
  double sum = 0;
  size_t count = 0, saturated = 0;
  std::vector<double> radiance;  // a frame: the mean of what its pixels show at gain 1
  for (size_t f = 0; f < frames_.size(); ++f) {
    const double gain = frames_[f].gain;
    double shown = 0;
    const size_t before = count;
    for (size_t pixel = 0; pixel < pixels_->rays.size(); pixel += 97) {
      for (int c = 0; c < 3; ++c, ++count) {
        const uint8_t value = pixels_->rgb[f][3 * pixel + c];
        const double linear = decoded_[value] / (gain * pixels_->Normaliser(pixel));
        sum += std::pow(linear, inverse_gamma());
        shown += decoded_[value] / gain;
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

bool TrainingFrames::gains_relative() const {
  return std::ranges::all_of(frames_, [](const Frame& frame) { return std::isinf(frame.log_gain_reach); });
}

bool TrainingFrames::learns_first_gain() const {
  return std::isinf(frames_[0].log_gain_reach) &&
         std::ranges::any_of(frames_, [](const Frame& frame) { return std::isfinite(frame.log_gain_reach); });
}

Vec3d TrainingFrames::MeanRadiance(int frame) const {
  const Pixels& pixels = pixels_.value();
  Vec3d sum = Vec3d::Zero();
  for (size_t pixel = 0; pixel < pixels.rays.size(); ++pixel) {
    for (int c = 0; c < 3; ++c)
      sum[c] += decoded_[pixels.rgb[frame][3 * pixel + c]] / pixels.vignetting[pixel];
  }
  return sum / (frames_[frame].gain * static_cast<double>(pixels.rays.size()));
}

// Two independent numbers from the upper and the lower half.
TrainingFrames::Place TrainingFrames::PlaceOf(uint64_t draw, const Pixels& pixels) const {
  return {((draw >> 32) * frames_.size()) >> 32, ((draw & 0xffffffffull) * pixels.rays.size()) >> 32};
}

void TrainingFrames::Draw(uint64_t key, uint64_t first, const Vec3d& origin,
                          std::vector<RayBatch<float>::Ray>* rays) const {
  const Pixels& pixels = pixels_.value();
  const auto place = [&](size_t r) { return PlaceOf(RandomBits(key, first + r), pixels); };
  // So that rays don't wait for memory one by one. (In a function of its own the compiler takes this for
  // nothing and leaves it out.)
  for (size_t r = 0; r < rays->size(); ++r) {
    const auto [frame, pixel] = place(r);
    __builtin_prefetch(&pixels.rgb[frame][3 * pixel]);
    __builtin_prefetch(&pixels.rays[pixel]);
    __builtin_prefetch(&pixels.vignetting[pixel]);
    __builtin_prefetch(&pixels.pattern[pixel]);
  }
  for (size_t r = 0; r < rays->size(); ++r) Fill(place(r), pixels, origin, &(*rays)[r]);
}

void TrainingFrames::Fill(const Place& place, const Pixels& pixels, const Vec3d& origin,
                          RayBatch<float>::Ray* ray) const {
  const auto [frame_index, pixel] = place;
  const Frame& frame = frames_[frame_index];
  const Pose& pose = poses_[frame_index];
  ray->origin = (pose.translation() - origin).cast<float>();
  ray->direction = (pose.linear() * pixels.rays[pixel].cast<double>()).cast<float>();
  ray->frame = static_cast<int>(frame_index);
  const float normaliser = static_cast<float>(frame.gain * pixels.Normaliser(pixel) * scale_);
  ray->exposure = lit_ ? 1 / (pixels.pattern[pixel] * static_cast<float>(scale_)) : 1.0f;
  const float gamma = static_cast<float>(1 / inverse_gamma());
  const float darkest = std::pow(static_cast<float>(kHalfStep), gamma);
  ray->floor = darkest / normaliser;
  for (int c = 0; c < 3; ++c) {
    const uint8_t value = pixels.rgb[frame_index][3 * pixel + c];
    ray->bound[c] = value == 255 ? PixelBound::kAtLeast
                    : value == 0 ? PixelBound::kAtMost
                                 : PixelBound::kExact;
    const float seen = value == 0 ? static_cast<float>(kHalfStep) : value / 255.0f;
    if (lit_) {
      const float linear = value == 0 ? darkest : decoded_[value];
      ray->observed[c] = std::pow(linear / normaliser, 1 / gamma);
    } else {
      ray->observed[c] = seen;
    }
  }
}

TrainingFrames FramesFor(const Sequence& given, const TrainOptions& options, uint64_t seed) {
  const bool lit = options.field.reflectance != Reflectance::kUnlit;
  std::optional<Sequence> changed;  // what isn't changed isn't copied: a mask may be large
  if (options.binning != 1) changed = Binned(given, options.binning);
  if (options.poses.disturb_mm > 0 || options.poses.disturb_rad > 0) {
    if (!changed) changed = given;
    AddPoseNoise({options.poses.disturb_mm, options.poses.disturb_rad}, seed, &*changed);
  }
  return TrainingFrames(changed ? *changed : given, options.frames, lit, FrameBytes(options));
}

}  // namespace lumen
