#include "common/error.h"
#include "tools/options.h"

namespace lumen {

void AddTrain(CLI::App* app) {
  AddSubcommand(app, "train", "reconstructs a sequence",
                [](const CommonOptions&) -> nlohmann::json { throw InputError("train: not built yet"); });
}

}  // namespace lumen
