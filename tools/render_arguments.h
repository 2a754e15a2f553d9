// The command line's say in rendering, for the subcommands that render.
#pragma once

#include <CLI/CLI.hpp>
#include <filesystem>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "sim/render.h"

namespace lumen {

struct RenderArguments {
  std::filesystem::path scene;
  std::string frames;  // "A:B"
  std::vector<std::string> settings;
};

// Adds SCENE, --frames and --set.
void AddRenderArguments(CLI::App* command, RenderArguments* arguments);

// The command that renders one of the frames again, the very same numbers, with every setting.
std::string ReplayCommand(const RenderArguments& arguments, uint64_t seed, int frame);

// Reads the scene, renders it into `folder` and says on stderr what was not finite and how to replay it.
RenderResult RunRender(const RenderArguments& arguments, uint64_t seed, const std::filesystem::path& folder);

nlohmann::json ToJson(const RenderResult& result);

}  // namespace lumen
