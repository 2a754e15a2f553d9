#include <fmt/core.h>

#include <cmath>

#include "common/bar_chart.h"
#include "common/error.h"
#include "common/files.h"
#include "common/progress.h"
#include "sim/cost/render_cost.h"
#include "tools/cost.h"
#include "tools/options.h"
#include "tools/study/scaled_scene.h"

namespace lumen {
namespace {

namespace fs = std::filesystem;

struct Arguments {
  fs::path scene, folder;
  std::vector<std::string> settings;
  double scale = 1;
  RenderCostOptions options;
};

double Percent(double part) { return 100 * part; }

std::string PercentOrDash(double part) {
  return std::isfinite(part) ? fmt::format("{:.3f}", Percent(part)) : "-";
}

const SettingBias* BiasOf(const RenderCost& cost, const std::string& knob, const std::string& setting) {
  for (const SettingBias& bias : cost.biases) {
    if (bias.knob == knob && bias.setting == setting) return &bias;
  }
  return nullptr;
}

std::string CurvesTable(const RenderCost& cost, const CostCurves& curves, const CostReference& reference) {
  std::string table = fmt::format(
      "\nagainst {} samples, {} bounces (its own noise: pixels {:.3f}%, blocks {:.3f}%; mean ± {:.4f}%)\n",
      reference.samples, reference.bounces, Percent(reference.noise[0]), Percent(reference.noise[1]),
      Percent(reference.mean_error));
  table += fmt::format("{:<18}{:>9}{:>20}{:>10}{:>10}{:>20}\n", "knob", "setting", "CPU s", "pixels %",
                       "8x8 %", "mean off by %");
  for (const CostCurve& curve : curves.curves) {
    for (const CostPoint& point : curve.points) {
      const Bias bias = BiasOf(cost, curve.knob, point.setting)->bias;
      table += fmt::format("{:<18}{:>9}{:>11.4f} ± {:.4f}{:>10}{:>10}{:>+11.4f} ± {:.4f}{}{}\n", curve.knob,
                           point.setting, point.seconds, point.seconds_spread, PercentOrDash(point.errors[0]),
                           PercentOrDash(point.errors[1]), Percent(bias.value), Percent(bias.standard_error),
                           point.is_default ? "  the scene's" : "",
                           IsOnFrontier(curves, point, 0) ? "  frontier" : "");
    }
  }
  return table;
}

std::string EffectsTable(const RenderCost& cost) {
  std::string table = fmt::format("\na whole frame: {:.4f} ± {:.4f} CPU s, of which each effect adds\n",
                                  cost.frame_seconds, cost.frame_seconds_error);
  for (const EffectCost& effect : cost.effects) {
    table += fmt::format("{:<22}{:>+9.4f} ± {:.4f} s {:>+7.1f}%\n", effect.name, effect.seconds,
                         effect.seconds_error, Percent(effect.seconds / cost.frame_seconds));
  }
  return table;
}

std::string EffectsCsv(const RenderCost& cost) {
  std::string csv = "effect,cpu_seconds,standard_error,fraction_of_frame\n";
  csv += fmt::format("(whole frame),{:.6g},{:.3g},1\n", cost.frame_seconds, cost.frame_seconds_error);
  for (const EffectCost& effect : cost.effects) {
    csv += fmt::format("{},{:.6g},{:.3g},{:.4g}\n", effect.name, effect.seconds, effect.seconds_error,
                       effect.seconds / cost.frame_seconds);
  }
  return csv;
}

Drawing Page(const RenderCost& cost) {
  constexpr double kWidth = 560, kHeight = 380;
  const auto plot = [](const CostCurves& curves, size_t measure, const std::string& title) {
    CostCurves percent = curves;
    for (CostCurve& curve : percent.curves) {
      for (CostPoint& point : curve.points) {
        point.errors[measure] = Percent(point.errors[measure]);
        point.error_spreads[measure] = Percent(point.error_spreads[measure]);
      }
    }
    Plot plot = CostPlot(percent, measure, "CPU seconds a frame", "error, % of the mean");
    plot.title = title;
    return DrawPlot(plot, kWidth, kHeight);
  };
  Drawing page{2 * kWidth, 2 * kHeight, {}};
  Place(plot(cost.sampling, 0, "Pixels, against the scene's own light"), 0, 0, &page);
  Place(plot(cost.sampling, 1, "Means of 8×8 pixels, against the same"), kWidth, 0, &page);
  Place(plot(cost.transport, 0, "Pixels, against light followed to its end"), 0, kHeight, &page);
  std::vector<ChartBar> bars;
  for (const EffectCost& effect : cost.effects) {
    bars.push_back(
        {effect.name, effect.seconds, effect.seconds_error,
         fmt::format("{:+.3f} s, {:+.0f}%", effect.seconds, Percent(effect.seconds / cost.frame_seconds))});
  }
  Place(DrawBars(fmt::format("What effects add to a frame of {:.3f} CPU seconds", cost.frame_seconds), bars,
                 kWidth, kHeight),
        kWidth, kHeight, &page);
  return page;
}

nlohmann::json ToJson(const RenderCost& cost, const CostCurves& curves, const CostReference& reference) {
  const auto number = [](double value) {
    return std::isfinite(value) ? nlohmann::json(value) : nlohmann::json();
  };
  nlohmann::json json = {{"reference",
                          {{"samples", reference.samples},
                           {"bounces", reference.bounces},
                           {"pixel_noise", reference.noise[0]},
                           {"block_noise", reference.noise[1]},
                           {"mean_error", reference.mean_error}}},
                         {"points", nlohmann::json::array()}};
  for (const CostCurve& curve : curves.curves) {
    for (const CostPoint& point : curve.points) {
      const Bias bias = BiasOf(cost, curve.knob, point.setting)->bias;
      json["points"].push_back({{"knob", curve.knob},
                                {"setting", point.setting},
                                {"cpu_seconds", point.seconds},
                                {"cpu_seconds_spread", point.seconds_spread},
                                {"pixel_error", number(point.errors[0])},
                                {"block_error", number(point.errors[1])},
                                {"bias", bias.value},
                                {"bias_standard_error", bias.standard_error},
                                {"default", point.is_default},
                                {"frontier", IsOnFrontier(curves, point, 0)}});
    }
  }
  return json;
}

nlohmann::json ToJson(const RenderCost& cost) {
  nlohmann::json effects = nlohmann::json::object();
  for (const EffectCost& effect : cost.effects) {
    effects[effect.name] = {{"cpu_seconds", effect.seconds},
                            {"standard_error", effect.seconds_error},
                            {"fraction", effect.seconds / cost.frame_seconds}};
  }
  return {{"width", cost.width},
          {"height", cost.height},
          {"triangles", cost.triangles},
          {"sampling", ToJson(cost, cost.sampling, cost.sampling_reference)},
          {"transport", ToJson(cost, cost.transport, cost.transport_reference)},
          {"frame", {{"cpu_seconds", cost.frame_seconds}, {"standard_error", cost.frame_seconds_error}}},
          {"effects", effects}};
}

nlohmann::json Run(const Arguments& arguments, const CommonOptions& common) {
  RenderCostOptions options = arguments.options;
  options.seed = common.seed;
  const RenderCost cost = MeasureRenderCost(
      ReadScaledScene(arguments.scene, arguments.settings, common.seed, arguments.scale), options);
  fmt::print("frame {} of {}: {}×{} pixels, {} triangles\n", options.frame, arguments.scene.string(),
             cost.width, cost.height, cost.triangles);
  fmt::print("{}{}{}", CurvesTable(cost, cost.sampling, cost.sampling_reference),
             CurvesTable(cost, cost.transport, cost.transport_reference), EffectsTable(cost));
  CreateFolder(arguments.folder);
  WriteFile(arguments.folder / "cost_render.csv", ToCsv(cost.sampling));
  WriteFile(arguments.folder / "cost_render_bounces.csv", ToCsv(cost.transport));
  WriteFile(arguments.folder / "cost_render_effects.csv", EffectsCsv(cost));
  WritePictures(Page(cost), arguments.folder, "cost_render");
  Say("curves and pictures in " + arguments.folder.string());
  return ToJson(cost);
}

}  // namespace

void AddCostRender(CLI::App* cost) {
  const auto arguments = std::make_shared<Arguments>();
  CLI::App* command =
      AddSubcommand(cost, "render", "what a frame's accuracy costs: knobs, their frontier, effects",
                    [=](const CommonOptions& common) { return Run(*arguments, common); });
  command->add_option("scene", arguments->scene, "scene file (see scenes/README.md)")->required();
  command->add_option("-o,--output", arguments->folder, "folder for cost_render.csv, .svg and .png")
      ->required();
  command->add_option("--set", arguments->settings, "a key of the scene: path.to.key=value");
  command->add_option("--frame", arguments->options.frame, "the frame to measure (default: 0)")
      ->check(CLI::NonNegativeNumber);
  command->add_option("--scale", arguments->scale, "of the picture's width and height (default: 1)")
      ->check(CLI::Range(1e-3, 8.0));
  command
      ->add_option("--seconds", arguments->options.seconds,
                   "about how long it may take: more makes the reference better and the curves longer "
                   "(default: 120)")
      ->check(CLI::PositiveNumber);
  command->add_option("--runs", arguments->options.runs, "of every setting (default: 3)")
      ->check(CLI::Range(2, 1000));
}

}  // namespace lumen
