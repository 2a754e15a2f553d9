// What a run takes of the machine's memory, as the system counts it, and how it is shared out.
#include "recon/training/memory.h"

#include <gtest/gtest.h>

#include "common/files.h"
#include "recon/training/training_frames.h"
#include "tests/child_process.h"
#include "tests/small_sequence.h"

namespace lumen {
namespace {

constexpr int64_t kRun = 300'000'000;  // what a run may take

// Linux counts a thread's pages by 64 at a time: so far off may each thread's count be, bytes.
constexpr int64_t kCountedAtOnce = 64 * 4096;

constexpr int64_t kMask = int64_t{4096} * 4096;  // of the large frame, bytes

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

  // Peak of a command, bytes; of this process when it starts the command's at the least, which Linux counts
  // in.
  static int64_t PeakOf(const std::vector<std::string>& command) {
    const pid_t child = test::StartLumen(command);
    int status = 0;
    rusage usage = {};
    EXPECT_EQ(wait4(child, &status, 0, &usage), child);
    EXPECT_EQ(status, 0);
    return int64_t{usage.ru_maxrss} * 1024;
  }
  // Of a whole run.
  int64_t PeakOfTraining(int side, int iterations, const std::vector<std::string>& more) const {
    std::vector<std::string> command = {"train",          SquareSequence(side), "-o",
                                        scratch_ / "run", "--iterations",       std::to_string(iterations),
                                        "--quiet"};
    command.insert(command.end(), more.begin(), more.end());
    return PeakOf(command);
  }

  const test::ScratchFolder scratch_;
};

// Of a frame of 4096 × 4096 pixels, 50 MB, 27 bytes a pixel are kept, as many as fit into half of kFrameBytes
// at least. What comes on top of that over a frame of 64 × 64 is the mask's 17 MB, while that is read its
// file's and the rows': less than 12 MB, so that the frame isn't held whole.
TEST_F(Memory, AFrameOf4096SquaredIsNotHeldWhole) {
  const std::vector<std::string> coarse = {"--set", "extract.cell_mm=8", "--threads", "1"};
  const int64_t large = PeakOfTraining(4096, 1, coarse) - PeakOfTraining(64, 1, coarse);
  EXPECT_LT(large, int64_t{kFrameBytes} + 12'000'000);
  EXPECT_GT(large, int64_t{kFrameBytes} - kMask - 4 * kCountedAtOnce);  // so much it does keep
}

TEST_F(Memory, AFineMeshTakesWhatThePixelsHaveGivenBack) {
  const std::vector<std::string> coarse = {"--set", "extract.cell_mm=8", "--threads", "1"},
                                 fine = {"--set", "extract.cell_mm=0.35", "--threads", "1"};
  const int64_t mesh = PeakOfTraining(64, 1, fine) - PeakOfTraining(64, 1, coarse);
  EXPECT_GT(mesh, 16 * kCountedAtOnce);
  EXPECT_LT(PeakOfTraining(4096, 1, fine), PeakOfTraining(4096, 1, coarse) + mesh / 2);
}

// The frame takes all that pixels may take up. On two threads, as are meant; each more has a workspace of its
// own.
TEST_F(Memory, ARunTakesNoMoreThan300MB) {
  struct Case {
    std::string preset;
    std::vector<std::string> settings;
    int iterations;
  };
  const std::vector<std::string> wide = {"network.sdf_hidden=[256,256]", "network.color_hidden=[256,256]"};
  const int64_t program = PeakOf({"--help"});
  for (const Case& run : {Case{"fast", {}, 60}, Case{"fast", wide, 60}, Case{"paper", {}, 2},
                          Case{"paper", {"network.precision=\"bf16\"", "poses.refine=true"}, 2}}) {
    std::vector<std::string> more = {"--preset", run.preset, "--threads", "2"};
    for (const std::string& setting : run.settings) more.insert(more.end(), {"--set", setting});
    const int64_t peak = PeakOfTraining(4096, run.iterations, more);
    const auto pixels = static_cast<int64_t>(FrameBytes(ReadTrainOptions(run.preset, run.settings)));
    EXPECT_LT(peak, kRun) << testing::PrintToString(more);
    EXPECT_GT(peak, program + pixels - kMask) << testing::PrintToString(more);
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
// of 128 samples on two threads eight panels of 8 × 256 units, three of 4 × 256 and of the ambient
// network's 16. Two threads round each weight, and drop a gradient each that comes with that by poses.
TEST(MemorySharedOut, CountsThePapersNetworks) {
  constexpr double kParameters = 802e3, kPasses = 2 * 2 * 128 * (8 * 8 * 256 + 3 * (4 * 256 + 16));
  TrainOptions options = ReadTrainOptions("paper", {});
  EXPECT_NEAR(double(NetworkBytes(options)), 4 * (8 * kParameters + kPasses), 0.5e6);
  options.field.network_precision = Precision::kBfloat16;
  EXPECT_NEAR(double(NetworkBytes(options)), 4 * (10 * kParameters + kPasses), 0.5e6);
  options.poses.refine = true;
  EXPECT_NEAR(double(NetworkBytes(options)), 4 * (12 * kParameters + kPasses), 0.5e6);
}

}  // namespace
}  // namespace lumen
