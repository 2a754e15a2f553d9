#include "common/error.h"
#include "tools/options.h"

namespace lumen {

void AddRender(CLI::App* app) {
  AddSubcommand(app, "render", "renders a scene to a sequence folder with its ground truth",
                [](const CommonOptions&) -> nlohmann::json { throw InputError("render: not built yet"); });
}

}  // namespace lumen
