// The knobs of training that trade accuracy for time: a table that the cost measurement goes through.
#pragma once

#include <string>
#include <vector>

#include "recon/training/options.h"

namespace lumen {

struct TrainKnobSetting {
  std::string label;
  TrainOptions options;
  bool is_own = false;  // as the run that the others are compared with
};

struct TrainKnob {
  std::string name;
  std::vector<TrainKnobSetting> settings;
};

// Each knob with settings of it alone, own's among them; `few` leaves some out. available_frames: of the
// sequence. Knobs of what own doesn't use (a grid's, of a field without one) are absent.
std::vector<TrainKnob> TrainKnobsOf(const TrainOptions& own, int available_frames, bool few);

}  // namespace lumen
