#include "recon/photometry/plot.h"

#include <fmt/format.h>

#include <numeric>

#include "recon/evaluation/layout.h"
#include "recon/photometry/chart.h"

namespace lumen {
namespace {

constexpr int kWidth = 460, kHeight = 300;
constexpr Rgb8 kDots = {30, 90, 170}, kFitted = {205, 40, 40}, kExpected = {150, 150, 150};
// A bin in the middle of nowhere says more about its few places than about the light.
constexpr double kLeastShare = 1e-4;

ChartPoints Dots(const std::vector<Bin>& bins) {
  int64_t count = 0;
  for (const Bin& bin : bins) count += bin.count;
  ChartPoints points;
  points.color = kDots;
  for (const Bin& bin : bins) {
    if (double(bin.count) < kLeastShare * double(count)) continue;
    points.x.push_back(bin.at);
    points.y.push_back(bin.mean);
    points.error.push_back(bin.standard_error);
  }
  return points;
}

// Through the points' middle with the given slope, over their range.
ChartPoints StraightLine(const ChartPoints& points, double slope, const Rgb8& color) {
  const double count = static_cast<double>(points.x.size());
  const double middle_x = std::accumulate(points.x.begin(), points.x.end(), 0.0) / count;
  const double middle_y = std::accumulate(points.y.begin(), points.y.end(), 0.0) / count;
  ChartPoints line;
  line.color = color;
  line.joined = true;
  for (double x : {points.x.front(), points.x.back()}) {
    line.x.push_back(x);
    line.y.push_back(middle_y + slope * (x - middle_x));
  }
  return line;
}

// y = 0 over the points' range.
ChartPoints ZeroLine(const ChartPoints& points) {
  return {{points.x.front(), points.x.back()}, {0, 0}, {}, kExpected, true};
}

Panel FactorPanel(const std::string& what, const std::string& x_label, const std::vector<Bin>& bins,
                  const Figure& figure, double sign) {
  Chart chart = {x_label, {}};
  const ChartPoints dots = Dots(bins);
  if (!dots.x.empty()) {
    chart.series = {StraightLine(dots, sign * figure.expected.value(), kExpected),
                    StraightLine(dots, sign * figure.value, kFitted), dots};
  }
  return {fmt::format("{}: {:.3f} +- {:.3f} (expected {:.4g})", what, figure.value, figure.standard_error,
                      *figure.expected),
          DrawChart(chart, kWidth, kHeight)};
}

Panel ResidualPanel(const std::string& title, const std::string& x_label, const std::vector<Bin>& bins) {
  const ChartPoints dots = Dots(bins);
  Chart chart = {x_label, {}};
  if (!dots.x.empty()) chart.series = {ZeroLine(dots), dots};
  return {title, DrawChart(chart, kWidth, kHeight)};
}

Panel GainPanel(const Photometry& photometry) {
  ChartPoints known, fitted;
  fitted.color = kDots;
  known.color = kExpected;
  known.joined = true;
  for (int number : photometry.frame_numbers) {
    const Figure* figure = photometry.Find(GainFigureName(number));
    if (figure == nullptr) continue;
    fitted.x.push_back(number);
    fitted.y.push_back(figure->value);
    fitted.error.push_back(figure->standard_error);
    if (!figure->expected) continue;
    known.x.push_back(number);
    known.y.push_back(*figure->expected);
  }
  if (fitted.x.empty())
    return {"log gain: one frame has none to compare with", DrawChart({}, kWidth, kHeight)};
  return {"log gain about its mean (grey: the sequence's own)",
          DrawChart({"frame", {known, fitted}}, kWidth, kHeight)};
}

}  // namespace

Image8 PlotPhotometry(const Photometry& photometry) {
  return Compose(
      {FactorPanel("exponent of t", "log t (t in mm)", photometry.factor_t, *photometry.Find("t_exponent"),
                   1),
       FactorPanel("exponent of cos", "log cos of incidence", photometry.factor_cos,
                   *photometry.Find("cos_exponent"), 1),
       FactorPanel("spread", "1 - D.L", photometry.factor_axis, *photometry.Find("spread"), -1),
       ResidualPanel("residual (log) by distance", "mm", photometry.by_distance),
       ResidualPanel("residual (log) by incidence", "degrees", photometry.by_angle), GainPanel(photometry)},
      3, {});
}

}  // namespace lumen
