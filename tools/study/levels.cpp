#include "tools/study/levels.h"

#include "sim/cost/knobs.h"

namespace lumen {
namespace {

// A colour that varies over the wall and a gain a frame are in the paper's model (eq. 3).
bool InPapersModel(const std::string& effect) {
  return effect == "mottling" || effect == "vessels" || effect == "auto_gain";
}

}  // namespace

std::string NameOf(Level level) { return level == Level::kIdeal ? "ideal" : "full"; }

void ApplyLevel(Level level, Scene* scene) {
  if (level == Level::kFull) return;
  scene->peristalsis.reset();
  for (const EffectSwitch& effect : SwitchesOf(*scene)) {
    if (!InPapersModel(effect.name)) effect.switch_off(scene);
  }
  scene->sensor.record_gain = true;
}

}  // namespace lumen
