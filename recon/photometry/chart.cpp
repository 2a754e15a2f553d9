#include "recon/photometry/chart.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>

#include "recon/evaluation/layout.h"

namespace lumen {
namespace {

constexpr int kLeft = 62, kRight = 12, kTop = 8, kBottom = 44, kText = 13;
constexpr Rgb8 kInk = {40, 40, 40}, kGrid = {225, 225, 225};

struct Axis {
  double low = std::numeric_limits<double>::infinity();
  double high = -std::numeric_limits<double>::infinity();
  int from_px = 0, to_px = 0;

  void Include(double value) {
    low = std::min(low, value);
    high = std::max(high, value);
  }
  void Widen() {
    // A single value still needs an axis.
    const double margin = high > low ? 0.05 * (high - low) : 1;
    low -= margin;
    high += margin;
  }
  double Pixel(double value) const { return from_px + (value - low) / (high - low) * (to_px - from_px); }
  // 1, 2 or 5 times a power of ten, some five steps an axis.
  double Step() const {
    const double rough = (high - low) / 5, power = std::pow(10, std::floor(std::log10(rough)));
    for (double factor : {1.0, 2.0, 5.0}) {
      if (rough <= factor * power) return factor * power;
    }
    return 10 * power;
  }
};

void Dot(Image8* image, int x, int y, const Rgb8& color) {
  if (x >= 0 && y >= 0 && x < image->width && y < image->height)
    std::copy_n(color.data(), 3, image->Pixel(x, y));
}

void Line(Image8* image, double x0, double y0, double x1, double y1, const Rgb8& color) {
  const int steps = std::max(1, static_cast<int>(std::ceil(std::max(std::abs(x1 - x0), std::abs(y1 - y0)))));
  for (int i = 0; i <= steps; ++i) {
    const double t = double(i) / steps;
    Dot(image, static_cast<int>(std::lround(x0 + t * (x1 - x0))),
        static_cast<int>(std::lround(y0 + t * (y1 - y0))), color);
  }
}

void Marker(Image8* image, double x, double y, const Rgb8& color) {
  for (int dy = -2; dy <= 2; ++dy) {
    for (int dx = -2; dx <= 2; ++dx) {
      if (dx * dx + dy * dy <= 5) Dot(image, int(std::lround(x)) + dx, int(std::lround(y)) + dy, color);
    }
  }
}

void DrawAxes(const Axis& x, const Axis& y, const std::string& x_label, Image8* image) {
  for (double tick = std::ceil(x.low / x.Step()) * x.Step(); tick <= x.high; tick += x.Step()) {
    Line(image, x.Pixel(tick), y.from_px, x.Pixel(tick), y.to_px, kGrid);
    // A tick that rounding leaves beside 0 is 0.
    const double shown = std::abs(tick) < 1e-9 * x.Step() ? 0 : tick;
    DrawCentred(image, int(std::lround(x.Pixel(tick))), y.from_px + kText + 4, kText,
                fmt::format("{:.4g}", shown), kInk);
  }
  for (double tick = std::ceil(y.low / y.Step()) * y.Step(); tick <= y.high; tick += y.Step()) {
    Line(image, x.from_px, y.Pixel(tick), x.to_px, y.Pixel(tick), kGrid);
    const double shown = std::abs(tick) < 1e-9 * y.Step() ? 0 : tick;
    DrawText(image, 4, int(std::lround(y.Pixel(tick))) + kText / 3, kText, fmt::format("{:.4g}", shown),
             kInk.data());
  }
  Line(image, x.from_px, y.from_px, x.to_px, y.from_px, kInk);
  Line(image, x.from_px, y.from_px, x.from_px, y.to_px, kInk);
  DrawCentred(image, (x.from_px + x.to_px) / 2, image->height - 8, kText, x_label, kInk);
}

void DrawSeries(const ChartPoints& points, const Axis& x, const Axis& y, Image8* image) {
  for (size_t i = 0; i < points.x.size(); ++i) {
    const double u = x.Pixel(points.x[i]), v = y.Pixel(points.y[i]);
    if (!points.error.empty()) {
      Line(image, u, y.Pixel(points.y[i] - points.error[i]), u, y.Pixel(points.y[i] + points.error[i]),
           points.color);
    }
    if (!points.joined) {
      Marker(image, u, v, points.color);
    } else if (i > 0) {
      Line(image, x.Pixel(points.x[i - 1]), y.Pixel(points.y[i - 1]), u, v, points.color);
    }
  }
}

}  // namespace

Image8 DrawChart(const Chart& chart, int width, int height) {
  Image8 image(width, height, 3, 255);
  Axis x, y;
  for (const ChartPoints& points : chart.series) {
    for (size_t i = 0; i < points.x.size(); ++i) {
      const double error = points.error.empty() ? 0 : points.error[i];
      x.Include(points.x[i]);
      y.Include(points.y[i] - error);
      y.Include(points.y[i] + error);
    }
  }
  if (!(x.low <= x.high)) {
    DrawCentred(&image, width / 2, height / 2, kText, "nothing to show", kInk);
    return image;
  }
  x.Widen();
  y.Widen();
  x.from_px = kLeft;
  x.to_px = width - kRight;
  y.from_px = height - kBottom;
  y.to_px = kTop;
  DrawAxes(x, y, chart.x_label, &image);
  for (const ChartPoints& points : chart.series) DrawSeries(points, x, y, &image);
  return image;
}

}  // namespace lumen
