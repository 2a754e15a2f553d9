#include "recon/photometry/looks.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "common/plot.h"
#include "recon/evaluation/layout.h"

namespace lumen {
namespace {

constexpr std::array kPercentiles = {1, 5, 25, 50, 75, 95, 99};
constexpr std::array kDistancePercentiles = {1, 25, 50, 75, 99};
constexpr int kPictureHeight = 480;
// Codes from here on count as saturated: what was 255 once, compression has moved by a few.
constexpr int kSaturated = 250;

// What there is to count in a sequence's valid pixels.
struct Census {
  std::array<std::array<int64_t, 256>, 3> codes{};
  int64_t white = 0, pixels = 0;
  std::vector<float> distance_mm;  // along the ray
};

Census Count(const Sequence& sequence) {
  const Image8 valid = ValidPixels(sequence.calibration);
  const Camera<double> camera(sequence.calibration.camera);
  Census census;
  for (const SequenceFrame& frame : sequence.frames) {
    const Image8 color = ReadColor(sequence, frame);
    const ImageF z = frame.depth.empty() ? ImageF() : DecodeDepth(ReadImage16(frame.depth, 1));
    for (int y = 0; y < valid.height; ++y) {
      for (int x = 0; x < valid.width; ++x) {
        if (!*valid.Pixel(x, y)) continue;
        const uint8_t* rgb = color.Pixel(x, y);
        for (int c = 0; c < 3; ++c) ++census.codes[c][rgb[c]];
        census.white += std::min({rgb[0], rgb[1], rgb[2]}) >= kSaturated;
        ++census.pixels;
        if (z.empty() || !std::isfinite(*z.Pixel(x, y))) continue;
        census.distance_mm.push_back(static_cast<float>(*z.Pixel(x, y) / camera.Unproject(Vec2d(x, y))->z()));
      }
    }
  }
  return census;
}

int CodeAt(const std::array<double, 256>& distribution, double part) {
  const auto at = std::ranges::lower_bound(distribution, part);
  return std::min(255, static_cast<int>(at - distribution.begin()));
}

double Percentile(std::vector<float>* values, double percent) {
  const auto at = values->begin() + static_cast<ptrdiff_t>(percent / 100 * double(values->size() - 1));
  std::nth_element(values->begin(), at, values->end());
  return *at;
}

PlotSeries DistributionLine(const std::array<double, 256>& distribution, const Rgb8& color, bool dashed) {
  PlotSeries line;
  for (int code = 0; code < 256; ++code) {
    line.x.push_back(code);
    line.y.push_back(distribution[code]);
  }
  line.color = color;
  line.joined = true;
  line.dots = false;
  line.dashed = dashed;
  return line;
}

Panel FramePanel(const Looks& looks) {
  return {looks.name,
          Scaled(looks.color, looks.color.width * kPictureHeight / looks.color.height, kPictureHeight)};
}

}  // namespace

Looks LooksOf(const Sequence& sequence, const Photometry& photometry) {
  Census census = Count(sequence);
  Looks looks;
  looks.name = sequence.folder.filename().empty() ? sequence.folder.parent_path().filename().string()
                                                  : sequence.folder.filename().string();
  looks.color = ReadColor(sequence, sequence.frames[sequence.frames.size() / 2]);
  const double pixels = static_cast<double>(census.pixels);
  const auto add = [&](const std::string& name, double value) { looks.figures.push_back({name, value}); };
  for (int c = 0; c < 3; ++c) {
    int64_t below = 0;
    for (int code = 0; code < 256; ++code) {
      below += census.codes[c][code];
      looks.distribution[c][code] = double(below) / pixels;
    }
    for (int percent : kPercentiles) {
      add(fmt::format("{} p{}", ChannelName(c), percent), CodeAt(looks.distribution[c], percent / 100.0));
    }
  }
  for (int c = 0; c < 3; ++c) {
    add(fmt::format("{} saturated %", ChannelName(c)), 100 * (1 - looks.distribution[c][kSaturated - 1]));
  }
  add("white %", 100 * double(census.white) / pixels);
  for (int percent : kDistancePercentiles) {
    if (census.distance_mm.empty()) break;
    add(fmt::format("distance p{}, mm", percent), Percentile(&census.distance_mm, percent));
  }
  for (const char* figure : {"t_exponent", "cos_exponent", "spread", "r_squared", "residual"}) {
    for (int c = 0; c < 3; ++c) {
      const std::string name = fmt::format("{}.{}", ChannelName(c), figure);
      if (const Figure* found = photometry.Find(name)) add(name, found->value);
    }
  }
  return looks;
}

std::vector<LookDifference> CompareLooks(const Looks& first, const Looks& second, double tolerance) {
  std::vector<LookDifference> differences;
  for (const LookFigure& one : first.figures) {
    const auto other = std::ranges::find(second.figures, one.name, &LookFigure::name);
    if (other == second.figures.end()) continue;
    const bool within = std::abs(one.value - other->value) <= tolerance * std::abs(other->value);
    differences.push_back({one.name, one.value, other->value, within});
  }
  return differences;
}

std::string ToTable(const Looks& first, const Looks& second, const std::vector<LookDifference>& differences) {
  std::string table = fmt::format("{:<20}{:>14}{:>26}{:>9}\n", "figure", first.name, second.name, "ratio");
  int within = 0;
  for (const LookDifference& difference : differences) {
    table += fmt::format("{:<20}{:>14.4g}{:>26.4g}{:>9.2f}{}\n", difference.name, difference.first,
                         difference.second, difference.first / difference.second,
                         difference.within ? "" : "  <--");
    within += difference.within;
  }
  return table + fmt::format("{} of {} figures alike\n", within, differences.size());
}

Image8 LooksPicture(const Looks& first, const Looks& second) {
  Plot plot;
  plot.x.label = "code (dashed: the second)";
  plot.y.label = "part of the pixels that are no brighter";
  constexpr std::array<Rgb8, 3> kColors = {{{200, 40, 40}, {30, 140, 60}, {40, 80, 200}}};
  for (int c = 0; c < 3; ++c) {
    plot.series.push_back(DistributionLine(first.distribution[c], kColors[c], false));
    plot.series.push_back(DistributionLine(second.distribution[c], kColors[c], true));
  }
  return Compose({FramePanel(first),
                  FramePanel(second),
                  {"distributions", ToImage(DrawPlot(plot, kPictureHeight, kPictureHeight))}},
                 3, {});
}

}  // namespace lumen
