// The knobs of the path tracer that trade accuracy for time, and the effects of a scene that can be switched
// off: tables that the cost measurement goes through.
#pragma once

#include <functional>
#include <string>
#include <vector>

#include "sim/scene.h"

namespace lumen {

// Sixteen rays at a time, or one by one (reference_path.h).
enum class PathTracer { kPackets, kSingleFloat, kSingleDouble };

struct KnobSetting {
  std::string label;
  PathOptions options;
  double work = 1;      // a guess of its time, in units of the scene's own: what is too long is left out
  bool is_own = false;  // the scene's own setting
  PathTracer tracer = PathTracer::kPackets;
};

struct Knob {
  std::string name;
  bool biased;  // its settings expect different pictures
  std::vector<KnobSetting> settings;
};

// The knobs that make a difference in this scene, each with settings of it alone, the scene's own among them.
std::vector<Knob> KnobsOf(const Scene& scene);

struct EffectSwitch {
  std::string name;  // as in Scene::effects
  std::function<void(Scene*)> switch_off;
};

// The effects that this scene has and that can be taken out of it.
std::vector<EffectSwitch> SwitchesOf(const Scene& scene);

// One source at the camera that is as strong as all.
void MoveToCamera(Light* light);

}  // namespace lumen
