// Colours for numbers, as in the paper's figures.
#pragma once

#include <vector>

#include "common/image.h"

namespace lumen {

inline constexpr Rgb8 kUnobservedGrey = {150, 150, 150};

// Diverging: blue at −1, light grey at 0, red at 1, linear in between, saturated beyond. The outer halves
// darken, as those of matplotlib's "seismic" do; its white middle is grey here, as white would vanish on the
// page.
Rgb8 Seismic(double x);

// The rainbow from dark blue (0) to dark red (1), clipped beyond: MATLAB's "jet" of piecewise linear
// channels.
Rgb8 Jet(double x);

// Seismic of a signed error, saturated at ±limit_mm.
std::vector<Rgb8> ErrorColors(const std::vector<double>& signed_error_mm, double limit_mm);

// Jet of how many frames see a place, 1…frames; unobserved grey for none.
std::vector<Rgb8> CountColors(const std::vector<int>& frames_seeing, int frames);

}  // namespace lumen
