// Renders a scene into a sequence folder.
#pragma once

#include <cstdint>
#include <filesystem>
#include <string>
#include <vector>

#include "sim/scene.h"

namespace lumen {

struct RenderOptions {
  std::filesystem::path folder;
  int first_frame = 0;
  int last_frame = -1;  // exclusive; −1 = all
  uint64_t seed = 0;
  std::vector<int> frames = {};  // to render instead, ascending; empty = those of the range
};

struct RenderResult {
  double seconds = 0;
  int frames = 0;
  int64_t samples = 0;
  int64_t rays = 0;
  int64_t not_finite = 0;        // samples left out, the metering's included
  std::string first_not_finite;  // where the first was: frame, pixel, sample
  int first_not_finite_frame = -1;
  std::vector<std::string> effects;
};

// Writes the frames that the options name, poses, gains and ground truth. Frames, gains included, don't
// depend on which others are rendered. The files of an earlier render in the folder are removed first, its
// calibration.toml included; a sequence that was not rendered is refused. Throws InputError.
RenderResult Render(const Scene& scene, const RenderOptions& options);

}  // namespace lumen
