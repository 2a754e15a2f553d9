// Points, lines and error bars on linear or logarithmic axes, with a legend beside them.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "common/drawing.h"

namespace lumen {

struct PlotSeries {
  std::string name;                 // in the legend; empty = not there
  std::vector<double> x, y;         // as many; points that an axis can't show (not finite, not positive on a
                                    // logarithmic one) are left out
  std::vector<double> error;        // half the length of a vertical bar; empty = none
  std::vector<std::string> labels;  // beside the points, where there is room; empty = none
  Rgb8 color = {30, 90, 170};
  bool dots = true;
  bool joined = false;  // a line from point to point
  bool dashed = false;
  bool rings = false;  // rings around the points in place of dots: to mark them
  double width = 1.5;  // of the line, px
};

struct PlotAxis {
  std::string label;
  bool logarithmic = false;
  std::optional<double> low, high;  // limits; nothing = as the points want
};

struct Plot {
  std::string title;  // empty = none
  PlotAxis x, y;
  std::vector<PlotSeries> series;  // drawn in order
};

// Axes that hold all points and bars, with ticks at 1, 2 or 5 times a power of ten. Labels of points avoid
// the points, lines and each other; one that finds no place is left out.
Drawing DrawPlot(const Plot& plot, double width, double height);

// Distinct colours for the curves of a plot; they return after so many.
inline constexpr size_t kPlotColors = 12;
Rgb8 PlotColor(size_t index);

}  // namespace lumen
