// How a sequence can depart from what LightNeuS assumes: each departure by itself, and their combinations.
#pragma once

#include <cstdint>
#include <functional>
#include <string>
#include <vector>

#include "common/sequence.h"
#include "recon/training/options.h"
#include "sim/scene.h"

namespace lumen {

// Errors of the poses, root mean squares over frames; each component is normal, frames independent.
struct PoseNoise {
  double shift_mm = 0.5;
  double angle_rad = 0.3 / 180 * kPi;
};

// One departure. Functions that are empty change nothing.
struct BudgetEffect {
  std::string name;
  std::function<void(Scene*)> leave_out;                       // of the frames
  std::function<void(uint64_t seed, Sequence*)> keep_unknown;  // what the reconstructor is told changes
  std::function<void(TrainOptions*)> restrict;                 // so does what it may use
};

// Those of the scene's effects that can be left out (`texture` stands for mottling and vessels; vignetting is
// unknown to the reconstructor where it is on); then unknown gains, pose noise and half the frames, which
// every scene can have. Throws InputError, `scene_name` in front, where the scene has no effect of its own.
std::vector<BudgetEffect> BudgetEffectsOf(const Scene& scene, const std::string& scene_name);

enum class VariantKind { kIdeal, kOne, kAll, kAllBut };

struct BudgetVariant {
  VariantKind kind = VariantKind::kIdeal;
  std::string name;      // "ideal", "jpeg", "all", "all but jpeg"
  std::vector<bool> on;  // one an effect
};

// No effect, each alone, all, all but each; none of them twice.
std::vector<BudgetVariant> BudgetVariantsOf(const std::vector<BudgetEffect>& effects, bool all_but);

// Disturbs every frame's pose: rotation vector and shift, drawn by seed and frame.
void AddPoseNoise(const PoseNoise& noise, uint64_t seed, Sequence* sequence);

}  // namespace lumen
