// What accuracy costs in time: curves of error against seconds, one a knob that trades them.
#pragma once

#include <string>
#include <vector>

#include "common/plot.h"

namespace lumen {

// One setting of a knob. Spreads are half the range over the runs.
struct CostPoint {
  std::string setting;  // "16"
  double seconds = 0, seconds_spread = 0;
  std::vector<double> errors, error_spreads;  // one a measure; NaN = not known
  bool is_default = false;                    // the setting that holds where nobody chooses
};

struct CostCurve {
  std::string knob;
  std::vector<CostPoint> points;
};

// Curves whose errors can be compared.
struct CostCurves {
  std::vector<std::string> measures;  // names of the errors: "pixel_error"
  std::vector<CostCurve> curves;
};

// Whether the point's error is known and no other point is both no slower and no worse, and better in one.
bool IsOnFrontier(const CostCurves& curves, const CostPoint& point, size_t measure);

// Those points, by seconds.
std::vector<CostPoint> Frontier(const CostCurves& curves, size_t measure);

// A line a point: knob, setting, seconds, errors, their spreads, whether default and whether on the frontier
// of each measure.
std::string ToCsv(const CostCurves& curves);

// Both axes logarithmic, each point with its setting beside it; the frontier grey behind the curves, defaults
// ringed. x_label names the kind of seconds.
Plot CostPlot(const CostCurves& curves, size_t measure, const std::string& x_label,
              const std::string& y_label);

}  // namespace lumen
