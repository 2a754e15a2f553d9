// What a run takes of the machine's memory, as the system counts it, and how it is shared out.
#include "recon/training/memory.h"

#include <gtest/gtest.h>

#include "common/files.h"
#include "recon/training/training_frames.h"
#include "tests/child_process.h"
#include "tests/small_sequence.h"

namespace lumen {
namespace {

constexpr size_t kRun = 300'000'000;  // what a run may take

// Linux counts a thread's pages by 64 at a time: so far off may each thread's count be, bytes.
constexpr size_t kCountedAtOnce = 64 * 4096;

class Memory : public testing::Test {
 protected:
  void SetUp() override {
#ifdef __SANITIZE_ADDRESS__
    GTEST_SKIP() << "the sanitizer keeps what is freed for a while, and counts as the program's memory";
#endif
  }

  // A grey frame of side × side pixels, all of which the mask lets see.
  std::filesystem::path SquareSequence(int side) const {
    Sequence sequence;
    sequence.folder = scratch_ / std::to_string(side);
    if (std::filesystem::exists(sequence.folder)) return sequence.folder;
    CreateFolder(sequence.folder);
    Calibration& calibration = sequence.calibration;
    calibration.light = EndomapperLight();
    calibration.response.gamma = 2.2;
    CameraIntrinsics& camera = calibration.camera;
    camera.width = camera.height = side;
    camera.cx = camera.cy = (side - 1) / 2.0;
    camera.fx = camera.fy = 0.6 * side;
    calibration.mask = Image8(side, side, 1, 255);
    sequence.frames.resize(1);
    WriteSequenceHeader(sequence);
    WriteImage(FrameFile(sequence.folder, 0, "color.png"), Image8(side, side, 3, 90));
    return sequence.folder;
  }

  // Peak of a whole run of one step, bytes.
  size_t PeakOfTraining(int side, const std::vector<std::string>& more) const {
    std::vector<std::string> command = {
        "train", SquareSequence(side), "-o", scratch_ / "run", "--iterations", "1", "--quiet"};
    command.insert(command.end(), more.begin(), more.end());
    const pid_t child = test::StartLumen(command);
    int status = 0;
    rusage usage;
    wait4(child, &status, 0, &usage);
    EXPECT_EQ(status, 0);
    return size_t(usage.ru_maxrss) * 1024;
  }

  const test::ScratchFolder scratch_;
};

// Of a frame of 4096 × 4096 pixels, 50 MB, 27 bytes a pixel are kept, as many as fit into half of kFrameBytes
// at least. What comes on top of that over a frame of 64 × 64 is the mask's 17 MB, while that is read its
// file's and the rows': less than 12 MB, so that the frame isn't held whole.
TEST_F(Memory, AFrameOf4096SquaredIsNotHeldWhole) {
  const std::vector<std::string> coarse = {"--set", "extract.cell_mm=8", "--threads", "1"};
  const size_t large = PeakOfTraining(4096, coarse) - PeakOfTraining(64, coarse);
  constexpr size_t kMask = size_t{4096} * 4096;
  EXPECT_LT(large, kFrameBytes + 12'000'000);
  EXPECT_GT(large, kFrameBytes - kMask - 4 * kCountedAtOnce);  // so much it does keep
}

TEST_F(Memory, AFineMeshTakesWhatThePixelsHaveGivenBack) {
  const std::vector<std::string> coarse = {"--set", "extract.cell_mm=8", "--threads", "1"},
                                 fine = {"--set", "extract.cell_mm=0.35", "--threads", "1"};
  const size_t mesh = PeakOfTraining(64, fine) - PeakOfTraining(64, coarse);
  EXPECT_GT(mesh, 16 * kCountedAtOnce);
  EXPECT_LT(PeakOfTraining(4096, fine), PeakOfTraining(4096, coarse) + mesh / 2);
}

// The frame takes all that pixels may take up. On two threads, as are meant; each more has a workspace of its
// own.
TEST_F(Memory, ARunTakesNoMoreThan300MB) {
  const std::vector<std::string> wide = {"--set", "network.sdf_hidden=[256,256]", "--set",
                                         "network.color_hidden=[256,256]"};
  const std::vector<std::vector<std::string>> runs = {
      {},
      wide,
      {"--preset", "paper"},
      {"--preset", "paper", "--set", "network.precision=\"bf16\""},
  };
  for (std::vector<std::string> run : runs) {
    run.insert(run.end(), {"--threads", "2"});
    const size_t peak = PeakOfTraining(4096, run);
    EXPECT_LT(peak, kRun) << testing::PrintToString(run);
    EXPECT_GT(peak, kFrameBytes) << testing::PrintToString(run);
  }
}

TrainOptions WithHidden(const std::string& preset, const std::vector<int>& widths) {
  TrainOptions options = ReadTrainOptions(preset, {});
  options.field.sdf_hidden = options.field.color_hidden = widths;
  return options;
}

TEST(MemorySharedOut, PixelsMakeRoomForWideNetworks) {
  EXPECT_EQ(FrameBytes(ReadTrainOptions("fast", {})), kFrameBytes);
  const size_t wide = FrameBytes(WithHidden("fast", {256, 256}));
  EXPECT_LT(wide, kFrameBytes);
  EXPECT_LT(FrameBytes(WithHidden("fast", {512, 512})), wide);
  EXPECT_EQ(FrameBytes(WithHidden("fast", {4096, 4096})), kFrameBytes / 4);
}

// By hand: NeuS's networks with the paper's inputs have 802 thousand parameters. Of each there are itself,
// two moments, a gradient and its part of the normalised weights, and three chunks' gradients; and of 2 rays
// of 128 samples on two threads eight panels of 8 × 256 units, three of 4 × 256.
TEST(MemorySharedOut, CountsThePapersNetworks) {
  constexpr double kParameters = 802e3 * (5 + 3), kPasses = 2 * 2 * 128 * (8 * 8 * 256 + 3 * 4 * 256);
  EXPECT_NEAR(double(NetworkBytes(ReadTrainOptions("paper", {}))), 4 * (kParameters + kPasses), 0.1e6);
}

}  // namespace
}  // namespace lumen
