// What a sequence with depth and normals says about its light: pixel codes, each with where the wall is to
// every light source.
#pragma once

#include <array>
#include <cstdint>
#include <string>
#include <vector>

#include "common/sequence.h"

namespace lumen {

struct PhotometryOptions {
  // Codes below it are left out. Rounding a code c to a whole number moves log(c) by −1/(24 c²) in the mean
  // (second order of the logarithm, u²/2c² with u uniform in ±½) with a variance of 1/(12 c²). The mean is
  // corrected; from 10 on what is left of it, of order 1/c⁴, is below 1e-6, and the scatter below 3%.
  int min_code = 10;
  // A pixel holds the mean over its square, depth and normals are those of its centre. Where the wall is
  // smooth, the two differ in second order only. Where a neighbour isn't where the pixel's tangent plane
  // leads to, a square may show two surfaces: with distances apart by a fraction δ their radiances are by 2δ,
  // and as no more than half the square is the other one's, the pixel is off by δ at most. A neighbour that
  // leaves the plane by more than this fraction excludes the pixel.
  double max_jump = 0.05;
  // Below this cosine of the camera's ray to the wall or of the strongest source's light to it the pixel is
  // left out: stored normals of 8 bits are off by up to 1/255, which is 4% of the radiance at 0.1.
  double min_cos = 0.1;
  // Side of the cubes in the world whose pixels may have errors in common: above the pattern of vessels and
  // mottling (7 mm).
  double cell_mm = 8;
  // Beyond that many pixels every k-th of every k-th row is taken.
  int64_t max_pixels = 2'000'000;
  // Frames that see fewer cells are left out: the standard errors come from the scatter among cells, and are
  // too small by about a part in twice their number (Cameron and Miller 2015, section VI).
  int min_cells = 10;
};

// Direction and distance from a light source to a pixel's place on the wall.
struct SourceGeometry {
  float log_distance;        // mm
  float log_cos;             // of the incidence; −infinity where the wall faces away
  float one_minus_cos_axis;  // 1 − D·L
};

// What the light's model needs to know of a source besides.
struct SourceConstants {
  Vec3d log_intensity;
  double spread_about_mean;  // its spread less the mean of all
};

// Pixels in the order of their cells.
struct Observations {
  const Sequence* sequence = nullptr;
  int sources = 0;
  std::vector<SourceConstants> constants;  // of each
  std::vector<int> frames;                 // indices into the sequence's frames that are used
  std::vector<int> left_out;  // and of those that aren't: no depth or normals, or too few cells in view
  // A pixel's:
  std::vector<int> frame;                    // index into `frames`
  std::vector<std::array<uint8_t, 3>> code;  // 0 = not to be used in this channel
  std::vector<float> log_vignetting;
  std::vector<SourceGeometry> geometry;  // `sources` of them a pixel
  // Pixels of cell k: [cell_begin[k], cell_begin[k + 1]).
  std::vector<int64_t> cell_begin;
  // What was left out, in pixels taken: saturated or dark are counted by channel.
  int64_t taken = 0;       // valid ones, before any of this
  int64_t no_surface = 0;  // nothing there, or beyond the depth's range
  int64_t edges = 0;
  int64_t grazing = 0;
  std::array<int64_t, 3> saturated{}, dark{};

  int64_t size() const { return static_cast<int64_t>(frame.size()); }
  int cells() const { return static_cast<int>(cell_begin.size()) - 1; }
};

// Reads the sequence's frames. The sequence is referred to. Throws InputError: no frame has depth and
// normals, none sees enough of the wall, a file of another size than the camera.
Observations Observe(const Sequence& sequence, const PhotometryOptions& options);

}  // namespace lumen
