// What every subcommand has in common.
#pragma once

#include <CLI/CLI.hpp>
#include <cstdint>
#include <filesystem>
#include <functional>
#include <nlohmann/json.hpp>

namespace lumen {

struct CommonOptions {
  int threads = 0;  // 0 = all
  uint64_t seed = 0;
  bool quiet = false;
  std::filesystem::path json;  // where the result for programs goes; empty = nowhere
};

// Adds a subcommand with --threads, --seed, --quiet and --json. `run` is called when the command line names
// it; what it returns is written to --json. main() turns exceptions into exit codes.
CLI::App* AddSubcommand(CLI::App* app, const std::string& name, const std::string& description,
                        std::function<nlohmann::json(const CommonOptions&)> run);

// Each lives in its own file and adds itself to the program.
void AddRender(CLI::App* app);
void AddTrain(CLI::App* app);
void AddEvaluate(CLI::App* app);
void AddExport(CLI::App* app);
void AddImport(CLI::App* app);
void AddLoop(CLI::App* app);
void AddCheck(CLI::App* app);
void AddPhotometry(CLI::App* app);
void AddCalibrate(CLI::App* app);
void AddCost(CLI::App* app);
void AddBudget(CLI::App* app);
void AddTable(CLI::App* app);

}  // namespace lumen
