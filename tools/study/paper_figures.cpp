#include "tools/study/paper_figures.h"

#include <algorithm>

namespace lumen {

// MedAE, MAE, RMSE; surveyed, then extended.
const std::vector<PaperFigures>& PaperTable() {
  static const std::vector<PaperFigures> table = {
      {"cecum_t1_a", "C1a", {0.95, 1.48, 2.01}, {0.83, 1.26, 1.72}},
      {"cecum_t1_b", "C1b", {4.85, 5.11, 5.63}, {4.89, 5.10, 5.60}},
      {"cecum_t2_a", "C2a", {1.40, 1.54, 1.87}, {1.41, 1.56, 1.90}},
      {"cecum_t2_b", "C2b", {3.26, 3.65, 4.39}, {3.32, 3.70, 4.42}},
      {"cecum_t2_c", "C2c", {2.57, 3.00, 3.74}, {2.54, 3.01, 3.77}},
      {"cecum_t3_a", "C3a", {1.12, 2.54, 5.49}, {1.27, 3.83, 7.96}},
      {"cecum_t4_a", "C4a", {1.90, 2.14, 2.92}, {1.91, 2.18, 2.95}},
      {"cecum_t4_b", "C4b", {1.41, 1.63, 2.10}, {1.45, 1.72, 2.20}},
      {"desc_t4_a", "D4a", {2.66, 3.26, 4.08}, {4.50, 6.61, 9.32}},
      {"sigmoid_t1_a", "S1a", {4.23, 4.33, 4.96}, {4.01, 4.19, 4.87}},
      {"sigmoid_t2_a", "S2a", {1.19, 1.89, 2.78}, {1.40, 2.36, 3.96}},
      {"sigmoid_t3_a", "S3a", {2.57, 2.68, 3.18}, {2.87, 3.27, 4.04}},
      {"sigmoid_t3_b", "S3b", {3.63, 4.16, 4.81}, {3.54, 4.64, 6.10}},
      {"trans_t1_a", "T1a", {3.43, 3.47, 4.07}, {3.38, 3.31, 3.86}},
      {"trans_t1_b", "T1b", {2.33, 2.72, 3.34}, {2.69, 3.21, 3.96}},
      {"trans_t2_a", "T2a", {2.24, 2.28, 2.58}, {2.19, 2.22, 2.55}},
      {"trans_t2_b", "T2b", {2.16, 2.30, 2.70}, {2.12, 2.28, 2.69}},
      {"trans_t2_c", "T2c", {5.07, 5.45, 6.48}, {4.44, 5.36, 6.78}},
      {"trans_t3_a", "T3a", {6.39, 8.65, 10.7}, {6.54, 8.10, 9.94}},
      {"trans_t3_b", "T3b", {11.0, 12.1, 14.4}, {13.6, 14.1, 15.9}},
      {"trans_t4_a", "T4a", {1.15, 2.31, 3.79}, {1.29, 2.22, 3.32}},
      {"trans_t4_b", "T4b", {1.75, 6.70, 11.3}, {8.00, 10.4, 13.9}},
  };
  return table;
}

const std::vector<PaperFigures>& PaperTableOfNeus() {
  static const std::vector<PaperFigures> table = {
      {"cecum_t1_a", "C1a", {4.53, 5.07, 6.40}, {4.68, 6.24, 8.77}},
      {"cecum_t4_b", "C4b", {10.6, 10.6, 11.6}, {5.35, 6.74, 8.56}},
  };
  return table;
}

const PaperFigures* FindPaperFigures(const std::vector<PaperFigures>& table, const std::string& sequence) {
  const auto row = std::ranges::find(table, sequence, &PaperFigures::sequence);
  return row == table.end() ? nullptr : &*row;
}

}  // namespace lumen
