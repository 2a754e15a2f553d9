#include "recon/training/train.h"

#include <fmt/core.h>

#include <algorithm>
#include <chrono>
#include <cmath>
#include <ctime>
#include <nlohmann/json.hpp>
#include <optional>
#include <sstream>

#include "common/abandoned_files.h"
#include "common/error.h"
#include "common/files.h"
#include "common/mesh.h"
#include "common/pose_file.h"
#include "common/progress.h"
#include "common/random.h"
#include "recon/surface/extract.h"
#include "recon/training/checkpoint.h"
#include "recon/training/continue_lumen.h"
#include "recon/training/plausible.h"
#include "recon/training/trainer.h"

namespace lumen {
namespace {

using Clock = std::chrono::steady_clock;

constexpr double kReportSeconds = 1;

// A run has failed where at least so many steps were taken and this share of them, or all of the last so
// many, had no finite gradient: nothing but the rays changes from one such step to the next.
constexpr int64_t kFewSteps = 100;
constexpr double kTooManySkipped = 0.5;

constexpr double kMeanOver = 0.98;  // what the running mean of the loss keeps from step to step

// Every so many iterations the wall is looked at: a look costs as much as two. So many rays tell a share of
// 95% to 1%, one of 40% to 2%.
constexpr int64_t kLookEvery = 500;
constexpr int kLookRays = 512;

double SecondsSince(Clock::time_point start) {
  return std::chrono::duration<double>(Clock::now() - start).count();
}

// Without parallax nothing brings back what the fog at the start has moved, and a factor of light between
// walls that is free at every place explains any frame, on any surface: the surface then leaves through the
// bounds.
TrainOptions ForFrames(TrainOptions options, int taken) {
  const bool free_ambient =
      HasAlbedo(options.field.reflectance) && options.field.interreflection == Interreflection::kMean;
  if (taken > 1) return options;
  options.schedule.fog_iterations = 0;
  if (!free_ambient) return options;
  Say("one frame alone can't tell light between walls from distance: network.interreflection = \"none\"");
  options.field.interreflection = Interreflection::kNone;
  return options;
}

class Run {
 public:
  Run(const Sequence& sequence, const TrainOptions& options, const TrainRun& run)
      : options_(ForFrames(options, std::min(options.frames, static_cast<int>(sequence.frames.size())))),
        run_(run),
        frames_(FramesFor(sequence, options_, run.seed)),
        trainer_(frames_, options_, run.seed),
        settings_("seed = " + std::to_string(run.seed) + "\n" + FormatTrainOptions(options_)) {}

  TrainResult Go() {
    CreateFolder(run_.folder);
    RemoveAbandonedFiles(run_.folder);
    if (run_.resume) Resume();
    WriteFile(run_.folder / "config.toml", settings_);
    if (!run_.resume) RemoveEarlierRun();
    Optimise();
    if (saved_iteration_ != trainer_.state().iteration) Save();
    SayWhichCamerasAreOutside();
    const std::optional<Continuation> continuation = ContinuationNow();
    frames_.ReleasePixels();  // a fine mesh takes as much memory as they
    const Mesh mesh = MeshNow(continuation);
    if (mesh.faces.empty()) {
      throw InputError(run_.folder.string() +
                       ": training left no surface; check poses and light, or train longer");
    }
    WriteMesh(run_.folder / "mesh.ply", mesh);
    if (options_.poses.refine) WriteFile(run_.folder / "pose.txt", PosesText(PosesNow()));
    return result_;
  }

 private:
  bool by_clock() const { return options_.schedule.seconds > 0; }

  // Another run's would be taken for this one's if this one fails or is killed before it has any.
  void RemoveEarlierRun() const {
    RemoveCheckpoints(run_.folder / "checkpoint");
    for (const char* name : {"mesh.ply", "pose.txt"}) std::filesystem::remove(run_.folder / name);
  }

  void Resume() {
    const auto file = run_.folder / "checkpoint";
    if (!ReadLatestCheckpoint(file, settings_, &trainer_.state()))
      return Say("no checkpoint in " + run_.folder.string() + ": starting afresh");
    saved_iteration_ = trainer_.state().iteration;
    ReadLog();
    Say("resuming at iteration " + std::to_string(trainer_.state().iteration));
  }

  // What was reported before the checkpoint; what came after it will be again.
  void ReadLog() {
    const auto file = run_.folder / "log.jsonl";
    if (!std::filesystem::exists(file)) return;
    std::istringstream lines(ReadFile(file));
    for (std::string line; std::getline(lines, line);) {
      const auto report = nlohmann::json::parse(line, nullptr, false);
      if (!report.is_object() || report.value("iteration", int64_t(0)) > trainer_.state().iteration) break;
      log_ += line + "\n";
    }
  }

  double ProgressNow(double seconds) const {
    const auto& schedule = options_.schedule;
    return by_clock()
               ? seconds / schedule.seconds
               : static_cast<double>(trainer_.state().iteration) / static_cast<double>(schedule.iterations);
  }

  void Optimise() {
    Progress progress("train");
    TrainState& state = trainer_.state();
    const auto start = Clock::now();
    const std::clock_t cpu_start = std::clock();
    const double seconds_before = state.seconds;
    const int64_t iterations_before = state.iteration;
    double last_report = 0, last_checkpoint = 0;
    double loss = 0, loss_weight = 0;  // since the last report
    while (true) {
      const double elapsed = SecondsSince(start);
      const double done = ProgressNow(seconds_before + elapsed);
      WriteMeshesDue(done);
      if (done >= 1) break;
      const StepReport step = trainer_.Step(done);
      if (by_clock()) state.seconds = seconds_before + SecondsSince(start);
      if (!step.skipped) {
        loss += step.loss.Sum();
        ++loss_weight;
        if (state.start_photometric == 0)
          state.start_photometric = state.mean_photometric = step.loss.photometric;
        state.mean_photometric = kMeanOver * state.mean_photometric + (1 - kMeanOver) * step.loss.photometric;
      }
      skipped_in_a_row_ = step.skipped ? skipped_in_a_row_ + 1 : 0;
      if (state.iteration >= kFewSteps) CheckSkipped();
      if (state.iteration % kLookEvery == 0) CheckHope();
      if (elapsed - last_report >= kReportSeconds && loss_weight > 0) {
        last_report = elapsed;
        Report(seconds_before + elapsed, step, loss / loss_weight);
        progress.Update(done, "loss " + std::to_string(loss / loss_weight));
        loss = loss_weight = 0;
      }
      result_.final_loss = step.loss.Sum();
      if (elapsed - last_checkpoint >= options_.schedule.checkpoint_seconds) {
        last_checkpoint = elapsed;
        Save();
      }
    }
    CheckSkipped();
    CheckResult();
    result_.seconds = seconds_before + SecondsSince(start);
    result_.cpu_seconds = static_cast<double>(std::clock() - cpu_start) / CLOCKS_PER_SEC;
    result_.iterations = state.iteration;
    result_.rays_per_second = static_cast<double>(state.iteration - iterations_before) *
                              options_.sampling.rays / std::max(SecondsSince(start), 1e-9);
    result_.stopped_by = by_clock() ? "seconds" : "iterations";
    result_.skipped_steps = state.skipped_steps;
  }

  std::optional<Continuation> ContinuationNow() {
    if (!options_.continue_lumen) return std::nullopt;
    return ContinueLumen(frames_, trainer_.field(), trainer_.Weights(), trainer_.origin(), options_.sampling,
                         run_.seed);
  }

  Mesh MeshNow(const std::optional<Continuation>& continuation) {
    ExtractOptions extract;
    extract.cell_mm = options_.extract_cell_mm;
    extract.inside = CameraPlaces();
    if (continuation) extract.continuation = &*continuation;
    Mesh mesh = ExtractMesh(trainer_.field(), trainer_.Weights(), trainer_.origin(), extract);
    if (!options_.poses.refine) return mesh;
    const Similarity back = FromRefined();
    for (Vec3d& vertex : mesh.vertices) vertex = Mapped(back, vertex);
    return mesh;
  }

  Similarity FromRefined() const {
    return BackToGiven(trainer_.Poses(), frames_.world_from_camera(),
                       {options_.poses.noise_mm, options_.poses.noise_rad});
  }

  std::vector<Pose> PosesNow() const {
    std::vector<Pose> poses = trainer_.Poses();
    const Similarity back = FromRefined();
    for (Pose& pose : poses) pose = Mapped(back, pose);
    return poses;
  }

  // A resumed run keeps what it had written.
  void WriteMeshesDue(double done) {
    for (; meshes_written_ < run_.meshes_at.size() && run_.meshes_at[meshes_written_] <= done;
         ++meshes_written_) {
      const auto file = MeshAtFile(run_.folder, run_.meshes_at[meshes_written_]);
      if (run_.resume && std::filesystem::exists(file)) continue;
      const Mesh mesh = MeshNow(ContinuationNow());
      if (!mesh.faces.empty()) WriteMesh(file, mesh);
    }
  }

  void Save() {
    WriteCheckpoint(run_.folder / "checkpoint", settings_, trainer_.state());
    saved_iteration_ = trainer_.state().iteration;
  }

  void CheckSkipped() const {
    const TrainState& state = trainer_.state();
    const bool too_many =
        static_cast<double>(state.skipped_steps) > kTooManySkipped * static_cast<double>(state.iteration);
    if (!too_many && skipped_in_a_row_ < kFewSteps) return;
    throw InputError(run_.folder.string() + ": training fails: " + std::to_string(state.skipped_steps) +
                     " of " + std::to_string(state.iteration) +
                     " steps had no finite gradient, the first at iteration " +
                     std::to_string(state.first_skipped_step) + "; lower schedule.learning_rate");
  }

  // Rays that some of the frames' pixels see by, the same all along.
  RayBatch<float> LookAround() const {
    RayBatch<float> batch;
    batch.rays.resize(kLookRays);
    const uint64_t key = RandomBits(run_.seed, 0x6c6f6f6bull);
    frames_.Draw(key, 0, trainer_.origin(), &batch.rays);
    return batch;
  }

  WallSeen Look() {
    RayBatch<float> rays = LookAround();
    return LookAtWall(trainer_.field(), trainer_.Weights(), options_.sampling, &rays);
  }

  [[noreturn]] void Fail(const std::string& why) const {
    throw InputError(fmt::format(
        "{}: training fails: after {} iterations {}; lower schedule.learning_rate, or check poses, gains and "
        "light",
        run_.folder.string(), trainer_.state().iteration, why));
  }

  // Asked at iterations that don't depend on the clock.
  void CheckHope() {
    const std::string why = WhyHopeless(Look());
    if (!why.empty()) Fail(why);
  }

  void CheckResult() {
    const WallSeen wall = Look();
    const TrainState& state = trainer_.state();
    const bool told = state.iteration >= kFewSteps && state.start_photometric > 0;
    const double left = told ? state.mean_photometric / state.start_photometric : 0;
    const std::string why = WhyUseless(wall, left), odd = WhatIsOdd(wall, left);
    if (!why.empty()) Fail(why);
    if (!odd.empty())
      Say(odd + "; lower schedule.learning_rate, train longer, or check poses, gains and light");
  }

  // Relative to the field's origin.
  std::vector<Vec3d> CameraPlaces() const {
    std::vector<Vec3d> places;
    for (const Pose& pose : trainer_.Poses()) places.push_back(pose.translation() - trainer_.origin());
    return places;
  }

  // What poses that are wrong, or a wall that was never seen, come to.
  void SayWhichCamerasAreOutside() {
    std::string outside;
    for (size_t i : PlacesOutside(trainer_.field(), trainer_.Weights(), CameraPlaces()))
      outside += (outside.empty() ? "" : ", ") + std::to_string(frames_.number(static_cast<int>(i)));
    if (outside.empty()) return;
    Say("the cameras of these frames lie outside the reconstructed lumen; check their poses: " + outside);
  }

  void Report(double seconds, const StepReport& step, double mean_loss) {
    const TrainState& state = trainer_.state();
    const nlohmann::ordered_json line = {{"seconds", seconds},
                                         {"iteration", state.iteration},
                                         {"loss", mean_loss},
                                         {"photometric", step.loss.photometric},
                                         {"eikonal", step.loss.eikonal},
                                         {"albedo", step.loss.albedo},
                                         {"ambient", step.loss.ambient},
                                         {"free_space", step.loss.free_space},
                                         {"s_per_mm", step.sharpness_per_mm},
                                         {"active_samples", step.loss.active_samples},
                                         {"skipped_steps", state.skipped_steps},
                                         {"first_skipped_step", state.first_skipped_step}};
    log_ += line.dump() + "\n";
    WriteFile(run_.folder / "log.jsonl", log_);
  }

  const TrainOptions options_;
  const TrainRun run_;
  TrainingFrames frames_;
  Trainer trainer_;
  std::string settings_;
  std::string log_;
  int64_t saved_iteration_ = -1;
  size_t meshes_written_ = 0;
  int64_t skipped_in_a_row_ = 0;
  TrainResult result_;
};

}  // namespace

std::filesystem::path MeshAtFile(const std::filesystem::path& folder, double part) {
  return folder / fmt::format("mesh_at_{:.3f}.ply", part);
}

TrainResult Train(const Sequence& sequence, const TrainOptions& options, const TrainRun& run) {
  return Run(sequence, options, run).Go();
}

}  // namespace lumen
