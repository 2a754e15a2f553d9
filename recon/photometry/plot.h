// A photometric fit as a picture.
#pragma once

#include "common/image.h"
#include "recon/photometry/photometry.h"

namespace lumen {

// Six charts: the light's three factors as the pixels show them (dots) and as fitted (red) and expected
// (grey) lines, residuals by distance and angle with their standard errors, gains by frame (the sequence's
// own as a line).
Image8 PlotPhotometry(const Photometry& photometry);

}  // namespace lumen
