#include "recon/photometry/plot.h"

#include <fmt/format.h>

#include <numeric>

#include "common/plot.h"
#include "recon/evaluation/layout.h"

namespace lumen {
namespace {

constexpr int kWidth = 460, kHeight = 300;
constexpr Rgb8 kDots = {30, 90, 170}, kFitted = {205, 40, 40}, kExpected = {150, 150, 150};
// A bin in the middle of nowhere says more about its few places than about the light.
constexpr double kLeastShare = 1e-4;

PlotSeries Dots(const std::vector<Bin>& bins) {
  int64_t count = 0;
  for (const Bin& bin : bins) count += bin.count;
  PlotSeries points;
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
PlotSeries StraightLine(const PlotSeries& points, double slope, const Rgb8& color) {
  const double count = static_cast<double>(points.x.size());
  const double middle_x = std::accumulate(points.x.begin(), points.x.end(), 0.0) / count;
  const double middle_y = std::accumulate(points.y.begin(), points.y.end(), 0.0) / count;
  PlotSeries line;
  line.color = color;
  line.joined = true;
  line.dots = false;
  for (double x : {points.x.front(), points.x.back()}) {
    line.x.push_back(x);
    line.y.push_back(middle_y + slope * (x - middle_x));
  }
  return line;
}

// y = 0 over the points' range.
PlotSeries ZeroLine(const PlotSeries& points) {
  PlotSeries line;
  line.x = {points.x.front(), points.x.back()};
  line.y = {0, 0};
  line.color = kExpected;
  line.joined = true;
  line.dots = false;
  return line;
}

Panel Charted(const std::string& title, const std::string& x_label, std::vector<PlotSeries> series) {
  Plot plot;
  plot.x.label = x_label;
  plot.series = std::move(series);
  return {title, ToImage(DrawPlot(plot, kWidth, kHeight))};
}

Panel FactorPanel(const std::string& what, const std::string& x_label, const std::vector<Bin>& bins,
                  const Figure& figure, double sign) {
  std::vector<PlotSeries> series;
  const PlotSeries dots = Dots(bins);
  if (!dots.x.empty()) {
    series = {StraightLine(dots, sign * figure.expected.value(), kExpected),
              StraightLine(dots, sign * figure.value, kFitted), dots};
  }
  return Charted(fmt::format("{}: {:.3f} ± {:.3f} (expected {:.4g})", what, figure.value,
                             figure.standard_error, *figure.expected),
                 x_label, std::move(series));
}

Panel ResidualPanel(const std::string& title, const std::string& x_label, const std::vector<Bin>& bins) {
  const PlotSeries dots = Dots(bins);
  std::vector<PlotSeries> series;
  if (!dots.x.empty()) series = {ZeroLine(dots), dots};
  return Charted(title, x_label, std::move(series));
}

Panel GainPanel(const Photometry& photometry) {
  PlotSeries known, fitted;
  fitted.color = kDots;
  known.color = kExpected;
  known.joined = true;
  known.dots = false;
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
  if (fitted.x.empty()) return Charted("log gain: one frame has none to compare with", "frame", {});
  return Charted("log gain about its mean (grey: the sequence's own)", "frame", {known, fitted});
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
