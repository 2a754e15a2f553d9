#include "recon/training/options.h"

#include <cmath>
#include <sstream>

#include "common/config.h"
#include "common/error.h"

namespace lumen {
namespace {

struct Preset {
  const char* name;
  const char* text;  // what differs from the defaults of TrainOptions
};

constexpr Preset kPresets[] = {
    {"fast", ""},
    {"neus", R"(
[network]
reflectance = "unlit"
[loss]
albedo = 0.0
)"},
};

const char* const kReflectanceNames[] = {"lambertian", "free", "unlit"};
const char* const kInterreflectionNames[] = {"none", "mean"};

std::vector<int> Widths(const ConfigTable& table, const std::string& key, const std::vector<int>& otherwise) {
  if (!table.Has(key)) return otherwise;
  std::vector<int> widths;
  for (double width : table.Numbers(key, 0, {1, 4096})) {
    if (width != std::floor(width)) table.Fail(key, "widths are whole numbers");
    widths.push_back(static_cast<int>(width));
  }
  return widths;
}

void ReadField(const ConfigTable& root, FieldOptions* field) {
  if (const auto grid = root.Optional("grid")) {
    field->grid.levels = static_cast<int>(grid->Integer("levels", field->grid.levels, {1, 32}));
    field->grid.coarsest_cell_mm =
        grid->Number("coarsest_cell_mm", field->grid.coarsest_cell_mm, {1e-3, 1e3});
    field->grid.finest_cell_mm = grid->Number("finest_cell_mm", field->grid.finest_cell_mm, {1e-3, 1e3});
    field->grid.log2_table_size =
        static_cast<int>(grid->Integer("log2_table_size", field->grid.log2_table_size, {4, 24}));
  }
  if (const auto network = root.Optional("network")) {
    field->sdf_hidden = Widths(*network, "sdf_hidden", field->sdf_hidden);
    field->color_hidden = Widths(*network, "color_hidden", field->color_hidden);
    field->features = static_cast<int>(network->Integer("features", field->features, {0, 1024}));
    field->unit_mm = network->Number("unit_mm", field->unit_mm, kPositive);
    const std::string name = network->Choice("reflectance", kReflectanceNames[int(field->reflectance)],
                                             {kReflectanceNames, kReflectanceNames + 3});
    for (int i = 0; i < 3; ++i)
      if (name == kReflectanceNames[i]) field->reflectance = static_cast<Reflectance>(i);
    const std::string source =
        network->Choice("interreflection", kInterreflectionNames[int(field->interreflection)],
                        {kInterreflectionNames, kInterreflectionNames + 2});
    field->interreflection = source == "mean" ? Interreflection::kMean : Interreflection::kNone;
    field->ambient_hidden = Widths(*network, "ambient_hidden", field->ambient_hidden);
  }
  if (const auto initial = root.Optional("initial")) {
    field->initial.radius_mm = initial->Number("radius_mm", field->initial.radius_mm, kPositive);
    field->initial.reach_mm = initial->Number("reach_mm", field->initial.reach_mm, kNotNegative);
  }
}

void ReadRest(const ConfigTable& root, TrainOptions* options) {
  options->frames = static_cast<int>(root.Integer("frames", options->frames, {1, 1e6}));
  if (const auto bounds = root.Optional("bounds")) {
    options->bounds.ahead_mm = bounds->Number("ahead_mm", options->bounds.ahead_mm, kPositive);
    options->bounds.aside_mm = bounds->Number("aside_mm", options->bounds.aside_mm, kPositive);
  }
  if (const auto sampling = root.Optional("sampling")) {
    auto& s = options->sampling;
    s.rays = static_cast<int>(sampling->Integer("rays", s.rays, {1, 1 << 20}));
    s.coarse = static_cast<int>(sampling->Integer("coarse", s.coarse, {2, 4096}));
    s.surface = static_cast<int>(sampling->Integer("surface", s.surface, {1, 4096}));
    s.spread = static_cast<int>(sampling->Integer("spread", s.spread, {1, 4096}));
    s.surface_spacing = sampling->Number("surface_spacing", s.surface_spacing, kPositive);
    s.weight_threshold = sampling->Number("weight_threshold", s.weight_threshold, kFraction);
  }
  if (const auto loss = root.Optional("loss")) {
    auto& l = options->loss;
    l.eikonal = loss->Number("eikonal", l.eikonal, kNotNegative);
    l.albedo = loss->Number("albedo", l.albedo, kNotNegative);
    l.albedo_final = loss->Number("albedo_final", l.albedo_final, kPositive);
    l.ambient = loss->Number("ambient", l.ambient, kNotNegative);
    l.albedo_width = loss->Number("albedo_width", l.albedo_width, kPositive);
  }
  if (const auto schedule = root.Optional("schedule")) {
    auto& s = options->schedule;
    s.iterations = schedule->Integer("iterations", s.iterations, {1, 1e12});
    s.seconds = schedule->Number("seconds", s.seconds, kNotNegative);
    s.learning_rate = schedule->Number("learning_rate", s.learning_rate, kPositive);
    s.learning_rate_final = schedule->Number("learning_rate_final", s.learning_rate_final, {1e-9, 1});
    s.sharpness_start_per_mm =
        schedule->Number("sharpness_start_per_mm", s.sharpness_start_per_mm, kPositive);
    s.sharpness_end_per_mm = schedule->Number("sharpness_end_per_mm", s.sharpness_end_per_mm, kPositive);
    s.checkpoint_seconds = schedule->Number("checkpoint_seconds", s.checkpoint_seconds, kNotNegative);
  }
  if (const auto extract = root.Optional("extract")) {
    options->extract_cell_mm = extract->Number("cell_mm", options->extract_cell_mm, {1e-3, 1e3});
  }
}

std::string Array(const std::vector<int>& values) {
  std::string text = "[";
  for (size_t i = 0; i < values.size(); ++i) text += (i ? ", " : "") + std::to_string(values[i]);
  return text + "]";
}

}  // namespace

std::vector<std::string> PresetNames() {
  std::vector<std::string> names;
  for (const Preset& preset : kPresets) names.push_back(preset.name);
  return names;
}

TrainOptions ReadTrainOptions(const std::string& name, const std::vector<std::string>& settings) {
  for (const Preset& preset : kPresets) {
    if (name != preset.name) continue;
    TrainOptions options;
    options.preset = name;
    // The preset itself first: what the command line sets lies on top of it.
    for (const auto& config :
         {Config::Parse(preset.text, "preset " + name), Config::Parse("", "command line", {}, settings)}) {
      ReadField(config.root(), &options.field);
      ReadRest(config.root(), &options);
      config.RejectUnknown();
    }
    return options;
  }
  std::string known;
  for (const Preset& preset : kPresets) known += std::string(known.empty() ? "" : ", ") + preset.name;
  throw InputError("--preset " + name + ": no such preset; there are: " + known);
}

std::string FormatTrainOptions(const TrainOptions& o) {
  std::ostringstream out;
  out.precision(17);
  out << "preset = \"" << o.preset << "\"\nframes = " << o.frames
      << "\n\n[grid]\nlevels = " << o.field.grid.levels
      << "\ncoarsest_cell_mm = " << o.field.grid.coarsest_cell_mm
      << "\nfinest_cell_mm = " << o.field.grid.finest_cell_mm
      << "\nlog2_table_size = " << o.field.grid.log2_table_size
      << "\n\n[network]\nsdf_hidden = " << Array(o.field.sdf_hidden)
      << "\ncolor_hidden = " << Array(o.field.color_hidden) << "\nfeatures = " << o.field.features
      << "\nunit_mm = " << o.field.unit_mm << "\nreflectance = \""
      << kReflectanceNames[int(o.field.reflectance)] << "\"\ninterreflection = \""
      << kInterreflectionNames[int(o.field.interreflection)]
      << "\"\nambient_hidden = " << Array(o.field.ambient_hidden)
      << "\n\n[initial]\nradius_mm = " << o.field.initial.radius_mm
      << "\nreach_mm = " << o.field.initial.reach_mm << "\n\n[bounds]\nahead_mm = " << o.bounds.ahead_mm
      << "\naside_mm = " << o.bounds.aside_mm << "\n\n[sampling]\nrays = " << o.sampling.rays
      << "\ncoarse = " << o.sampling.coarse << "\nsurface = " << o.sampling.surface
      << "\nspread = " << o.sampling.spread << "\nsurface_spacing = " << o.sampling.surface_spacing
      << "\nweight_threshold = " << o.sampling.weight_threshold << "\n\n[loss]\neikonal = " << o.loss.eikonal
      << "\nalbedo = " << o.loss.albedo << "\nalbedo_final = " << o.loss.albedo_final
      << "\nambient = " << o.loss.ambient << "\nalbedo_width = " << o.loss.albedo_width
      << "\n\n[schedule]\niterations = " << o.schedule.iterations << "\nseconds = " << o.schedule.seconds
      << "\nlearning_rate = " << o.schedule.learning_rate
      << "\nlearning_rate_final = " << o.schedule.learning_rate_final
      << "\nsharpness_start_per_mm = " << o.schedule.sharpness_start_per_mm
      << "\nsharpness_end_per_mm = " << o.schedule.sharpness_end_per_mm
      << "\ncheckpoint_seconds = " << o.schedule.checkpoint_seconds
      << "\n\n[extract]\ncell_mm = " << o.extract_cell_mm << "\n";
  return out.str();
}

}  // namespace lumen
