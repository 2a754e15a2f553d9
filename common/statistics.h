// What repeated measurements say.
#pragma once

#include <vector>

namespace lumen {

// The mean of the middle two of an even number. values: at least one.
double MedianOf(std::vector<double> values);
// NaN where one of them is.
double HalfRange(const std::vector<double>& values);

}  // namespace lumen
