// The subcommands of `lumen cost`, each in its own file.
#pragma once

#include <CLI/CLI.hpp>

namespace lumen {

void AddCostRender(CLI::App* cost);
void AddCostTrain(CLI::App* cost);

}  // namespace lumen
