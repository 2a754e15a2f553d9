// Which line of a sequence's pose file belongs to which of its frames.
#pragma once

#include <cstddef>
#include <optional>
#include <string>
#include <vector>

namespace lumen {

// numbers: of the frames that are here, ascending; lines: how many the file has. One entry a frame, nothing
// where it has no line.
//
// As many lines as frames: in order. More lines: one for every frame that was ever recorded, so a frame's
// number, from 0, is that of its line. Fewer, and numbers without a gap: the file has lost its end. Nothing
// at all where the frames can't be told apart.
std::optional<std::vector<std::optional<size_t>>> LinesOfFrames(const std::vector<int>& numbers,
                                                                size_t lines);

// "3", "3–5, 8".
std::string Ranges(const std::vector<int>& ascending);

}  // namespace lumen
