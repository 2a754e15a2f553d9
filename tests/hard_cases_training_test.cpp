// Sequences that are hard on the reconstructor: each ends with a closed, finite mesh around its cameras, or
// in one clear line. Kernels: hard_cases_kernels_test.cpp, hard_cases_network_test.cpp. Frames are 8-bit
// files, which hold no NaN; poses and calibration can.
#include <gtest/gtest.h>
#include <sys/wait.h>

#include <cmath>
#include <cstdlib>
#include <optional>

#include "common/files.h"
#include "common/image.h"
#include "common/mesh.h"
#include "common/pose_file.h"
#include "common/progress.h"
#include "common/random.h"
#include "recon/evaluation/mesh_check.h"
#include "recon/training/plausible.h"
#include "recon/training/ray_sampler.h"
#include "recon/training/train.h"
#include "recon/training/trainer.h"
#include "tests/finite_difference.h"
#include "tests/small_sequence.h"

namespace lumen {
namespace {

using test::Random;
using test::ScratchFolder;
using test::SmallSequence;

std::vector<std::string> Settings(const std::vector<std::string>& more = {}) {
  std::vector<std::string> all = {"schedule.iterations=40", "sampling.rays=64", "extract.cell_mm=4"};
  all.insert(all.end(), more.begin(), more.end());
  return all;
}

// Turns around a point by the solid angles of all faces (Van Oosterom and Strackee 1983): 1 inside, 0
// outside.
double Winding(const Mesh& mesh, const Vec3d& point) {
  double sum = 0;
  for (const Vec3i& face : mesh.faces) {
    const Vec3d a = mesh.vertices[face[0]] - point, b = mesh.vertices[face[1]] - point,
                c = mesh.vertices[face[2]] - point;
    sum += 2 * std::atan2(a.dot(b.cross(c)), a.norm() * b.norm() * c.norm() + a.dot(b) * c.norm() +
                                                 b.dot(c) * a.norm() + c.dot(a) * b.norm());
  }
  return sum / (4 * kPi);
}

struct Outcome {
  std::string said;  // on stderr
  std::string error;
  TrainResult result;
  bool has_mesh = false;
};

// A short run. Whatever it leaves as a mesh must be finite, closed and hold every camera.
Outcome TrainOn(const Sequence& sequence, const std::vector<std::string>& more = {}) {
  const ScratchFolder folder;
  TrainRun run;
  run.folder = folder / "run";
  Outcome outcome;
  testing::internal::CaptureStderr();
  SetQuiet(false);
  outcome.error =
      test::ErrorOf([&] { outcome.result = Train(sequence, ReadTrainOptions("fast", Settings(more)), run); });
  SetQuiet(true);
  outcome.said = testing::internal::GetCapturedStderr();
  EXPECT_EQ(outcome.error.find('\n'), std::string::npos) << outcome.error;
  outcome.has_mesh = std::filesystem::exists(run.folder / "mesh.ply");
  if (!outcome.has_mesh) return outcome;
  const Mesh mesh = ReadMesh(run.folder / "mesh.ply");  // refuses what is not finite
  EXPECT_TRUE(IsManifoldAndClosed(mesh));
  for (const SequenceFrame& frame : sequence.frames)
    EXPECT_NEAR(Winding(mesh, frame.world_from_camera.translation()), 1, 1e-6) << frame.number;
  return outcome;
}

void ExpectMesh(const Sequence& sequence) {
  const Outcome outcome = TrainOn(sequence);
  EXPECT_EQ(outcome.error, "");
  EXPECT_TRUE(outcome.has_mesh);
  EXPECT_EQ(outcome.result.skipped_steps, 0);
  EXPECT_TRUE(std::isfinite(outcome.result.final_loss));
}

// The small sequence with other pixels: change(x, y, channel, value).
template <class Change>
Sequence Repainted(const ScratchFolder& folder, const Change& change) {
  Sequence sequence = SmallSequence();
  for (SequenceFrame& frame : sequence.frames) {
    Image8 color = ReadColor(sequence, frame);
    for (int y = 0; y < color.height; ++y)
      for (int x = 0; x < color.width; ++x)
        for (int c = 0; c < 3; ++c) color.Pixel(x, y)[c] = change(x, y, c, color.Pixel(x, y)[c]);
    frame.color = folder / frame.color.filename().string();
    WriteImage(frame.color, color);
  }
  return sequence;
}

TEST(HardCasesTraining, BlackAndWhiteFramesAreRefused) {
  const ScratchFolder folder;
  const Outcome black = TrainOn(Repainted(folder, [](int, int, int, int) { return 0; }));
  EXPECT_NE(black.error.find("all frames are black"), std::string::npos) << black.error;
  const Outcome white = TrainOn(Repainted(folder, [](int, int, int, int) { return 255; }));
  EXPECT_NE(white.error.find("all frames are white"), std::string::npos) << white.error;
  EXPECT_FALSE(black.has_mesh || white.has_mesh);
}

TEST(HardCasesTraining, OneColourAndHalfSaturated) {
  const ScratchFolder folder;
  ExpectMesh(Repainted(folder, [](int, int, int c, int) { return 60 + 30 * c; }));
  ExpectMesh(Repainted(folder, [](int x, int y, int, int value) { return (x + y) % 2 ? 255 : value; }));
  ExpectMesh(Repainted(folder, [](int x, int, int, int value) { return x % 3 ? 0 : value; }));
}

// What saturated and black pixels bound they bound from one side: value and slope by hand.
TEST(HardCasesTraining, SaturatedPixelsPullOneWayOnly) {
  for (const double predicted : {0.2, 0.999, 1.0, 1.001, 1e30}) {
    const Term<double> saturated = PhotometricLoss(predicted, 1.0, PixelBound::kAtLeast);
    EXPECT_EQ(saturated.slope, predicted < 1 ? -1 : 0);
    EXPECT_EQ(saturated.value, predicted < 1 ? 1 - predicted : 0);
    const Term<double> black = PhotometricLoss(predicted, 1.0, PixelBound::kAtMost);
    EXPECT_EQ(black.slope, predicted > 1 ? 1 : 0);
  }
}

// Rotations about one place; one place and one direction; one frame; 1 mm of travel.
TEST(HardCasesTraining, HardlyAnyParallax) {
  const Sequence& whole = SmallSequence();
  const Vec3d place = whole.frames[0].world_from_camera.translation();
  Sequence rotating = whole, standing = whole, single = whole, slow = whole;
  double travel = 0;
  for (const SequenceFrame& frame : whole.frames)
    travel = std::max(travel, (frame.world_from_camera.translation() - place).norm());
  for (size_t i = 0; i < whole.frames.size(); ++i) {
    rotating.frames[i].world_from_camera.translation() = place;
    standing.frames[i].world_from_camera = whole.frames[0].world_from_camera;
    Pose& pose = slow.frames[i].world_from_camera;
    pose.translation() = place + (pose.translation() - place) / travel;
  }
  single.frames.resize(1);
  for (const Sequence& sequence : {rotating, standing, single, slow}) ExpectMesh(sequence);
  EXPECT_NE(TrainOn(rotating).said.find("no parallax"), std::string::npos);
}

TEST(HardCasesTraining, PosesWrongByTwoMillimetresAndTwoDegrees) {
  Sequence sequence = SmallSequence();
  uint64_t state = 5;
  for (SequenceFrame& frame : sequence.frames) {
    const auto direction = [&] { return Vec3d(Random(state), Random(state), Random(state)).normalized(); };
    frame.world_from_camera.translation() += 2 * direction();
    frame.world_from_camera.rotate(Eigen::AngleAxisd(2 * kPi / 180, direction()));
  }
  ExpectMesh(sequence);
}

// One gain of them: named. All of them: the albedo is off by that factor, to which colours are matched before
// the first step; without interreflection, which tells albedos apart, the loss is the same to rounding.
TEST(HardCasesTraining, GainsWrongByAHundred) {
  Sequence one = SmallSequence(), all = SmallSequence(), fair = SmallSequence();
  for (size_t i = 0; i < fair.frames.size(); ++i) {
    fair.frames[i].gain = fair.frames[i].gain.value_or(1);
    all.frames[i].gain = 100 * *fair.frames[i].gain;
    one.frames[i].gain = (i == 3 ? 100 : 1) * *fair.frames[i].gain;
  }
  const Outcome outcome = TrainOn(one);
  EXPECT_EQ(outcome.error, "");
  EXPECT_TRUE(outcome.has_mesh);
  EXPECT_NE(outcome.said.find(std::to_string(one.frames[3].number) + " (0.0"), std::string::npos)
      << outcome.said;
  EXPECT_EQ(TrainOn(fair).said.find("gain"), std::string::npos);
  ExpectMesh(all);
  for (SequenceFrame& frame : all.frames) frame.gain = *frame.gain / 1e4;
  ExpectMesh(all);
  const TrainOptions options = ReadTrainOptions("fast", Settings({"network.interreflection=\"none\""}));
  const TrainingFrames frames(fair, 6, true), brighter(all, 6, true);
  Trainer trainer(frames, options, 0), other(brighter, options, 0);
  // Of one step: Adam moves what has no gradient but a rounding's as far as everything else.
  const double expected = trainer.Step(0).loss.Sum(), found = other.Step(0).loss.Sum();
  EXPECT_NEAR(found, expected, 1e-4 * expected);
}

// FORMATS: lengths are mm. Another unit by name is refused by the reader; by numbers alone metres bring
// cameras so close together that it is said, micrometres so far apart that no colon has room.
TEST(HardCasesTraining, OtherUnits) {
  const ScratchFolder folder;
  std::filesystem::copy(SmallSequence().folder, folder / "metres", std::filesystem::copy_options::recursive);
  std::string text = ReadFile(folder / "metres/sequence.toml");
  const size_t at = text.find("unit = \"mm\"");
  ASSERT_NE(at, std::string::npos);
  WriteFile(folder / "metres/sequence.toml", text.replace(at, 11, "unit = \"m\""));
  const std::string refused = test::ErrorOf([&] { ReadSequence(folder / "metres"); });
  EXPECT_NE(refused.find("unit"), std::string::npos) << refused;
  Sequence metres = SmallSequence(), micrometres = SmallSequence();
  for (size_t i = 0; i < metres.frames.size(); ++i) {
    metres.frames[i].world_from_camera.translation() /= 1000;
    micrometres.frames[i].world_from_camera.translation() *= 1000;
  }
  EXPECT_NE(TrainOn(metres).said.find("metres"), std::string::npos);
  const Outcome far = TrainOn(micrometres);
  EXPECT_NE(far.error.find("must be in mm"), std::string::npos) << far.error;
}

TEST(HardCasesTraining, AnythingNotANumberIsNamed) {
  const ScratchFolder folder;
  std::filesystem::copy(SmallSequence().folder, folder / "nan", std::filesystem::copy_options::recursive);
  const auto spoil = [&](const std::string& name, size_t from) {
    const std::string kept = ReadFile(folder / "nan" / name);
    std::string text = kept;
    const size_t begin = text.find_first_of("0123456789", from);
    text.replace(begin, text.find_first_not_of("0123456789.e-", begin) - begin, "nan");
    WriteFile(folder / "nan" / name, text);
    const std::string error = test::ErrorOf([&] { ReadSequence(folder / "nan"); });
    WriteFile(folder / "nan" / name, kept);
    EXPECT_NE(error.find(name), std::string::npos) << error;
    EXPECT_EQ(error.find('\n'), std::string::npos) << error;
    return error;
  };
  const std::string poses = ReadFile(folder / "nan/pose.txt");
  const size_t second_line = poses.find('\n') + 1;
  EXPECT_NE(spoil("pose.txt", second_line).find(":2"), std::string::npos);  // of the rotation
  size_t translation = second_line;
  for (int comma = 0; comma < 12; ++comma) translation = poses.find(',', translation) + 1;
  EXPECT_NE(spoil("pose.txt", translation).find(":2"), std::string::npos);
  const std::string text = ReadFile(folder / "nan/sequence.toml");
  for (const char* key : {"cx = ", "spread = ", "intensity = ", "gamma = "}) {
    ASSERT_NE(text.find(key), std::string::npos) << key;
    spoil("sequence.toml", text.find(key));
  }
  // And where no file is read.
  Sequence sequence = SmallSequence();
  sequence.frames[4].world_from_camera.translation().y() = std::nan("");
  const Outcome outcome = TrainOn(sequence);
  EXPECT_NE(outcome.error.find("frame " + std::to_string(sequence.frames[4].number)), std::string::npos);
}

// The truth isn't known to training: a camera in the wall shows in the surface that is learnt. Here that is a
// tube of 20 mm around the first camera, whose signed distance is 20 − r.
TEST(HardCasesTraining, CamerasOutsideOrOnTheSurfaceAreNamed) {
  FieldOptions options;
  options.initial.radius_mm = 20;
  options.initial.reach_mm = 0;
  const InitialSurface initial(options.initial, {Pose::Identity()}, Vec3d::Zero());
  const Field<float> field(options, initial, {Vec3d::Constant(-60), Vec3d::Constant(60)});
  const std::vector<float> parameters(field.parameter_count(), 0.0f);
  const std::vector<size_t> outside = PlacesOutside(
      field, parameters.data(), {Vec3d(0, 0, 0), Vec3d(25, 0, 0), Vec3d(0, 19.9, 0), Vec3d(0, 0, 20)});
  EXPECT_EQ(outside, (std::vector<size_t>{1, 3}));
}

// Where the truth is known, `lumen check` refuses such a sequence by frame.
TEST(HardCasesTraining, CamerasOutsideTheTruthAreRefusedByCheck) {
  const ScratchFolder folder;
  std::filesystem::copy(SmallSequence().folder, folder / "out", std::filesystem::copy_options::recursive);
  const auto check = [&] {
    const std::string command = std::string(LUMEN_COMMAND) + " check " + (folder / "out").string() + " >" +
                                (folder / "found").string() + " 2>&1";
    return WEXITSTATUS(std::system(command.c_str()));
  };
  EXPECT_EQ(check(), 0) << ReadFile(folder / "found");
  std::vector<Pose> poses;
  for (const SequenceFrame& frame : SmallSequence().frames) poses.push_back(frame.world_from_camera);
  const Mesh truth = ReadMesh(SmallSequence().ground_truth_mesh);
  poses[2].translation() = Bounds(truth).max() + Vec3d(1, 1, 1);
  // From the lumen through the wall's nearest place and a fifth of a millimetre on.
  const Vec3d camera = poses[4].translation();
  Vec3d nearest = truth.vertices[0];
  for (const Vec3d& vertex : truth.vertices)
    if ((vertex - camera).norm() < (nearest - camera).norm()) nearest = vertex;
  poses[4].translation() = nearest + 0.2 * (nearest - camera).normalized();
  WriteFile(folder / "out/pose.txt", PosesText(poses));
  EXPECT_EQ(check(), 1);
  const std::string found = ReadFile(folder / "found");
  for (int frame : {0, 1, 3, 5}) {
    EXPECT_EQ(found.find("frame " + std::to_string(frame) + ": the camera lies outside"), std::string::npos)
        << found;
  }
  for (int frame : {2, 4}) {
    EXPECT_NE(found.find("frame " + std::to_string(frame) + ": the camera lies outside"), std::string::npos)
        << found;
  }
}

bool AllFinite(const LineVector<float>& values) {
  return std::all_of(values.begin(), values.end(), [](float value) { return std::isfinite(value); });
}

// Rays from the origin within 60° of +z, evenly over the sphere's part there.
RayBatch<float> RaysAhead(int count) {
  RayBatch<float> batch;
  batch.rays.resize(count);
  uint64_t state = 3;
  for (auto& ray : batch.rays) {
    const double z = 0.75 + 0.25 * Random(state), turn = kPi * Random(state), across = std::sqrt(1 - z * z);
    ray.origin = Vec3f::Zero();
    ray.direction = Vec3d(across * std::cos(turn), across * std::sin(turn), z).cast<float>();
  }
  return batch;
}

// A sphere around the origin in a box that ends 100 mm away: its field and rays from the origin.
struct SphereSeen {
  explicit SphereSeen(double radius_mm) {
    options.initial.radius_mm = radius_mm;
    options.initial.reach_mm = 0;
    const InitialSurface initial(options.initial, {Pose::Identity()}, Vec3d::Zero());
    field.emplace(options, initial, Eigen::AlignedBox3d{Vec3d::Constant(-100), Vec3d::Constant(100)});
    parameters.resize(field->parameter_count());
  }
  WallSeen Look() {
    RayBatch<float> rays = RaysAhead(400);
    return LookAtWall(*field, parameters.data(), {}, &rays);
  }
  FieldOptions options;
  std::optional<Field<float>> field;
  std::vector<float> parameters;
};

// The box's nearest face, 100 mm straight ahead, cuts off a cap of a sphere of r within acos(100/r): of the
// cone of 60° that is a share of 2 (1 − 100/r).
TEST(HardCasesTraining, WhatRaysMeetIsMeasured) {
  for (const double radius_mm : {20.0, 58.0, 70.0}) {
    const WallSeen wall = SphereSeen(radius_mm).Look();
    EXPECT_NEAR(wall.median_mm, radius_mm, 0.02);
    EXPECT_EQ(wall.beyond, 0);
  }
  for (const double share : {0.05, 0.25}) {
    // Four standard errors of a share among 400 rays.
    EXPECT_NEAR(SphereSeen(100 / (1 - share / 2)).Look().beyond, share,
                4 * std::sqrt(share * (1 - share) / 400));
  }
  EXPECT_NEAR(SphereSeen(300).Look().beyond, 1, 1e-9);
}

TEST(HardCasesTraining, ColourNetworksThatHaveDiedAreTold) {
  SphereSeen sphere(20);
  const Field<float>& field = *sphere.field;
  field.Initialise(1, sphere.parameters.data());
  EXPECT_FALSE(sphere.Look().one_color);
  std::fill(sphere.parameters.begin() + static_cast<std::ptrdiff_t>(field.grid_size()),
            sphere.parameters.end(), 0.0f);
  std::fill_n(&sphere.parameters[field.color_bias_begin()], 3, -1.25f);
  EXPECT_TRUE(sphere.Look().one_color);
}

// Runs that scenes unlike ours may make are let through; what measured failures looked like isn't.
TEST(HardCasesTraining, WallsAreRefusedOnlyWhereNothingIsLeftOfThem) {
  const WallSeen good{0, 35, false}, open_end{0.38, 80, false}, at_the_end{0.87, 90, false},
      dead{0, 35, true}, lost{0.99, 122, true};
  for (const WallSeen& wall : {good, open_end, at_the_end, dead}) EXPECT_EQ(WhyHopeless(wall), "");
  EXPECT_EQ(WhyHopeless(lost), "99% of the pixels see no wall within the bounds");
  EXPECT_EQ(WhyUseless(lost, 0), WhyHopeless(lost));
  EXPECT_EQ(WhyUseless({0, 35, false}, 0.9) + WhyUseless(at_the_end, 0.9) + WhyUseless(dead, 0.07), "");
  EXPECT_EQ(WhyUseless(dead, 0.15),
            "the wall has one colour, whatever the frames show, and 15% of the photometric loss is left");

  EXPECT_EQ(WhatIsOdd(good, 0.2), "");
  EXPECT_EQ(WhatIsOdd({0.06, 58, false}, 0.2), "");
  EXPECT_EQ(WhatIsOdd(at_the_end, 0.2), "87% of the pixels see no wall within the bounds");
  EXPECT_EQ(WhatIsOdd(open_end, 0.2),
            "half of the pixels see the wall more than 80 mm away: no colon is that wide");
  EXPECT_EQ(WhatIsOdd(dead, 0.07), "the wall has one colour, whatever the frames show");
  EXPECT_EQ(WhatIsOdd(good, 0.6), "training has learnt little: 60% of the photometric loss is left");
}

// Bounds that are nearer than the wall: the run ends in a line, and leaves neither mesh nor checkpoint.
TEST(HardCasesTraining, ARunWhoseWallHasLeftTheBoundsStops) {
  const ScratchFolder folder;
  TrainRun run;
  run.folder = folder / "run";
  CreateFolder(run.folder);
  WriteFile(run.folder / "mesh.ply", "an earlier run's");
  const std::string error = test::ErrorOf([&] {
    Train(SmallSequence(), ReadTrainOptions("fast", Settings({"bounds.ahead_mm=9", "bounds.aside_mm=9"})),
          run);
  });
  EXPECT_NE(error.find("training fails: after 40 iterations "), std::string::npos) << error;
  EXPECT_NE(error.find("no wall within the bounds; lower schedule.learning_rate"), std::string::npos)
      << error;
  EXPECT_EQ(error.find('\n'), std::string::npos);
  EXPECT_FALSE(std::filesystem::exists(run.folder / "mesh.ply"));
  EXPECT_FALSE(std::filesystem::exists(run.folder / "checkpoint"));
}

// Ten times too high: whatever comes of it is finite and closed, or a clear word. A thousand times: steps
// whose gradient is not finite are skipped and counted, the state stays finite, and the run stops.
TEST(HardCasesTraining, LearningRatesTooHigh) {
  const Outcome tenfold = TrainOn(SmallSequence(), {"schedule.learning_rate=0.1"});
  EXPECT_TRUE(tenfold.has_mesh || tenfold.error.find("learning_rate") != std::string::npos) << tenfold.error;
  const Outcome thousandfold = TrainOn(SmallSequence(), {"schedule.learning_rate=10"});
  EXPECT_NE(thousandfold.error.find("learning_rate"), std::string::npos) << thousandfold.error;
  EXPECT_FALSE(thousandfold.has_mesh);
  const TrainOptions options = ReadTrainOptions("fast", Settings({"schedule.learning_rate=10"}));
  const TrainingFrames frames(SmallSequence(), 6, true);
  Trainer trainer(frames, options, 0);
  int skipped = 0;
  for (int step = 0; step < 30; ++step) skipped += trainer.Step(step / 30.0).skipped;
  EXPECT_GT(skipped, 0);
  const TrainState& state = trainer.state();
  EXPECT_EQ(state.skipped_steps, skipped);
  EXPECT_GE(state.first_skipped_step, 0);
  EXPECT_TRUE(AllFinite(state.parameters) && AllFinite(state.first) && AllFinite(state.second));
}

// Of a step that is skipped nothing stays but the count: what follows is what another trainer makes of the
// state.
TEST(HardCasesTraining, AStepThatIsSkippedLeavesNothingBehind) {
  const TrainOptions options = ReadTrainOptions("fast", {});
  const TrainingFrames frames(SmallSequence(), 6, true);
  Trainer trainer(frames, options, 0);
  for (int step = 0; step < 3; ++step) ASSERT_FALSE(trainer.Step(0.1).skipped);
  const LineVector<float> good = trainer.state().parameters;
  std::ranges::fill(trainer.state().parameters, std::numeric_limits<float>::quiet_NaN());
  EXPECT_TRUE(trainer.Step(0.1).skipped);
  trainer.state().parameters = good;
  EXPECT_EQ(trainer.state().first_skipped_step, 3);

  Trainer other(frames, options, 0);
  other.state() = trainer.state();
  for (Trainer* each : {&trainer, &other}) EXPECT_FALSE(each->Step(0.1).skipped);
  EXPECT_NE(trainer.state().parameters, good);
  EXPECT_EQ(trainer.state().parameters, other.state().parameters);
  EXPECT_EQ(trainer.state().log_gain, other.state().log_gain);
}

// Whatever the field's values have become, samples are finite, in order and on their ray: sorting numbers
// that aren't would write beyond its end.
TEST(HardCasesTraining, SamplersOnFieldsThatAreNotFinite) {
  FieldOptions options;
  options.initial.radius_mm = 20;
  const InitialSurface initial(options.initial, {Pose::Identity()}, Vec3d::Zero());
  const Field<float> field(options, initial, {Vec3d::Constant(-60), Vec3d::Constant(60)});
  const float infinity = std::numeric_limits<float>::infinity();
  for (const std::string sampler : {"guided", "importance"}) {
    const TrainOptions::Sampling sampling =
        ReadTrainOptions("fast", {"sampling.sampler=\"" + sampler + "\""}).sampling;
    for (const float spoilt : {std::nanf(""), infinity, -infinity, 3e38f, 1e20f}) {
      uint64_t state = 9;
      std::vector<float> parameters(field.parameter_count());
      field.Initialise(1, parameters.data());
      for (float& parameter : parameters)
        if (Random(state) > 0.9) parameter = Random(state) > 0 ? spoilt : -spoilt;
      RayBatch<float> batch;
      batch.rays.resize(64);
      for (auto& ray : batch.rays) {
        ray.origin = Vec3f(3, 0, 0);
        ray.direction = Vec3d(Random(state), Random(state), Random(state)).normalized().cast<float>();
      }
      MakeRaySampler(sampling, &field)->Place(parameters.data(), sampling, 1, 7, &batch);
      for (size_t r = 0; r < batch.rays.size(); ++r) {
        const auto begin = batch.distance.begin() + static_cast<std::ptrdiff_t>(r) * batch.samples;
        EXPECT_TRUE(std::is_sorted(begin, begin + batch.samples));
        const float far = FarthestSample(field.box(), batch.rays[r].origin, batch.rays[r].direction);
        for (int k = 0; k < batch.samples; ++k) {
          ASSERT_TRUE(begin[k] >= kNearest_mm && begin[k] <= far) << spoilt << " " << begin[k];
        }
        ASSERT_TRUE(batch.rays[r].eikonal_sample >= 0 && batch.rays[r].eikonal_sample < batch.samples);
      }
    }
  }
}

// A beam so narrow that a float's exponential is 0 at the image's rim: those pixels say nothing, the others
// do.
TEST(HardCasesTraining, LightThatReachesHardlyAnything) {
  Sequence sequence = SmallSequence();
  for (LightSource& source : sequence.calibration.light.sources) source.spread = 200;
  const TrainingFrames narrow(sequence, 6, true), all(SmallSequence(), 6, true);
  EXPECT_LT(narrow.pixel_rays().size(), all.pixel_rays().size());
  EXPECT_GT(narrow.pixel_rays().size(), 0u);
  ExpectMesh(sequence);
}

}  // namespace
}  // namespace lumen
