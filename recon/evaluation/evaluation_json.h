// The evaluation for programs: FORMATS' JSON.
#pragma once

#include <nlohmann/json_fwd.hpp>

#include "recon/evaluation/evaluate.h"

namespace lumen {

// Figures that don't exist, for want of a vertex or a point, are null.
nlohmann::json ToJson(const Evaluation& evaluation);

}  // namespace lumen
