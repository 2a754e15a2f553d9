// A scene at another size of its pictures, for the subcommands that measure.
#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "sim/scene.h"

namespace lumen {

// ReadScene, the camera's width and height (and a mask's) times `scale`.
Scene ReadScaledScene(const std::filesystem::path& file, const std::vector<std::string>& settings,
                      uint64_t seed, double scale);

}  // namespace lumen
