#include "tools/study/budget.h"

#include <fmt/core.h>

#include <algorithm>

#include "common/error.h"
#include "common/files.h"
#include "common/progress.h"
#include "tools/options.h"
#include "tools/study/budget_table.h"
#include "tools/study/scaled_scene.h"
#include "tools/study_arguments.h"

namespace lumen {
namespace {

struct Arguments : StudyArguments {
  std::vector<std::string> effects;
};

// What holds where nothing else is said: differences show long before a run is at its best.
constexpr double kScale = 0.3, kQuickScale = 0.2;
constexpr int64_t kIterations = 1500, kQuickIterations = 250;
constexpr const char *kCell = "extract.cell_mm=1", *kQuickCell = "extract.cell_mm=2";
constexpr int kSeeds = 3, kQuickSeeds = 1;

TrainOptions OwnOptions(const Arguments& arguments) {
  TrainArguments train = arguments.train;
  train.settings.insert(train.settings.begin(), arguments.quick ? kQuickCell : kCell);
  if (train.iterations == 0 && train.seconds == 0) {
    train.iterations = arguments.quick ? kQuickIterations : kIterations;
  }
  return ReadTrainOptions(train.preset, train.Settings());
}

// What the command line says and what is needed besides for the scene to have all that a budget is about.
std::vector<std::string> BudgetSettings(const Arguments& arguments, uint64_t seed, double scale) {
  std::vector<std::string> settings = arguments.settings;
  const Scene own = ReadScaledScene(arguments.scene, settings, seed, scale);
  for (const std::string& setting : MissingInBudget(own)) settings.push_back(setting);
  return settings;
}

std::vector<BudgetEffect> EffectsToMeasure(const Arguments& arguments, const Scene& scene) {
  const std::vector<BudgetEffect> all = BudgetEffectsOf(scene);
  if (arguments.effects.empty()) return all;
  std::vector<BudgetEffect> named;
  for (const std::string& name : arguments.effects) {
    const auto effect = std::ranges::find(all, name, &BudgetEffect::name);
    if (effect == all.end()) {
      std::string known;
      for (const BudgetEffect& other : all) known += (known.empty() ? "" : ", ") + other.name;
      throw InputError("--effect " + name + ": there is no such effect; there are: " + known);
    }
    named.push_back(*effect);
  }
  return named;
}

// The scene without the effects that aren't asked for.
void LeaveOutOthers(const std::vector<BudgetEffect>& effects, Scene* scene) {
  for (const BudgetEffect& effect : BudgetEffectsOf(*scene)) {
    const bool asked = std::ranges::count(effects, effect.name, &BudgetEffect::name) > 0;
    if (!asked && effect.reduce_to) effect.reduce_to(0, scene);
  }
}

std::string TitleOf(const Arguments& arguments, const Scene& scene, const BudgetOptions& options) {
  const CameraIntrinsics& camera = scene.calibration.camera;
  const auto& schedule = options.train.schedule;
  const std::string length = schedule.seconds > 0 ? fmt::format("{} s", schedule.seconds)
                                                  : fmt::format("{} iterations", schedule.iterations);
  const size_t frames = std::min(scene.world_from_camera.size(), size_t(options.train.frames));
  return fmt::format("{}: {} frames of {}×{} pixels, {}, {} seed{}", arguments.scene.filename().string(),
                     frames, camera.width, camera.height, length, options.seeds,
                     options.seeds == 1 ? "" : "s");
}

nlohmann::json Run(const Arguments& arguments, const CommonOptions& common) {
  BudgetOptions options;
  options.train = OwnOptions(arguments);
  options.seeds = arguments.seeds > 0 ? arguments.seeds : arguments.quick ? kQuickSeeds : kSeeds;
  options.seed = common.seed;
  options.folder = arguments.folder;
  const double scale = arguments.scale > 0 ? arguments.scale : arguments.quick ? kQuickScale : kScale;
  const std::vector<std::string> settings = BudgetSettings(arguments, common.seed, scale);
  Scene scene = ReadScaledScene(arguments.scene, settings, common.seed, scale);
  SetBudgetExposure(&scene);
  const std::vector<BudgetEffect> effects = EffectsToMeasure(arguments, scene);
  LeaveOutOthers(effects, &scene);
  for (const BudgetEffect& effect : effects) options.subject += "effect = " + effect.name + "\n";
  for (const std::string& setting : settings) options.subject += setting + "\n";
  options.subject += SubjectOf(arguments, scale, common.seed);
  const Budget budget = MeasureBudget(scene, effects, options);

  const std::string title = TitleOf(arguments, scene, options);
  fmt::print("{}\n{}", title, ToTable(budget));
  WriteFile(arguments.folder / "budget.csv", ToCsv(budget));
  WritePictures(DrawBudget(budget, title), arguments.folder, "budget");
  Say("table and pictures in " + arguments.folder.string());
  nlohmann::json result = ToJson(budget);
  result["scene"] = arguments.scene.string();
  result["scale"] = scale;
  result["seeds"] = options.seeds;
  result["iterations"] = options.train.schedule.iterations;
  return result;
}

}  // namespace

void AddBudget(CLI::App* app) {
  const auto arguments = std::make_shared<Arguments>();
  CLI::App* command =
      AddSubcommand(app, "budget", "millimetres of error per physical effect: a table and a picture",
                    [=](const CommonOptions& common) { return Run(*arguments, common); });
  AddStudyArguments(command, {"budget", "0.3", "short runs on small frames, one seed: some minutes"},
                    arguments.get());
  command->add_option("--effect", arguments->effects,
                      "an effect to measure, by its name in the table; the others stay off (default: all)");
}

}  // namespace lumen
