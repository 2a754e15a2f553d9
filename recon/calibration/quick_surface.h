// A surface that is good enough to say which place of the wall each pixel sees: a short training run with all
// gains unknown.
#pragma once

#include <cstdint>
#include <vector>

#include "common/mesh.h"
#include "common/sequence.h"

namespace lumen {

struct QuickSurfaceOptions {
  int frames = 20;  // taken uniformly over the sequence
  int64_t iterations = 4000;
  double cell_mm = 1.5;  // of the mesh
};

struct QuickSurface {
  Mesh mesh;                     // world mm, faces oriented away from the lumen
  std::vector<int> frames;       // indices of the sequence's frames that it was learnt from
  std::vector<double> log_gain;  // of these, as learnt; the first one's is 0
};

// Gains of the sequence are not looked at. Throws InputError where training does, or leaves no surface.
QuickSurface LearnQuickSurface(const Sequence& sequence, const QuickSurfaceOptions& options, uint64_t seed);

}  // namespace lumen
