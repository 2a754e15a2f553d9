#include "common/cost_curves.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

namespace lumen {

bool IsOnFrontier(const CostCurves& curves, const CostPoint& point, size_t measure) {
  if (!std::isfinite(point.errors[measure])) return false;
  for (const CostCurve& curve : curves.curves) {
    for (const CostPoint& other : curve.points) {
      if (other.seconds <= point.seconds && other.errors[measure] <= point.errors[measure] &&
          (other.seconds < point.seconds || other.errors[measure] < point.errors[measure])) {
        return false;
      }
    }
  }
  return true;
}

std::vector<CostPoint> Frontier(const CostCurves& curves, size_t measure) {
  std::vector<CostPoint> frontier;
  for (const CostCurve& curve : curves.curves) {
    for (const CostPoint& point : curve.points) {
      if (IsOnFrontier(curves, point, measure)) frontier.push_back(point);
    }
  }
  std::ranges::sort(frontier, {}, &CostPoint::seconds);
  return frontier;
}

std::string ToCsv(const CostCurves& curves) {
  std::string csv = "knob,setting,seconds,seconds_spread";
  for (const std::string& measure : curves.measures)
    csv += fmt::format(",{0},{0}_spread,{0}_frontier", measure);
  csv += ",default\n";
  for (const CostCurve& curve : curves.curves) {
    for (const CostPoint& point : curve.points) {
      csv +=
          fmt::format("{},{},{:.6g},{:.3g}", curve.knob, point.setting, point.seconds, point.seconds_spread);
      for (size_t m = 0; m < curves.measures.size(); ++m) {
        csv += fmt::format(",{:.6g},{:.3g},{:d}", point.errors[m], point.error_spreads[m],
                           IsOnFrontier(curves, point, m));
      }
      csv += fmt::format(",{:d}\n", point.is_default);
    }
  }
  return csv;
}

Plot CostPlot(const CostCurves& curves, size_t measure, const std::string& x_label,
              const std::string& y_label) {
  Plot plot;
  plot.x = {x_label, true, {}, {}};
  plot.y = {y_label, true, {}, {}};
  PlotSeries frontier;
  frontier.name = "frontier";
  frontier.color = {205, 205, 205};
  frontier.joined = true;
  frontier.dots = false;
  frontier.width = 7;
  for (const CostPoint& point : Frontier(curves, measure)) {
    frontier.x.push_back(point.seconds);
    frontier.y.push_back(point.errors[measure]);
  }
  plot.series.push_back(frontier);
  PlotSeries defaults;
  defaults.name = "default";
  defaults.color = {20, 20, 20};
  defaults.rings = true;
  for (const CostCurve& curve : curves.curves) {
    PlotSeries series;
    series.name = curve.knob;
    const size_t index = plot.series.size() - 1;
    series.color = PlotColor(index);
    series.dashed = index >= kPlotColors;
    series.joined = true;
    for (const CostPoint& point : curve.points) {
      series.x.push_back(point.seconds);
      series.y.push_back(point.errors[measure]);
      series.error.push_back(point.error_spreads[measure]);
      series.labels.push_back(point.setting);
      if (!point.is_default) continue;
      defaults.x.push_back(point.seconds);
      defaults.y.push_back(point.errors[measure]);
    }
    plot.series.push_back(series);
  }
  plot.series.push_back(defaults);
  return plot;
}

}  // namespace lumen
