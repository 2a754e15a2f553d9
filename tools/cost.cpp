#include "tools/cost.h"

#include "tools/options.h"

namespace lumen {

void AddCost(CLI::App* app) {
  CLI::App* command = app->add_subcommand("cost", "what accuracy costs in time: a table and a plot");
  command->require_subcommand(1);
  AddCostRender(command);
  AddCostTrain(command);
}

}  // namespace lumen
