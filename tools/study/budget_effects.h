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

// One departure. Functions that are empty change nothing.
struct BudgetEffect {
  std::string name;
  // Of an effect that grows step by step, each step's name, the last being all of it; otherwise empty: the
  // effect is one step.
  std::vector<std::string> steps;
  std::function<void(int step, Scene*)> reduce_to;             // as many steps of it, in the frames; 0 = none
  std::function<void(uint64_t seed, Sequence*)> keep_unknown;  // what the reconstructor is told changes
  std::function<void(TrainOptions*)> restrict;                 // so does what it may use

  int whole() const { return steps.empty() ? 1 : static_cast<int>(steps.size()); }
};

// Settings that give a scene what it doesn't name of the effects that a budget is about, at the strength of a
// colonoscope: eight bounces; three guides beside the camera, CF-H190L's, together as strong as the scene's
// light; a coat of mucus (the default one, bounced_roughness 0.6); tissue with blood; vignetting k = 0.2,
// what a calibration may leave; an exposure of half the frame interval and as long a readout; the default
// sensor's noise. The rest a scene can name too, and is then measured, but nobody else's.
std::vector<std::string> MissingInBudget(const Scene& scene);

// The paper's model has a texture and a gain a frame. The gain is automatic in all that the budget renders,
// by the scene's own loop or the default one, so that an effect which adds light doesn't saturate the frames;
// and it is recorded.
void SetBudgetExposure(Scene* scene);

// Those of the scene's effects that the paper's model hasn't, light between walls step by step (one bounce,
// two, all); vignetting is unknown to the reconstructor where it is on. Then unknown gains, pose noise and a
// quarter of the frames.
std::vector<BudgetEffect> BudgetEffectsOf(const Scene& scene);

enum class VariantKind { kIdeal, kOne, kAll, kAllBut };

struct BudgetVariant {
  VariantKind kind = VariantKind::kIdeal;
  std::string name;        // "ideal", "jpeg", "bounces: 1", "all", "all but jpeg", "all but bounces past 1"
  std::vector<int> steps;  // one an effect: how much of it is there
};

// No effect, each step of each alone, all, all but each (and but its later steps); none of them twice.
std::vector<BudgetVariant> BudgetVariantsOf(const std::vector<BudgetEffect>& effects, bool all_but);

}  // namespace lumen
