#include "sim/cost/knobs.h"

#include <algorithm>

#include "sim/imaging/reference_path.h"

namespace lumen {
namespace {

// A setting a value and one for the scene's own value, from small to large; `set` puts a value into the
// options.
Knob NumberKnob(const std::string& name, bool biased, const PathOptions& own, std::vector<int> values,
                int own_value, const std::function<void(int, PathOptions*)>& set,
                const std::function<double(int)>& work) {
  values.push_back(own_value);
  std::ranges::sort(values);
  values.erase(std::unique(values.begin(), values.end()), values.end());
  Knob knob{name, biased, {}};
  for (int value : values) {
    KnobSetting setting{std::to_string(value), own, work(value), value == own_value};
    set(value, &setting.options);
    knob.settings.push_back(setting);
  }
  return knob;
}

bool SharesPaths(const PathOptions& options) { return options.bounces > 0 && options.shared_paths > 0; }

Knob SamplerKnob(const PathOptions& own) {
  Knob knob{"sampler", false, {}};
  for (const auto& [name, sampling] :
       {std::pair("sobol", Sampling::kSobol), {"independent", Sampling::kIndependent}}) {
    knob.settings.push_back({name, own, 1, sampling == own.sampler});
    knob.settings.back().options.sampler = sampling;
  }
  return knob;
}

// Rays in packets and one by one, each pixel with a path of its own; the scene's own setting, if its pixels
// share paths, is a third.
Knob PacketsKnob(const PathOptions& own) {
  Knob knob{"packets", false, {}};
  if (SharesPaths(own)) knob.settings.push_back({"16 shared", own, 1, true});
  PathOptions alone = own;
  alone.shared_paths = 0;
  knob.settings.push_back({"16", alone, 1, !SharesPaths(own)});
  knob.settings.push_back({"1", alone, 2, false, PathTracer::kSingleFloat});
  return knob;
}

// Rays one by one in either precision, beside the scene's own: float, in packets.
Knob PrecisionKnob(const PathOptions& own) {
  return {"precision",
          false,
          {{"own", own, 1, true},
           {"float", own, 2, false, PathTracer::kSingleFloat},
           {"double", own, 2, false, PathTracer::kSingleDouble}}};
}

}  // namespace

std::vector<Knob> KnobsOf(const Scene& scene) {
  const PathOptions& own = scene.path;
  std::vector<Knob> knobs;
  knobs.push_back(NumberKnob(
      "samples", false, own, {1, 2, 4, 8, 16, 32, 64, 128, 256}, own.samples,
      [](int n, PathOptions* options) { options->samples = n; },
      [&](int n) { return double(n) / own.samples; }));
  // As many free of it as there are bounces: none plays it.
  if (own.bounces > 0) {
    knobs.push_back(NumberKnob(
        "roulette_after", false, own,
        {0, std::min(1, own.bounces), std::min(2, own.bounces), std::min(4, own.bounces), own.bounces},
        std::min(own.roulette_after, own.bounces),
        [](int n, PathOptions* options) { options->roulette_after = n; }, [](int) { return 1.0; }));
  }
  if (own.bounces > 0) {
    knobs.push_back(NumberKnob(
        "shared_paths", false, own, {0, 8, 16, 32, 64, 128}, own.shared_paths,
        [](int n, PathOptions* options) { options->shared_paths = n; }, [](int) { return 1.0; }));
  }
  knobs.push_back(SamplerKnob(own));
  if (MissingInReference(scene.sensor.shutter.has_value(), scene.defocus.has_value()).empty()) {
    knobs.push_back(PacketsKnob(own));
    knobs.push_back(PrecisionKnob(own));
  }
  knobs.push_back(NumberKnob(
      "bounces", true, own, {0, 1, 2, 3, 5, 8, 16}, own.bounces,
      [](int n, PathOptions* options) { options->bounces = n; },
      [&](int n) { return (1.0 + n) / (1.0 + own.bounces); }));
  return knobs;
}

std::vector<EffectSwitch> SwitchesOf(const Scene& scene) {
  const std::vector<EffectSwitch> all = {
      {"interreflection", [](Scene* s) { s->path.bounces = 0; }},
      {"mottling", [](Scene* s) { s->surface.mottling.reset(); }},
      {"vessels", [](Scene* s) { s->surface.vessels.reset(); }},
      {"coat",
       [](Scene* s) {
         s->surface.coat.reset();
         s->surface.bounced_coat.reset();
       }},
      {"subsurface", [](Scene* s) { s->surface.subsurface.reset(); }},
      {"offset_guides", [](Scene* s) { MoveToCamera(&s->calibration.light); }},
      {"vignetting", [](Scene* s) { s->calibration.response.vignetting = 0; }},
      {"defocus", [](Scene* s) { s->defocus.reset(); }},
      {"chromatic_aberration", [](Scene* s) { s->chromatic_aberration.reset(); }},
      {"shutter", [](Scene* s) { s->sensor.shutter.reset(); }},
      {"auto_gain", [](Scene* s) { s->sensor.auto_gain.reset(); }},
      {"sensor_noise", [](Scene* s) { s->sensor.noise.reset(); }},
      {"jpeg", [](Scene* s) { s->sensor.jpeg.reset(); }},
  };
  std::vector<EffectSwitch> present;
  for (const EffectSwitch& effect : all) {
    if (std::ranges::find(scene.effects, effect.name) != scene.effects.end()) present.push_back(effect);
  }
  return present;
}

void MoveToCamera(Light* light) {
  std::vector<LightSource>& sources = light->sources;
  for (size_t i = 1; i < sources.size(); ++i) sources[0].intensity += sources[i].intensity;
  sources.resize(1);
  sources[0].position.setZero();
}

}  // namespace lumen
