#include "common/plot.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>

namespace lumen {
namespace {

constexpr double kLeft = 56, kRight = 14, kTop = 26, kTitle = 20, kBottom = 46, kText = 13, kSmallText = 11;
constexpr double kLegendRow = 19, kLegendLine = 24, kDot = 2.6, kRing = 6;
constexpr Rgb8 kInk = {40, 40, 40}, kGrid = {225, 225, 225};

// An axis' scale: where a value is, px.
class Scale {
 public:
  Scale(const PlotAxis& axis, double from_px, double to_px)
      : logarithmic_(axis.logarithmic), from_px_(from_px), to_px_(to_px) {}

  bool Shows(double value) const { return std::isfinite(value) && (!logarithmic_ || value > 0); }
  void Include(double value) {
    if (!Shows(value)) return;
    low_ = std::min(low_, At(value));
    high_ = std::max(high_, At(value));
  }
  bool empty() const { return !(low_ <= high_); }
  void Settle(const PlotAxis& axis) {
    // A single value still needs an axis.
    const double margin = high_ > low_ ? 0.05 * (high_ - low_) : logarithmic_ ? 0.3 : 1;
    low_ = axis.low ? At(*axis.low) : low_ - margin;
    high_ = axis.high ? At(*axis.high) : high_ + margin;
  }
  double Pixel(double value) const {
    return from_px_ + (At(value) - low_) / (high_ - low_) * (to_px_ - from_px_);
  }

  std::vector<double> Ticks() const { return logarithmic_ ? LogarithmicTicks() : LinearTicks(); }

 private:
  double At(double value) const { return logarithmic_ ? std::log10(value) : value; }

  // 1, 2 or 5 times a power of ten, some five steps an axis.
  std::vector<double> LinearTicks() const {
    const double rough = (high_ - low_) / 5, power = std::pow(10, std::floor(std::log10(rough)));
    const double step = rough <= power       ? power
                        : rough <= 2 * power ? 2 * power
                        : rough <= 5 * power ? 5 * power
                                             : 10 * power;
    std::vector<double> ticks;
    // + 0: a tick at −0 is 0.
    for (double i = std::ceil(low_ / step); i * step <= high_; ++i) ticks.push_back(i * step + 0.0);
    return ticks;
  }

  // Powers of ten, with 2 and 5 times them where that leaves room.
  std::vector<double> LogarithmicTicks() const {
    const bool dense = high_ - low_ < 2.6;
    const int step = std::max(1, static_cast<int>(std::ceil((high_ - low_) / 6)));
    std::vector<double> ticks;
    for (int decade = static_cast<int>(std::floor(low_)); decade <= high_; ++decade) {
      for (double factor : {1.0, 2.0, 5.0}) {
        if (factor == 1 ? decade % step != 0 : !dense) continue;
        const double tick = factor * std::pow(10, decade);
        if (At(tick) >= low_ && At(tick) <= high_) ticks.push_back(tick);
      }
    }
    return ticks;
  }

  bool logarithmic_;
  double from_px_, to_px_;
  double low_ = std::numeric_limits<double>::infinity();
  double high_ = -std::numeric_limits<double>::infinity();
};

struct Box {
  double x0, y0, x1, y1;
  bool Overlaps(const Box& other) const {
    return x0 < other.x1 && other.x0 < x1 && y0 < other.y1 && other.y0 < y1;
  }
};

class PlotDrawer {
 public:
  PlotDrawer(const Plot& plot, double width, double height)
      : plot_(plot),
        drawing_{width, height, {}},
        inside_{kLeft, kTop + (plot.title.empty() ? 0 : kTitle), width - kRight - LegendWidth(plot),
                height - kBottom},
        x_(plot.x, inside_.x0, inside_.x1),
        y_(plot.y, inside_.y1, inside_.y0) {}

  Drawing Draw() {
    for (const PlotSeries& series : plot_.series) Include(series);
    if (!plot_.title.empty()) Text({kLeft, kTitle - 4}, plot_.title, kText + 1, TextAlign::kLeft);
    if (x_.empty() || y_.empty()) {
      Text({(inside_.x0 + inside_.x1) / 2, (inside_.y0 + inside_.y1) / 2}, "nothing to show", kText,
           TextAlign::kCentre);
      return drawing_;
    }
    x_.Settle(plot_.x);
    y_.Settle(plot_.y);
    DrawAxes();
    for (const PlotSeries& series : plot_.series) DrawSeries(series);
    for (const PlotSeries& series : plot_.series) DrawLabels(series);
    DrawLegend();
    return drawing_;
  }

 private:
  static double LegendWidth(const Plot& plot) {
    double width = 0;
    for (const PlotSeries& series : plot.series) {
      if (!series.name.empty()) width = std::max(width, TextWidth(series.name, kText) + kLegendLine + 16);
    }
    return width;
  }

  void Include(const PlotSeries& series) {
    for (size_t i = 0; i < series.x.size(); ++i) {
      const double error = series.error.empty() ? 0 : series.error[i];
      x_.Include(series.x[i]);
      y_.Include(series.y[i]);
      // On a logarithmic axis a bar that reaches 0 has no lower end to show.
      y_.Include(series.y[i] - error);
      y_.Include(series.y[i] + error);
    }
  }

  bool Shows(const PlotSeries& series, size_t i) const {
    return x_.Shows(series.x[i]) && y_.Shows(series.y[i]);
  }
  Vec2d At(const PlotSeries& series, size_t i) const {
    return {x_.Pixel(series.x[i]), y_.Pixel(series.y[i])};
  }

  void Text(const Vec2d& at, const std::string& text, double size, TextAlign align,
            const Rgb8& color = kInk) {
    drawing_.shapes.push_back(DrawnText{at, text, size, color, align});
  }
  void Line(const Vec2d& a, const Vec2d& b, const Rgb8& color, double width = 1, bool dashed = false) {
    drawing_.shapes.push_back(DrawnLine{{a, b}, color, width, dashed});
  }

  void DrawAxes() {
    double free_from = -std::numeric_limits<double>::infinity();
    for (double tick : x_.Ticks()) {
      const double x = x_.Pixel(tick);
      Line({x, inside_.y0}, {x, inside_.y1}, kGrid);
      const std::string text = fmt::format("{:.4g}", tick);
      if (x - TextWidth(text, kText) / 2 < free_from) continue;
      Text({x, inside_.y1 + kText + 4}, text, kText, TextAlign::kCentre);
      free_from = x + TextWidth(text, kText) / 2 + 6;
    }
    for (double tick : y_.Ticks()) {
      const double y = y_.Pixel(tick);
      Line({inside_.x0, y}, {inside_.x1, y}, kGrid);
      Text({inside_.x0 - 6, y + kText / 3}, fmt::format("{:.4g}", tick), kText, TextAlign::kRight);
    }
    Line({inside_.x0, inside_.y1}, {inside_.x1, inside_.y1}, kInk);
    Line({inside_.x0, inside_.y0}, {inside_.x0, inside_.y1}, kInk);
    Text({(inside_.x0 + inside_.x1) / 2, drawing_.height - 10}, plot_.x.label, kText, TextAlign::kCentre);
    Text({8, inside_.y0 - 10}, plot_.y.label, kText, TextAlign::kLeft);
  }

  void DrawSeries(const PlotSeries& series) {
    DrawnLine line{{}, series.color, series.width, series.dashed};
    for (size_t i = 0; i < series.x.size(); ++i) {
      if (!Shows(series, i)) continue;
      const Vec2d at = At(series, i);
      line.points.push_back(at);
      if (!series.error.empty() && series.error[i] > 0) DrawBar(series, i);
    }
    if (series.joined) {
      for (size_t i = 0; i + 1 < line.points.size(); ++i)
        segments_.push_back({line.points[i], line.points[i + 1]});
      drawing_.shapes.push_back(line);
    }
    for (const Vec2d& at : line.points) {
      if (series.rings) {
        drawing_.shapes.push_back(DrawnDisc{at, kRing, series.color, 1.5});
      } else if (series.dots) {
        drawing_.shapes.push_back(DrawnDisc{at, kDot, series.color});
      }
      const double reach = series.rings ? kRing + 1 : kDot + 1;
      taken_.push_back({at.x() - reach, at.y() - reach, at.x() + reach, at.y() + reach});
    }
  }

  void DrawBar(const PlotSeries& series, size_t i) {
    const double low = series.y[i] - series.error[i];
    const double x = x_.Pixel(series.x[i]);
    const double bottom = y_.Shows(low) ? y_.Pixel(low) : inside_.y1;
    Line({x, std::min(bottom, inside_.y1)}, {x, y_.Pixel(series.y[i] + series.error[i])}, series.color);
  }

  // How much of a line runs through a box, px.
  double Crossed(const Box& box) const {
    double length = 0;
    for (const auto& [a, b] : segments_) {
      const double whole = (b - a).norm();
      const int steps = static_cast<int>(std::ceil(whole / 2));
      for (int k = 0; k <= steps; ++k) {
        const Vec2d p = a + (steps > 0 ? double(k) / steps : 0.0) * (b - a);
        if (p.x() > box.x0 && p.x() < box.x1 && p.y() > box.y0 && p.y() < box.y1) length += 2;
      }
    }
    return length;
  }

  void DrawLabels(const PlotSeries& series) {
    for (size_t i = 0; i < series.labels.size(); ++i) {
      if (Shows(series, i) && !series.labels[i].empty())
        DrawLabel(At(series, i), series.labels[i], series.color);
    }
  }

  // At the best of some places around a point; nowhere, if all are taken.
  void DrawLabel(const Vec2d& point, const std::string& label, const Rgb8& color) {
    const double width = TextWidth(label, kSmallText), height = kSmallText;
    constexpr std::array<std::array<double, 2>, 8> kPlaces = {
        {{1, -1}, {-1, -1}, {1, 1}, {-1, 1}, {1, 0}, {-1, 0}, {0, -1}, {0, 1}}};
    double best = std::numeric_limits<double>::infinity();
    Box best_box{};
    for (double away : {kDot + 2, kRing + 2, 2 * kRing}) {
      for (const auto& [right, down] : kPlaces) {
        const double x = point.x() + right * (away + width / 2), y = point.y() + down * (away + height / 2);
        const Box box{x - width / 2, y - height / 2, x + width / 2, y + height / 2};
        if (box.x0 < inside_.x0 || box.x1 > drawing_.width || box.y0 < inside_.y0 || box.y1 > inside_.y1)
          continue;
        if (std::any_of(taken_.begin(), taken_.end(), [&](const Box& other) { return box.Overlaps(other); }))
          continue;
        const double cost = Crossed(box) + away;
        if (cost < best) {
          best = cost;
          best_box = box;
        }
      }
    }
    // A line through half of a label's width makes it unreadable.
    if (!(best < width / 2 + 2 * kRing)) return;
    taken_.push_back(best_box);
    Text({(best_box.x0 + best_box.x1) / 2, best_box.y1 - 2}, label, kSmallText, TextAlign::kCentre, color);
  }

  void DrawLegend() {
    double y = inside_.y0 + kLegendRow / 2;
    for (const PlotSeries& series : plot_.series) {
      if (series.name.empty()) continue;
      const double x = inside_.x1 + 12;
      if (series.joined) Line({x, y}, {x + kLegendLine - 6, y}, series.color, series.width, series.dashed);
      const Vec2d middle(x + (kLegendLine - 6) / 2, y);
      if (series.rings) {
        drawing_.shapes.push_back(DrawnDisc{middle, kRing, series.color, 1.5});
      } else if (series.dots) {
        drawing_.shapes.push_back(DrawnDisc{middle, kDot, series.color});
      }
      Text({x + kLegendLine, y + kText / 3}, series.name, kText, TextAlign::kLeft);
      y += kLegendRow;
    }
  }

  const Plot& plot_;
  Drawing drawing_;
  Box inside_;
  Scale x_, y_;
  std::vector<Box> taken_;  // what labels must keep clear of
  std::vector<std::pair<Vec2d, Vec2d>> segments_;
};

}  // namespace

Drawing DrawPlot(const Plot& plot, double width, double height) {
  return PlotDrawer(plot, width, height).Draw();
}

Rgb8 PlotColor(size_t index) {
  // Paul Tol's "bright" scheme and two darker ones, told apart by the colour-blind; and four more.
  static constexpr std::array<Rgb8, kPlotColors> kColors = {{{68, 119, 170},
                                                             {238, 102, 119},
                                                             {34, 136, 51},
                                                             {204, 160, 40},
                                                             {102, 190, 220},
                                                             {170, 51, 119},
                                                             {110, 110, 110},
                                                             {120, 60, 20},
                                                             {235, 130, 50},
                                                             {140, 110, 200},
                                                             {0, 140, 140},
                                                             {150, 160, 40}}};
  return kColors[index % kColors.size()];
}

}  // namespace lumen
