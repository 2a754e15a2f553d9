#include "common/error.h"
#include "tools/options.h"

namespace lumen {

void AddCheck(CLI::App* app) {
  AddSubcommand(app, "check", "says what is wrong with a sequence, a mesh or a scene",
                [](const CommonOptions&) -> nlohmann::json { throw InputError("check: not built yet"); });
}

}  // namespace lumen
