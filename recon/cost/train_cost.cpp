#include "recon/cost/train_cost.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <nlohmann/json.hpp>

#include "common/error.h"
#include "common/files.h"
#include "common/parallel.h"
#include "common/progress.h"
#include "common/statistics.h"
#include "recon/cost/train_knobs.h"
#include "recon/evaluation/evaluate.h"
#include "recon/training/train.h"

namespace lumen {
namespace {

// Completeness doesn't count here.
constexpr int kCompletenessPoints = 100;

constexpr double kUnknown = std::numeric_limits<double>::quiet_NaN();

struct Measured {
  double seconds = 0, surveyed_mm = kUnknown, extended_mm = kUnknown;
};

nlohmann::json NumberOrNull(double value) {
  return std::isfinite(value) ? nlohmann::json(value) : nlohmann::json();
}

double NumberOf(const nlohmann::json& json) { return json.is_null() ? kUnknown : json.get<double>(); }

// The runs that have been made, in a file.
class Record {
 public:
  Record(std::filesystem::path file, std::string subject)
      : file_(std::move(file)), subject_(std::move(subject)) {
    if (std::filesystem::exists(file_)) {
      // What isn't a record of this subject is made anew.
      const auto json = nlohmann::json::parse(ReadFile(file_), nullptr, false);
      if (json.is_object() && json.value("subject", "") == subject_) runs_ = json.at("runs");
    }
  }

  bool Find(const std::string& key, Measured* measured) const {
    const auto run = runs_.find(key);
    if (run == runs_.end()) return false;
    *measured = {run->at("seconds"), NumberOf(run->at("surveyed_mm")), NumberOf(run->at("extended_mm"))};
    return true;
  }

  void Add(const std::string& key, const Measured& measured) {
    runs_[key] = {{"seconds", measured.seconds},
                  {"surveyed_mm", NumberOrNull(measured.surveyed_mm)},
                  {"extended_mm", NumberOrNull(measured.extended_mm)}};
    WriteFile(file_, nlohmann::json({{"subject", subject_}, {"runs", runs_}}).dump(1) + "\n");
  }

 private:
  std::filesystem::path file_;
  std::string subject_;
  nlohmann::json runs_ = nlohmann::json::object();
};

std::vector<TrainKnob> KnobsToMeasure(const TrainCostOptions& options, const Sequence& sequence) {
  const std::vector<TrainKnob> all =
      TrainKnobsOf(options.own, static_cast<int>(sequence.frames.size()), options.few);
  if (options.knobs.empty()) return all;
  std::vector<TrainKnob> named;
  for (const std::string& name : options.knobs) {
    const auto knob = std::ranges::find(all, name, &TrainKnob::name);
    if (knob == all.end()) {
      std::string known;
      for (const TrainKnob& other : all) known += (known.empty() ? "" : ", ") + other.name;
      throw InputError("--knob " + name + ": this training has no such knob; there are: " + known);
    }
    named.push_back(*knob);
  }
  return named;
}

class TrainCostMeasurement {
 public:
  TrainCostMeasurement(const Sequence& sequence, const TrainCostOptions& options)
      : sequence_(sequence),
        options_(options),
        truth_(ReadGroundTruth(sequence)),
        knobs_(KnobsToMeasure(options, sequence)),
        record_((CreateFolder(options.folder), options.folder / "measured.json"), options.subject) {
    for (const TrainKnob& knob : knobs_) runs_ += static_cast<int>(knob.settings.size()) * options.seeds;
  }

  CostCurves Run() {
    CostCurves curves{{"surveyed_mae_mm", "extended_mae_mm"}, {}};
    for (const TrainKnob& knob : knobs_) {
      CostCurve curve{knob.name, {}};
      for (const TrainKnobSetting& setting : knob.settings) curve.points.push_back(PointOf(knob, setting));
      curves.curves.push_back(curve);
    }
    return curves;
  }

 private:
  CostPoint PointOf(const TrainKnob& knob, const TrainKnobSetting& setting) {
    std::vector<double> seconds, surveyed, extended;
    for (int k = 0; k < options_.seeds; ++k) {
      const Measured run = RunOf(setting.options, options_.seed + static_cast<uint64_t>(k));
      seconds.push_back(run.seconds);
      surveyed.push_back(run.surveyed_mm);
      extended.push_back(run.extended_mm);
      ++runs_done_;
      progress_.Update(double(runs_done_) / runs_, knob.name + " " + setting.label + ": " +
                                                       std::to_string(run.surveyed_mm) + " mm in " +
                                                       std::to_string(run.seconds) + " s");
    }
    return {setting.label,
            MedianOf(seconds),
            HalfRange(seconds),
            {MedianOrNan(surveyed), MedianOrNan(extended)},
            {HalfRange(surveyed), HalfRange(extended)},
            setting.is_own};
  }

  // A setting of which a run fails isn't worth a median.
  static double MedianOrNan(const std::vector<double>& values) {
    return std::isnan(HalfRange(values)) ? kUnknown : MedianOf(values);
  }

  Measured RunOf(const TrainOptions& options, uint64_t seed) {
    const std::string key = "seed = " + std::to_string(seed) +
                            "\nthreads = " + std::to_string(ThreadCount()) + "\n" +
                            FormatTrainOptions(options);
    Measured measured;
    if (record_.Find(key, &measured)) return measured;
    TrainRun run;
    run.folder = options_.folder / "run";
    run.seed = seed;
    try {
      measured.seconds = Train(sequence_, options, run).cpu_seconds;
      EvaluateOptions evaluate;
      evaluate.completeness_points = kCompletenessPoints;
      const Evaluation evaluation = Evaluate(ReadMesh(run.folder / "mesh.ply"), truth_, sequence_, evaluate);
      if (evaluation.surveyed.error) measured.surveyed_mm = evaluation.surveyed.error->mae_mm;
      if (evaluation.extended.error) measured.extended_mm = evaluation.extended.error->mae_mm;
    } catch (const InputError& error) {
      Say(error.what());
    }
    std::filesystem::remove_all(run.folder);
    record_.Add(key, measured);
    return measured;
  }

  const Sequence& sequence_;
  const TrainCostOptions& options_;
  const Mesh truth_;
  const std::vector<TrainKnob> knobs_;
  Record record_;
  Progress progress_{"cost"};
  int runs_ = 0, runs_done_ = 0;
};

}  // namespace

CostCurves MeasureTrainCost(const Sequence& sequence, const TrainCostOptions& options) {
  return TrainCostMeasurement(sequence, options).Run();
}

}  // namespace lumen
