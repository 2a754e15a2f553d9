#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "common/plot.h"
#include "tools/study/budget_table.h"

namespace lumen {
namespace {

constexpr double kMargin = 16, kTitle = 44, kRow = 34, kBar = 11, kText = 13, kPanel = 430, kNote = 112;
constexpr Rgb8 kInk = {40, 40, 40}, kFaint = {225, 225, 225}, kColors[] = {{221, 132, 82}, {68, 119, 170}};

using Region = BudgetFigure BudgetCell::*;

class BudgetChart {
 public:
  BudgetChart(const Budget& budget, const std::string& title) : budget_(budget) {
    for (const BudgetRow& row : budget.rows) {
      names_ = std::max(names_, TextWidth(row.name, kText));
      for (const BudgetCell& cell : row.cells) {
        for (const BudgetFigure& figure : {cell.surveyed, cell.extended}) {
          if (std::isfinite(figure.mae_mm)) high_ = std::max(high_, figure.mae_mm + figure.spread_mm);
        }
      }
    }
    if (high_ == 0) high_ = 1;
    left_ = kMargin + names_ + 12;
    page_.width = left_ + 2 * kPanel + kMargin;
    page_.height = kTitle + 26 + kRow * static_cast<double>(budget.rows.size()) + kMargin;
    Text({kMargin, 24}, title, kText + 2, TextAlign::kLeft);
  }

  Drawing Draw() {
    Names();
    Panel(left_, "Surveyed: mean absolute error, mm", &BudgetCell::surveyed);
    Panel(left_ + kPanel, "Extended: mean absolute error, mm", &BudgetCell::extended);
    Legend();
    return page_;
  }

 private:
  void Text(const Vec2d& at, const std::string& text, double size, TextAlign align) {
    page_.shapes.push_back(DrawnText{at, text, size, kInk, align});
  }

  void Box(const Vec2d& low, const Vec2d& high, const Rgb8& color) {
    page_.shapes.emplace_back(std::in_place_type<DrawnBox>, low, high, color);
  }

  static double Top(size_t row) { return kTitle + 26 + kRow * static_cast<double>(row); }

  void Names() {
    for (size_t i = 0; i < budget_.rows.size(); ++i) {
      Text({left_ - 10, Top(i) + kRow / 2 + kText / 3}, budget_.rows[i].name, kText, TextAlign::kRight);
      // Other kinds of variants stand apart.
      if (i == 0 || budget_.rows[i].kind == budget_.rows[i - 1].kind) continue;
      page_.shapes.push_back(
          DrawnLine{{{kMargin, Top(i)}, {page_.width - kMargin, Top(i)}}, kFaint, 1, false});
    }
  }

  void Panel(double left, const std::string& title, Region region) {
    const double width = kPanel - kNote;
    const auto x = [&](double mm) { return left + mm / high_ * width; };
    Text({left, kTitle + 16}, title, kText, TextAlign::kLeft);
    const double bottom = Top(budget_.rows.size());
    for (size_t model = 0; model < budget_.models.size(); ++model) {
      const double ideal = (budget_.rows.front().cells[model].*region).mae_mm;
      if (!std::isfinite(ideal)) continue;
      page_.shapes.push_back(DrawnLine{{{x(ideal), Top(0)}, {x(ideal), bottom}}, kColors[model], 1, true});
    }
    for (size_t i = 0; i < budget_.rows.size(); ++i) {
      for (size_t model = 0; model < budget_.models.size(); ++model) {
        Bar(left, x, i, model, region);
      }
    }
    page_.shapes.push_back(DrawnLine{{{left, Top(0)}, {left, bottom}}, kInk, 1, false});
  }

  template <class X>
  void Bar(double left, const X& x, size_t i, size_t model, Region region) {
    const BudgetRow& row = budget_.rows[i];
    const BudgetFigure& figure = row.cells[model].*region;
    const double y = Top(i) + kRow / 2 + (static_cast<double>(model) - 0.5) * (kBar + 2);
    if (!std::isfinite(figure.mae_mm)) {
      Text({left + 6, y + kText / 3}, "no surface", kText - 2, TextAlign::kLeft);
      return;
    }
    Box({left, y - kBar / 2}, {x(figure.mae_mm), y + kBar / 2}, kColors[model]);
    const double low = x(std::max(0.0, figure.mae_mm - figure.spread_mm)),
                 high = x(figure.mae_mm + figure.spread_mm);
    page_.shapes.push_back(DrawnLine{{{low, y}, {high, y}}, kInk, 1.5, false});
    const double over = figure.mae_mm - (budget_.rows.front().cells[model].*region).mae_mm;
    std::string note = fmt::format("{:.2f}", figure.mae_mm);
    if (i > 0 && std::isfinite(over)) note += fmt::format(" ({:+.2f})", over);
    Text({high + 6, y + kText / 3}, note, kText - 2, TextAlign::kLeft);
  }

  void Legend() {
    double x = page_.width - kMargin;
    for (size_t model = budget_.models.size(); model-- > 0;) {
      const std::string name = "model of light: " + budget_.models[model];
      x -= TextWidth(name, kText) + 6;
      Text({x, 24}, name, kText, TextAlign::kLeft);
      Box({x - 18, 14}, {x - 6, 25}, kColors[model]);
      x -= 40;
    }
  }

  const Budget& budget_;
  Drawing page_;
  double names_ = 0, high_ = 0, left_ = 0;
};

}  // namespace

Drawing DrawBudget(const Budget& budget, const std::string& title) {
  return BudgetChart(budget, title).Draw();
}

}  // namespace lumen
