// The command line's say in training, for the subcommands that train.
#pragma once

#include <CLI/CLI.hpp>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "recon/training/train.h"

namespace lumen {

struct TrainArguments {
  std::string preset = "fast";
  double seconds = 0;
  int64_t iterations = 0;
  int frames = 0;
  std::vector<std::string> settings;

  // All of it as settings of ReadTrainOptions.
  std::vector<std::string> Settings() const;
};

// Adds --preset, --seconds, --iterations, --frames and --set (as `set_name`).
void AddTrainArguments(CLI::App* command, TrainArguments* arguments, const std::string& set_name = "--set");

nlohmann::json ToJson(const TrainResult& result);

}  // namespace lumen
