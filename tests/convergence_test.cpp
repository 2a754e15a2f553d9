#include "tools/study/convergence.h"

#include <gtest/gtest.h>

#include "common/files.h"
#include "common/mesh.h"
#include "recon/training/train.h"
#include "tests/small_sequence.h"
#include "tests/support.h"

namespace lumen {
namespace {

// The paper's parts of the run; what is there already is taken, as a mesh that is put there shows.
TEST(Convergence, ShowsThePartsAndGoesOnFromTheRunThatIsThere) {
  const test::ScratchFolder folder;
  const TrainOptions options =
      ReadTrainOptions("fast", {"schedule.iterations=26", "sampling.rays=32", "extract.cell_mm=4"});
  const auto draw = [&](uint64_t seed) {
    return DrawConvergence(test::SmallSequence(), options, seed, folder.path());
  };
  const std::vector<ConvergencePoint> first = draw(0);
  ASSERT_EQ(first.size(), 5u);
  const int64_t expected[] = {1, 2, 5, 6, 26};
  for (size_t i = 0; i < 5; ++i) {
    EXPECT_EQ(first[i].iteration, expected[i]);
    EXPECT_GT(first[i].surveyed.mae_mm, 0.2);
  }
  EXPECT_TRUE(std::filesystem::exists(folder / "convergence.png"));
  WriteMesh(MeshAtFile(folder / "convergence", ConvergenceParts()[0]),
            ReadGroundTruth(test::SmallSequence()));
  const std::vector<ConvergencePoint> again = draw(0);
  ASSERT_EQ(again.size(), 5u);
  EXPECT_LT(again[0].surveyed.mae_mm, 1e-4);
  EXPECT_EQ(again[4].surveyed.mae_mm, first[4].surveyed.mae_mm);
  EXPECT_GT(draw(1)[0].surveyed.mae_mm, 0.2);
}

}  // namespace
}  // namespace lumen
