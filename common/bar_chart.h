// Horizontal bars with their numbers beside them.
#pragma once

#include <string>
#include <vector>

#include "common/drawing.h"

namespace lumen {

struct ChartBar {
  std::string label;  // left of the axis
  double value = 0, error = 0;
  std::string note;  // right of the bar
};

// Bars from 0, one below the other.
Drawing DrawBars(const std::string& title, const std::vector<ChartBar>& bars, double width, double height);

}  // namespace lumen
