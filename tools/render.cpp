#include <iostream>

#include "tools/options.h"
#include "tools/render_arguments.h"

namespace lumen {

void AddRender(CLI::App* app) {
  struct Arguments {
    RenderArguments render;
    std::filesystem::path folder;
  };
  auto arguments = std::make_shared<Arguments>();
  auto* command = AddSubcommand(app, "render", "renders a scene to a sequence folder with its ground truth",
                                [arguments](const CommonOptions& common) {
                                  const RenderResult result =
                                      RunRender(arguments->render, common.seed, arguments->folder);
                                  std::cout << "rendered " << result.frames << " frames in " << result.seconds
                                            << " s to " << arguments->folder.string() << "\n";
                                  return ToJson(result);
                                });
  AddRenderArguments(command, &arguments->render);
  command->add_option("-o", arguments->folder, "folder of the sequence")->required();
}

}  // namespace lumen
