#include "tools/options.h"

#include "common/files.h"
#include "common/parallel.h"
#include "common/progress.h"

namespace lumen {

CLI::App* AddSubcommand(CLI::App* app, const std::string& name, const std::string& description,
                        std::function<nlohmann::json(const CommonOptions&)> run) {
  auto* command = app->add_subcommand(name, description);
  auto options = std::make_shared<CommonOptions>();
  command->add_option("--threads", options->threads, "threads to use (default: all)")
      ->check(CLI::Range(0, 4096));
  command->add_option("--seed", options->seed, "seed of every random number (default: 0)");
  command->add_flag("--quiet", options->quiet, "say nothing but results and errors");
  command->add_option("--json", options->json, "write the result for programs to this file");
  command->callback([options, run = std::move(run)] {
    SetThreadCount(options->threads);
    SetQuiet(options->quiet);
    const nlohmann::json result = run(*options);
    if (!options->json.empty()) WriteFile(options->json, result.dump(2) + "\n");
  });
  return command;
}

}  // namespace lumen
