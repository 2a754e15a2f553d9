#include "tools/study/levels.h"

#include "sim/cost/knobs.h"

namespace lumen {

bool InPapersModel(const std::string& effect) {
  return effect == "mottling" || effect == "vessels" || effect == "auto_gain";
}

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
