#include "tools/study/budget.h"

#include <fmt/format.h>

#include <cmath>
#include <limits>
#include <map>

#include "common/error.h"
#include "common/files.h"
#include "common/progress.h"
#include "common/statistics.h"
#include "recon/evaluation/evaluate.h"
#include "recon/training/train.h"
#include "sim/cost/knobs.h"
#include "sim/render.h"
#include "tools/study/run_record.h"

namespace lumen {
namespace {

namespace fs = std::filesystem;

// Completeness doesn't count here.
constexpr int kCompletenessPoints = 100;
constexpr double kUnknown = std::numeric_limits<double>::quiet_NaN();

struct LightModel {
  std::string name;
  TrainOptions options;
  bool light_at_camera;
};

std::vector<LightModel> ModelsOf(const TrainOptions& own) {
  LightModel paper{"paper", own, true};
  paper.options.field.interreflection = Interreflection::kNone;
  return {paper, {"ours", own, false}};
}

// A variant's run.
struct Run {
  size_t variant, model;
  uint64_t seed;
  std::string key;
};

class BudgetMeasurement {
 public:
  BudgetMeasurement(const Scene& scene, const std::vector<BudgetEffect>& effects,
                    const BudgetOptions& options)
      : scene_(scene),
        effects_(effects),
        options_(options),
        variants_(BudgetVariantsOf(effects, options.all_but)),
        models_(ModelsOf(options.train)),
        record_((CreateFolder(options.folder), options.folder / "measured.json"), options.subject) {
    // Evaluation takes the mesh: no picture of the truth is looked at.
    scene_.truth = {false, {}};
  }

  Budget Measure() {
    // Variants with the same frames, rendered once.
    std::map<std::vector<int>, std::vector<Run>> missing;
    for (const Run& run : AllRuns()) {
      ++runs_;
      if (record_.Find(run.key)) {
        ++runs_done_;
      } else {
        missing[RenderedEffects(variants_[run.variant])].push_back(run);
      }
    }
    for (const auto& [rendered, runs] : missing) MeasureRuns(rendered, runs);
    fs::remove_all(options_.folder / "sequence");
    return Summary();
  }

 private:
  std::vector<Run> AllRuns() const {
    std::vector<Run> runs;
    for (size_t variant = 0; variant < variants_.size(); ++variant) {
      for (size_t model = 0; model < models_.size(); ++model) {
        for (int k = 0; k < options_.seeds; ++k) {
          const uint64_t seed = options_.seed + static_cast<uint64_t>(k);
          runs.push_back({variant, model, seed, KeyOf(variant, model, seed)});
        }
      }
    }
    return runs;
  }

  // Everything that a run follows from but the subject: effects by name, so that the record holds whichever
  // of them are asked for.
  std::string KeyOf(size_t variant, size_t model, uint64_t seed) const {
    std::string key = "effects =";
    for (size_t i = 0; i < effects_.size(); ++i) {
      const int step = variants_[variant].steps[i];
      if (step == 0) continue;
      key += " " + effects_[i].name;
      if (!effects_[i].steps.empty()) key += ":" + effects_[i].steps[step - 1];
    }
    return key + fmt::format("\nmodel = {}\nseed = {}\n", models_[model].name, seed) +
           FormatTrainOptions(TrainOptionsOf(variant, model));
  }

  TrainOptions TrainOptionsOf(size_t variant, size_t model) const {
    TrainOptions options = models_[model].options;
    for (size_t i = 0; i < effects_.size(); ++i) {
      if (variants_[variant].steps[i] > 0 && effects_[i].restrict) effects_[i].restrict(&options);
    }
    return options;
  }

  // As much of each effect as the frames show.
  std::vector<int> RenderedEffects(const BudgetVariant& variant) const {
    std::vector<int> rendered = variant.steps;
    for (size_t i = 0; i < effects_.size(); ++i) {
      if (!effects_[i].reduce_to) rendered[i] = 0;
    }
    return rendered;
  }

  Sequence RenderWith(const std::vector<int>& rendered) const {
    Scene scene = scene_;
    for (size_t i = 0; i < effects_.size(); ++i) {
      if (effects_[i].reduce_to && rendered[i] < effects_[i].whole())
        effects_[i].reduce_to(rendered[i], &scene);
    }
    RenderOptions options;
    options.folder = options_.folder / "sequence";
    options.seed = options_.seed;
    options.frames = UniformFrames(static_cast<int>(scene.world_from_camera.size()), options_.train.frames);
    Render(scene, options);
    return ReadSequence(options.folder);
  }

  void MeasureRuns(const std::vector<int>& rendered, const std::vector<Run>& runs) {
    const Sequence sequence = RenderWith(rendered);
    const Mesh truth = ReadGroundTruth(sequence);
    for (const Run& run : runs) {
      const std::vector<double> errors = Errors(sequence, truth, run);
      record_.Add(run.key, errors);
      Say(fmt::format("{}/{} {}, {}, seed {}: {:.3f} and {:.3f} mm", ++runs_done_, runs_,
                      variants_[run.variant].name, models_[run.model].name, run.seed, errors[0], errors[1]));
    }
  }

  // Mean absolute, of the surveyed and the extended region.
  std::vector<double> Errors(const Sequence& sequence, const Mesh& truth, const Run& run) const {
    Sequence told = sequence;
    for (size_t i = 0; i < effects_.size(); ++i) {
      if (variants_[run.variant].steps[i] > 0 && effects_[i].keep_unknown) {
        effects_[i].keep_unknown(run.seed, &told);
      }
    }
    if (models_[run.model].light_at_camera) MoveToCamera(&told.calibration.light);
    TrainRun train;
    train.folder = options_.folder / "run";
    train.seed = run.seed;
    std::vector<double> errors = {kUnknown, kUnknown};
    try {
      Train(told, TrainOptionsOf(run.variant, run.model), train);
      EvaluateOptions evaluate;
      evaluate.completeness_points = kCompletenessPoints;
      const Evaluation evaluation =
          Evaluate(ReadMesh(train.folder / "mesh.ply"), truth, Surveying(sequence), evaluate);
      if (evaluation.surveyed.error) errors[0] = evaluation.surveyed.error->mae_mm;
      if (evaluation.extended.error) errors[1] = evaluation.extended.error->mae_mm;
    } catch (const InputError& error) {
      Say(error.what());  // a run without a surface at its end is a result too
    }
    fs::remove_all(train.folder);
    return errors;
  }

  // The sequence with the poses of all frames, rendered or not.
  Sequence Surveying(Sequence sequence) const {
    sequence.frames.clear();
    for (const Pose& pose : scene_.world_from_camera) {
      sequence.frames.emplace_back().world_from_camera = pose;
    }
    return sequence;
  }

  Budget Summary() const {
    Budget budget;
    for (const LightModel& model : models_) budget.models.push_back(model.name);
    for (size_t variant = 0; variant < variants_.size(); ++variant) {
      BudgetRow row{variants_[variant].kind, variants_[variant].name, {}};
      for (size_t model = 0; model < models_.size(); ++model) {
        std::vector<double> surveyed, extended;
        for (int k = 0; k < options_.seeds; ++k) {
          const auto errors =
              record_.Find(KeyOf(variant, model, options_.seed + static_cast<uint64_t>(k))).value();
          surveyed.push_back(errors.at(0));
          extended.push_back(errors.at(1));
        }
        row.cells.push_back({FigureOf(surveyed), FigureOf(extended)});
      }
      budget.rows.push_back(row);
    }
    return budget;
  }

  // A variant of which a run fails isn't worth a median.
  static BudgetFigure FigureOf(const std::vector<double>& errors_mm) {
    const double spread = HalfRange(errors_mm);
    return {std::isnan(spread) ? kUnknown : MedianOf(errors_mm), spread};
  }

  Scene scene_;
  const std::vector<BudgetEffect>& effects_;
  const BudgetOptions& options_;
  const std::vector<BudgetVariant> variants_;
  const std::vector<LightModel> models_;
  RunRecord record_;
  int runs_ = 0, runs_done_ = 0;
};

}  // namespace

Budget MeasureBudget(const Scene& scene, const std::vector<BudgetEffect>& effects,
                     const BudgetOptions& options) {
  return BudgetMeasurement(scene, effects, options).Measure();
}

}  // namespace lumen
