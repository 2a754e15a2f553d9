#include "tools/render_arguments.h"

#include <iostream>

#include "common/error.h"

namespace lumen {
namespace {

void ReadFrameRange(const std::string& text, RenderOptions* options) {
  if (text.empty()) return;
  int end = 0;
  char colon = 0;
  std::istringstream in(text);
  if (!(in >> options->first_frame >> colon >> end) || colon != ':' || !in.eof() ||
      end <= options->first_frame) {
    throw InputError("--frames " + text + ": give the first frame and the one after the last, as in 0:20");
  }
  options->last_frame = end;
}

// As a shell takes it for one word.
std::string Quoted(const std::string& word) {
  const bool plain = word.find_first_not_of(
                         "abcdefghijklmnopqrstuvwxyzABCDEFGHIJKLMNOPQRSTUVWXYZ0123456789"
                         "_-./=,:+%@") == std::string::npos;
  if (plain && !word.empty()) return word;
  std::string quoted = "'";
  for (const char c : word) quoted += c == '\'' ? std::string("'\\''") : std::string(1, c);
  return quoted + "'";
}

}  // namespace

std::string ReplayCommand(const RenderArguments& arguments, uint64_t seed, int frame) {
  std::string command = "lumen render " + Quoted(arguments.scene.string());
  for (const std::string& setting : arguments.settings) command += " --set " + Quoted(setting);
  return command + " --frames " + std::to_string(frame) + ":" + std::to_string(frame + 1) + " --seed " +
         std::to_string(seed) + " -o replay";
}

void AddRenderArguments(CLI::App* command, RenderArguments* arguments) {
  command->add_option("scene", arguments->scene, "scene file (see scenes/README.md)")->required();
  command->add_option("--frames", arguments->frames, "render frames A to B−1 only: A:B");
  command->add_option("--set", arguments->settings, "a key of the scene: path.to.key=value");
}

RenderResult RunRender(const RenderArguments& arguments, uint64_t seed, const std::filesystem::path& folder) {
  RenderOptions options;
  options.folder = folder;
  options.seed = seed;
  ReadFrameRange(arguments.frames, &options);
  const RenderResult result = Render(ReadScene(arguments.scene, arguments.settings, seed), options);
  if (result.not_finite > 0) {
    std::cerr << "lumen: " << result.not_finite
              << " samples were not finite and are left out; the first: " << result.first_not_finite
              << "; replay it with: " << ReplayCommand(arguments, seed, result.first_not_finite_frame)
              << "\n";
  }
  return result;
}

nlohmann::json ToJson(const RenderResult& result) {
  return {{"seconds", result.seconds},       {"frames", result.frames},
          {"samples", result.samples},       {"rays", result.rays},
          {"not_finite", result.not_finite}, {"first_not_finite", result.first_not_finite},
          {"effects", result.effects}};
}

}  // namespace lumen
