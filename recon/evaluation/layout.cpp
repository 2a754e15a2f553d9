#include "recon/evaluation/layout.h"

#include <algorithm>
#include <cmath>
#include <numeric>

namespace lumen {
namespace {

constexpr int kGap = 12, kText = 16, kTitle = kText + 10, kBar = 18;
constexpr Rgb8 kInk = {30, 30, 30};

void Paste(const Image8& from, int x0, int y0, Image8* to) {
  for (int y = 0; y < from.height; ++y) {
    std::copy_n(from.Pixel(0, y), size_t(from.width) * 3, to->Pixel(x0, y0 + y));
  }
}

void DrawBar(const ColorBar& bar, int x0, int y0, int width, Image8* page) {
  for (int x = 0; x < width; ++x) {
    const Rgb8 color = bar.color((x + 0.5) / width);
    for (int y = 0; y < kBar; ++y) std::copy_n(color.data(), 3, page->Pixel(x0 + x, y0 + y));
  }
  const int baseline = y0 + kBar + kText + 2;
  DrawText(page, x0, baseline, kText, bar.low, kInk);
  DrawText(page, x0 + width / 2, baseline, kText, bar.middle, kInk, TextAlign::kCentre);
  DrawText(page, x0 + width, baseline, kText, bar.high, kInk, TextAlign::kRight);
}

}  // namespace

Image8 Compose(const std::vector<Panel>& panels, int columns, const std::vector<ColorBar>& bars) {
  const int rows = (static_cast<int>(panels.size()) + columns - 1) / columns;
  std::vector<int> widths(columns, 0), heights(rows, 0);
  for (size_t i = 0; i < panels.size(); ++i) {
    widths[i % columns] = std::max(widths[i % columns], panels[i].image.width);
    heights[i / columns] = std::max(heights[i / columns], panels[i].image.height);
  }
  const int width = std::accumulate(widths.begin(), widths.end(), kGap * (columns + 1));
  const int bars_height = bars.empty() ? 0 : kBar + kText + 2 * kGap;
  const int height =
      std::accumulate(heights.begin(), heights.end(), (kGap / 2 + kTitle) * rows + kGap + bars_height);
  Image8 page(width, height, 3, 255);
  int y = 0;
  for (int row = 0; row < rows; ++row) {
    int x = kGap;
    y += kTitle;
    for (int column = 0; column < columns && row * columns + column < static_cast<int>(panels.size());
         ++column) {
      const Panel& panel = panels[row * columns + column];
      DrawText(&page, x, y - 6, kText, panel.title, kInk);
      Paste(panel.image, x, y, &page);
      x += widths[column] + kGap;
    }
    y += heights[row] + kGap / 2;
  }
  const int bar_count = static_cast<int>(bars.size());
  for (int b = 0; b < bar_count; ++b) {
    const int bar_width = (width - kGap * (bar_count + 1)) / bar_count;
    DrawBar(bars[b], kGap + b * (bar_width + kGap), y + kGap, bar_width, &page);
  }
  return page;
}

Image8 Scaled(const Image8& image, int width, int height) {
  Image8 scaled(width, height, image.channels);
  // A new pixel covers [i, i+1)·scale of the old ones, the outer ones in part.
  const auto covered = [](int i, double scale, int size, std::vector<std::pair<int, double>>* weights) {
    weights->clear();
    const double begin = i * scale, end = std::min((i + 1) * scale, double(size));
    for (int k = static_cast<int>(begin); k < end; ++k) {
      weights->push_back({k, std::min(end, k + 1.0) - std::max(begin, double(k))});
    }
  };
  std::vector<std::pair<int, double>> columns, rows;
  for (int y = 0; y < height; ++y) {
    covered(y, double(image.height) / height, image.height, &rows);
    for (int x = 0; x < width; ++x) {
      covered(x, double(image.width) / width, image.width, &columns);
      for (int c = 0; c < image.channels; ++c) {
        double sum = 0, weight = 0;
        for (const auto& [v, row_weight] : rows) {
          for (const auto& [u, column_weight] : columns) {
            sum += row_weight * column_weight * image.Pixel(u, v)[c];
            weight += row_weight * column_weight;
          }
        }
        scaled.Pixel(x, y)[c] = static_cast<uint8_t>(std::lround(sum / weight));
      }
    }
  }
  return scaled;
}

}  // namespace lumen
