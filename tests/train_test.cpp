// A whole run, small: the same bytes for any number of threads, and for a run that was killed and resumed.
#include "recon/training/train.h"

#include <gtest/gtest.h>
#include <signal.h>
#include <unistd.h>

#include <algorithm>
#include <bit>
#include <cmath>

#include "common/error.h"
#include "common/files.h"
#include "common/parallel.h"
#include "common/progress.h"
#include "recon/training/checkpoint.h"
#include "recon/training/estimate.h"
#include "recon/training/trainer.h"
#include "tests/child_process.h"
#include "tests/small_sequence.h"

namespace lumen {
namespace {

using test::ExitCode;
using test::ScratchFolder;
using test::SmallSequence;
using test::StartLumen;

std::vector<std::string> SmallSettings(int iterations) {
  return {"schedule.iterations=" + std::to_string(iterations), "sampling.rays=96", "extract.cell_mm=3"};
}

TrainResult TrainSmall(const std::filesystem::path& folder, const std::vector<std::string>& settings) {
  TrainRun run;
  run.folder = folder;
  return Train(SmallSequence(), ReadTrainOptions("fast", settings), run);
}

TEST(Train, SameBytesForAnyNumberOfThreads) {
  const ScratchFolder folder;
  SetThreadCount(1);
  TrainSmall(folder / "one", SmallSettings(40));
  SetThreadCount(2);
  TrainSmall(folder / "two", SmallSettings(40));
  SetThreadCount(0);
  EXPECT_EQ(ReadFile(folder / "one/checkpoint"), ReadFile(folder / "two/checkpoint"));
  EXPECT_EQ(ReadFile(folder / "one/mesh.ply"), ReadFile(folder / "two/mesh.ply"));
  TrainSmall(folder / "longer", SmallSettings(41));
  EXPECT_NE(ReadFile(folder / "one/mesh.ply"), ReadFile(folder / "longer/mesh.ply"));
}

// Starts the command; it writes a checkpoint after every step.
pid_t StartTraining(const std::filesystem::path& folder, bool resume) {
  std::vector<std::string> words = {
      "train", SmallSequence().folder.string(), "-o", folder.string(), "--quiet", "--iterations", "120"};
  for (const char* setting : {"sampling.rays=96", "extract.cell_mm=3", "grid.log2_table_size=10",
                              "schedule.checkpoint_seconds=0"}) {
    words.insert(words.end(), {"--set", setting});
  }
  if (resume) words.push_back("--resume");
  return StartLumen(words);
}

TEST(Train, KilledAndResumedEqualsUninterrupted) {
  const ScratchFolder folder;
  ASSERT_EQ(ExitCode(StartTraining(folder / "whole", false)), 0);
  const pid_t child = StartTraining(folder / "killed", false);
  while (!std::filesystem::exists(folder / "killed/checkpoint")) usleep(1000);
  kill(child, SIGKILL);
  EXPECT_EQ(ExitCode(child), -1);
  ASSERT_FALSE(std::filesystem::exists(folder / "killed/mesh.ply"));
  ASSERT_NE(ReadFile(folder / "whole/checkpoint"), ReadFile(folder / "killed/checkpoint"));
  ASSERT_EQ(ExitCode(StartTraining(folder / "killed", true)), 0);
  EXPECT_EQ(ReadFile(folder / "whole/checkpoint"), ReadFile(folder / "killed/checkpoint"));
  EXPECT_EQ(ReadFile(folder / "whole/mesh.ply"), ReadFile(folder / "killed/mesh.ply"));
}

TEST(Train, NeusSeesNoLightAndStillEndsWithAMesh) {
  const ScratchFolder folder;
  TrainRun run;
  run.folder = folder / "run";
  const TrainResult result = Train(SmallSequence(), ReadTrainOptions("neus", SmallSettings(20)), run);
  EXPECT_EQ(result.iterations, 20);
  EXPECT_EQ(result.stopped_by, "iterations");
  EXPECT_TRUE(std::filesystem::exists(folder / "run/mesh.ply"));
}

// A single frame can't tell light between walls from distance, and brings back nothing that a fog moves; two
// can.
TEST(Train, OneFrameDoesWithoutTheFreeFactorOfLightBetweenWallsAndWithoutFog) {
  const auto configured = [](size_t frames, const std::string& interreflection, const std::string& key) {
    const ScratchFolder folder;
    Sequence sequence = SmallSequence();
    sequence.frames.resize(frames);
    TrainRun run;
    run.folder = folder.path();
    std::vector<std::string> settings = SmallSettings(20);
    settings.push_back("network.interreflection=\"" + interreflection + "\"");
    Train(sequence, ReadTrainOptions("fast", settings), run);
    const std::string config = ReadFile(folder / "config.toml"), name = "\n" + key + " = ";
    const size_t begin = config.find(name) + name.size();
    return config.substr(begin, config.find('\n', begin) - begin);
  };
  EXPECT_EQ(configured(1, "mean", "interreflection"), "\"none\"");
  EXPECT_EQ(configured(2, "mean", "interreflection"), "\"mean\"");
  EXPECT_EQ(configured(1, "radiosity", "interreflection"),
            "\"radiosity\"");  // the surface says what it sends itself
  EXPECT_EQ(configured(1, "radiosity", "fog_iterations"), "0");
  EXPECT_EQ(configured(2, "radiosity", "fog_iterations"), "200");
}

// They are of the same start whatever the run's length, and the run ends as it would without them.
TEST(Train, MeshesOnTheWayAreWrittenAndChangeNothing) {
  const ScratchFolder folder;
  const auto train = [&](const std::string& name, int iterations, const std::vector<double>& meshes_at) {
    TrainRun run;
    run.folder = folder / name;
    run.meshes_at = meshes_at;
    Train(SmallSequence(), ReadTrainOptions("fast", SmallSettings(iterations)), run);
    return ReadFile(run.folder / "mesh.ply");
  };
  const std::string plain = train("plain", 20, {});
  EXPECT_EQ(train("with", 20, {0, 0.5}), plain);
  EXPECT_NE(train("short", 6, {0}), plain);
  const std::string start = ReadFile(MeshAtFile(folder / "with", 0)),
                    half = ReadFile(MeshAtFile(folder / "with", 0.5));
  EXPECT_EQ(ReadFile(MeshAtFile(folder / "short", 0)), start);
  EXPECT_NE(start, half);
  EXPECT_NE(half, plain);
}

TEST(TrainOptions, AreReadBackFromTheirText) {
  const TrainOptions options = ReadTrainOptions("fast", {"loss.eikonal=0.25", "network.sdf_hidden=[16, 8]"});
  EXPECT_EQ(options.loss.eikonal, 0.25);
  EXPECT_EQ(options.field.sdf_hidden, (std::vector<int>{16, 8}));
  EXPECT_EQ(ReadTrainOptions("neus", {}).field.reflectance, Reflectance::kUnlit);
  EXPECT_EQ(ReadTrainOptions("neus_paper", {}).field.reflectance, Reflectance::kUnlit);
  EXPECT_EQ(ReadTrainOptions("neus_paper", {}).field.sdf_hidden.size(), 8u);
  const std::string narrow =
      test::ErrorOf([] { ReadTrainOptions("paper", {"network.sdf_hidden=[32, 32, 32, 32]"}); });
  EXPECT_NE(narrow.find("sdf_skip"), std::string::npos) << narrow;
  // Mistakes are named with the remedy.
  const std::string misspelt = test::ErrorOf([] { ReadTrainOptions("fast", {"loss.eikonl=1"}); });
  EXPECT_NE(misspelt.find("eikonal"), std::string::npos) << misspelt;
  const std::string no_preset = test::ErrorOf([] { ReadTrainOptions("slow", {}); });
  EXPECT_NE(no_preset.find("fast"), std::string::npos) << no_preset;
}

// The size of everything that is learnt follows from the shapes alone.
TEST(Train, DryRunCountsMeasuresAndLeavesNoFile) {
  const ScratchFolder folder;
  const TrainOptions options =
      ReadTrainOptions("paper", {"network.sdf_hidden=[60]", "network.sdf_skip=0", "network.color_hidden=[7]",
                                 "network.features=5", "sampling.rays=8", "schedule.iterations=1000"});
  EstimateOptions how;
  how.seconds = 0;
  const auto before = std::filesystem::last_write_time(SmallSequence().folder);
  const TrainEstimate estimate = EstimateTraining(SmallSequence(), options, how);
  const int sdf = 39 * 60 + 60 + 60 * 6 + 6, color = (3 + 27 + 3 + 5) * 7 + 7 + 7 * 3 + 3;
  EXPECT_EQ(estimate.network_parameters, sdf + color + 60 + 6 + 7 + 3);  // with a length a row
  EXPECT_EQ(estimate.parameters, estimate.network_parameters);
  EXPECT_EQ(estimate.samples_per_iteration, 8 * 128);
  EXPECT_EQ(estimate.frames, 6);
  EXPECT_EQ(estimate.measured_iterations, 2);
  EXPECT_GT(estimate.seconds_per_iteration, 0);
  EXPECT_DOUBLE_EQ(estimate.seconds, 1000 * estimate.seconds_per_iteration);
  EXPECT_GT(estimate.resident_bytes, estimate.state_bytes);
  // Every part of a step that there is takes some of it; without a grid that part takes none.
  for (size_t i = 0; i < kPhaseNames.size(); ++i)
    EXPECT_EQ(estimate.phase_seconds[i] > 0, i != static_cast<size_t>(Phase::kGrid)) << kPhaseNames[i];
  const int status =
      std::system((std::string(LUMEN_COMMAND) + " train " + SmallSequence().folder.string() +
                   " --dry-run --iterations 7 --json " + (folder / "cost.json").string() + " >/dev/null")
                      .c_str());
  ASSERT_EQ(status, 0);
  const std::string cost = ReadFile(folder / "cost.json");
  EXPECT_NE(cost.find("\"iterations\": 7"), std::string::npos);
  EXPECT_NE(cost.find("\"grid\""), std::string::npos) << cost;
  EXPECT_EQ(std::distance(std::filesystem::directory_iterator(folder.path()), {}), 1);
  EXPECT_EQ(std::filesystem::last_write_time(SmallSequence().folder), before);
}

TEST(Checkpoint, DamageIsRefused) {
  const ScratchFolder folder;
  TrainState state;
  state.parameters = {1, 2, 3};
  state.first = {4, 5, 6};
  state.second = {7, 8, 9};
  state.iteration = 17;
  state.log_sharpness = {0.5f, -1, 2};
  WriteCheckpoint(folder / "checkpoint", "settings", state);
  TrainState back;
  back.parameters.resize(3);
  back.first.resize(3);
  back.second.resize(3);
  ReadCheckpoint(folder / "checkpoint", "settings", &back);
  EXPECT_EQ(back.iteration, 17);
  EXPECT_EQ(back.second[2], 9);
  EXPECT_EQ(back.log_sharpness, state.log_sharpness);
  const std::string bytes = ReadFile(folder / "checkpoint");
  for (size_t at : {size_t(0), bytes.size() / 2, bytes.size() - 1}) {
    std::string changed = bytes;
    changed[at] ^= 1;
    WriteFile(folder / "changed", changed);
    EXPECT_THROW(ReadCheckpoint(folder / "changed", "settings", &back), InputError) << at;
    WriteFile(folder / "cut", bytes.substr(0, at));
    EXPECT_THROW(ReadCheckpoint(folder / "cut", "settings", &back), InputError) << at;
  }
  EXPECT_THROW(ReadCheckpoint(folder / "checkpoint", "others", &back), InputError);
  back.first.resize(2);
  EXPECT_THROW(ReadCheckpoint(folder / "checkpoint", "settings", &back), InputError);
}

// Steps are those of the state, for any number of threads, and are taken by what is learnt in float: its
// tables have more digits than what is looked up.
TEST(Train, TablesInBfloat16AreLearntInFloat) {
  const auto options = [](const std::string& precision) {
    return ReadTrainOptions("fast", {"sampling.rays=64", "grid.precision=\"" + precision + "\""});
  };
  const TrainingFrames frames(test::SmallSequence(), 6, true);
  Trainer whole(frames, options("float"), 5), through(frames, options("bf16"), 5),
      first(frames, options("bf16"), 5), second(frames, options("bf16"), 5);
  SetThreadCount(1);
  for (int step = 0; step < 8; ++step) {
    whole.Step(step / 10.0);
    through.Step(step / 10.0);
  }
  SetThreadCount(2);
  for (int step = 0; step < 3; ++step) first.Step(step / 10.0);
  second.state() = first.state();
  for (int step = 3; step < 8; ++step) second.Step(step / 10.0);
  SetThreadCount(0);
  EXPECT_EQ(through.state().parameters, second.state().parameters);
  EXPECT_NE(through.state().parameters, whole.state().parameters);
  const auto& learnt = through.state().parameters;
  const size_t tables = through.field().grid_size();
  const auto has_more_digits = [](float x) { return (std::bit_cast<uint32_t>(x) & 0xffff) != 0; };
  EXPECT_GT(
      std::count_if(learnt.begin(), learnt.begin() + static_cast<std::ptrdiff_t>(tables), has_more_digits),
      static_cast<std::ptrdiff_t>(tables / 2));
  EXPECT_TRUE(std::equal(learnt.begin() + static_cast<std::ptrdiff_t>(tables), learnt.end(),
                         through.Weights() + tables));
}

// Steps are those of the state, for any number of threads; the loss is off by the networks' rounding alone,
// of which photometric and eikonal terms take a few times 2⁻⁸.
TEST(Train, ProductsInBfloat16FollowThoseInFloat) {
  const auto options = [](const std::string& precision) {
    return ReadTrainOptions("fast", {"sampling.rays=64", "network.precision=\"" + precision + "\""});
  };
  EXPECT_NE(FormatTrainOptions(options("bf16")), FormatTrainOptions(options("float")));
  const TrainingFrames frames(test::SmallSequence(), 6, true);
  Trainer whole(frames, options("float"), 5), rounded(frames, options("bf16"), 5),
      again(frames, options("bf16"), 5);
  for (int step = 0; step < 8; ++step) {
    SetThreadCount(1);
    const double expected = whole.Step(step / 10.0).loss.Sum(), found = rounded.Step(step / 10.0).loss.Sum();
    SetThreadCount(2);
    again.Step(step / 10.0);
    EXPECT_NEAR(found, expected, 0.05 * expected) << step;
    EXPECT_NE(found, expected);
  }
  SetThreadCount(0);
  EXPECT_EQ(rounded.state().parameters, again.state().parameters);
}

// The fog's own sharpness at first, the schedule's from the fog's last step on; whichever of the two limits
// comes first.
TEST(Schedule, FogLiftsAndLeavesTheScheduleAsItWas) {
  const TrainingFrames frames(test::SmallSequence(), 20, true);
  const auto sharpness = [&](const std::vector<std::string>& settings, double progress_a_step) {
    std::vector<std::string> all = {"sampling.rays=4", "network.interreflection=\"none\"",
                                    "schedule.sharpness_start_per_mm=0.5",
                                    "schedule.sharpness_end_per_mm=2.0"};
    all.insert(all.end(), settings.begin(), settings.end());
    Trainer trainer(frames, ReadTrainOptions("fast", all), 0);
    std::vector<double> values;
    for (int step = 0; step < 8; ++step)
      values.push_back(trainer.Step(step * progress_a_step).sharpness_per_mm);
    return values;
  };
  const auto without = sharpness({"schedule.fog_iterations=0"}, 0.02);
  const auto by_steps = sharpness({"schedule.fog_iterations=4", "schedule.fog_per_mm=0.125"}, 0.02);
  const auto by_share = sharpness({"schedule.fog_iterations=1000", "schedule.fog_per_mm=0.125"}, 0.1);
  for (int step = 0; step < 8; ++step) {
    EXPECT_NEAR(without[step], 0.5 * std::pow(4, 0.02 * step), 1e-5);
    EXPECT_NEAR(by_steps[step], without[step] * std::pow(0.25, std::max(0.0, 1 - step / 4.0)), 1e-5);
    EXPECT_NEAR(by_share[step], 0.5 * std::pow(4, 0.1 * step) * std::pow(0.25, std::max(0.0, 1 - step / 2.0)),
                1e-5);
  }
}

// A run that is longer than settle_from and has come as far as settle_part has its last sharpness by then,
// and a rate that falls with 1/sqrt(iteration); a shorter one is as it would be without.
TEST(Schedule, LongRunsSettle) {
  const TrainingFrames frames(test::SmallSequence(), 20, true);
  const auto trainer = [&](std::vector<std::string> settings) {
    settings.insert(settings.end(), {"sampling.rays=4", "network.interreflection=\"none\"",
                                     "schedule.sharpness_start_per_mm=0.5", "schedule.fog_iterations=0"});
    return std::make_unique<Trainer>(frames, ReadTrainOptions("fast", settings), 0);
  };
  const auto soft = trainer({"schedule.sharpness_end_per_mm=2.0", "schedule.settle_from=0"});
  const auto shorter = trainer({"schedule.sharpness_end_per_mm=2.0", "schedule.settle_from=1000"});
  const auto longer =
      trainer({"schedule.sharpness_end_per_mm=2.0", "schedule.settle_from=4", "schedule.settle_part=1e-3"});
  const auto by_part =
      trainer({"schedule.sharpness_end_per_mm=2.0", "schedule.settle_from=1", "schedule.settle_part=0.08"});
  for (int step = 0; step < 8; ++step) {
    const double progress = 0.02 * step;
    EXPECT_NEAR(soft->Step(progress).sharpness_per_mm, 0.5 * std::pow(4, progress), 1e-5);
    shorter->Step(progress);
    const double grown = 0.5 * std::pow(4, std::min(1.0, step / 4.0));
    EXPECT_NEAR(longer->Step(progress).sharpness_per_mm, grown, 1e-5);
    EXPECT_NEAR(by_part->Step(progress).sharpness_per_mm, grown, 1e-5);
  }
  EXPECT_EQ(shorter->state().parameters, soft->state().parameters);

  // Of one sharpness: the second step is 1/sqrt(2) as long, but for what the ray's weights differ by.
  const auto steady = trainer({"schedule.sharpness_end_per_mm=0.5", "schedule.settle_from=0"});
  const auto settling = trainer({"schedule.sharpness_end_per_mm=0.5", "schedule.settle_from=1"});
  steady->Step(0.5);
  settling->Step(0.5);
  const auto before = steady->state().parameters;
  ASSERT_EQ(settling->state().parameters, before);
  EXPECT_NE(steady->Step(0.5).loss.photometric, settling->Step(0.5).loss.photometric);
  double whole = 0, part = 0;
  for (size_t i = 0; i < before.size(); ++i) {
    whole += std::abs(double(steady->state().parameters[i]) - before[i]);
    part += std::abs(double(settling->state().parameters[i]) - before[i]);
  }
  EXPECT_GT(whole, 0);
  EXPECT_NEAR(part / whole, std::sqrt(0.5), 0.03);
}

}  // namespace
}  // namespace lumen
