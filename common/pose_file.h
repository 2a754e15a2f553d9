// C3VD's pose.txt: a line a frame, 16 comma-separated numbers of a 4×4 matrix, camera to world, mm.
#pragma once

#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "common/math.h"

namespace lumen {

// One of the file's filled lines.
struct PoseLine {
  std::optional<Pose> pose;
  std::string problem;  // "FILE:LINE: …" where there is no pose
};

// Reads today's layout (the matrix transposed: numbers 12–14 are the translation) and that of C3VD's first
// release (numbers 3, 7, 11 are); numbers 3, 7, 11 all 0 tell today's. Rotations that are orthonormal to 1e-3
// only, as far as the file's digits go, become the nearest rotation. Throws InputError where the file can't
// be read.
std::vector<PoseLine> ReadPoseLines(const std::filesystem::path& file);

// The same where every line must be a pose. Throws InputError with file and line.
std::vector<Pose> ReadPoses(const std::filesystem::path& file);

// Today's layout, every digit.
std::string PosesText(const std::vector<Pose>& world_from_camera);

}  // namespace lumen
