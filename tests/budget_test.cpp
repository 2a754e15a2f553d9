// The error budget: which variants there are, the table's arithmetic, and a measurement that is stopped and
// goes on.
#include "tools/study/budget.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <limits>
#include <set>

#include "common/files.h"
#include "common/progress.h"
#include "sim/render.h"
#include "tests/support.h"
#include "tools/study/budget_table.h"
#include "tools/study/run_record.h"

namespace lumen {
namespace {

using test::ScratchFolder;

Scene SmallScene(std::vector<std::string> settings) {
  settings.insert(settings.end(), {"camera.width=90", "camera.height=72", "trajectory.frames=4",
                                   "path.samples=1", "geometry.tolerance_mm=0.3", "truth.c3vd=false"});
  return ReadScene(LUMEN_SOURCE_FOLDER "/scenes/colon_lit.toml", settings, 0);
}

std::vector<std::string> Names(const std::vector<BudgetEffect>& effects) {
  std::vector<std::string> names;
  for (const BudgetEffect& effect : effects) names.push_back(effect.name);
  return names;
}

// As `lumen budget` has it: with what the scene doesn't name.
Scene WholeScene(std::vector<std::string> settings) {
  for (const std::string& missing : MissingInBudget(SmallScene(settings))) settings.push_back(missing);
  Scene scene = SmallScene(settings);
  SetBudgetExposure(&scene);
  return scene;
}

void LeaveOutAll(Scene* scene) {
  for (const BudgetEffect& effect : BudgetEffectsOf(*scene))
    if (effect.reduce_to) effect.reduce_to(0, scene);
}

TEST(BudgetEffects, AreAllThatTheStudyIsAboutWhateverTheSceneNames) {
  const std::vector<std::string> expected = {"bounces",
                                             "coat",
                                             "subsurface",
                                             "offset_guides",
                                             "vignetting_unknown",
                                             "motion_blur",
                                             "rolling_shutter",
                                             "sensor_noise",
                                             "gains_unknown",
                                             "pose_noise",
                                             "quarter_of_frames"};
  const Scene lit = WholeScene({});
  EXPECT_EQ(Names(BudgetEffectsOf(lit)), expected);
  // What the scene names stays as it is.
  EXPECT_EQ(lit.path.bounces, 3);
  EXPECT_EQ(lit.sensor.auto_gain->target, 0.45);

  const Scene plain = WholeScene({"path.bounces=0", "sensor.shutter={exposure = 0.2}",
                                  "light.source=[{position = [0, 0, 0], direction = [0, 0, 1], spread = 2, "
                                  "intensity = [3000, 3300, 3600]}]"});
  EXPECT_EQ(Names(BudgetEffectsOf(plain)), expected);
  EXPECT_EQ(plain.path.bounces, 8);
  EXPECT_EQ(plain.sensor.shutter->exposure, 0.2);
  EXPECT_EQ(plain.sensor.shutter->readout, 0.5);
  ASSERT_EQ(plain.calibration.light.sources.size(), 3u);
  for (const LightSource& guide : plain.calibration.light.sources) {
    EXPECT_EQ(guide.spread, 2);
    EXPECT_LT((guide.intensity - Vec3d(1000, 1100, 1200)).norm(), 1e-9);
  }
  // Those that are not to be had by default are measured where a scene names them.
  EXPECT_EQ(std::ranges::count(Names(BudgetEffectsOf(WholeScene({"sensor.jpeg={}"}))), "jpeg"), 1);
}

TEST(BudgetEffects, LeaveThePapersAssumptions) {
  Scene ideal = WholeScene({"sensor.record_gain=false", "lens.defocus={}"});
  LeaveOutAll(&ideal);
  EXPECT_EQ(ideal.path.bounces, 0);
  EXPECT_FALSE(ideal.surface.coat || ideal.surface.subsurface || ideal.surface.bounced_coat);
  EXPECT_FALSE(ideal.sensor.noise || ideal.sensor.shutter || ideal.defocus);
  EXPECT_EQ(ideal.calibration.response.vignetting, 0);
  ASSERT_EQ(ideal.calibration.light.sources.size(), 1u);
  EXPECT_TRUE(ideal.calibration.light.sources[0].position.isZero(0));
  EXPECT_LT((ideal.calibration.light.sources[0].intensity - Vec3d(3600, 3600, 3600)).norm(), 1e-9);
  // Its model has a texture, and a gain a frame that is known.
  EXPECT_TRUE(ideal.surface.mottling && ideal.surface.vessels && ideal.sensor.auto_gain);
  EXPECT_TRUE(ideal.sensor.record_gain);
}

TEST(BudgetEffects, EachLeavesTheOthers) {
  const Scene whole = WholeScene({});
  for (const BudgetEffect& effect : BudgetEffectsOf(whole)) {
    if (!effect.reduce_to) continue;
    Scene scene = whole;
    for (const BudgetEffect& other : BudgetEffectsOf(whole))
      if (other.reduce_to && other.name != effect.name) other.reduce_to(0, &scene);
    const std::vector<bool> there = {scene.path.bounces > 0,
                                     scene.surface.coat.has_value(),
                                     scene.surface.subsurface.has_value(),
                                     scene.calibration.light.sources.size() > 1,
                                     scene.calibration.response.vignetting > 0,
                                     scene.sensor.shutter && scene.sensor.shutter->exposure > 0,
                                     scene.sensor.shutter && scene.sensor.shutter->readout > 0,
                                     scene.sensor.noise.has_value()};
    EXPECT_EQ(std::ranges::count(there, true), 1) << effect.name;
  }
}

TEST(BudgetEffects, BouncesComeStepByStep) {
  for (const auto& [bounces, steps] : std::vector<std::pair<int, std::vector<std::string>>>{
           {1, {"1"}}, {2, {"1", "2"}}, {3, {"1", "2", "3"}}, {8, {"1", "2", "8"}}}) {
    const Scene scene = WholeScene({"path.bounces=" + std::to_string(bounces)});
    const BudgetEffect effect = BudgetEffectsOf(scene)[0];
    ASSERT_EQ(effect.steps, steps);
    for (int step = 0; step <= effect.whole(); ++step) {
      Scene reduced = scene;
      effect.reduce_to(step, &reduced);
      EXPECT_EQ(reduced.path.bounces, step == 0 ? 0 : std::stoi(steps[step - 1]));
    }
  }
}

TEST(BudgetVariants, CoverIdealEachStepAllAndAllButEachOnce) {
  for (size_t count : {1u, 2u, 3u, 6u}) {
    for (int steps : {1, 3}) {  // of the first effect
      std::vector<BudgetEffect> effects(count);
      for (size_t i = 0; i < count; ++i) effects[i].name = std::string(1, static_cast<char>('a' + i));
      if (steps > 1) effects[0].steps = {"1", "2", "8"};
      const std::vector<BudgetVariant> variants = BudgetVariantsOf(effects, true);
      std::set<std::vector<int>> different;
      std::set<std::string> names;
      for (const BudgetVariant& variant : variants) {
        different.insert(variant.steps);
        names.insert(variant.name);
        int on = 0, whole = 0;
        for (size_t i = 0; i < count; ++i) {
          on += variant.steps[i] > 0;
          whole += variant.steps[i] == effects[i].whole();
        }
        const int all = static_cast<int>(count);
        const int least_on[] = {0, 1, all, all - 1}, most_on[] = {0, 1, all, all};
        EXPECT_GE(on, least_on[int(variant.kind)]) << variant.name;
        EXPECT_LE(on, most_on[int(variant.kind)]) << variant.name;
        EXPECT_TRUE(variant.kind != VariantKind::kAllBut || whole == all - 1) << variant.name;
      }
      EXPECT_EQ(different.size(), variants.size()) << count;
      EXPECT_EQ(names.size(), variants.size()) << count;
      EXPECT_EQ(variants.front().kind, VariantKind::kIdeal);
      const size_t more = static_cast<size_t>(steps - 1);
      EXPECT_EQ(variants.size(), count == 1 ? 2 + more : count == 2 ? 4 + 2 * more : 2 + 2 * (count + more));
    }
  }
}

TEST(BudgetTable, DifferencesAreToTheIdealOfTheSameModel) {
  Budget budget{{"paper", "ours"}, {}};
  budget.rows.push_back({VariantKind::kIdeal, "ideal", {{{1, 0.1}, {2, 0}}, {{0.5, 0}, {0.75, 0}}}});
  const double unknown = std::numeric_limits<double>::quiet_NaN();
  budget.rows.push_back(
      {VariantKind::kOne, "jpeg", {{{1.5, 0.25}, {1.75, 0}}, {{unknown, unknown}, {3, 0}}}});
  const BudgetDifference paper = DifferenceToIdeal(budget, budget.rows[1], 0);
  EXPECT_EQ(paper.surveyed_mm, 0.5);
  EXPECT_EQ(paper.extended_mm, -0.25);
  EXPECT_EQ(DifferenceToIdeal(budget, budget.rows[1], 1).extended_mm, 2.25);

  const std::string table = ToTable(budget);
  EXPECT_NE(table.find("1.00 ± 0.10  "), std::string::npos) << table;
  EXPECT_NE(table.find("1.50 ± 0.25  +0.50"), std::string::npos) << table;
  EXPECT_NE(ToCsv(budget).find("\njpeg,one,paper,1.5,0.25,0.5,1.75,0,-0.25\n"), std::string::npos)
      << ToCsv(budget);
  const nlohmann::json json = ToJson(budget);
  ASSERT_EQ(json["variants"].size(), 4u);
  EXPECT_TRUE(json["variants"][3]["surveyed_mae_mm"].is_null());
  EXPECT_EQ(json["variants"][3]["extended_over_ideal_mm"], 2.25);
  // A run without a surface is said, not drawn as a bar of nothing.
  EXPECT_NE(ToSvg(DrawBudget(budget, "title")).find("no surface"), std::string::npos);
}

TEST(RunRecord, ForgetsAnotherSubjectAndWhatIsNoRecord) {
  const ScratchFolder folder;
  const auto file = folder / "measured.json";
  RunRecord(file, "one").Add("run", {1.5, std::numeric_limits<double>::quiet_NaN()});
  const auto found = RunRecord(file, "one").Find("run");
  ASSERT_TRUE(found);
  EXPECT_EQ(found->at(0), 1.5);
  EXPECT_TRUE(std::isnan(found->at(1)));
  EXPECT_FALSE(RunRecord(file, "one").Find("other"));
  EXPECT_FALSE(RunRecord(file, "two").Find("run"));
  for (const char* broken : {"", "{\"subject\": \"one\"", "[1, 2]", "{\"subject\": \"one\", \"runs\": 3}"}) {
    WriteFile(file, broken);
    EXPECT_FALSE(RunRecord(file, "one").Find("run")) << broken;
  }
}

TEST(Budget, MeasuresAndGoesOnFromWhatIsMeasured) {
  const ScratchFolder folder;
  SetQuiet(true);
  const Scene scene = SmallScene({"path.bounces=0"});
  std::vector<BudgetEffect> effects;
  for (const BudgetEffect& effect : BudgetEffectsOf(scene)) {
    if (effect.name == "offset_guides") effects.push_back(effect);
  }
  BudgetOptions options;
  options.train =
      ReadTrainOptions("fast", {"schedule.iterations=4", "sampling.rays=32", "extract.cell_mm=4"});
  options.seeds = 1;
  options.folder = folder / "budget";
  options.subject = "one";
  const Budget budget = MeasureBudget(scene, effects, options);
  ASSERT_EQ(budget.rows.size(), 2u);
  EXPECT_EQ(budget.rows[1].name, "offset_guides");
  for (const BudgetRow& row : budget.rows) {
    ASSERT_EQ(row.cells.size(), 2u);
    for (const BudgetCell& cell : row.cells) {
      // The initial surface is off by millimetres, not by more than its size.
      EXPECT_GT(cell.surveyed.mae_mm, 0.5) << row.name;
      EXPECT_LT(cell.surveyed.mae_mm, 30) << row.name;
      EXPECT_EQ(cell.surveyed.spread_mm, 0);
    }
  }
  EXPECT_FALSE(std::filesystem::exists(options.folder / "sequence"));
  EXPECT_FALSE(std::filesystem::exists(options.folder / "run"));

  // A mark in the record shows what is taken from it.
  auto json = nlohmann::json::parse(ReadFile(options.folder / "measured.json"));
  for (auto& [key, numbers] : json["runs"].items()) numbers[0] = 12345;
  WriteFile(options.folder / "measured.json", json.dump());
  const Budget again = MeasureBudget(scene, effects, options);
  for (size_t i = 0; i < budget.rows.size(); ++i) {
    for (size_t model = 0; model < 2; ++model) {
      EXPECT_EQ(again.rows[i].cells[model].surveyed.mae_mm, 12345);
      EXPECT_EQ(again.rows[i].cells[model].extended.mae_mm, budget.rows[i].cells[model].extended.mae_mm);
    }
  }
  options.train.schedule.iterations = 5;  // other settings are other runs
  EXPECT_NE(MeasureBudget(scene, effects, options).rows[0].cells[0].surveyed.mae_mm, 12345);
}

}  // namespace
}  // namespace lumen
