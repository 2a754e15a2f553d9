// The error budget: what each physical effect costs a reconstruction, in millimetres.
#pragma once

#include <cstdint>
#include <filesystem>
#include <string>
#include <vector>

#include "recon/training/options.h"
#include "sim/scene.h"
#include "tools/study/budget_effects.h"

namespace lumen {

struct BudgetOptions {
  TrainOptions train;
  int seeds = 3;        // runs of every variant
  bool all_but = true;  // also leave out one effect at a time
  uint64_t seed = 0;    // of the frames; of the first run, the others' follow
  // Where frames and runs are made and what has been measured stands (measured.json): a run that is in there
  // isn't made again.
  std::filesystem::path folder;
  // What a run depends on besides training's options and the effects: the scene's origin. Runs of another are
  // forgotten.
  std::string subject;
};

// A region's mean absolute error: the median over the seeds, and half their range. NaN where a run leaves no
// surface.
struct BudgetFigure {
  double mae_mm = 0, spread_mm = 0;
};

struct BudgetCell {
  BudgetFigure surveyed, extended;
};

struct BudgetRow {
  VariantKind kind = VariantKind::kIdeal;
  std::string name;
  std::vector<BudgetCell> cells;  // one a model
};

struct Budget {
  std::vector<std::string> models;  // of light, that the reconstructor has
  std::vector<BudgetRow> rows;      // the ideal first
};

// Renders, reconstructs and evaluates every variant with two models of light: the paper's (one source at the
// camera as strong as all, no light from wall to wall) and that of options.train with the light as it is.
// Frames that training takes are rendered, once for all variants that show the same; what is surveyed follows
// from the poses of all. The scene's gain must be automatic (SetBudgetExposure).
Budget MeasureBudget(const Scene& scene, const std::vector<BudgetEffect>& effects,
                     const BudgetOptions& options);

}  // namespace lumen
