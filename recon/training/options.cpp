#include "recon/training/options.h"

#include <cmath>
#include <sstream>

#include "common/config.h"
#include "common/error.h"
#include "common/files.h"
#include "recon/network/adam.h"

namespace lumen {
namespace {

struct Preset {
  const char* name;
  std::vector<const char*> texts;  // what differs from the defaults of TrainOptions, a later one on top
};

// The baseline: pixels as they are, and no light. Without light the surface hardly leaves the tube that it
// starts from, so that one is as wide as a colon.
constexpr const char* kUnlit = R"(
[initial]
radius_mm = 24
fit_reach = false
[network]
reflectance = "unlit"
[loss]
albedo = 0.0
[schedule]
fog_iterations = 0
)";

// NeuS's published configuration for scenes without masks (Wang et al. 2021), its unit being 68 mm. Warm-up:
// 5,000 of 300,000 iterations. Sharpness: from 20 a unit on; its rounds from 64 a unit on. All samples are
// shaded, as NeuS does. The tube is our start in place of NeuS's sphere, which initial.shape = "sphere" turns
// inside out: one around all cameras is far from the walls of a lumen.
constexpr const char* kPaper = R"(
[grid]
levels = 0
[network]
place_octaves = 6
direction_octaves = 4
sdf_hidden = [256, 256, 256, 256, 256, 256, 256, 256]
sdf_activation = "softplus"
sdf_skip = 4
color_hidden = [256, 256, 256, 256]
features = 256
weight_norm = true
unit_mm = 68.0
reflectance = "free"
interreflection = "none"
[sampling]
rays = 512
sampler = "importance"
uniform = 64
rounds = 4
round = 16
round_sharpness_per_mm = 0.9412
weight_threshold = 0.0
[loss]
eikonal = 0.1
free_space = 0.0
[schedule]
iterations = 300000
learning_rate = 5e-4
learning_rate_final = 0.05
decay = "cosine"
warm_up = 0.016667
adam_beta2 = 0.999
settle_from = 0
sharpness_start_per_mm = 0.294
sharpness_rate = 10.0
)";

const std::vector<Preset>& Presets() {
  static const std::vector<Preset> presets = {
      {"fast", {}}, {"paper", {kPaper}}, {"neus", {kUnlit}}, {"neus_paper", {kPaper, kUnlit}}};
  return presets;
}

// One of an enumeration's names, in its order.
template <class Enum>
void ReadChoice(const ConfigTable& table, const char* key, const std::vector<std::string>& names,
                Enum* value) {
  const std::string name = table.Choice(key, names[static_cast<size_t>(*value)], names);
  for (size_t i = 0; i < names.size(); ++i)
    if (name == names[i]) *value = static_cast<Enum>(i);
}

const std::vector<std::string> kActivationNames = {"relu", "squareplus", "softplus"};
const std::vector<std::string> kShapeNames = {"tube", "sphere"};
const std::vector<std::string> kSamplerNames = {"guided", "importance"};
const std::vector<std::string> kDecayNames = {"exponential", "cosine"};
const std::vector<std::string> kPrecisionNames = {"float", "bf16"};
const char* const kReflectanceNames[] = {"lambertian", "free", "coat", "unlit"};
const char* const kInterreflectionNames[] = {"none", "mean", "radiosity"};

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
    field->grid.levels = static_cast<int>(grid->Integer("levels", field->grid.levels, {0, 32}));
    field->grid.coarsest_cell_mm =
        grid->Number("coarsest_cell_mm", field->grid.coarsest_cell_mm, {1e-3, 1e3});
    field->grid.finest_cell_mm = grid->Number("finest_cell_mm", field->grid.finest_cell_mm, {1e-3, 1e3});
    field->grid.log2_table_size =
        static_cast<int>(grid->Integer("log2_table_size", field->grid.log2_table_size, {4, 24}));
    ReadChoice(*grid, "precision", kPrecisionNames, &field->grid.precision);
  }
  if (const auto network = root.Optional("network")) {
    field->sdf_hidden = Widths(*network, "sdf_hidden", field->sdf_hidden);
    field->color_hidden = Widths(*network, "color_hidden", field->color_hidden);
    field->place_octaves = static_cast<int>(network->Integer("place_octaves", field->place_octaves, {0, 16}));
    field->direction_octaves =
        static_cast<int>(network->Integer("direction_octaves", field->direction_octaves, {0, 16}));
    ReadChoice(*network, "sdf_activation", kActivationNames, &field->sdf_activation);
    field->sdf_skip = static_cast<int>(network->Integer("sdf_skip", field->sdf_skip, {0, 64}));
    field->weight_norm = network->Flag("weight_norm", field->weight_norm);
    ReadChoice(*network, "precision", kPrecisionNames, &field->network_precision);
    field->features = static_cast<int>(network->Integer("features", field->features, {0, 1024}));
    field->unit_mm = network->Number("unit_mm", field->unit_mm, kPositive);
    const std::string name = network->Choice("reflectance", kReflectanceNames[int(field->reflectance)],
                                             {kReflectanceNames, kReflectanceNames + 4});
    for (int i = 0; i < 4; ++i)
      if (name == kReflectanceNames[i]) field->reflectance = static_cast<Reflectance>(i);
    field->bound_albedo = network->Flag("bound_albedo", field->bound_albedo);
    field->coat.ior = network->Number("coat_ior", field->coat.ior, {1.01, 1.99});
    field->coat.learn_ior = network->Flag("coat_ior_learnt", field->coat.learn_ior);
    const std::string source =
        network->Choice("interreflection", kInterreflectionNames[int(field->interreflection)],
                        {kInterreflectionNames, kInterreflectionNames + 3});
    for (int i = 0; i < 3; ++i)
      if (source == kInterreflectionNames[i]) field->interreflection = static_cast<Interreflection>(i);
    field->ambient_hidden = Widths(*network, "ambient_hidden", field->ambient_hidden);
  }
  if (const auto initial = root.Optional("initial")) {
    ReadChoice(*initial, "shape", kShapeNames, &field->initial.shape);
    field->initial.radius_mm = initial->Number("radius_mm", field->initial.radius_mm, kPositive);
    // A reach that is said is meant.
    if (initial->Has("reach_mm")) field->initial.fit_reach = false;
    field->initial.reach_mm = initial->Number("reach_mm", field->initial.reach_mm, kNotNegative);
    field->initial.fit_reach = initial->Flag("fit_reach", field->initial.fit_reach);
  }
}

void ReadRest(const ConfigTable& root, TrainOptions* options) {
  options->frames = static_cast<int>(root.Integer("frames", options->frames, {1, 1e6}));
  options->binning = static_cast<int>(root.Integer("binning", options->binning, {1, 1e6}));
  if (const auto bounds = root.Optional("bounds")) {
    options->bounds.ahead_mm = bounds->Number("ahead_mm", options->bounds.ahead_mm, kPositive);
    options->bounds.aside_mm = bounds->Number("aside_mm", options->bounds.aside_mm, kPositive);
  }
  if (const auto sampling = root.Optional("sampling")) {
    auto& s = options->sampling;
    s.rays = static_cast<int>(sampling->Integer("rays", s.rays, {1, 1 << 20}));
    ReadChoice(*sampling, "sampler", kSamplerNames, &s.kind);
    s.uniform = static_cast<int>(sampling->Integer("uniform", s.uniform, {2, 4096}));
    s.rounds = static_cast<int>(sampling->Integer("rounds", s.rounds, {0, 64}));
    s.round = static_cast<int>(sampling->Integer("round", s.round, {1, 4096}));
    s.round_sharpness_per_mm =
        sampling->Number("round_sharpness_per_mm", s.round_sharpness_per_mm, kPositive);
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
    // Its end keeps every trust above 1e-6: their sum stays a number.
    l.ambient_doubt = loss->Number("ambient_doubt", l.ambient_doubt, {0, 1e6});
    l.albedo_width = loss->Number("albedo_width", l.albedo_width, kPositive);
    l.free_space = loss->Number("free_space", l.free_space, kNotNegative);
    l.clearance_mm = loss->Number("clearance_mm", l.clearance_mm, kNotNegative);
  }
  if (const auto schedule = root.Optional("schedule")) {
    auto& s = options->schedule;
    s.iterations = schedule->Integer("iterations", s.iterations, {1, 1e12});
    s.seconds = schedule->Number("seconds", s.seconds, kNotNegative);
    s.learning_rate = schedule->Number("learning_rate", s.learning_rate, kPositive);
    s.learning_rate_final = schedule->Number("learning_rate_final", s.learning_rate_final, {1e-9, 1});
    ReadChoice(*schedule, "decay", kDecayNames, &s.decay);
    s.warm_up = schedule->Number("warm_up", s.warm_up, {0, 0.999});
    s.adam_beta2 = schedule->Number("adam_beta2", s.adam_beta2, {0, 0.999999});
    s.table_epsilon = schedule->Number("table_epsilon", s.table_epsilon, {kLeastAdamEpsilon, 1});
    s.table_epsilon_from = schedule->Integer("table_epsilon_from", s.table_epsilon_from, {0, 1e12});
    s.settle_from = schedule->Integer("settle_from", s.settle_from, {0, 1e12});
    s.settle_part = schedule->Number("settle_part", s.settle_part, kPositive);
    s.sharpness_rate = schedule->Number("sharpness_rate", s.sharpness_rate, kNotNegative);
    s.sharpness_start_per_mm =
        schedule->Number("sharpness_start_per_mm", s.sharpness_start_per_mm, kPositive);
    s.sharpness_end_per_mm = schedule->Number("sharpness_end_per_mm", s.sharpness_end_per_mm, kPositive);
    s.fog_per_mm = schedule->Number("fog_per_mm", s.fog_per_mm, kPositive);
    s.fog_iterations = schedule->Integer("fog_iterations", s.fog_iterations, {0, 1e12});
    s.checkpoint_seconds = schedule->Number("checkpoint_seconds", s.checkpoint_seconds, kNotNegative);
  }
  if (const auto poses = root.Optional("poses")) {
    auto& p = options->poses;
    p.refine = poses->Flag("refine", p.refine);
    p.translation_rate_mm = poses->Number("translation_rate_mm", p.translation_rate_mm, kPositive);
    p.rotation_rate_rad = poses->Number("rotation_rate_rad", p.rotation_rate_rad, kPositive);
    p.start = poses->Number("start", p.start, {0, 1});
    p.noise_mm = poses->Number("noise_mm", p.noise_mm, kPositive);
    p.noise_rad = poses->Number("noise_rad", p.noise_rad, kPositive);
    p.pull = poses->Number("pull", p.pull, kNotNegative);
    p.disturb_mm = poses->Number("disturb_mm", p.disturb_mm, kNotNegative);
    p.disturb_rad = poses->Number("disturb_rad", p.disturb_rad, kNotNegative);
  }
  if (const auto extract = root.Optional("extract")) {
    options->extract_cell_mm = extract->Number("cell_mm", options->extract_cell_mm, {1e-3, 1e3});
    options->continue_lumen = extract->Flag("continue_lumen", options->continue_lumen);
  }
}

std::string Array(const std::vector<int>& values) {
  std::string text = "[";
  for (size_t i = 0; i < values.size(); ++i) text += (i ? ", " : "") + std::to_string(values[i]);
  return text + "]";
}

// What no single key is at fault for.
void RequireFit(const TrainOptions& options) {
  const FieldOptions& field = options.field;
  const int layers = static_cast<int>(field.sdf_hidden.size());
  if (field.sdf_skip > layers) {
    throw InputError("network.sdf_skip = " + std::to_string(field.sdf_skip) +
                     ": the distance network's last layer is " + std::to_string(layers));
  }
  const int inputs = field.grid.levels * Grid<float>::kFeatures + 6 * field.place_octaves + 3;
  if (field.sdf_skip > 0 && field.sdf_hidden[field.sdf_skip - 1] <= inputs) {
    throw InputError("network.sdf_skip: " + std::to_string(field.sdf_hidden[field.sdf_skip - 1]) +
                     " numbers can't hold the " + std::to_string(inputs) +
                     " of the encoding and the layer before it; widen network.sdf_hidden");
  }
}

}  // namespace

std::vector<std::string> PresetNames() {
  std::vector<std::string> names;
  for (const Preset& preset : Presets()) names.push_back(preset.name);
  return names;
}

TrainOptions ReadTrainOptions(const std::string& name, const std::vector<std::string>& settings) {
  for (const Preset& preset : Presets()) {
    if (name != preset.name) continue;
    TrainOptions options;
    options.preset = name;
    // The preset itself first: what the command line sets lies on top of it.
    std::vector<Config> configs;
    for (const char* text : preset.texts) configs.push_back(Config::Parse(text, "preset " + name));
    configs.push_back(Config::Parse("", "command line", {}, settings));
    for (const Config& config : configs) {
      ReadField(config.root(), &options.field);
      ReadRest(config.root(), &options);
      config.RejectUnknown();
    }
    RequireFit(options);
    return options;
  }
  std::string known;
  for (const Preset& preset : Presets()) known += std::string(known.empty() ? "" : ", ") + preset.name;
  throw InputError("--preset " + name + ": no such preset; there are: " + known);
}

RunOptions ReadRunOptions(const std::filesystem::path& file) {
  RunOptions run;
  run.text = ReadFile(file);
  const Config config = Config::Parse(run.text, file.string());
  run.seed = static_cast<uint64_t>(config.root().Integer("seed"));
  run.train.preset = config.root().String("preset");
  ReadField(config.root(), &run.train.field);
  ReadRest(config.root(), &run.train);
  config.RejectUnknown();
  RequireFit(run.train);
  return run;
}

std::string FormatTrainOptions(const TrainOptions& o) {
  std::ostringstream out;
  out.precision(17);
  out << "preset = \"" << o.preset << "\"\nframes = " << o.frames << "\nbinning = " << o.binning
      << "\n\n[grid]\nlevels = " << o.field.grid.levels
      << "\ncoarsest_cell_mm = " << o.field.grid.coarsest_cell_mm
      << "\nfinest_cell_mm = " << o.field.grid.finest_cell_mm
      << "\nlog2_table_size = " << o.field.grid.log2_table_size << "\nprecision = \""
      << kPrecisionNames[int(o.field.grid.precision)] << "\""
      << "\n\n[network]\nsdf_hidden = " << Array(o.field.sdf_hidden) << "\nsdf_activation = \""
      << kActivationNames[int(o.field.sdf_activation)] << "\"\nsdf_skip = " << o.field.sdf_skip
      << "\nweight_norm = " << (o.field.weight_norm ? "true" : "false") << "\nprecision = \""
      << kPrecisionNames[int(o.field.network_precision)] << "\""
      << "\nplace_octaves = " << o.field.place_octaves
      << "\ndirection_octaves = " << o.field.direction_octaves
      << "\ncolor_hidden = " << Array(o.field.color_hidden) << "\nfeatures = " << o.field.features
      << "\nunit_mm = " << o.field.unit_mm << "\nreflectance = \""
      << kReflectanceNames[int(o.field.reflectance)]
      << "\"\nbound_albedo = " << (o.field.bound_albedo ? "true" : "false")
      << "\ncoat_ior = " << o.field.coat.ior
      << "\ncoat_ior_learnt = " << (o.field.coat.learn_ior ? "true" : "false") << "\ninterreflection = \""
      << kInterreflectionNames[int(o.field.interreflection)]
      << "\"\nambient_hidden = " << Array(o.field.ambient_hidden) << "\n\n[initial]\nshape = \""
      << kShapeNames[int(o.field.initial.shape)] << "\"\nradius_mm = " << o.field.initial.radius_mm
      << "\nreach_mm = " << o.field.initial.reach_mm
      << "\nfit_reach = " << (o.field.initial.fit_reach ? "true" : "false")
      << "\n\n[bounds]\nahead_mm = " << o.bounds.ahead_mm << "\naside_mm = " << o.bounds.aside_mm
      << "\n\n[sampling]\nrays = " << o.sampling.rays << "\nsampler = \""
      << kSamplerNames[int(o.sampling.kind)] << "\"\nuniform = " << o.sampling.uniform
      << "\nrounds = " << o.sampling.rounds << "\nround = " << o.sampling.round
      << "\nround_sharpness_per_mm = " << o.sampling.round_sharpness_per_mm
      << "\ncoarse = " << o.sampling.coarse << "\nsurface = " << o.sampling.surface
      << "\nspread = " << o.sampling.spread << "\nsurface_spacing = " << o.sampling.surface_spacing
      << "\nweight_threshold = " << o.sampling.weight_threshold << "\n\n[loss]\neikonal = " << o.loss.eikonal
      << "\nalbedo = " << o.loss.albedo << "\nalbedo_final = " << o.loss.albedo_final
      << "\nambient = " << o.loss.ambient << "\nambient_doubt = " << o.loss.ambient_doubt
      << "\nalbedo_width = " << o.loss.albedo_width << "\nfree_space = " << o.loss.free_space
      << "\nclearance_mm = " << o.loss.clearance_mm
      << "\n\n[schedule]\niterations = " << o.schedule.iterations << "\nseconds = " << o.schedule.seconds
      << "\nlearning_rate = " << o.schedule.learning_rate
      << "\nlearning_rate_final = " << o.schedule.learning_rate_final << "\ndecay = \""
      << kDecayNames[int(o.schedule.decay)] << "\"\nwarm_up = " << o.schedule.warm_up
      << "\nadam_beta2 = " << o.schedule.adam_beta2 << "\ntable_epsilon = " << o.schedule.table_epsilon
      << "\ntable_epsilon_from = " << o.schedule.table_epsilon_from
      << "\nsettle_from = " << o.schedule.settle_from << "\nsettle_part = " << o.schedule.settle_part
      << "\nsharpness_rate = " << o.schedule.sharpness_rate
      << "\nsharpness_start_per_mm = " << o.schedule.sharpness_start_per_mm
      << "\nsharpness_end_per_mm = " << o.schedule.sharpness_end_per_mm
      << "\nfog_per_mm = " << o.schedule.fog_per_mm << "\nfog_iterations = " << o.schedule.fog_iterations
      << "\ncheckpoint_seconds = " << o.schedule.checkpoint_seconds
      << "\n\n[poses]\nrefine = " << (o.poses.refine ? "true" : "false")
      << "\ntranslation_rate_mm = " << o.poses.translation_rate_mm
      << "\nrotation_rate_rad = " << o.poses.rotation_rate_rad << "\nstart = " << o.poses.start
      << "\nnoise_mm = " << o.poses.noise_mm << "\nnoise_rad = " << o.poses.noise_rad
      << "\npull = " << o.poses.pull << "\ndisturb_mm = " << o.poses.disturb_mm
      << "\ndisturb_rad = " << o.poses.disturb_rad << "\n\n[extract]\ncell_mm = " << o.extract_cell_mm
      << "\ncontinue_lumen = " << (o.continue_lumen ? "true" : "false") << "\n";
  return out.str();
}

}  // namespace lumen
