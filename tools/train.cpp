#include <fmt/core.h>

#include <iostream>

#include "recon/training/estimate.h"
#include "tools/options.h"
#include "tools/sequence_arguments.h"
#include "tools/train_arguments.h"

namespace lumen {
namespace {

// "5.2 s", "3.1 h", "17.4 days".
std::string Duration(double seconds) {
  if (seconds < 120) return fmt::format("{:.3g} s", seconds);
  if (seconds < 7200) return fmt::format("{:.3g} min", seconds / 60);
  if (seconds < 172800) return fmt::format("{:.3g} h", seconds / 3600);
  return fmt::format("{:.3g} days", seconds / 86400);
}

nlohmann::json Estimate(const Sequence& sequence, const TrainOptions& options, uint64_t seed) {
  EstimateOptions how;
  how.seed = seed;
  const TrainEstimate estimate = EstimateTraining(sequence, options, how);
  constexpr double kMegabyte = 1e6;
  fmt::print("parameters     {} ({} of them the networks')\n", estimate.parameters,
             estimate.network_parameters);
  fmt::print("an iteration   {} rays × {} samples = {}\n", options.sampling.rays, options.sampling.PerRay(),
             estimate.samples_per_iteration);
  fmt::print("memory         {:.0f} MB, of which {:.1f} MB parameters, gradient and moments; {} frames\n",
             static_cast<double>(estimate.resident_bytes) / kMegabyte,
             static_cast<double>(estimate.state_bytes) / kMegabyte, estimate.frames);
  fmt::print("seconds        {:.4g} an iteration (median of {})\n", estimate.seconds_per_iteration,
             estimate.measured_iterations);
  fmt::print("goes on       ");
  nlohmann::json phases;
  for (size_t i = 0; i < kPhaseNames.size(); ++i) {
    fmt::print(" {} {:.3g}", kPhaseNames[i], 1e3 * estimate.phase_seconds[i]);
    phases[kPhaseNames[i]] = estimate.phase_seconds[i];
  }
  fmt::print(" ms, all threads\n");
  fmt::print("the whole run  {} iterations, {}\n", estimate.iterations, Duration(estimate.seconds));
  return {{"parameters", estimate.parameters},
          {"network_parameters", estimate.network_parameters},
          {"frames", estimate.frames},
          {"samples_per_iteration", estimate.samples_per_iteration},
          {"state_bytes", estimate.state_bytes},
          {"resident_bytes", estimate.resident_bytes},
          {"measured_iterations", estimate.measured_iterations},
          {"seconds_per_iteration", estimate.seconds_per_iteration},
          {"phase_seconds", phases},
          {"iterations", estimate.iterations},
          {"seconds", estimate.seconds}};
}

}  // namespace

void AddTrain(CLI::App* app) {
  struct Arguments {
    SequenceArguments sequence;
    std::filesystem::path run;
    TrainArguments train;
    bool resume = false, dry_run = false;
  };
  auto arguments = std::make_shared<Arguments>();
  const auto run_command = [arguments](const CommonOptions& common) -> nlohmann::json {
    const TrainOptions options = ReadTrainOptions(arguments->train.preset, arguments->train.Settings());
    if (arguments->dry_run) return Estimate(ReadSequence(arguments->sequence), options, common.seed);
    if (arguments->run.empty()) throw CLI::RequiredError("-o (or --dry-run)");
    TrainRun run;
    run.folder = arguments->run;
    run.seed = common.seed;
    run.resume = arguments->resume;
    const TrainResult result = Train(ReadSequence(arguments->sequence), options, run);
    std::cout << "trained " << result.iterations << " iterations in " << result.seconds << " s; the mesh is "
              << (run.folder / "mesh.ply").string() << "\n";
    return ToJson(result);
  };
  auto* command = AddSubcommand(app, "train", "reconstructs a sequence", [=](const CommonOptions& common) {
    return OfferingToSkip([&] { return run_command(common); });
  });
  AddSequenceArguments(command, &arguments->sequence, "sequence");
  command->add_option("-o", arguments->run, "folder of the run; a dry run needs none");
  AddTrainArguments(command, &arguments->train);
  command->add_flag("--resume", arguments->resume, "go on from the folder's checkpoint");
  command->add_flag("--dry-run", arguments->dry_run,
                    "measure some iterations and say what the whole run would cost here; write nothing");
}

}  // namespace lumen
