// Plots as lists of shapes: where values land on their axes, labels that keep clear of everything, SVG and
// pixels that say the same.
#include "common/plot.h"

#include <gtest/gtest.h>

#include <cmath>

namespace lumen {
namespace {

template <class T>
std::vector<T> ShapesOf(const Drawing& drawing) {
  std::vector<T> shapes;
  for (const Shape& shape : drawing.shapes) {
    if (const T* one = std::get_if<T>(&shape)) shapes.push_back(*one);
  }
  return shapes;
}

std::vector<Vec2d> Dots(const Plot& plot) {
  std::vector<Vec2d> centres;
  for (const DrawnDisc& disc : ShapesOf<DrawnDisc>(DrawPlot(plot, 500, 400))) centres.push_back(disc.centre);
  return centres;
}

Plot PlotOf(std::vector<double> x, std::vector<double> y) {
  Plot plot;
  plot.series.resize(1);
  plot.series[0].x = std::move(x);
  plot.series[0].y = std::move(y);
  return plot;
}

TEST(Plot, EqualRatiosAreEqualStepsOnLogarithmicAxes) {
  Plot plot = PlotOf({1, 10, 100}, {0.5, 1, 2});
  plot.x.logarithmic = plot.y.logarithmic = true;
  const std::vector<Vec2d> dots = Dots(plot);
  ASSERT_EQ(dots.size(), 3u);
  EXPECT_NEAR((dots[1] - dots[0] - (dots[2] - dots[1])).norm(), 0, 1e-9);
  EXPECT_GT(dots[1].x(), dots[0].x());
  EXPECT_LT(dots[1].y(), dots[0].y());  // upwards
  plot.x.logarithmic = false;
  const std::vector<Vec2d> linear = Dots(plot);
  EXPECT_NEAR((linear[2].x() - linear[1].x()) / (linear[1].x() - linear[0].x()), 10, 1e-9);
}

// A gridline's place and its text are those of its value: read off three dots whose values are ticks.
TEST(Plot, TicksStandAtTheirValues) {
  Plot plot = PlotOf({1, 10, 1000}, {0, 50, 100});
  plot.x.logarithmic = true;
  const Drawing drawing = DrawPlot(plot, 500, 400);
  const std::vector<Vec2d> dots = Dots(plot);
  int found = 0;
  for (const DrawnText& text : ShapesOf<DrawnText>(drawing)) {
    if (text.text == "10") {
      EXPECT_NEAR(text.at.x(), dots[1].x(), 1e-9);
      ++found;
    } else if (text.text == "50") {
      EXPECT_NEAR(text.at.y() - text.size / 3, dots[1].y(), 1e-9);
      ++found;
    }
  }
  EXPECT_EQ(found, 2);
}

TEST(Plot, WhatAnAxisCannotShowIsLeftOut) {
  Plot plot = PlotOf({1, 0, 2, NAN, 3}, {1, 1, -1, 1, INFINITY});
  EXPECT_EQ(Dots(plot).size(), 3u);
  plot.x.logarithmic = plot.y.logarithmic = true;
  EXPECT_EQ(Dots(plot).size(), 1u);
  EXPECT_EQ(ShapesOf<DrawnText>(DrawPlot(PlotOf({}, {}), 500, 400)).front().text, "nothing to show");
}

// Fifty labels in a crowd: those that are drawn overlap neither dots nor one another.
TEST(Plot, LabelsKeepClear) {
  Plot plot = PlotOf({}, {});
  PlotSeries& series = plot.series[0];
  for (int i = 0; i < 50; ++i) {
    series.x.push_back(std::fmod(i * 0.618, 1));
    series.y.push_back(std::fmod(i * 0.414, 1));
    series.labels.push_back("n" + std::to_string(100 + i));
  }
  const Drawing drawing = DrawPlot(plot, 500, 400);
  std::vector<DrawnText> labels;
  for (const DrawnText& text : ShapesOf<DrawnText>(drawing)) {
    if (text.text[0] == 'n') labels.push_back(text);
  }
  EXPECT_GT(labels.size(), 30u);
  const auto overlap = [](const DrawnText& a, const Vec2d& low, const Vec2d& high) {
    const double half = TextWidth(a.text, a.size) / 2;
    return a.at.x() - half < high.x() && a.at.x() + half > low.x() && a.at.y() - a.size + 2 < high.y() &&
           a.at.y() > low.y();
  };
  for (size_t i = 0; i < labels.size(); ++i) {
    for (const DrawnDisc& dot : ShapesOf<DrawnDisc>(drawing)) {
      EXPECT_FALSE(overlap(labels[i], dot.centre, dot.centre)) << labels[i].text;
    }
    for (size_t j = 0; j < i; ++j) {
      const double half = TextWidth(labels[j].text, labels[j].size) / 2;
      EXPECT_FALSE(
          overlap(labels[i], labels[j].at - Vec2d(half, labels[j].size - 2), labels[j].at + Vec2d(half, 0)))
          << labels[i].text << " " << labels[j].text;
    }
  }
}

TEST(Drawing, PixelsAreWhereTheShapesAre) {
  Drawing drawing{20, 10, {}};
  drawing.shapes.push_back(DrawnLine{{{2, 3}, {12, 3}}, {255, 0, 0}, 2, false});
  drawing.shapes.push_back(DrawnDisc{{16, 6}, 2, {0, 0, 255}, 0});
  for (int scale : {1, 2}) {
    const Image8 image = ToImage(drawing, scale);
    ASSERT_EQ(image.width, 20 * scale);
    ASSERT_EQ(image.height, 10 * scale);
    // What is left of white, by channel, is the shapes' area: a capsule of 10×2 and a half-disc at each end,
    // and a disc.
    double red = 0, blue = 0;
    for (int i = 0; i < image.width * image.height; ++i) {
      red += (255 - image.data[3 * i + 2]) / 255.0;
      blue += (255 - image.data[3 * i]) / 255.0;
    }
    EXPECT_NEAR(red / (scale * scale), 20 + kPi, 0.6);
    EXPECT_NEAR(blue / (scale * scale), 4 * kPi, 0.6);
    EXPECT_EQ(image.Pixel(7 * scale, 3 * scale)[1], 0);
    EXPECT_EQ(image.Pixel(16 * scale, 6 * scale)[0], 0);
    EXPECT_EQ(image.Pixel(7 * scale, 7 * scale)[0], 255);
  }
}

TEST(Drawing, BoxesCoverTheirArea) {
  Drawing drawing{20, 10, {}};
  drawing.shapes.push_back(DrawnBox{{2.5, 3}, {12, 7}, {0, 0, 0}});
  const Image8 image = ToImage(drawing);
  double covered = 0;
  for (int i = 0; i < image.width * image.height; ++i) covered += (255 - image.data[3 * i]) / 255.0;
  EXPECT_NEAR(covered, 9.5 * 4, 0.1);
  EXPECT_NEAR(image.Pixel(2, 4)[0], 127.5, 1);  // half of it
  EXPECT_EQ(image.Pixel(3, 2)[0], 255);
  EXPECT_EQ(image.Pixel(11, 6)[0], 0);
}

TEST(Drawing, SvgHoldsTheSameAndEscapesText) {
  Drawing part{10, 10, {}};
  part.shapes.push_back(DrawnLine{{{1, 2}, {3, 4}}, {255, 128, 0}, 2, true});
  part.shapes.push_back(DrawnText{{5, 6}, "a < b & c", 12, {0, 0, 0}, TextAlign::kRight});
  Drawing page{100, 50, {}};
  Place(part, 10, 20, &page);
  const std::string svg = ToSvg(page);
  EXPECT_NE(svg.find(R"(points="11.00,22.00 13.00,24.00")"), std::string::npos) << svg;
  EXPECT_NE(svg.find(R"(stroke="#ff8000")"), std::string::npos);
  EXPECT_NE(svg.find("stroke-dasharray"), std::string::npos);
  EXPECT_NE(svg.find(R"(text-anchor="end">a &lt; b &amp; c</text>)"), std::string::npos);
  EXPECT_NE(svg.find(R"(viewBox="0 0 100 50")"), std::string::npos);
}

}  // namespace
}  // namespace lumen
