// Runs that are killed, disks that are full, checkpoints that are damaged: nothing is lost, and what is gone
// on with is what an undisturbed run would have had.
#include <gtest/gtest.h>
#include <signal.h>
#include <unistd.h>

#include "common/abandoned_files.h"
#include "common/files.h"
#include "common/parallel.h"
#include "common/random.h"
#include "recon/training/checkpoint.h"
#include "recon/training/train.h"
#include "tests/child_process.h"
#include "tests/small_sequence.h"

namespace lumen {
namespace {

using test::ExitCode;
using test::ScratchFolder;
using test::SmallSequence;
using test::StartLumen;
namespace fs = std::filesystem;

// A checkpoint after every step, small; it holds the light that the wall sends itself, found at the first.
const std::vector<std::string> kSettings = {
    "schedule.iterations=60", "schedule.settle_from=30",       "sampling.rays=64",
    "extract.cell_mm=4",      "schedule.checkpoint_seconds=0", "network.interreflection=\"radiosity\"",
    "grid.log2_table_size=10"};

void TrainHere(const fs::path& folder, bool resume = false) {
  TrainRun run;
  run.folder = folder;
  run.resume = resume;
  Train(SmallSequence(), ReadTrainOptions("fast", kSettings), run);
}

// The command as a child, its messages in `said`.
pid_t Start(const fs::path& folder, bool resume, const fs::path& said, rlim_t largest_file = RLIM_INFINITY) {
  std::vector<std::string> words = {"train", SmallSequence().folder.string(), "-o", folder.string(),
                                    "--quiet"};
  for (const std::string& setting : kSettings) words.insert(words.end(), {"--set", setting});
  if (resume) words.push_back("--resume");
  return StartLumen(words, said, largest_file);
}

void ExpectOneLine(const fs::path& said) {
  const std::string text = ReadFile(said);
  EXPECT_EQ(text.find('\n'), text.size() - 1) << text;
  EXPECT_EQ(text.rfind("lumen: ", 0), 0u) << text;
}

void ExpectSameRun(const fs::path& expected, const fs::path& found) {
  for (const char* name : {"checkpoint", "checkpoint.before", "mesh.ply", "config.toml"})
    EXPECT_TRUE(ReadFile(expected / name) == ReadFile(found / name)) << name;
}

TEST(Reliability, RadiosityHasTheSameBytesForAnyNumberOfThreads) {
  const ScratchFolder folder;
  SetThreadCount(1);
  TrainHere(folder / "one");
  SetThreadCount(2);
  TrainHere(folder / "two");
  TrainHere(folder / "again");
  SetThreadCount(0);
  ExpectSameRun(folder / "one", folder / "two");
  ExpectSameRun(folder / "one", folder / "again");
}

TEST(Reliability, KilledAgainAndAgain) {
  const ScratchFolder folder;
  TrainHere(folder / "whole");
  const fs::path killed = folder / "killed";
  int kills = 0;
  for (int round = 0; round < 12; ++round) {
    const pid_t child = Start(killed, true, folder / "said");
    usleep(static_cast<useconds_t>(RandomBits(1, round) % 250000));
    kill(child, SIGKILL);
    if (ExitCode(child) == -1) ++kills;
  }
  EXPECT_GT(kills, 0);
  ASSERT_EQ(ExitCode(Start(killed, true, folder / "said")), 0) << ReadFile(folder / "said");
  ExpectSameRun(folder / "whole", killed);
}

TEST(Reliability, WhatKilledProcessesLeftIsRemovedNothingElse) {
  const ScratchFolder folder;
  const pid_t gone = fork();
  if (gone == 0) _exit(0);
  ASSERT_EQ(ExitCode(gone), 0);
  const std::string dead = std::to_string(gone), alive = std::to_string(getpid());
  const std::vector<std::string> stay = {".mesh." + alive + "-0.tmp.ply",
                                         "mesh." + dead + "-0.tmp.ply",
                                         ".mesh." + dead + "-0.ply",
                                         ".a-1.tmp",
                                         ".tmp",
                                         "-.tmp"};
  for (const std::string& name : stay) WriteFile(folder / name, "");
  WriteFile(folder / (".checkpoint." + dead + "-12.tmp"), "");
  WriteFile(folder / (".mesh." + dead + "-3.tmp.ply"), "");
  RemoveAbandonedFiles(folder.path());
  EXPECT_EQ(std::distance(fs::directory_iterator(folder.path()), {}), 6);
  for (const std::string& name : stay) EXPECT_TRUE(fs::exists(folder / name)) << name;
}

// A run that was killed after some steps, its last checkpoint damaged in one of several ways.
TEST(Reliability, DamagedCheckpointGivesWayToTheOneBefore) {
  const ScratchFolder folder;
  TrainHere(folder / "whole");
  const std::string last = ReadFile(folder / "whole/checkpoint");
  std::string flipped = last;
  flipped[last.size() / 3] ^= 0x10;
  for (const std::string& damaged : {flipped, last.substr(0, last.size() / 2), std::string()}) {
    fs::remove_all(folder / "damaged");
    fs::copy(folder / "whole", folder / "damaged");
    fs::remove(folder / "damaged/mesh.ply");
    WriteFile(folder / "damaged/checkpoint", damaged);
    TrainHere(folder / "damaged", true);
    // The step is taken again; the damaged one has become the one before.
    EXPECT_TRUE(ReadFile(folder / "damaged/mesh.ply") == ReadFile(folder / "whole/mesh.ply"));
    EXPECT_TRUE(ReadFile(folder / "damaged/checkpoint") == last);
  }
  // Killed between the two renames: there is only the one before.
  fs::copy(folder / "whole", folder / "between");
  fs::remove(folder / "between/checkpoint");
  TrainHere(folder / "between", true);
  EXPECT_TRUE(ReadFile(folder / "between/checkpoint") == last);
  // Both damaged: refused, in a line that says what to do.
  WriteFile(folder / "whole/checkpoint", flipped);
  WriteFile(folder / "whole/checkpoint.before", last.substr(0, 100));
  const std::string error = test::ErrorOf([&] { TrainHere(folder / "whole", true); });
  EXPECT_NE(error.find("the one before it"), std::string::npos) << error;
  EXPECT_NE(error.find("without --resume"), std::string::npos) << error;
}

// Files may grow to half of a checkpoint: one line, exit 1, what was there stays, no temporary file; with
// room again the run ends as if nothing had been.
TEST(Reliability, FullDiskLosesNothing) {
  const ScratchFolder folder;
  TrainHere(folder / "whole");
  fs::copy(folder / "whole", folder / "full");
  fs::remove(folder / "full/mesh.ply");
  // The state of a step earlier.
  fs::rename(folder / "full/checkpoint.before", folder / "full/checkpoint");
  const std::string kept = ReadFile(folder / "full/checkpoint");
  EXPECT_EQ(ExitCode(Start(folder / "full", true, folder / "said", kept.size() / 2)), 1);
  ExpectOneLine(folder / "said");
  EXPECT_NE(ReadFile(folder / "said").find("checkpoint"), std::string::npos) << ReadFile(folder / "said");
  EXPECT_TRUE(ReadFile(folder / "full/checkpoint") == kept);
  for (const auto& entry : fs::directory_iterator(folder / "full"))
    EXPECT_NE(entry.path().filename().string()[0], '.') << entry.path();
  ASSERT_EQ(ExitCode(Start(folder / "full", true, folder / "said")), 0);
  ExpectSameRun(folder / "whole", folder / "full");
}

// A folder that nobody may write to, not even root: nothing is trained first.
TEST(Reliability, ReadOnlyFolderIsRefused) {
  const ScratchFolder folder;
  for (const char* place : {"/proc", "/proc/lumen-run"}) {
    EXPECT_EQ(ExitCode(Start(place, false, folder / "said")), 1);
    ExpectOneLine(folder / "said");
  }
}

}  // namespace
}  // namespace lumen
