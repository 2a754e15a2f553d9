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

TEST(BudgetEffects, AreTheScenesOwnThenWhatTheReconstructorLacks) {
  const Scene scene = SmallScene({"response.vignetting=1"});
  const std::vector<BudgetEffect> effects = BudgetEffectsOf(scene, "scene");
  EXPECT_EQ(Names(effects),
            (std::vector<std::string>{"interreflection", "texture", "offset_guides", "vignetting_unknown",
                                      "auto_gain", "gains_unknown", "pose_noise", "half_the_frames"}));
  // With all of them left out the paper's assumptions hold.
  Scene ideal = scene;
  for (const BudgetEffect& effect : effects)
    if (effect.leave_out) effect.leave_out(&ideal);
  EXPECT_EQ(ideal.path.bounces, 0);
  EXPECT_FALSE(ideal.surface.mottling || ideal.surface.vessels || ideal.sensor.auto_gain);
  EXPECT_EQ(ideal.calibration.response.vignetting, 0);
  ASSERT_EQ(ideal.calibration.light.sources.size(), 1u);
  EXPECT_TRUE(ideal.calibration.light.sources[0].position.isZero(0));
  EXPECT_EQ(ideal.calibration.light.sources[0].intensity, Vec3d(3600, 3600, 3600));
}

TEST(BudgetEffects, ASceneWithoutEffectsIsRefused) {
  Scene scene;
  const std::string error = test::ErrorOf([&] { BudgetEffectsOf(scene, "plain.toml"); });
  EXPECT_EQ(error.find("plain.toml: "), 0u) << error;
  EXPECT_NE(error.find("path.bounces"), std::string::npos) << error;
  EXPECT_EQ(error.find('\n'), std::string::npos) << error;
}

TEST(BudgetVariants, CoverIdealEachAllAndAllButEachOnce) {
  for (size_t count : {1u, 2u, 3u, 6u}) {
    std::vector<BudgetEffect> effects(count);
    for (size_t i = 0; i < count; ++i) effects[i].name = std::string(1, static_cast<char>('a' + i));
    const std::vector<BudgetVariant> variants = BudgetVariantsOf(effects, true);
    std::set<std::vector<bool>> different;
    for (const BudgetVariant& variant : variants) different.insert(variant.on);
    EXPECT_EQ(different.size(), variants.size()) << count;
    EXPECT_EQ(variants.front().kind, VariantKind::kIdeal);
    EXPECT_EQ(variants.size(), count == 1 ? 2 : count == 2 ? 4 : 2 + 2 * count);
    for (const BudgetVariant& variant : variants) {
      const auto on = static_cast<size_t>(std::ranges::count(variant.on, true));
      const size_t expected[] = {0, 1, count, count - 1};
      EXPECT_EQ(on, expected[int(variant.kind)]) << variant.name;
    }
  }
}

TEST(PoseNoise, HasTheRootMeanSquareThatItIsToldAndFollowsFromSeedAndFrame) {
  Sequence exact;
  for (int number = 0; number < 4000; ++number) {
    SequenceFrame frame;
    frame.number = number;
    frame.world_from_camera.translate(Vec3d(1, 2, 3));
    frame.world_from_camera.rotate(Eigen::AngleAxisd(1, Vec3d(0, 0.6, 0.8)));
    exact.frames.push_back(frame);
  }
  Sequence noisy = exact, again = exact, other = exact;
  const PoseNoise noise{0.5, 0.005};
  AddPoseNoise(noise, 7, &noisy);
  AddPoseNoise(noise, 7, &again);
  AddPoseNoise(noise, 8, &other);
  double shift = 0, angle = 0;
  Vec3d mean = Vec3d::Zero();
  for (size_t i = 0; i < exact.frames.size(); ++i) {
    const Pose &a = exact.frames[i].world_from_camera, &b = noisy.frames[i].world_from_camera;
    EXPECT_EQ(b.matrix(), again.frames[i].world_from_camera.matrix());
    EXPECT_NE(b.matrix(), other.frames[i].world_from_camera.matrix());
    const Vec3d by = b.translation() - a.translation();
    mean += by / double(exact.frames.size());
    shift += by.squaredNorm() / double(exact.frames.size());
    const double turned = Eigen::AngleAxisd(a.rotation().transpose() * b.rotation()).angle();
    angle += turned * turned / double(exact.frames.size());
  }
  // Four standard errors of 4000 frames: the mean's is 0.5 / √4000 at most, a root mean square's relative one
  // √(2/3 / 4000) / 2.
  EXPECT_LT(mean.norm(), 4 * 0.5 / std::sqrt(4000.0));
  EXPECT_NEAR(std::sqrt(shift), 0.5, 0.5 * 4 * std::sqrt(2.0 / 3 / 4000) / 2);
  EXPECT_NEAR(std::sqrt(angle), 0.005, 0.005 * 4 * std::sqrt(2.0 / 3 / 4000) / 2);
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
  for (const BudgetEffect& effect : BudgetEffectsOf(scene, "scene")) {
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
