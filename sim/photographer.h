// What lens, sensor and recorder make of a frame's radiance: the steps behind the path tracer, each of which
// is there only if the scene names it.
#pragma once

#include <cstdint>

#include "sim/scene.h"

namespace lumen {

class Photographer {
 public:
  // Scene and valid pixels are referred to.
  Photographer(const Scene& scene, const Image8& valid, uint64_t seed);

  // The colour file's pixels. radiance: linear, RGB, as RenderFrame gives it.
  Image8 Photograph(int frame, double gain, const ImageF& radiance) const;

 private:
  Image8 Expose(int frame, double gain, const ImageF& radiance) const;

  const Scene& scene_;
  const Image8& valid_;
  uint64_t seed_;
  ImageF vignetting_;
};

}  // namespace lumen
