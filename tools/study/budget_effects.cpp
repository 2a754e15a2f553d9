#include "tools/study/budget_effects.h"

#include <algorithm>
#include <cmath>

#include "common/error.h"
#include "common/random.h"
#include "sim/cost/knobs.h"

namespace lumen {
namespace {

constexpr uint64_t kPoseNoiseSeed = 0x706f7365ull;

// Both paint the wall; how it departs from one colour is one question.
bool IsTexture(const std::string& name) { return name == "mottling" || name == "vessels"; }

// A standard normal number of (seed, frame, component), by Box and Muller.
double Normal(uint64_t seed, uint64_t frame, uint64_t component) {
  // 1 − u is in (0, 1]: its logarithm is finite.
  const double u = 1 - UniformDouble(RandomBits(seed, frame, component, 0));
  const double v = UniformDouble(RandomBits(seed, frame, component, 1));
  return std::sqrt(-2 * std::log(u)) * std::cos(2 * kPi * v);
}

std::vector<BudgetEffect> EffectsOfScene(const Scene& scene) {
  std::vector<BudgetEffect> effects;
  if (scene.peristalsis) {
    effects.push_back({"peristalsis", [](Scene* s) { s->peristalsis.reset(); }, {}, {}});
  }
  for (const EffectSwitch& effect : SwitchesOf(scene)) {
    if (!IsTexture(effect.name)) {
      effects.push_back({effect.name, effect.switch_off, {}, {}});
    } else if (std::ranges::find(effects, "texture", &BudgetEffect::name) == effects.end()) {
      const auto plain = [](Scene* s) {
        s->surface.mottling.reset();
        s->surface.vessels.reset();
      };
      effects.push_back({"texture", plain, {}, {}});
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

}  // namespace

std::vector<BudgetEffect> BudgetEffectsOf(const Scene& scene, const std::string& scene_name) {
  std::vector<BudgetEffect> effects = EffectsOfScene(scene);
  if (effects.empty()) {
    throw InputError(scene_name +
                     ": has no effect that a budget could switch off; name some, e.g. path.bounces = 3 or "
                     "[sensor.noise] (scenes/README.md)");
  }
  const auto forget_gains = [](uint64_t, Sequence* sequence) {
    for (SequenceFrame& frame : sequence->frames) frame.gain.reset();
  };
  const auto disturb_poses = [](uint64_t seed, Sequence* sequence) {
    AddPoseNoise(PoseNoise{}, seed, sequence);
  };
  const int available = static_cast<int>(scene.world_from_camera.size());
  const auto halve_frames = [available](TrainOptions* options) {
    options->frames = std::max(1, std::min(options->frames, available) / 2);
  };
  effects.push_back({"gains_unknown", {}, forget_gains, {}});
  effects.push_back({"pose_noise", {}, disturb_poses, {}});
  effects.push_back({"half_the_frames", {}, {}, halve_frames});
  return effects;
}

std::vector<BudgetVariant> BudgetVariantsOf(const std::vector<BudgetEffect>& effects, bool all_but) {
  const size_t count = effects.size();
  std::vector<BudgetVariant> variants = {{VariantKind::kIdeal, "ideal", std::vector<bool>(count, false)}};
  for (size_t i = 0; i < count; ++i) {
    variants.push_back({VariantKind::kOne, effects[i].name, std::vector<bool>(count, false)});
    variants.back().on[i] = true;
  }
  if (count < 2) return variants;
  variants.push_back({VariantKind::kAll, "all", std::vector<bool>(count, true)});
  if (!all_but || count < 3) return variants;
  for (size_t i = 0; i < count; ++i) {
    variants.push_back({VariantKind::kAllBut, "all but " + effects[i].name, std::vector<bool>(count, true)});
    variants.back().on[i] = false;
  }
  return variants;
}

void AddPoseNoise(const PoseNoise& noise, uint64_t seed, Sequence* sequence) {
  const uint64_t own_seed = RandomBits(seed, kPoseNoiseSeed);
  // The mean square of a vector is that of its three components together.
  const double shift_mm = noise.shift_mm / std::sqrt(3.0), angle_rad = noise.angle_rad / std::sqrt(3.0);
  for (SequenceFrame& frame : sequence->frames) {
    const auto number = static_cast<uint64_t>(frame.number);
    const auto normals = [&](uint64_t first) {
      return Vec3d(Normal(own_seed, number, first), Normal(own_seed, number, first + 1),
                   Normal(own_seed, number, first + 2));
    };
    const Vec3d rotation = angle_rad * normals(0);
    Pose& pose = frame.world_from_camera;
    if (rotation.norm() > 0) pose.rotate(Eigen::AngleAxisd(rotation.norm(), rotation.normalized()));
    pose.pretranslate(shift_mm * normals(3));
  }
}

}  // namespace lumen
