// Puts pictures side by side on a page, with titles and colour bars.
#pragma once

#include <functional>
#include <string>
#include <vector>

#include "common/image.h"
#include "recon/evaluation/colormap.h"

namespace lumen {

struct Panel {
  std::string title;
  Image8 image;  // three channels
};

struct ColorBar {
  std::function<Rgb8(double)> color;  // of 0 (left) … 1 (right)
  std::string low, middle, high;      // what stands under its ends and its middle
};

// Panels in rows of `columns`, a column as wide as its widest panel, each under its title; below them the
// bars side by side. White between.
Image8 Compose(const std::vector<Panel>& panels, int columns, const std::vector<ColorBar>& bars);

// The image at another size: every new pixel is the mean of the area it covers. Any
// number of channels.
Image8 Scaled(const Image8& image, int width, int height);

}  // namespace lumen
