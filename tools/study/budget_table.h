// The error budget for people and for programs.
#pragma once

#include <nlohmann/json.hpp>
#include <string>

#include "common/drawing.h"
#include "tools/study/budget.h"

namespace lumen {

// mae_mm over that of the ideal variant with the same model.
struct BudgetDifference {
  double surveyed_mm = 0, extended_mm = 0;
};
BudgetDifference DifferenceToIdeal(const Budget& budget, const BudgetRow& row, size_t model);

// A line a variant: errors with their spread over seeds and the difference to the ideal, for both models.
std::string ToTable(const Budget& budget);
// A line a variant and model.
std::string ToCsv(const Budget& budget);
nlohmann::json ToJson(const Budget& budget);

// Bars of both regions side by side, one a variant and model, a dashed line at the ideal's.
Drawing DrawBudget(const Budget& budget, const std::string& title);

}  // namespace lumen
