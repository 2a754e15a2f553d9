// Polynomials in one variable, coefficients from the constant up, and the roots of monotone functions by a
// method that cannot leave its bracket.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <limits>
#include <vector>

namespace lumen {

template <class T>
struct ValueAndSlope {
  T value;
  T slope;
};

// Horner's scheme for the polynomial and its derivative.
template <class T, size_t N>
ValueAndSlope<T> EvaluatePolynomial(const std::array<T, N>& coefficients, T x) {
  ValueAndSlope<T> result{0, 0};
  for (size_t i = N; i-- > 0;) {
    result.slope = result.slope * x + result.value;
    result.value = result.value * x + coefficients[i];
  }
  return result;
}

// The root in [low, high] of a function that grows from ≤ 0 to ≥ 0 there: Newton's method from `guess`,
// falling back to bisection where a step leaves the bracket, which shrinks at every step. Ends where a step
// no longer moves x or the value is 0, and after kSteps at the latest. `function(x)` gives a ValueAndSlope.
template <class T, class Function>
T SolveIncreasing(const Function& function, T low, T high, T guess) {
  // Enough to bisect a bracket of any doubles of one sign and magnitude 2^±40 down to neighbours; in practice
  // a handful are taken.
  constexpr int kSteps = 140;
  T x = std::clamp(guess, low, high);
  for (int step = 0; step < kSteps; ++step) {
    const ValueAndSlope<T> f = function(x);
    if (f.value == 0) return x;
    (f.value < 0 ? low : high) = x;
    T next = x - f.value / f.slope;
    if (!(next > low && next < high)) next = low + (high - low) / 2;
    if (std::abs(next - x) <= std::numeric_limits<T>::epsilon() / 2 * std::abs(next)) return next;
    if (next == low || next == high) return next;
    x = next;
  }
  return x;
}

// Where the polynomial changes sign in (low, high), ascending: between the sign changes of its derivative it
// is monotone, so each interval holds one at most. A root that is touched without a change of sign is none.
std::vector<double> SignChanges(const std::vector<double>& coefficients, double low, double high);

}  // namespace lumen
