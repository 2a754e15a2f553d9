// A photometric fit for people and for programs.
#pragma once

#include <nlohmann/json_fwd.hpp>
#include <string>

#include "recon/photometry/photometry.h"

namespace lumen {

std::string ToTable(const Photometry& photometry, const Observations& observations);

nlohmann::json ToJson(const Photometry& photometry, const Observations& observations);

}  // namespace lumen
