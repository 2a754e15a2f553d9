#include "common/frame_gains.h"

#include <algorithm>
#include <cmath>
#include <string>

namespace lumen {
namespace {

std::vector<int> ReadNumbers(const ConfigTable& frames, size_t gains) {
  if (!frames.Has("number")) return {};
  std::vector<int> numbers;
  for (double number : frames.Numbers("number", gains, {0, 1e9})) {
    if (number != std::floor(number) || (!numbers.empty() && number <= numbers.back()))
      frames.Fail("number", "must be whole numbers in ascending order");
    numbers.push_back(static_cast<int>(number));
  }
  return numbers;
}

}  // namespace

void FrameGains::Read(const ConfigTable& root) {
  const auto frames = root.Optional("frames");
  if (!frames || !frames->Has("gain")) return;
  values_ = frames->Numbers("gain", 0, kPositive);
  numbers_ = ReadNumbers(*frames, values_.size());
  table_ = frames;
}

void FrameGains::ReadErrors(const ConfigTable& root) {
  const auto table = root.Optional("uncertainty");
  if (!table || !table->Has("log_gain")) return;
  log_errors_ = table->Numbers("log_gain", 0, kNotNegative);
  errors_table_ = table;
  const auto frames = root.Optional("frames");
  if (!frames || !frames->Has("gain")) table->Fail("log_gain", "there is no gain in [frames] that it is of");
}

void FrameGains::Assign(const std::vector<std::optional<size_t>>& line, size_t lines,
                        std::vector<SequenceFrame>* frames) const {
  if (!table_) return;
  if (errors_table_ && log_errors_.size() != values_.size()) {
    errors_table_->Fail("log_gain", "has " + std::to_string(log_errors_.size()) +
                                        " elements, but there are " + std::to_string(values_.size()) +
                                        " gains");
  }
  const std::vector<std::optional<size_t>> places = PlacesOf(*frames, line, lines);
  for (size_t i = 0; i < frames->size(); ++i) {
    if (!places[i]) continue;
    (*frames)[i].gain = values_[*places[i]];
    if (errors_table_) (*frames)[i].log_gain_error = log_errors_[*places[i]];
  }
}

std::vector<std::optional<size_t>> FrameGains::PlacesOf(const std::vector<SequenceFrame>& frames,
                                                        const std::vector<std::optional<size_t>>& line,
                                                        size_t lines) const {
  std::vector<std::optional<size_t>> places(frames.size());
  if (!numbers_.empty()) {
    bool any = false;
    for (size_t i = 0; i < frames.size(); ++i) {
      const auto number = std::ranges::lower_bound(numbers_, frames[i].number);
      if (number == numbers_.end() || *number != frames[i].number) continue;
      places[i] = static_cast<size_t>(number - numbers_.begin());
      any = true;
    }
    if (!any) table_->Fail("number", "none of these frames is here");
    return places;
  }
  if (values_.size() == lines && values_.size() != frames.size()) return line;
  if (values_.size() != frames.size()) {
    table_->Fail("gain", "has " + std::to_string(values_.size()) + " elements, but there are " +
                             std::to_string(frames.size()) + " frames");
  }
  for (size_t i = 0; i < frames.size(); ++i) places[i] = i;
  return places;
}

}  // namespace lumen
