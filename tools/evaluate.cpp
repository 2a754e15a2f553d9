#include "common/error.h"
#include "tools/options.h"

namespace lumen {

void AddEvaluate(CLI::App* app) {
  AddSubcommand(app, "evaluate", "measures a reconstruction against the truth",
                [](const CommonOptions&) -> nlohmann::json { throw InputError("evaluate: not built yet"); });
}

}  // namespace lumen
