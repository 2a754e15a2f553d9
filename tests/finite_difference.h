// Gradients against central differences: random numbers to differentiate at, and the differences.
#pragma once

#include "common/random.h"
#include "recon/network/panel.h"

namespace lumen::test {

// −1…1.
inline double Random(uint64_t& state) { return 2 * UniformDouble(Mix64(state++)) - 1; }

inline void Fill(Panel<double>* panel, uint64_t& state, double scale = 1) {
  for (int tile = 0; tile < panel->tiles(); ++tile)
    for (int i = 0; i < panel->rows() * kTile; ++i) panel->Tile(tile)[i] = scale * Random(state);
}

inline double Dot(const Panel<double>& a, const Panel<double>& b) {
  double sum = 0;
  for (int tile = 0; tile < a.tiles(); ++tile)
    for (int i = 0; i < a.rows() * kTile; ++i) sum += a.Tile(tile)[i] * b.Tile(tile)[i];
  return sum;
}

// Central difference of f at x, where f has size about 1: steps of 1e-5 leave 1e-10 of truncation (times the
// third derivative) and 1e-11 of rounding.
template <class F>
double Difference(F f, double* x, double step = 1e-5) {
  const double kept = *x;
  *x = kept + step;
  const double above = f();
  *x = kept - step;
  const double below = f();
  *x = kept;
  return (above - below) / (2 * step);
}

}  // namespace lumen::test
