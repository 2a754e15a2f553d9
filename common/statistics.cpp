#include "common/statistics.h"

#include <algorithm>
#include <cmath>
#include <limits>

namespace lumen {

double MedianOf(std::vector<double> values) {
  std::ranges::sort(values);
  const size_t n = values.size();
  return n % 2 ? values[n / 2] : (values[n / 2 - 1] + values[n / 2]) / 2;
}

double HalfRange(const std::vector<double>& values) {
  if (std::ranges::any_of(values, [](double v) { return std::isnan(v); })) {
    return std::numeric_limits<double>::quiet_NaN();
  }
  const auto [low, high] = std::ranges::minmax(values);
  return (high - low) / 2;
}

}  // namespace lumen
