// The frames that a run trains on: their pixels, photometrically normalised as in the paper,
// I′ = (I^γ / (L_e g))^(1/γ), and the rays that see them.
#pragma once

#include <cstdint>
#include <optional>
#include <vector>

#include "common/sequence.h"
#include "recon/training/memory.h"
#include "recon/training/options.h"
#include "recon/training/ray_loss.h"

namespace lumen {

// `kept` of `available` places in ascending order, one at random in each of as many equal parts; all of them,
// if kept ≥ available.
std::vector<uint32_t> SpreadEvenly(size_t available, size_t kept);

class TrainingFrames {
 public:
  // Reads `count` frames taken uniformly over the sequence (all, if there are fewer), one after the other.
  // `lit`: normalise; otherwise pixels stay as they are (NeuS). bytes: see kFrameBytes; the pixels have half
  // of it at least. Throws InputError: a frame unreadable, no pixel valid, all pixels black or all saturated,
  // poses that no colon has room for. Says in a line what is odd about poses and gains.
  TrainingFrames(const Sequence& sequence, int count, bool lit, size_t bytes = kFrameBytes);

  int size() const { return static_cast<int>(frames_.size()); }
  // NNNN of a frame's files.
  int number(int frame) const { return numbers_[frame]; }
  // Poses of the frames taken.
  const std::vector<Pose>& world_from_camera() const { return poses_; }
  const Light& light() const { return calibration_.light; }
  // Unit rays in camera axes of the image's valid pixels that are kept.
  const std::vector<Vec3f>& pixel_rays() const { return pixels_.value().rays; }
  // Of every frame, and for good.
  bool gains_known() const { return gains_known_; }
  // By how much the logarithm of a frame's gain may be off from what the sequence says: one standard error of
  // an estimate, for a drift of the gains can make up for a far wall that is still too near, and training
  // left to itself strays that way; infinite where it says nothing, 0 where it knows.
  double LogGainReach(int frame) const;
  // Whether the first frame's gain is unknown and others' are not; if all are unknown, it is 1.
  bool learns_first_gain() const;
  // Whether all gains are unknown, so that they are known up to a common factor only.
  bool gains_relative() const;
  // Over the frames taken (HueSlope).
  double hue_slope() const { return hue_slope_; }
  // 1/γ of the comparison; for an sRGB response that of the 2.2 which approximates it.
  double inverse_gamma() const;

  // Mean over a frame's valid pixels of the radiance that they show, RGB, in units of full scale at gain 1
  // (or at the frame's own gain, where that is unknown). Saturated pixels count as full scale.
  Vec3d MeanRadiance(int frame) const;

  // Fills the pixels' part of rays: direction and origin relative to `origin`, frame, exposure, floor,
  // observed value and its bounds. Frame and pixel of ray r are chosen, uniformly, by (key, first + r).
  void Draw(uint64_t key, uint64_t first, const Vec3d& origin, std::vector<RayBatch<float>::Ray>* rays) const;

  // Gives back what the pixels take up. Who asks for rays or a frame's radiance afterwards gets
  // std::bad_optional_access.
  void ReleasePixels() { pixels_.reset(); }

 private:
  struct Frame {
    double gain;  // 1 where unknown
    double log_gain_reach;
  };
  // That are kept, the same of every frame.
  struct Pixels {
    std::vector<Vec3f> rays;
    std::vector<float> vignetting;
    std::vector<float> pattern;             // L_e on its ray, mm²
    std::vector<std::vector<uint8_t>> rgb;  // a frame: three a pixel
    double Normaliser(size_t pixel) const { return double(vignetting[pixel]) * pattern[pixel]; }
  };
  struct Place {
    size_t frame, pixel;
  };
  Place PlaceOf(uint64_t draw, const Pixels& pixels) const;
  void Fill(const Place& place, const Pixels& pixels, const Vec3d& origin, RayBatch<float>::Ray* ray) const;
  // Fills what pixels_ has one of a pixel; their places in the image, ascending.
  std::vector<uint32_t> FindPixels(const Calibration& calibration, size_t most);
  void ReadFrames(const Sequence& sequence, const std::vector<int>& indices,
                  const std::vector<uint32_t>& places);
  void FindScale(const Sequence& sequence);

  Calibration calibration_;  // without its mask
  bool lit_;
  bool gains_known_ = true;
  double hue_slope_ = 0;
  std::vector<int> numbers_;
  std::vector<Pose> poses_;
  std::vector<Frame> frames_;
  std::optional<Pixels> pixels_ = Pixels();
  double scale_ = 1;  // 1/mm²: brings normalised pixels to a mean of one half
  float decoded_[256];
};

// The frames that a run with these options trains on.
TrainingFrames FramesFor(const Sequence& sequence, const TrainOptions& options, uint64_t seed);

}  // namespace lumen
