// The paper's table over scenes and sequences: its arithmetic, its formats, and a measurement that is stopped
// and goes on.
#include "tools/study/table.h"

#include <gtest/gtest.h>

#include <cmath>
#include <filesystem>

#include "common/files.h"
#include "common/progress.h"
#include "sim/render.h"
#include "tests/child_process.h"
#include "tests/support.h"
#include "tools/study/paper_figures.h"
#include "tools/study/scene_source.h"
#include "tools/study/table_text.h"

namespace lumen {
namespace {

namespace fs = std::filesystem;
using test::ErrorOf;
using test::ScratchFolder;

ErrorFigures MeanOf(const std::vector<std::string>& left_out, bool only_these,
                    ErrorFigures PaperFigures::*region) {
  ErrorFigures mean;
  int count = 0;
  for (const PaperFigures& row : PaperTable()) {
    const bool named = std::ranges::count(left_out, row.sequence) > 0;
    if (named != only_these) continue;
    const ErrorFigures& figures = row.*region;
    mean.medae_mm += figures.medae_mm;
    mean.mae_mm += figures.mae_mm;
    mean.rmse_mm += figures.rmse_mm;
    ++count;
  }
  return {mean.medae_mm / count, mean.mae_mm / count, mean.rmse_mm / count};
}

void ExpectNear(const ErrorFigures& figures, const ErrorFigures& expected, double by) {
  EXPECT_NEAR(figures.medae_mm, expected.medae_mm, by);
  EXPECT_NEAR(figures.mae_mm, expected.mae_mm, by);
  EXPECT_NEAR(figures.rmse_mm, expected.rmse_mm, by);
}

// The means that the paper prints beneath its rows say whether the rows are copied right: half a unit of the
// last digit of its rounded rows and of the mean itself.
TEST(PaperFigures, RowsHaveTheMeansThatThePaperPrints) {
  EXPECT_EQ(PaperTable().size(), 22u);
  const std::vector<std::string> few = {"trans_t2_c", "trans_t3_a", "trans_t3_b", "trans_t4_b"};
  ExpectNear(MeanOf(few, false, &PaperFigures::surveyed), {2.39, 2.80, 3.58}, 0.0101);
  ExpectNear(MeanOf(few, false, &PaperFigures::extended), {2.53, 3.15, 4.18}, 0.0101);
  ExpectNear(MeanOf(few, true, &PaperFigures::surveyed), {6.04, 8.23, 10.7}, 0.0501);
  ExpectNear(MeanOf(few, true, &PaperFigures::extended), {8.16, 9.47, 11.6}, 0.0501);
}

TableRow RowOf(const std::string& name, double span_mm, double mae_mm) {
  TableRow row;
  row.name = name;
  row.span_mm = span_mm;
  row.path_mm = 2 * span_mm;
  row.frames = 100;
  row.surveyed = ErrorFigures{mae_mm / 2, mae_mm, mae_mm * 2};
  row.extended = ErrorFigures{mae_mm, mae_mm * 2, mae_mm * 4};
  row.truth_share = 0.5;
  row.seconds = 12;
  return row;
}

Table HandMade() {
  Table table;
  table.preset = "fast";
  table.rows = {RowOf("cecum_t1_a", 40, 1), RowOf("trans_t3_b", 5, 4), RowOf("my_own", 20, 2)};
  table.rows[2].data = TableData::kTwinOfStandIn;
  table.rows.push_back(RowOf("failed", 30, 0));
  table.rows[3].surveyed.reset();
  table.rows[3].extended.reset();
  return table;
}

bool Holds(const std::string& text, const std::string& part) { return text.find(part) != std::string::npos; }

TEST(TableText, HasTheFiguresThePapersBesideThemAndSaysThatTheDataDiffer) {
  const std::string text = ToText(HandMade());
  EXPECT_TRUE(Holds(text, "NOT the same data")) << text;
  EXPECT_TRUE(
      Holds(text,
            "cecum_t1_a          C1a |  0.50   1.00   2.00 |  0.95   1.48   2.01 |  1.00   2.00   4.00 "
            "|  0.83   1.26   1.72 |    80.0    40.0   50.0      -     12"))
      << text;
  EXPECT_TRUE(Holds(text, "my_own*                 |  1.00   2.00   4.00 |     -      -      - |")) << text;
  EXPECT_TRUE(Holds(text, "failed                  |     -      -      - |")) << text;
  // Of what has figures; the short one stands apart.
  EXPECT_TRUE(Holds(text, "mean of 3               |  0.75   1.50   3.00 |  0.95   1.48   2.01 |")) << text;
  EXPECT_TRUE(Holds(text, "mean of 1 (< 1 cm)      |  2.00   4.00   8.00 | 11.00  12.10  14.40 |")) << text;
  EXPECT_TRUE(Holds(text, "*: the recorded trajectory is absent")) << text;
}

TEST(TableText, OfRealSequencesDoesNotSpeakOfATwin) {
  Table table = HandMade();
  for (TableRow& row : table.rows) row.data = TableData::kSequence;
  EXPECT_FALSE(Holds(ToText(table), "twin"));
  EXPECT_FALSE(Holds(ToLatex(table), "not the same data"));
}

TEST(TableText, NeusStandsBesideThePapersNeus) {
  Table table = HandMade();
  table.preset = "neus";
  const std::string text = ToText(table);
  EXPECT_TRUE(Holds(text, "|  4.53   5.07   6.40 |")) << text;
  EXPECT_FALSE(Holds(text, "14.40")) << text;
}

TEST(TableCsv, HasAsManyFieldsInEveryLine) {
  std::istringstream lines(ToCsv(HandMade()));
  std::string line;
  size_t fields = 0, rows = 0;
  while (std::getline(lines, line)) {
    if (line.starts_with('#')) continue;
    const size_t own = static_cast<size_t>(std::ranges::count(line, ',')) + 1;
    if (fields == 0) fields = own;
    EXPECT_EQ(own, fields) << line;
    ++rows;
  }
  EXPECT_EQ(rows, 1u + 4 + 2);  // head, sequences, means
  EXPECT_TRUE(Holds(
      ToCsv(HandMade()),
      "cecum_t1_a,C1a,twin,full,fast,0,100,80,40,0.5,1,2,1,2,4,0.95,1.48,2.01,0.83,1.26,1.72,0.5,,12\n"))
      << ToCsv(HandMade());
}

TEST(TableLatex, HasAsManyColumnsInEveryRow) {
  const std::string latex = ToLatex(HandMade());
  std::istringstream lines(latex);
  std::string line;
  size_t rows = 0;
  while (std::getline(lines, line)) {
    if (line.starts_with('%') || !line.ends_with("\\\\") || Holds(line, "multicolumn")) continue;
    EXPECT_EQ(std::ranges::count(line, '&'), 12) << line;
    ++rows;
  }
  EXPECT_EQ(rows, 1u + 4 + 2);
  EXPECT_TRUE(Holds(latex, "C1a & 0.50 & 1.00 & 2.00 & 0.95 & 1.48 & 2.01 & 1.00 & 2.00 & 4.00")) << latex;
  EXPECT_TRUE(Holds(latex, "my\\_own$^*$ & ")) << latex;
  EXPECT_TRUE(Holds(latex, "not the same data")) << latex;
}

TEST(TableSubjects, AreScenesAndSequencesByName) {
  const ScratchFolder folder;
  WriteFile(folder / "b.toml", "");
  WriteFile(folder / "notes.txt", "");
  CreateFolder(folder / "common");
  WriteFile(folder / "common/base.toml", "");
  CreateFolder(folder / "a");
  WriteFile(folder / "a/pose.txt", "");
  const std::vector<TableSubject> subjects = FindTableSubjects(folder.path());
  ASSERT_EQ(subjects.size(), 2u);
  EXPECT_EQ(subjects[0].name, "a");
  EXPECT_FALSE(subjects[0].is_scene);
  EXPECT_EQ(subjects[1].name, "b");
  EXPECT_TRUE(subjects[1].is_scene);
}

TEST(TableSubjects, AFolderWithoutAnyIsOneClearLine) {
  const ScratchFolder folder;
  for (const fs::path& path : {folder.path(), folder / "absent"}) {
    const std::string error = ErrorOf([&] { FindTableSubjects(path); });
    EXPECT_EQ(error.find(path.string() + ": "), 0u) << error;
    EXPECT_EQ(error.find('\n'), std::string::npos) << error;
  }
  WriteFile(folder / "pose.txt", "");
  EXPECT_TRUE(Holds(ErrorOf([&] { FindTableSubjects(folder.path()); }), "give the folder that holds it"));
}

TEST(Levels, IdealLeavesWhatThePapersModelHas) {
  Scene scene = ReadScene(LUMEN_SOURCE_FOLDER "/scenes/c3vd_twin/trans_t3_b.toml",
                          {"geometry.tolerance_mm=0.3", "trajectory.frames=3"}, 0);
  EXPECT_EQ(scene.path.bounces, 2);
  EXPECT_TRUE(scene.surface.coat && scene.sensor.noise && scene.sensor.auto_gain);
  EXPECT_EQ(scene.calibration.light.sources.size(), 3u);
  EXPECT_FALSE(scene.sensor.record_gain);
  ApplyLevel(Level::kFull, &scene);
  EXPECT_TRUE(scene.surface.coat);
  ApplyLevel(Level::kIdeal, &scene);
  EXPECT_EQ(scene.path.bounces, 0);
  EXPECT_FALSE(scene.surface.coat || scene.surface.bounced_coat || scene.sensor.noise || scene.sensor.jpeg ||
               scene.sensor.shutter || scene.defocus || scene.chromatic_aberration || scene.peristalsis);
  ASSERT_EQ(scene.calibration.light.sources.size(), 1u);
  EXPECT_TRUE(scene.calibration.light.sources[0].position.isZero(0));
  EXPECT_EQ(scene.calibration.light.sources[0].intensity, Vec3d(3600, 3600, 3600));
  EXPECT_TRUE(scene.sensor.record_gain);
  EXPECT_TRUE(scene.surface.mottling && scene.surface.vessels);
}

TEST(SceneSource, ChangesWithTheBaseAndTheTrajectory) {
  const ScratchFolder folder;
  WriteFile(folder / "base.toml", "[camera]\nwidth = 3\n");
  WriteFile(folder / "scene.toml", "base = \"base.toml\"\n[trajectory]\npath = \"pose.txt\"\n");
  const std::string before = SceneSource(folder / "scene.toml");
  EXPECT_EQ(SceneSource(folder / "scene.toml"), before);
  WriteFile(folder / "base.toml", "[camera]\nwidth = 4\n");
  const std::string other_base = SceneSource(folder / "scene.toml");
  EXPECT_NE(other_base, before);
  WriteFile(folder / "pose.txt", "1,2");
  const std::string with_poses = SceneSource(folder / "scene.toml");
  EXPECT_NE(with_poses, other_base);
  WriteFile(folder / "pose.txt", "1,3");
  EXPECT_NE(SceneSource(folder / "scene.toml"), with_poses);
}

// A scene that is quick to measure.
TableOptions SmallOptions(const fs::path& folder) {
  TableOptions options;
  options.train = ReadTrainOptions("fast", {"schedule.iterations=60", "sampling.rays=64", "extract.cell_mm=4",
                                            "frames=3", "schedule.checkpoint_seconds=0"});
  options.settings = {"geometry.tolerance_mm=0.3", "trajectory.frames=9", "path.samples=1"};
  options.level = Level::kIdeal;  // gains are known then
  options.scale = 0.06;
  options.completeness_points = 500;
  options.folder = folder;
  return options;
}

const std::vector<TableSubject> kOneScene = {
    {"trans_t3_b", LUMEN_SOURCE_FOLDER "/scenes/c3vd_twin/trans_t3_b.toml", true}};

TEST(Table, WhatIsMeasuredIsNotMeasuredAgainUnlessSomethingChanged) {
  const ScratchFolder folder;
  SetQuiet(true);
  TableOptions options = SmallOptions(folder / "table");
  const TableRow row = MeasureTable(kOneScene, options).rows.at(0);
  EXPECT_EQ(row.frames, 9);  // all of them, though three are rendered
  EXPECT_TRUE(IsShort(row));
  EXPECT_TRUE(fs::exists(folder / "table/trans_t3_b/strip.png"));
  int files = 0;
  for (const auto& entry : fs::directory_iterator(folder / "table/trans_t3_b/sequence")) {
    files += Holds(entry.path().filename().string(), "_color.png");
  }
  EXPECT_EQ(files, 3);

  const fs::path measured = folder / "table/trans_t3_b/measured.json";
  auto json = nlohmann::json::parse(ReadFile(measured));
  for (auto& [key, numbers] : json["runs"].items()) numbers[0] = 12345;
  WriteFile(measured, json.dump());
  EXPECT_EQ(MeasureTable(kOneScene, options).rows.at(0).surveyed->medae_mm, 12345);
  options.settings.push_back("surface.mottling.contrast=0.3");
  EXPECT_NE(MeasureTable(kOneScene, options).rows.at(0).surveyed->medae_mm, 12345);
}

TEST(Table, AFolderOfSequencesIsTrainedOnAndEvaluatedAsItIs) {
  const ScratchFolder folder;
  SetQuiet(true);
  MeasureTable(kOneScene, SmallOptions(folder / "twin"));
  CreateFolder(folder / "given");
  fs::rename(folder / "twin/trans_t3_b/sequence", folder / "given/one");
  const TableOptions options = SmallOptions(folder / "table");
  const Table table = MeasureTable(FindTableSubjects(folder / "given"), options);
  ASSERT_EQ(table.rows.size(), 1u);
  EXPECT_EQ(table.rows[0].data, TableData::kSequence);
  EXPECT_EQ(table.rows[0].frames, 3);
  ASSERT_TRUE(table.rows[0].surveyed);
  EXPECT_LT(table.rows[0].surveyed->mae_mm, 30);
  EXPECT_FALSE(fs::exists(folder / "table/one/sequence"));
}

TEST(Table, GainsThatNobodyRecordedAreEstimatedOrLearnt) {
  const ScratchFolder folder;
  SetQuiet(true);
  TableOptions options = SmallOptions(folder / "table");
  options.level = Level::kFull;
  options.calibrate_iterations = 30;
  const TableRow row = MeasureTable(kOneScene, options).rows.at(0);
  ASSERT_TRUE(row.surveyed);
  EXPECT_LT(row.surveyed->mae_mm, 30);
  const auto runs = nlohmann::json::parse(ReadFile(folder / "table/trans_t3_b/measured.json"))["runs"];
  const std::string estimated = "gains, their errors, spread, gamma";
  ASSERT_TRUE(runs.contains(estimated));
  // Three frames, or none of them where such a run tells nothing.
  const size_t count = runs[estimated].size();
  EXPECT_TRUE(count == 0 || count == 2 * 3 + 2) << count;
}

// Killed again and again at odd moments, it comes to the same table.
TEST(Table, KilledAndResumedEqualsUninterrupted) {
  const ScratchFolder folder;
  const auto words = [&](const std::string& name) {
    std::vector<std::string> words = {"table",      LUMEN_SOURCE_FOLDER "/scenes/c3vd_twin",
                                      "-o",         (folder / name).string(),
                                      "--quick",    "--sequences",
                                      "trans_t3_b", "--scale",
                                      "0.06",       "--iterations",
                                      "60",         "--frames",
                                      "3",          "--quiet",
                                      "--level",    "ideal",
                                      "--threads",  "2"};
    for (const char* setting : {"geometry.tolerance_mm=0.3", "trajectory.frames=9"}) {
      words.insert(words.end(), {"--set", setting});
    }
    for (const char* setting : {"sampling.rays=64", "extract.cell_mm=4", "schedule.checkpoint_seconds=0"}) {
      words.insert(words.end(), {"--train-set", setting});
    }
    return words;
  };
  ASSERT_EQ(test::ExitCode(test::StartLumen(words("whole"))), 0);
  for (const int milliseconds : {150, 400, 700, 1000, 1300, 1600}) {
    const pid_t child = test::StartLumen(words("parts"));
    usleep(static_cast<useconds_t>(milliseconds) * 1000);
    kill(child, SIGKILL);
    test::ExitCode(child);
  }
  ASSERT_EQ(test::ExitCode(test::StartLumen(words("parts"))), 0);
  // All but how long it took.
  const auto without_seconds = [&](const std::string& name) {
    std::string csv = ReadFile(folder / name / "table.csv"), lines;
    std::istringstream in(csv);
    for (std::string line; std::getline(in, line);) lines += line.substr(0, line.rfind(',')) + "\n";
    return lines;
  };
  EXPECT_EQ(without_seconds("parts"), without_seconds("whole"));
}

}  // namespace
}  // namespace lumen
