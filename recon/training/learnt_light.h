// What a trained field says of a frame's light, pixel by pixel: albedo, and what the wall sends to the camera
// of the guides' light and of the rest of the wall's.
#pragma once

#include <filesystem>
#include <memory>

#include "common/image.h"
#include "common/sequence.h"

namespace lumen {

// Of every stride-th pixel of every stride-th row, from the upper left on; NaN where nothing is known.
struct LightFrame {
  ImageF albedo;            // RGB; up to a factor where the light's power or the gains are unknown
  ImageF direct, indirect;  // RGB radiance, without glints, in any one unit
  ImageF distance_mm;       // along the ray
};

class LearntLight {
 public:
  // Reads a run's config.toml and checkpoint; sequence: that it was trained on. Throws InputError: a file is
  // missing, damaged or of another sequence, or the run's reflectance has no albedo.
  LearntLight(const std::filesystem::path& run, const Sequence& sequence);
  ~LearntLight();

  // Indices of the sequence's frames that were trained on.
  const std::vector<int>& frames() const;
  // Of the n-th of them, where its pixels' rays meet the surface.
  LightFrame At(int n, int stride) const;

 private:
  struct State;
  std::unique_ptr<State> state_;
};

}  // namespace lumen
