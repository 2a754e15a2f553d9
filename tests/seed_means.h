// Numbers measured under several seeds: their means, and whether two measurements of them agree.
#pragma once

#include <cstddef>
#include <vector>

#include "common/image.h"
#include "tests/welch.h"

namespace lumen::test {

class SeedMeans {
 public:
  // As many values each time, at least twice.
  void Add(const std::vector<double>& values) {
    sums_.resize(values.size());
    squares_.resize(values.size());
    for (size_t i = 0; i < values.size(); ++i) {
      sums_[i] += values[i];
      squares_[i] += values[i] * values[i];
    }
    ++seeds_;
  }

  size_t size() const { return sums_.size(); }
  int seeds() const { return seeds_; }
  double mean(size_t i) const { return sums_[i] / seeds_; }
  // Of the mean.
  double variance(size_t i) const { return (squares_[i] / seeds_ - mean(i) * mean(i)) / (seeds_ - 1); }

 private:
  std::vector<double> sums_, squares_;
  int seeds_ = 0;
};

// How many of the values differ by more than all of them together would by chance once in 1/false_alarm
// (Welch's test of each). Both have as many, under as many seeds.
inline int CountOff(const SeedMeans& a, const SeedMeans& b, double false_alarm) {
  const double each = SharedOut(false_alarm, static_cast<double>(a.size()));
  int off = 0;
  for (size_t i = 0; i < a.size(); ++i) {
    off += WelchChance(a.mean(i) - b.mean(i), a.variance(i), b.variance(i), a.seeds()) < each;
  }
  return off;
}

// Means over squares of edge × edge pixels, row by row, of the three channels each; what is left over at the
// right and below is left out.
inline std::vector<double> BlockMeansOf(const ImageF& image, int edge) {
  const int columns = image.width / edge, rows = image.height / edge;
  std::vector<double> means(static_cast<size_t>(columns) * rows * 3, 0.0);
  for (int y = 0; y < rows * edge; ++y) {
    for (int x = 0; x < columns * edge; ++x) {
      const size_t block = static_cast<size_t>(y / edge) * columns + x / edge;
      for (size_t c = 0; c < 3; ++c) means[3 * block + c] += image.Pixel(x, y)[c] / (double(edge) * edge);
    }
  }
  return means;
}

}  // namespace lumen::test
