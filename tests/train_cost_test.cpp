// What a reconstruction's accuracy costs: the table of knobs, and a measurement that is stopped and goes on.
#include "recon/cost/train_cost.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <nlohmann/json.hpp>

#include "common/files.h"
#include "recon/cost/train_knobs.h"
#include "tests/small_sequence.h"

namespace lumen {
namespace {

using test::ScratchFolder;
using test::SmallSequence;

TEST(TrainKnobs, VaryOneThingAroundTheRunsOwn) {
  for (const char* preset : {"fast", "paper", "neus"}) {
    const TrainOptions own = ReadTrainOptions(preset, {});
    for (bool few : {false, true}) {
      for (const TrainKnob& knob : TrainKnobsOf(own, 40, few)) {
        EXPECT_EQ(std::ranges::count(knob.settings, true, &TrainKnobSetting::is_own), 1) << knob.name;
        for (const TrainKnobSetting& setting : knob.settings) {
          EXPECT_EQ(FormatTrainOptions(setting.options) == FormatTrainOptions(own), setting.is_own)
              << preset << " " << knob.name << " " << setting.label;
          if (knob.name != "samples_a_ray") continue;
          EXPECT_EQ(std::to_string(setting.options.sampling.PerRay()), setting.label);
        }
      }
    }
  }
}

TEST(TrainKnobs, LeaveOutWhatTheRunDoesNotUse) {
  const auto has = [](const std::vector<TrainKnob>& knobs, const std::string& name) {
    return std::ranges::count(knobs, name, &TrainKnob::name) > 0;
  };
  const auto fast = TrainKnobsOf(ReadTrainOptions("fast", {}), 40, false);
  const auto paper = TrainKnobsOf(ReadTrainOptions("paper", {}), 40, false);
  EXPECT_TRUE(has(fast, "grid_levels"));
  EXPECT_FALSE(has(paper, "grid_levels"));
  EXPECT_TRUE(has(fast, "network_precision") && has(paper, "network_precision"));
  EXPECT_TRUE(has(fast, "interreflection"));
  EXPECT_FALSE(has(paper, "interreflection"));
  // More frames than there are would be the same run again.
  for (const TrainKnob& knob : TrainKnobsOf(ReadTrainOptions("fast", {}), 6, false)) {
    if (knob.name != "frames") continue;
    EXPECT_EQ(knob.settings.back().label, "6");
    EXPECT_TRUE(knob.settings.back().is_own);
  }
}

TEST(TrainCost, GoesOnFromWhatIsMeasuredAndForgetsAnotherSubject) {
  const ScratchFolder folder;
  TrainCostOptions options;
  options.own = ReadTrainOptions("fast", {"schedule.iterations=4", "sampling.rays=32", "extract.cell_mm=4"});
  options.few = true;
  options.knobs = {"grid_levels", "frames"};
  options.seeds = 1;
  options.folder = folder / "cost";
  options.subject = "one";
  const CostCurves curves = MeasureTrainCost(SmallSequence(), options);
  ASSERT_EQ(curves.measures.size(), 2u);
  for (const CostCurve& curve : curves.curves) {
    for (const CostPoint& point : curve.points) {
      EXPECT_GT(point.seconds, 0);
      // The initial surface is off by millimetres, not by more than its size.
      EXPECT_GT(point.errors[0], 0.5) << curve.knob << " " << point.setting;
      EXPECT_LT(point.errors[0], 30) << curve.knob << " " << point.setting;
    }
  }
  EXPECT_FALSE(std::filesystem::exists(options.folder / "run"));

  options.knobs = {"colour"};
  const std::string no_such = test::ErrorOf([&] { MeasureTrainCost(SmallSequence(), options); });
  EXPECT_NE(no_such.find("grid_levels"), std::string::npos) << no_such;
  options.knobs = {"grid_levels", "frames"};

  // A mark in the record shows what is taken from it.
  auto json = nlohmann::json::parse(ReadFile(options.folder / "measured.json"));
  for (auto& run : json["runs"]) run["seconds"] = 12345;
  WriteFile(options.folder / "measured.json", json.dump());
  const CostCurves again = MeasureTrainCost(SmallSequence(), options);
  for (size_t i = 0; i < curves.curves.size(); ++i) {
    for (size_t k = 0; k < curves.curves[i].points.size(); ++k) {
      EXPECT_EQ(again.curves[i].points[k].seconds, 12345);
      EXPECT_EQ(again.curves[i].points[k].errors, curves.curves[i].points[k].errors);
    }
  }
  json["subject"] = "another";
  WriteFile(options.folder / "measured.json", json.dump());
  for (const CostCurve& curve : MeasureTrainCost(SmallSequence(), options).curves)
    for (const CostPoint& point : curve.points) EXPECT_NE(point.seconds, 12345);
}

}  // namespace
}  // namespace lumen
