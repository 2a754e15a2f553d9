#include <fmt/core.h>

#include <cmath>

#include "common/files.h"
#include "common/parallel.h"
#include "common/progress.h"
#include "recon/cost/train_cost.h"
#include "sim/render.h"
#include "tools/cost.h"
#include "tools/options.h"
#include "tools/study/convergence.h"
#include "tools/study/scaled_scene.h"
#include "tools/study_arguments.h"

namespace lumen {
namespace {

namespace fs = std::filesystem;

struct Arguments : StudyArguments {
  std::vector<std::string> knobs;
};

// What --quick stands for, where nothing else is said.
constexpr double kQuickScale = 0.3;
constexpr int64_t kQuickIterations = 400;
constexpr const char* kQuickCell = "extract.cell_mm=2";
constexpr int kSeeds = 3;

TrainOptions OwnOptions(const Arguments& arguments) {
  TrainArguments train = arguments.train;
  if (arguments.quick) {
    train.settings.insert(train.settings.begin(), kQuickCell);
    if (train.iterations == 0) train.iterations = kQuickIterations;
  }
  TrainOptions options = ReadTrainOptions(train.preset, train.Settings());
  options.schedule.seconds = 0;  // the settings are compared by their seconds
  return options;
}

// Renders the scene, unless that has been done in this folder.
Sequence Subject(const Arguments& arguments, const std::string& subject, double scale, uint64_t seed) {
  const fs::path marker = arguments.folder / "subject.txt", folder = arguments.folder / "sequence";
  if (!fs::exists(marker) || ReadFile(marker) != subject) {
    RenderOptions options;
    options.folder = folder;
    options.seed = seed;
    const Scene scene = ReadScaledScene(arguments.scene, arguments.settings, seed, scale);
    CreateFolder(arguments.folder);
    fs::remove(marker);
    fs::remove_all(arguments.folder / "convergence");
    Render(scene, options);
    WriteFile(marker, subject);
  }
  return ReadSequence(folder);
}

std::string NumberOrDash(double value) { return std::isfinite(value) ? fmt::format("{:.3f}", value) : "-"; }

std::string Table(const CostCurves& curves) {
  std::string table = fmt::format("{:<18}{:>12}{:>20}{:>16}{:>16}\n", "knob", "setting", "CPU s",
                                  "surveyed mm", "extended mm");
  for (const CostCurve& curve : curves.curves) {
    for (const CostPoint& point : curve.points) {
      table += fmt::format("{:<18}{:>12}{:>12.3f} ± {:.3f}{:>16}{:>16}{}{}\n", curve.knob, point.setting,
                           point.seconds, point.seconds_spread, NumberOrDash(point.errors[0]),
                           NumberOrDash(point.errors[1]), point.is_default ? "  the run's own" : "",
                           IsOnFrontier(curves, point, 0) ? "  frontier" : "");
    }
  }
  return table;
}

std::string Table(const std::vector<ConvergencePoint>& convergence) {
  std::string table = "\niteration of one run   surveyed mm     extended mm\n";
  for (const ConvergencePoint& point : convergence) {
    table += fmt::format("{:>20}{:>14.3f}{:>16.3f}\n", point.iteration, point.surveyed.mae_mm,
                         point.extended.mae_mm);
  }
  return table;
}

Drawing Page(const CostCurves& curves) {
  constexpr double kWidth = 760, kHeight = 600;
  Drawing page{2 * kWidth, kHeight, {}};
  const char* const titles[] = {"Surveyed region", "Extended region"};
  for (size_t measure = 0; measure < 2; ++measure) {
    Plot plot = CostPlot(curves, measure, "CPU seconds of training", "mean absolute error, mm");
    plot.title = titles[measure];
    Place(DrawPlot(plot, kWidth, kHeight), static_cast<double>(measure) * kWidth, 0, &page);
  }
  return page;
}

nlohmann::json ToJson(const CostCurves& curves) {
  const auto number = [](double value) {
    return std::isfinite(value) ? nlohmann::json(value) : nlohmann::json();
  };
  nlohmann::json points = nlohmann::json::array();
  for (const CostCurve& curve : curves.curves) {
    for (const CostPoint& point : curve.points) {
      points.push_back({{"knob", curve.knob},
                        {"setting", point.setting},
                        {"cpu_seconds", point.seconds},
                        {"cpu_seconds_spread", point.seconds_spread},
                        {"surveyed_mae_mm", number(point.errors[0])},
                        {"surveyed_spread_mm", number(point.error_spreads[0])},
                        {"extended_mae_mm", number(point.errors[1])},
                        {"extended_spread_mm", number(point.error_spreads[1])},
                        {"default", point.is_default},
                        {"frontier", IsOnFrontier(curves, point, 0)}});
    }
  }
  return {{"threads", ThreadCount()}, {"points", points}};
}

nlohmann::json Run(const Arguments& arguments, const CommonOptions& common) {
  TrainCostOptions options;
  options.own = OwnOptions(arguments);
  options.few = arguments.quick;
  options.knobs = arguments.knobs;
  options.seeds = arguments.seeds > 0 ? arguments.seeds : arguments.quick ? 1 : kSeeds;
  options.seed = common.seed;
  options.folder = arguments.folder;
  const double scale = arguments.scale > 0 ? arguments.scale : arguments.quick ? kQuickScale : 1;
  options.subject = SubjectOf(arguments, scale, common.seed);
  const Sequence sequence = Subject(arguments, options.subject, scale, common.seed);
  const CostCurves curves = MeasureTrainCost(sequence, options);
  fmt::print("{}: {} frames of {}×{} pixels, {} seeds\n{}", arguments.scene.string(), sequence.frames.size(),
             sequence.calibration.camera.width, sequence.calibration.camera.height, options.seeds,
             Table(curves));
  WriteFile(arguments.folder / "cost_train.csv", ToCsv(curves));
  WritePictures(Page(curves), arguments.folder, "cost_train");
  const std::vector<ConvergencePoint> convergence =
      DrawConvergence(sequence, options.own, common.seed, arguments.folder);
  fmt::print("{}", Table(convergence));
  Say("curves and pictures in " + arguments.folder.string());
  nlohmann::json json = ToJson(curves);
  for (const ConvergencePoint& point : convergence) {
    json["convergence"].push_back({{"iteration", point.iteration},
                                   {"surveyed_mae_mm", point.surveyed.mae_mm},
                                   {"extended_mae_mm", point.extended.mae_mm}});
  }
  return json;
}

}  // namespace

void AddCostTrain(CLI::App* cost) {
  const auto arguments = std::make_shared<Arguments>();
  CLI::App* command =
      AddSubcommand(cost, "train", "what a reconstruction's accuracy costs: knobs and their frontier",
                    [=](const CommonOptions& common) { return Run(*arguments, common); });
  AddStudyArguments(command,
                    {"cost_train", "1", "few settings of a short run on small frames, one seed: two minutes"},
                    arguments.get());
  command->add_option("--knob", arguments->knobs,
                      "a knob to measure, by its name in the table (default: all)");
}

}  // namespace lumen
