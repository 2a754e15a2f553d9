// What a calibration has found: for people, for programs, and as calibration.toml.
#pragma once

#include <nlohmann/json_fwd.hpp>
#include <optional>
#include <string>

#include "recon/calibration/calibrate.h"

namespace lumen {

// What goes into calibration.toml: what the sequence doesn't say itself and the data tell. The light and γ of
// a sequence.toml are its own; those of a C3VD folder are a built-in guess.
struct Findings {
  bool gains = false, spread = false, gamma = false;
};
// everything: also what the sequence says itself.
Findings FindingsOf(const Sequence& sequence, const SequenceCalibration& found, bool everything);

// calibration.toml, which ReadSequence reads on top of the sequence's own files. Where frames of the sequence
// are left out the gains' frame numbers are written too.
std::string CalibrationText(const Sequence& sequence, const SequenceCalibration& found,
                            const Findings& findings);

// How far estimated gains are from those that the sequence says, up to a common factor (of least squares in
// log): the 95th percentile and the largest of |ratio − 1|.
struct GainComparison {
  double percentile95 = 0, largest = 0;
};
GainComparison CompareGains(const std::vector<double>& log_gain, const std::vector<double>& log_truth);
// Nothing where the sequence doesn't say all gains. The second: those that training alone has learnt.
struct GainComparisons {
  GainComparison calibrated, learnt;
};
std::optional<GainComparisons> CompareWithSequence(const Sequence& sequence,
                                                   const SequenceCalibration& found);

std::string ToTable(const Sequence& sequence, const SequenceCalibration& found, const Findings& findings);
nlohmann::json ToJson(const Sequence& sequence, const SequenceCalibration& found, const Findings& findings);

}  // namespace lumen
