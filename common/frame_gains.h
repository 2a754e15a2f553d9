// The gains of a sequence's frames as sequence.toml and calibration.toml say them, [frames]:
//
//   gain    one a frame, in the order of the frames that are here or of the pose file's lines
//   number  NNNN of the frames that the gains are of, ascending; other frames' gains are unknown. Without it:
//           of all
#pragma once

#include <optional>
#include <vector>

#include "common/config.h"
#include "common/sequence.h"

namespace lumen {

class FrameGains {
 public:
  // Takes those of a file's root in place of what was read before, if it has any. Throws InputError.
  void Read(const ConfigTable& root);
  // Standard errors of their logarithms, [uncertainty] log_gain of calibration.toml. Throws InputError.
  void ReadErrors(const ConfigTable& root);

  // line: of each frame in the pose file, which has so many lines. Throws InputError where the gains don't
  // fit the frames.
  void Assign(const std::vector<std::optional<size_t>>& line, size_t lines,
              std::vector<SequenceFrame>* frames) const;

 private:
  // Where among the gains a frame's stands.
  std::vector<std::optional<size_t>> PlacesOf(const std::vector<SequenceFrame>& frames,
                                              const std::vector<std::optional<size_t>>& line,
                                              size_t lines) const;

  std::vector<double> values_, log_errors_;
  std::vector<int> numbers_;                         // empty: of all frames
  std::optional<ConfigTable> table_, errors_table_;  // to complain about
};

}  // namespace lumen
