// Which files of a sequence folder belong to which frame, in the layouts and with the quirks of C3VD's
// releases.
#pragma once

#include <filesystem>
#include <map>

namespace lumen {

struct FrameFiles {
  std::filesystem::path color, depth, normals, flow, occlusion;  // empty = there is none
};

// By frame number: NNNN_color.png and its like in the folder itself, with or without leading zeros, and any
// number in the folders rgb, depth, normals, optical_flow and occlusions of C3VDv2. Throws InputError where
// two files claim the same place.
std::map<int, FrameFiles> FindFrameFiles(const std::filesystem::path& folder);

}  // namespace lumen
