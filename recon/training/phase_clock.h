// Where a step's time goes, for those who ask (recon/training/estimate.h).
#pragma once

#include <array>
#include <chrono>

namespace lumen {

// The main parts of a step, in their order; what there is besides (cameras kept free, light between walls,
// lengths of weights, gains and poses, chunks' gradients added up) is in none. Surface and colours are the
// field's forward passes with derivatives and the shading; backward is through the networks; grid is the
// gradient's way into the tables.
enum class Phase { kRays, kPlaces, kDistances, kSurface, kColors, kPixels, kBackward, kGrid, kAdam };
inline constexpr std::array kPhaseNames = {"rays",   "places",   "distances", "surface", "colours",
                                           "pixels", "backward", "grid",      "adam"};
using PhaseSeconds = std::array<double, kPhaseNames.size()>;

// One thread's.
class PhaseClock {
 public:
  // What passes from here on belongs to the phase that the next Lap names.
  void Start() { last_ = Now(); }
  void Lap(Phase phase) {
    const Time now = Now();
    seconds_[static_cast<size_t>(phase)] += std::chrono::duration<double>(now - last_).count();
    last_ = now;
  }
  const PhaseSeconds& seconds() const { return seconds_; }

 private:
  using Time = std::chrono::steady_clock::time_point;
  static Time Now() { return std::chrono::steady_clock::now(); }
  Time last_;
  PhaseSeconds seconds_ = {};
};

inline void Lap(PhaseClock* clock, Phase phase) {
  if (clock) clock->Lap(phase);
}

}  // namespace lumen
