#include "common/bar_chart.h"

#include <algorithm>

namespace lumen {
namespace {

constexpr double kLeft = 56, kRight = 14, kTop = 26, kTitle = 20, kText = 13, kHighestRow = 34;
constexpr Rgb8 kInk = {40, 40, 40}, kBar = {68, 119, 170};

}  // namespace

Drawing DrawBars(const std::string& title, const std::vector<ChartBar>& bars, double width, double height) {
  Drawing drawing{width, height, {}};
  drawing.shapes.push_back(DrawnText{{kLeft, kTitle - 4}, title, kText + 1, kInk, TextAlign::kLeft});
  double labels = 0, notes = 0, low = 0, high = 0;
  for (const ChartBar& bar : bars) {
    labels = std::max(labels, TextWidth(bar.label, kText));
    notes = std::max(notes, TextWidth(bar.note, kText));
    low = std::min(low, bar.value - bar.error);
    high = std::max(high, bar.value + bar.error);
  }
  if (!(high > low)) high = low + 1;
  const double from = labels + 16, to = width - kRight - notes - 8;
  const auto pixel = [&](double value) { return from + (value - low) / (high - low) * (to - from); };
  const double row =
      std::min(kHighestRow, (height - kTop - kTitle) / std::max<double>(1, double(bars.size())));
  double y = kTop + row / 2;
  for (const ChartBar& bar : bars) {
    drawing.shapes.push_back(DrawnBox{{pixel(std::min(0.0, bar.value)), y - row / 4},
                                      {pixel(std::max(0.0, bar.value)), y + row / 4},
                                      kBar});
    drawing.shapes.push_back(
        DrawnLine{{{pixel(bar.value - bar.error), y}, {pixel(bar.value + bar.error), y}}, kInk, 1.5, false});
    drawing.shapes.push_back(
        DrawnText{{from - 10, y + kText / 3}, bar.label, kText, kInk, TextAlign::kRight});
    const double end = pixel(std::max(0.0, bar.value + bar.error)) + 8;
    drawing.shapes.push_back(DrawnText{{end, y + kText / 3}, bar.note, kText, kInk, TextAlign::kLeft});
    y += row;
  }
  drawing.shapes.push_back(DrawnLine{{{pixel(0), kTop}, {pixel(0), y - row / 2}}, kInk, 1, false});
  return drawing;
}

}  // namespace lumen
