// The table for people, for spreadsheets, for papers and for programs.
#pragma once

#include <nlohmann/json.hpp>
#include <string>

#include "tools/study/table.h"

namespace lumen {

// Figures of each sequence with the paper's beside them, means over those of 1 cm and more and over the short
// ones; the paper's means are over the same sequences. All but ToJson say that the data aren't the same.
std::string ToText(const Table& table);
std::string ToCsv(const Table& table);
std::string ToLatex(const Table& table);  // a tabular; needs no package
nlohmann::json ToJson(const Table& table);

}  // namespace lumen
