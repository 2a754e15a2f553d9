// Times, and what repeated ones say.
#pragma once

#include <vector>

#include "common/statistics.h"

namespace lumen {

// That the process has spent on all its threads.
double CpuSeconds();
// Since some moment.
double WallSeconds();

// Runs body and answers the CPU seconds that it took.
template <class Body>
double CpuSecondsOf(const Body& body) {
  const double start = CpuSeconds();
  body();
  return CpuSeconds() - start;
}

// Of their median, from the interquartile range, as interruptions make the tails long: 1.253 σ/√n (for a
// normal distribution, as the next), σ being 0.741 of that range.
double MedianError(std::vector<double> values);

}  // namespace lumen
