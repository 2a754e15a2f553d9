// A converged picture, and how far others are from it.
#pragma once

#include <array>
#include <vector>

#include "common/image.h"

namespace lumen {

// By how much a picture is off: a pixel's luminance, or the mean of a block of 8×8, which noise that
// neighbours have in common is not averaged out of.
enum class ErrorMeasure { kPixels, kBlocks };
inline constexpr std::array kErrorMeasures = {ErrorMeasure::kPixels, ErrorMeasure::kBlocks};

// A picture's luminance (Rec. 709): of its valid pixels, of the blocks all of whose pixels are valid, and its
// sums over tiles that are large enough to err independently of each other.
struct Luminance {
  std::vector<double> pixels, blocks, tile_sums;
  double sum = 0;
};

// radiance: linear, RGB; valid: of its size, 0 = not.
Luminance LuminanceOf(const ImageF& radiance, const Image8& valid);

// Mean luminance less the reference's, in parts of that.
struct Bias {
  double value = 0, standard_error = 0;
};

// The mean of two pictures whose errors are independent: their difference says how far it may be off.
class Reference {
 public:
  Reference(Luminance first, Luminance second);

  // Its own error, as that of others below.
  double Noise(ErrorMeasure measure) const;
  // The standard error of its mean luminance, in parts of that.
  double MeanError() const;

  // Root mean square difference, in parts of the mean luminance, with the reference's own noise taken off;
  // NaN where the difference is less than twice that noise (in squares): then it says nothing.
  double Error(const Luminance& picture, ErrorMeasure measure) const;
  // Of pictures with independent errors and one expectation; two at least. The standard error comes from how
  // their tiles differ, so that what they have in common doesn't count as chance.
  Bias BiasOf(const std::vector<Luminance>& pictures) const;

 private:
  struct Part {
    std::vector<double> mean;
    double variance;  // of the mean, mean over its places
  };
  const Part& Of(ErrorMeasure measure) const { return measure == ErrorMeasure::kPixels ? pixels_ : blocks_; }

  Part pixels_, blocks_;
  double sum_, sum_variance_;
  double mean_;  // luminance of a pixel
};

}  // namespace lumen
