#include "recon/training/train.h"

#include <chrono>
#include <cmath>
#include <ctime>
#include <nlohmann/json.hpp>

#include "common/error.h"
#include "common/files.h"
#include "common/mesh.h"
#include "common/progress.h"
#include "recon/surface/extract.h"
#include "recon/training/checkpoint.h"
#include "recon/training/trainer.h"

namespace lumen {
namespace {

using Clock = std::chrono::steady_clock;

constexpr double kReportSeconds = 1;

// The share of steps without a finite gradient at which a run has failed.
constexpr double kTooManySkipped = 0.5;

double SecondsSince(Clock::time_point start) {
  return std::chrono::duration<double>(Clock::now() - start).count();
}

class Run {
 public:
  Run(const Sequence& sequence, const TrainOptions& options, const TrainRun& run)
      : options_(options),
        run_(run),
        frames_(sequence, options.frames, options.field.reflectance != Reflectance::kUnlit),
        trainer_(frames_, options, run.seed),
        settings_("seed = " + std::to_string(run.seed) + "\n" + FormatTrainOptions(options)) {}

  TrainResult Go() {
    CreateFolder(run_.folder);
    Resume();
    WriteFile(run_.folder / "config.toml", settings_);
    Optimise();
    WriteCheckpoint(run_.folder / "checkpoint", settings_, trainer_.state());
    const Mesh mesh =
        ExtractMesh(trainer_.field(), trainer_.Weights(), trainer_.origin(), {options_.extract_cell_mm});
    if (mesh.faces.empty()) {
      throw InputError(run_.folder.string() +
                       ": training left no surface; check poses and light, or train longer");
    }
    WriteMesh(run_.folder / "mesh.ply", mesh);
    return result_;
  }

 private:
  bool by_clock() const { return options_.schedule.seconds > 0; }

  void Resume() {
    const auto file = run_.folder / "checkpoint";
    if (!run_.resume) return;
    if (!std::filesystem::exists(file))
      return Say("no checkpoint in " + run_.folder.string() + ": starting afresh");
    ReadCheckpoint(file, settings_, &trainer_.state());
    if (std::filesystem::exists(run_.folder / "log.jsonl")) log_ = ReadFile(run_.folder / "log.jsonl");
    Say("resuming at iteration " + std::to_string(trainer_.state().iteration));
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
      if (done >= 1) break;
      const StepReport step = trainer_.Step(done);
      if (by_clock()) state.seconds = seconds_before + SecondsSince(start);
      if (!step.skipped) {
        loss += step.loss.Sum();
        ++loss_weight;
      }
      CheckSkipped();
      if (elapsed - last_report >= kReportSeconds) {
        last_report = elapsed;
        Report(seconds_before + elapsed, step, loss / loss_weight);
        progress.Update(done, "loss " + std::to_string(loss / loss_weight));
        loss = loss_weight = 0;
      }
      result_.final_loss = step.loss.Sum();
      if (elapsed - last_checkpoint >= options_.schedule.checkpoint_seconds) {
        last_checkpoint = elapsed;
        WriteCheckpoint(run_.folder / "checkpoint", settings_, state);
      }
    }
    result_.seconds = seconds_before + SecondsSince(start);
    result_.cpu_seconds = static_cast<double>(std::clock() - cpu_start) / CLOCKS_PER_SEC;
    result_.iterations = state.iteration;
    result_.rays_per_second = static_cast<double>(state.iteration - iterations_before) *
                              options_.sampling.rays / std::max(SecondsSince(start), 1e-9);
    result_.stopped_by = by_clock() ? "seconds" : "iterations";
    result_.skipped_steps = state.skipped_steps;
  }

  void CheckSkipped() const {
    const TrainState& state = trainer_.state();
    if (state.iteration < 100 ||
        state.skipped_steps <= kTooManySkipped * static_cast<double>(state.iteration))
      return;
    throw InputError(run_.folder.string() + ": training fails: " + std::to_string(state.skipped_steps) +
                     " of " + std::to_string(state.iteration) +
                     " steps had no finite gradient, the first at iteration " +
                     std::to_string(state.first_skipped_step) + "; lower schedule.learning_rate");
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
  TrainResult result_;
};

}  // namespace

TrainResult Train(const Sequence& sequence, const TrainOptions& options, const TrainRun& run) {
  return Run(sequence, options, run).Go();
}

}  // namespace lumen
