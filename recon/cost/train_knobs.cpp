#include "recon/cost/train_knobs.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <functional>

namespace lumen {
namespace {

using Set = std::function<void(double, TrainOptions*)>;

// A setting a value and one for own's value, from small to large.
TrainKnob NumberKnob(const std::string& name, const TrainOptions& own, std::vector<double> values,
                     double own_value, const Set& set) {
  values.push_back(own_value);
  std::ranges::sort(values);
  values.erase(std::unique(values.begin(), values.end()), values.end());
  TrainKnob knob{name, {}};
  for (double value : values) {
    TrainKnobSetting setting{fmt::format("{:.0f}", value), own, value == own_value};
    if (!setting.is_own) set(value, &setting.options);
    knob.settings.push_back(setting);
  }
  return knob;
}

// Own's value times or over each factor.
std::vector<double> Around(double own, const std::vector<double>& factors) {
  std::vector<double> values;
  for (double factor : factors) values.push_back(std::max(1.0, std::round(own * factor)));
  return values;
}

// Scales every hidden layer of both networks.
TrainKnob WidthKnob(const TrainOptions& own, const std::vector<double>& factors) {
  const double width = own.field.sdf_hidden.empty() ? 1 : own.field.sdf_hidden[0];
  return NumberKnob(
      "network_width", own, Around(width, factors), width, [width](double value, TrainOptions* options) {
        for (std::vector<int>* hidden : {&options->field.sdf_hidden, &options->field.color_hidden})
          for (int& w : *hidden) w = std::max(1, static_cast<int>(std::lround(w * value / width)));
      });
}

TrainKnob SamplesKnob(const TrainOptions& own, const std::vector<double>& factors) {
  const int per_ray = own.sampling.PerRay();
  const auto set = [per_ray](double value, TrainOptions* options) {
    auto& s = options->sampling;
    const auto scaled = [&](int n) {
      return std::max(1, static_cast<int>(std::lround(n * value / per_ray)));
    };
    if (s.kind == SamplerKind::kGuided) {
      s.surface = scaled(s.surface);
      s.spread = std::max(1, static_cast<int>(value) - s.surface);
    } else {
      s.round = scaled(s.round);
      s.uniform = std::max(2, static_cast<int>(value) - s.rounds * s.round);
    }
  };
  return NumberKnob("samples_a_ray", own, Around(per_ray, factors), per_ray, set);
}

// A setting a value of an enumeration, by its names in order.
template <class Enum>
TrainKnob ChoiceKnob(const std::string& name, const TrainOptions& own, const std::vector<const char*>& labels,
                     const std::function<Enum*(TrainOptions*)>& value) {
  TrainKnob knob{name, {}};
  for (size_t i = 0; i < labels.size(); ++i) {
    TrainKnobSetting setting{labels[i], own, false};
    Enum* chosen = value(&setting.options);
    setting.is_own = *chosen == static_cast<Enum>(i);
    *chosen = static_cast<Enum>(i);
    knob.settings.push_back(setting);
  }
  return knob;
}

}  // namespace

std::vector<TrainKnob> TrainKnobsOf(const TrainOptions& own, int available_frames, bool few) {
  const auto pick = [few](std::vector<double> some, std::vector<double> all) { return few ? some : all; };
  std::vector<TrainKnob> knobs;
  const auto iterations = static_cast<double>(own.schedule.iterations);
  knobs.push_back(
      NumberKnob("iterations", own, Around(iterations, pick({0.25, 0.5, 2}, {0.0625, 0.125, 0.25, 0.5, 2})),
                 iterations, [](double n, TrainOptions* o) { o->schedule.iterations = std::llround(n); }));
  knobs.push_back(NumberKnob(
      "rays", own, Around(own.sampling.rays, pick({0.25, 2}, {0.125, 0.25, 0.5, 2, 4})), own.sampling.rays,
      [](double n, TrainOptions* o) { o->sampling.rays = static_cast<int>(n); }));
  knobs.push_back(SamplesKnob(own, pick({0.5, 2}, {0.5, 0.75, 1.5, 2, 4})));
  if (own.field.grid.levels > 0) {
    const GridOptions& grid = own.field.grid;
    knobs.push_back(
        NumberKnob("log2_table_size", own, pick({12, 18}, {10, 12, 14, 16, 18}), grid.log2_table_size,
                   [](double n, TrainOptions* o) { o->field.grid.log2_table_size = static_cast<int>(n); }));
    knobs.push_back(
        NumberKnob("grid_levels", own, pick({4}, {2, 4, 6, 10, 12}), grid.levels,
                   [](double n, TrainOptions* o) { o->field.grid.levels = static_cast<int>(n); }));
    knobs.push_back(ChoiceKnob<Precision>("precision", own, {"float", "bf16"},
                                          [](TrainOptions* o) { return &o->field.grid.precision; }));
  }
  knobs.push_back(ChoiceKnob<Precision>("network_precision", own, {"float", "bf16"},
                                        [](TrainOptions* o) { return &o->field.network_precision; }));
  knobs.push_back(WidthKnob(own, pick({0.5, 2}, {0.25, 0.5, 2, 4})));
  std::vector<double> frames;
  for (double n : pick({5}, {3, 5, 10, 20, 40}))
    if (n <= available_frames) frames.push_back(n);
  knobs.push_back(NumberKnob("frames", own, frames, std::min(own.frames, available_frames),
                             [](double n, TrainOptions* o) { o->frames = static_cast<int>(n); }));
  knobs.push_back(NumberKnob("binning", own, pick({1, 2}, {1, 2, 3, 4, 8}), own.binning,
                             [](double n, TrainOptions* o) { o->binning = static_cast<int>(n); }));
  if (own.field.reflectance != Reflectance::kUnlit) {
    knobs.push_back(ChoiceKnob<Reflectance>("reflectance", own, {"lambertian", "free", "coat"},
                                            [](TrainOptions* o) { return &o->field.reflectance; }));
  }
  if (HasAlbedo(own.field.reflectance)) {
    knobs.push_back(ChoiceKnob<Interreflection>("interreflection", own, {"none", "mean", "radiosity"},
                                                [](TrainOptions* o) { return &o->field.interreflection; }));
  }
  return knobs;
}

}  // namespace lumen
