#include "tools/study/budget_table.h"

#include <fmt/format.h>

#include <cmath>

namespace lumen {
namespace {

constexpr const char* kKindNames[] = {"ideal", "one", "all", "all_but"};

std::string FigureText(const BudgetFigure& figure, double difference_mm, bool is_ideal) {
  if (!std::isfinite(figure.mae_mm)) return "-";
  std::string text = fmt::format("{:.2f} ± {:.2f}", figure.mae_mm, figure.spread_mm);
  if (!is_ideal && std::isfinite(difference_mm)) text += fmt::format("  {:+.2f}", difference_mm);
  return text;
}

nlohmann::json NumberOrNull(double value) {
  return std::isfinite(value) ? nlohmann::json(value) : nlohmann::json();
}

}  // namespace

BudgetDifference DifferenceToIdeal(const Budget& budget, const BudgetRow& row, size_t model) {
  const BudgetCell &own = row.cells[model], &ideal = budget.rows.front().cells[model];
  return {own.surveyed.mae_mm - ideal.surveyed.mae_mm, own.extended.mae_mm - ideal.extended.mae_mm};
}

std::string ToTable(const Budget& budget) {
  std::string head = fmt::format("{:<30}", "mm, ± over seeds, over ideal");
  for (const std::string& model : budget.models) {
    head += fmt::format("{:<22}{:<22}", model + ": surveyed", "extended");
  }
  std::string table = head + "\n";
  for (const BudgetRow& row : budget.rows) {
    const bool is_ideal = row.kind == VariantKind::kIdeal;
    table += fmt::format("{:<30}", row.name);
    for (size_t model = 0; model < row.cells.size(); ++model) {
      const BudgetDifference over = DifferenceToIdeal(budget, row, model);
      table += fmt::format("{:<22}{:<22}", FigureText(row.cells[model].surveyed, over.surveyed_mm, is_ideal),
                           FigureText(row.cells[model].extended, over.extended_mm, is_ideal));
    }
    table += "\n";
  }
  return table;
}

std::string ToCsv(const Budget& budget) {
  std::string csv =
      "variant,kind,model,surveyed_mae_mm,surveyed_spread_mm,surveyed_over_ideal_mm,extended_mae_mm,"
      "extended_spread_mm,extended_over_ideal_mm\n";
  for (const BudgetRow& row : budget.rows) {
    for (size_t model = 0; model < row.cells.size(); ++model) {
      const BudgetCell& cell = row.cells[model];
      const BudgetDifference over = DifferenceToIdeal(budget, row, model);
      csv += fmt::format("{},{},{},{:.6g},{:.3g},{:.6g},{:.6g},{:.3g},{:.6g}\n", row.name,
                         kKindNames[int(row.kind)], budget.models[model], cell.surveyed.mae_mm,
                         cell.surveyed.spread_mm, over.surveyed_mm, cell.extended.mae_mm,
                         cell.extended.spread_mm, over.extended_mm);
    }
  }
  return csv;
}

nlohmann::json ToJson(const Budget& budget) {
  nlohmann::json variants = nlohmann::json::array();
  for (const BudgetRow& row : budget.rows) {
    for (size_t model = 0; model < row.cells.size(); ++model) {
      const BudgetCell& cell = row.cells[model];
      const BudgetDifference over = DifferenceToIdeal(budget, row, model);
      variants.push_back({{"variant", row.name},
                          {"kind", kKindNames[int(row.kind)]},
                          {"model", budget.models[model]},
                          {"surveyed_mae_mm", NumberOrNull(cell.surveyed.mae_mm)},
                          {"surveyed_spread_mm", NumberOrNull(cell.surveyed.spread_mm)},
                          {"surveyed_over_ideal_mm", NumberOrNull(over.surveyed_mm)},
                          {"extended_mae_mm", NumberOrNull(cell.extended.mae_mm)},
                          {"extended_spread_mm", NumberOrNull(cell.extended.spread_mm)},
                          {"extended_over_ideal_mm", NumberOrNull(over.extended_mm)}});
    }
  }
  return {{"variants", variants}};
}

}  // namespace lumen
