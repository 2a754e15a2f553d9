#include "common/error.h"
#include "tools/options.h"

namespace lumen {

void AddLoop(CLI::App* app) {
  AddSubcommand(app, "loop", "renders, trains and evaluates a scene",
                [](const CommonOptions&) -> nlohmann::json { throw InputError("loop: not built yet"); });
}

}  // namespace lumen
