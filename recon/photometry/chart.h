// Points with error bars and lines on axes, as a picture.
#pragma once

#include <string>
#include <vector>

#include "common/image.h"
#include "recon/evaluation/colormap.h"

namespace lumen {

struct ChartPoints {
  std::vector<double> x, y, error;  // error: half the bar's length; empty = none
  Rgb8 color = {30, 90, 170};
  bool joined = false;  // a line from point to point in place of dots
};

struct Chart {
  std::string x_label;
  std::vector<ChartPoints> series;  // drawn in order
};

// Axes that hold all points and their bars, with ticks at 1, 2 or 5 times a power of ten. Three channels.
Image8 DrawChart(const Chart& chart, int width, int height);

}  // namespace lumen
