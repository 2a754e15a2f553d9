// What a frame's accuracy costs in CPU time: its path tracer's knobs against a converged reference, and its
// effects switched off one by one.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "common/cost_curves.h"
#include "sim/cost/reference.h"
#include "sim/scene.h"

namespace lumen {

struct RenderCostOptions {
  int frame = 0;
  double seconds = 120;  // of wall time that it may take, about; more of them make references better and
                         // curves longer
  int runs = 3;          // of every setting, each with random numbers of its own; at least 2
  uint64_t seed = 0;
};

// A converged picture to hold others against.
struct CostReference {
  int samples = 0, bounces = 0;
  std::vector<double> noise;  // its own remaining error by each measure, taken off the others' errors
  double mean_error = 0;      // standard error of its mean luminance, in parts of it
};

struct SettingBias {
  std::string knob, setting;
  Bias bias;
};

// The mask is left out.
struct EffectCost {
  std::string name;          // as in Scene::effects
  double seconds = 0;        // CPU seconds that a frame takes less without it
  double seconds_error = 0;  // its standard error
};

// Measures, in this order: relative error of a pixel's luminance (root mean square over valid pixels, in
// parts of their mean), and of the means of 8×8 blocks.
struct RenderCost {
  CostCurves sampling;   // knobs that leave the expected picture as it is, against the scene's own light
  CostCurves transport;  // bounces, against light that is followed to its end
  CostReference sampling_reference, transport_reference;
  std::vector<SettingBias> biases;  // of every point of every curve
  double frame_seconds = 0;         // CPU seconds of the whole frame: path tracer, lens, sensor
  double frame_seconds_error = 0;
  std::vector<EffectCost> effects;
  int width = 0, height = 0, triangles = 0;
};

// CPU seconds are the process's while the path tracer runs (for effects, the sensor's steps too); the median
// over runs. Throws InputError for a frame that the scene doesn't have.
RenderCost MeasureRenderCost(const Scene& scene, const RenderCostOptions& options);

}  // namespace lumen
