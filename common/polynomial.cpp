#include "common/polynomial.h"

namespace lumen {
namespace {

ValueAndSlope<double> Evaluate(const std::vector<double>& coefficients, double x) {
  ValueAndSlope<double> result{0, 0};
  for (size_t i = coefficients.size(); i-- > 0;) {
    result.slope = result.slope * x + result.value;
    result.value = result.value * x + coefficients[i];
  }
  return result;
}

}  // namespace

std::vector<double> SignChanges(const std::vector<double>& coefficients, double low, double high) {
  if (coefficients.size() < 2) return {};
  std::vector<double> derivative;
  for (size_t i = 1; i < coefficients.size(); ++i) derivative.push_back(double(i) * coefficients[i]);
  std::vector<double> ends = SignChanges(derivative, low, high);
  ends.push_back(high);

  std::vector<double> roots;
  for (double from = low; double to : ends) {
    const double at_from = Evaluate(coefficients, from).value;
    const double at_to = Evaluate(coefficients, to).value;
    if ((at_from < 0) != (at_to < 0)) {
      const double sign = at_from < 0 ? 1 : -1;
      const auto increasing = [&](double x) {
        const ValueAndSlope<double> f = Evaluate(coefficients, x);
        return ValueAndSlope<double>{sign * f.value, sign * f.slope};
      };
      const double root = SolveIncreasing(increasing, from, to, from + (to - from) / 2);
      if (root > low && root < high) roots.push_back(root);
    }
    from = to;
  }
  return roots;
}

}  // namespace lumen
