#include "sim/cost/timing.h"

#include <time.h>

#include <algorithm>
#include <cmath>

namespace lumen {
namespace {

double Seconds(clockid_t clock) {
  timespec time;
  clock_gettime(clock, &time);
  return static_cast<double>(time.tv_sec) + 1e-9 * static_cast<double>(time.tv_nsec);
}

}  // namespace

double CpuSeconds() { return Seconds(CLOCK_PROCESS_CPUTIME_ID); }

double WallSeconds() { return Seconds(CLOCK_MONOTONIC); }

double MedianError(std::vector<double> values) {
  std::ranges::sort(values);
  const size_t n = values.size();
  return 1.253 * 0.741 * (values[n - 1 - n / 4] - values[n / 4]) / std::sqrt(double(n));
}

}  // namespace lumen
