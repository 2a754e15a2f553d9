#include "tools/study/budget_effects.h"

#include <fmt/format.h>

#include <algorithm>

#include "common/calibration.h"
#include "recon/training/pose_noise.h"
#include "sim/cost/knobs.h"
#include "tools/study/levels.h"

namespace lumen {
namespace {

// Light between walls reaches most places after one bounce or two.
constexpr int kFirstBounces[] = {1, 2};

BudgetEffect Bounces(const Scene& scene) {
  std::vector<int> bounces;
  for (int n : kFirstBounces)
    if (n < scene.path.bounces) bounces.push_back(n);
  bounces.push_back(scene.path.bounces);
  BudgetEffect effect{"bounces", {}, {}, {}, {}};
  for (int n : bounces) effect.steps.push_back(std::to_string(n));
  effect.reduce_to = [bounces](int step, Scene* s) { s->path.bounces = step == 0 ? 0 : bounces[step - 1]; };
  return effect;
}

// What moves during the exposure, and that rows are read out one after the other, are two questions.
void AddShutter(const Shutter& shutter, std::vector<BudgetEffect>* effects) {
  const auto part = [&](const char* name, double Shutter::*time) {
    const auto leave_out = [time](int, Scene* s) {
      if (!s->sensor.shutter) return;
      (*s->sensor.shutter).*time = 0;
      if (s->sensor.shutter->exposure == 0 && s->sensor.shutter->readout == 0) s->sensor.shutter.reset();
    };
    effects->push_back({name, {}, leave_out, {}, {}});
  };
  if (shutter.exposure != 0) part("motion_blur", &Shutter::exposure);
  if (shutter.readout != 0) part("rolling_shutter", &Shutter::readout);
}

std::vector<BudgetEffect> EffectsOfScene(const Scene& scene) {
  std::vector<BudgetEffect> effects;
  if (scene.peristalsis) {
    effects.push_back({"peristalsis", {}, [](int, Scene* s) { s->peristalsis.reset(); }, {}, {}});
  }
  for (const EffectSwitch& effect : SwitchesOf(scene)) {
    if (InPapersModel(effect.name)) continue;
    if (effect.name == "interreflection") {
      effects.push_back(Bounces(scene));
    } else if (effect.name == "shutter") {
      AddShutter(*scene.sensor.shutter, &effects);
    } else {
      const auto leave_out = [off = effect.switch_off](int, Scene* s) { off(s); };
      effects.push_back({effect.name, {}, leave_out, {}, {}});
    }
    if (effect.name == "vignetting") {
      effects.back().name = "vignetting_unknown";
      effects.back().keep_unknown = [](uint64_t, Sequence* sequence) {
        sequence->calibration.response.vignetting = 0;
      };
    }
  }
  return effects;
}

// CF-H190L's light guides in place of the scene's light.
std::string ThreeGuides(const Light& light) {
  const LightSource& source = light.sources.front();
  Vec3d intensity = Vec3d::Zero();
  for (const LightSource& each : light.sources) intensity += each.intensity / 3;
  std::string guides;
  for (const char* position : {"[3.24, 0.55, 0]", "[-2.77, 2.66, 0]", "[-1.27, -3.14, 0]"}) {
    guides += fmt::format("{}{{position = {}, direction = {}, spread = {}, intensity = {}}}",
                          guides.empty() ? "" : ", ", position, ArrayText(source.direction.data(), 3),
                          source.spread, ArrayText(intensity.data(), 3));
  }
  return "light.source=[" + guides + "]";
}

}  // namespace

std::vector<std::string> MissingInBudget(const Scene& scene) {
  std::vector<std::string> missing;
  const auto has = [&](const char* effect) { return std::ranges::count(scene.effects, effect) > 0; };
  if (!has("interreflection")) missing.push_back("path.bounces=8");
  if (!has("offset_guides") && !scene.calibration.light.sources.empty())
    missing.push_back(ThreeGuides(scene.calibration.light));
  if (!has("coat")) missing.push_back("surface.coat={bounced_roughness = 0.6}");
  // μa of blood in the living colon (sim/imaging/subsurface.h).
  if (!has("subsurface")) missing.push_back("surface.subsurface={absorption_per_mm = [0.06, 1.1, 1.6]}");
  if (!has("vignetting")) missing.push_back("response.vignetting=0.2");
  const Shutter shutter = scene.sensor.shutter.value_or(Shutter{0, 0});
  if (shutter.exposure == 0) missing.push_back("sensor.shutter.exposure=0.5");
  if (shutter.readout == 0) missing.push_back("sensor.shutter.readout=0.5");
  if (!has("sensor_noise")) missing.push_back("sensor.noise={}");
  return missing;
}

void SetBudgetExposure(Scene* scene) {
  if (!scene->sensor.auto_gain) scene->sensor.auto_gain.emplace();
  scene->sensor.record_gain = true;
}

std::vector<BudgetEffect> BudgetEffectsOf(const Scene& scene) {
  std::vector<BudgetEffect> effects = EffectsOfScene(scene);
  const auto forget_gains = [](uint64_t, Sequence* sequence) {
    for (SequenceFrame& frame : sequence->frames) frame.gain.reset();
  };
  const auto disturb_poses = [](uint64_t seed, Sequence* sequence) {
    AddPoseNoise(PoseNoise{}, seed, sequence);
  };
  const int available = static_cast<int>(scene.world_from_camera.size());
  const auto fewer_frames = [available](TrainOptions* options) {
    options->frames = std::max(1, std::min(options->frames, available) / 4);
  };
  effects.push_back({"gains_unknown", {}, {}, forget_gains, {}});
  effects.push_back({"pose_noise", {}, {}, disturb_poses, {}});
  effects.push_back({"quarter_of_frames", {}, {}, {}, fewer_frames});
  return effects;
}

std::vector<BudgetVariant> BudgetVariantsOf(const std::vector<BudgetEffect>& effects, bool all_but) {
  const std::vector<int> none(effects.size(), 0);
  std::vector<int> whole;
  for (const BudgetEffect& effect : effects) whole.push_back(effect.whole());
  std::vector<BudgetVariant> variants = {{VariantKind::kIdeal, "ideal", none}};
  for (size_t i = 0; i < effects.size(); ++i) {
    const BudgetEffect& effect = effects[i];
    for (int step = 1; step <= effect.whole(); ++step) {
      variants.push_back({VariantKind::kOne, effect.name, none});
      if (!effect.steps.empty()) variants.back().name += ": " + effect.steps[step - 1];
      variants.back().steps[i] = step;
    }
  }
  if (effects.size() < 2) return variants;
  variants.push_back({VariantKind::kAll, "all", whole});
  // Of two effects all but one is the other, but for what has steps.
  for (size_t i = 0; all_but && i < effects.size(); ++i) {
    for (int step = effects.size() > 2 ? 0 : 1; step < whole[i]; ++step) {
      variants.push_back({VariantKind::kAllBut, "all but " + effects[i].name, whole});
      if (step > 0) variants.back().name += " past " + effects[i].steps[step - 1];
      variants.back().steps[i] = step;
    }
  }
  return variants;
}

}  // namespace lumen
