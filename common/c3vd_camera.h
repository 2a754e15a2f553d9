// C3VDv2's camera: the same scope as C3VD's (CF-HQ190L, 1350×1080), calibrated anew.
#pragma once

#include <filesystem>

#include "common/camera.h"

namespace lumen {

// What C3VDv2's camera_intrinsics.txt says.
CameraIntrinsics C3vdV2Intrinsics();

// Reads such a file: a line "name = value" each for width, height, cx, cy, a0 … a4, c, d, e; ';' and '#'
// start comments. Throws InputError naming the line, or what is missing.
CameraIntrinsics ReadC3vdIntrinsics(const std::filesystem::path& file);

}  // namespace lumen
