// Whether two sequences look alike, in figures: how their pixels are distributed, how much is saturated, how
// far the wall is, and how light falls off.
#pragma once

#include <array>
#include <string>
#include <vector>

#include "recon/photometry/photometry.h"

namespace lumen {

struct LookFigure {
  std::string name;  // "green p50"
  double value = 0;
};

struct Looks {
  std::string name;  // of the sequence
  std::vector<LookFigure> figures;
  // Of each channel's codes 0…255: part of the valid pixels that are no brighter.
  std::array<std::array<double, 256>, 3> distribution;
  Image8 color;  // a frame from the sequence's middle
};

// Percentiles of the valid pixels' codes by channel, parts that are saturated (in a channel; in all: white),
// percentiles of the distance along the ray, and the fit's figures by channel. The photometry is that of the
// sequence. Throws InputError.
Looks LooksOf(const Sequence& sequence, const Photometry& photometry);

// Figures that both have, side by side; a mark where the first is further from the second than `tolerance`,
// in parts of the second.
struct LookDifference {
  std::string name;
  double first, second;
  bool within;
};
std::vector<LookDifference> CompareLooks(const Looks& first, const Looks& second, double tolerance);

std::string ToTable(const Looks& first, const Looks& second, const std::vector<LookDifference>& differences);

// A frame of each side by side, and their distributions.
Image8 LooksPicture(const Looks& first, const Looks& second);

}  // namespace lumen
