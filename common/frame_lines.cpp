#include "common/frame_lines.h"

namespace lumen {

std::optional<std::vector<std::optional<size_t>>> LinesOfFrames(const std::vector<int>& numbers,
                                                                size_t lines) {
  const size_t frames = numbers.size();
  const bool by_number = lines > frames;
  const bool gap = frames > 0 && static_cast<size_t>(numbers.back() - numbers.front()) + 1 != frames;
  if (lines < frames && gap) return std::nullopt;
  std::vector<std::optional<size_t>> line(frames);
  for (size_t i = 0; i < frames; ++i) {
    const size_t wanted = by_number ? static_cast<size_t>(numbers[i]) : i;
    if (wanted < lines) {
      line[i] = wanted;
    } else if (by_number) {
      return std::nullopt;
    }
  }
  return line;
}

std::string Ranges(const std::vector<int>& ascending) {
  std::string text;
  for (size_t first = 0, last = 0; first < ascending.size(); first = last + 1) {
    for (last = first; last + 1 < ascending.size() && ascending[last + 1] == ascending[last] + 1;) ++last;
    text += (text.empty() ? "" : ", ") + std::to_string(ascending[first]);
    if (last > first) text += "–" + std::to_string(ascending[last]);
  }
  return text;
}

}  // namespace lumen
