#include "tools/train_arguments.h"

namespace lumen {

std::vector<std::string> TrainArguments::Settings() const {
  std::vector<std::string> all = settings;
  if (seconds > 0) all.push_back("schedule.seconds=" + std::to_string(seconds));
  if (iterations > 0) {
    all.push_back("schedule.iterations=" + std::to_string(iterations));
    all.push_back("schedule.seconds=0");
  }
  if (frames > 0) all.push_back("frames=" + std::to_string(frames));
  return all;
}

void AddTrainArguments(CLI::App* command, TrainArguments* arguments, const std::string& set_name) {
  std::string names;
  for (const std::string& name : PresetNames()) names += (names.empty() ? "" : ", ") + name;
  command->add_option("--preset", arguments->preset, "set of options: " + names)->capture_default_str();
  auto* seconds =
      command->add_option("--seconds", arguments->seconds, "train for so long")->check(CLI::PositiveNumber);
  command->add_option("--iterations", arguments->iterations, "train for so many steps")
      ->check(CLI::PositiveNumber)
      ->excludes(seconds);
  command->add_option("--frames", arguments->frames, "frames to train on, taken uniformly")
      ->check(CLI::PositiveNumber);
  command->add_option(set_name, arguments->settings, "an option of training: path.to.key=value");
}

nlohmann::json ToJson(const TrainResult& result) {
  return {{"seconds", result.seconds},
          {"cpu_seconds", result.cpu_seconds},
          {"iterations", result.iterations},
          {"rays_per_second", result.rays_per_second},
          {"final_loss", result.final_loss},
          {"stopped_by", result.stopped_by},
          {"skipped_steps", result.skipped_steps}};
}

}  // namespace lumen
