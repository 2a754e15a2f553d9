#include "tools/study/table.h"

#include <fmt/format.h>

#include <algorithm>
#include <chrono>
#include <cmath>
#include <limits>
#include <nlohmann/json.hpp>

#include "common/error.h"
#include "common/files.h"
#include "common/progress.h"
#include "recon/calibration/calibrate.h"
#include "recon/evaluation/evaluation_json.h"
#include "recon/training/train.h"
#include "sim/render.h"
#include "tools/study/run_record.h"
#include "tools/study/scaled_scene.h"
#include "tools/study/scene_source.h"
#include "tools/study/strips.h"

namespace lumen {
namespace {

namespace fs = std::filesystem;

constexpr double kShort_mm = 10;  // the paper's ("the camera moves less than 1 cm")
constexpr double kUnknown = std::numeric_limits<double>::quiet_NaN();
// In the record: the seconds that rendering took.
constexpr char kFramesReady[] = "frames are ready";
constexpr char kEstimated[] = "gains, their errors, spread, gamma";

class Stopwatch {
 public:
  double Seconds() const {
    return std::chrono::duration<double>(std::chrono::steady_clock::now() - start_).count();
  }

 private:
  std::chrono::steady_clock::time_point start_ = std::chrono::steady_clock::now();
};

// Numbers of the way between frames that are the whole sequence's.
void DescribePath(const std::vector<SequenceFrame>& frames, TableRow* row) {
  row->frames = static_cast<int>(frames.size());
  for (size_t i = 0; i < frames.size(); ++i) {
    const Vec3d place = frames[i].world_from_camera.translation();
    if (i > 0) row->path_mm += (place - frames[i - 1].world_from_camera.translation()).norm();
    for (size_t k = 0; k < i; ++k) {
      row->span_mm = std::max(row->span_mm, (place - frames[k].world_from_camera.translation()).norm());
    }
  }
}

std::vector<double> NumbersOf(const std::optional<ErrorFigures>& error) {
  if (!error) return {kUnknown, kUnknown, kUnknown};
  return {error->medae_mm, error->mae_mm, error->rmse_mm};
}

std::optional<ErrorFigures> FiguresOf(const double* numbers) {
  if (std::isnan(numbers[0])) return std::nullopt;
  return ErrorFigures{numbers[0], numbers[1], numbers[2]};
}

std::optional<double> KnownOf(double number) {
  return std::isnan(number) ? std::nullopt : std::optional(number);
}

// A row's measured part as the record has it.
std::vector<double> NumbersOf(const TableRow& row) {
  std::vector<double> numbers = NumbersOf(row.surveyed);
  const std::vector<double> extended = NumbersOf(row.extended);
  numbers.insert(numbers.end(), extended.begin(), extended.end());
  for (const double number :
       {row.truth_share.value_or(kUnknown), row.reconstruction_share.value_or(kUnknown), row.seconds,
        row.path_mm, row.span_mm, double(row.frames), double(row.data == TableData::kTwinOfStandIn)}) {
    numbers.push_back(number);
  }
  return numbers;
}

constexpr size_t kNumbers = 13;

void TakeNumbers(const std::vector<double>& numbers, bool is_scene, TableRow* row) {
  row->surveyed = FiguresOf(&numbers[0]);
  row->extended = FiguresOf(&numbers[3]);
  row->truth_share = KnownOf(numbers[6]);
  row->reconstruction_share = KnownOf(numbers[7]);
  row->seconds = numbers[8];
  row->path_mm = numbers[9];
  row->span_mm = numbers[10];
  row->frames = static_cast<int>(numbers[11]);
  if (is_scene) row->data = numbers[12] != 0 ? TableData::kTwinOfStandIn : TableData::kTwin;
}

std::vector<SequenceFrame> Taken(const std::vector<SequenceFrame>& frames, int at_most) {
  std::vector<SequenceFrame> taken;
  for (const int i : UniformFrames(static_cast<int>(frames.size()), at_most)) taken.push_back(frames[i]);
  return taken;
}

// One sequence, from its scene or folder to its figures.
class SequenceMeasurement {
 public:
  SequenceMeasurement(const TableSubject& subject, const TableOptions& options)
      : subject_(subject),
        options_(options),
        folder_(options.folder / subject.name),
        record_((CreateFolder(folder_), folder_ / "measured.json"), Source()) {
    row_.name = subject.name;
    row_.data = subject.is_scene ? TableData::kTwin : TableData::kSequence;
  }

  // Whether there was nothing to do.
  bool Known() const { return record_.Find(Key()).has_value(); }

  TableRow Measure() {
    const auto numbers = record_.Find(Key());
    if (!numbers) {
      Run();
    } else if (numbers->size() == kNumbers) {
      TakeNumbers(*numbers, subject_.is_scene, &row_);
    } else {
      throw InputError((folder_ / "measured.json").string() + ": was not written by this program; remove it");
    }
    return row_;
  }

 private:
  // All that the frames follow from.
  std::string Source() const {
    if (!subject_.is_scene) return SequenceSource(subject_.path);
    std::string source =
        fmt::format("level = {}\nscale = {}\nframes = {}\nseed = {}\n", NameOf(options_.level),
                    options_.scale, options_.train.frames, options_.seed);
    for (const std::string& setting : options_.settings) source += setting + "\n";
    return source + SceneSource(subject_.path);
  }

  // And what the reconstruction does besides.
  std::string Key() const {
    return fmt::format("points = {}\nviews = {}\nseed = {}\n", options_.completeness_points, options_.views,
                       options_.seed) +
           FormatTrainOptions(options_.train);
  }

  void Run() {
    const Stopwatch watch;
    Sequence sequence = subject_.is_scene ? OfScene() : OfFolder();
    DescribePath(all_frames_, &row_);
    EstimateWhatIsUnknown(&sequence);
    const bool has_surface = Reconstruct(sequence);
    if (has_surface) Evaluate(sequence);
    row_.seconds += watch.Seconds();
    // What fails isn't recorded: it may be the disk's fault.
    if (has_surface) record_.Add(Key(), NumbersOf(row_));
  }

  Sequence OfFolder() {
    Sequence sequence = ReadSequence(subject_.path, {.skip_damaged = true});
    for (const std::string& line : sequence.left_out) Say(line);
    all_frames_ = sequence.frames;
    sequence.frames = Taken(all_frames_, options_.train.frames);
    if (!record_.Find(kFramesReady)) FramesAreReady(0);
    return sequence;
  }

  // The frames that are trained on, rendered unless they are here already.
  Sequence OfScene() {
    Scene scene = ReadScaledScene(subject_.path, options_.settings, options_.seed, options_.scale);
    ApplyLevel(options_.level, &scene);
    scene.truth = {false, {}};  // evaluation takes the mesh
    if (scene.path_is_stand_in) row_.data = TableData::kTwinOfStandIn;
    RenderOptions render;
    render.folder = folder_ / "sequence";
    render.seed = options_.seed;
    const int count = static_cast<int>(scene.world_from_camera.size());
    render.frames = UniformFrames(count, options_.train.frames);
    if (const auto ready = record_.Find(kFramesReady)) {
      row_.seconds += ready->at(0);
    } else {
      const RenderResult result = Render(scene, render);
      if (result.not_finite > 0) {
        Say(fmt::format("{}: {} samples were not finite and are left out; the first: {}", subject_.name,
                        result.not_finite, result.first_not_finite));
      }
      FramesAreReady(result.seconds);
    }
    for (int number = 0; number < count; ++number) {
      SequenceFrame frame;
      frame.number = number;
      frame.world_from_camera = scene.world_from_camera[number];
      all_frames_.push_back(frame);
    }
    return ReadSequence(render.folder);
  }

  // From now on runs are of these frames.
  void FramesAreReady(double seconds) {
    fs::remove_all(folder_ / "run");
    record_.Add(kFramesReady, {seconds});
  }

  // Gains that the sequence doesn't say and, of a folder without sequence.toml, what the data tell of the
  // light's spread and of γ. Where nothing can be told training learns the gains.
  void EstimateWhatIsUnknown(Sequence* sequence) {
    if (std::ranges::all_of(sequence->frames, [](const auto& frame) { return frame.gain.has_value(); }))
      return;
    auto estimate = record_.Find(kEstimated);
    if (!estimate) {
      estimate = Estimated(*sequence);
      record_.Add(kEstimated, *estimate);
    }
    const size_t count = sequence->frames.size();
    if (estimate->size() != 2 * count + 2) return;
    for (size_t i = 0; i < count; ++i) {
      sequence->frames[i].gain = std::exp((*estimate)[i]);
      sequence->frames[i].log_gain_error = (*estimate)[count + i];
    }
    const double spread = (*estimate)[2 * count], gamma = (*estimate)[2 * count + 1];
    for (LightSource& source : sequence->calibration.light.sources) {
      if (!std::isnan(spread)) source.spread = spread;
    }
    if (!std::isnan(gamma)) sequence->calibration.response.gamma = gamma;
  }

  // Logarithms of gains, their standard errors, spread, γ; empty where the frames share too little.
  std::vector<double> Estimated(const Sequence& sequence) const {
    CalibrateOptions calibrate;
    calibrate.light = !sequence.has_toml;
    calibrate.surface.iterations = options_.calibrate_iterations;
    try {
      const SequenceCalibration found = Calibrate(sequence, calibrate, options_.seed);
      std::vector<double> numbers;
      for (const Estimate& gain : found.log_gain) numbers.push_back(gain.value);
      for (const Estimate& gain : found.log_gain) numbers.push_back(gain.standard_error);
      numbers.push_back(calibrate.light && found.tells_spread ? found.spread.value : kUnknown);
      numbers.push_back(calibrate.light && found.tells_gamma ? found.gamma.value : kUnknown);
      return numbers;
    } catch (const InputError& error) {
      Say(std::string(error.what()) + "; training learns the gains");
      return {};
    }
  }

  // False, and said why, where there is no reconstruction.
  bool Reconstruct(const Sequence& sequence) {
    TrainRun run;
    run.folder = folder_ / "run";
    run.seed = options_.seed;
    // A run of other options is none to go on from.
    const fs::path options = run.folder / "options.toml";
    run.resume = fs::exists(options) && ReadFile(options) == Key();
    try {
      if (!run.resume) {
        fs::remove_all(run.folder);
        CreateFolder(run.folder);
        WriteFile(options, Key());
      }
      Train(sequence, options_.train, run);
      return true;
    } catch (const InputError& error) {
      Say(error.what());
      return false;
    }
  }

  void Evaluate(const Sequence& sequence) {
    const Mesh reconstruction = ReadMesh(folder_ / "run" / "mesh.ply"), truth = ReadGroundTruth(sequence);
    Sequence all = sequence;
    if (options_.views > 0) {
      all.frames = Taken(all_frames_, options_.views);
    } else {
      all.frames = all_frames_;
    }
    EvaluateOptions evaluate;
    evaluate.completeness_points = options_.completeness_points;
    evaluate.seed = options_.seed;
    const Evaluation evaluation = lumen::Evaluate(reconstruction, truth, all, evaluate);
    row_.surveyed = evaluation.surveyed.error;
    row_.extended = evaluation.extended.error;
    row_.truth_share = evaluation.coverage.truth_share;
    row_.reconstruction_share = evaluation.coverage.reconstruction_share;
    WriteFile(folder_ / "evaluation.json", lumen::ToJson(evaluation).dump(2) + "\n");
    WriteStrip(evaluation, reconstruction, sequence, folder_ / "strip.png");
  }

  const TableSubject& subject_;
  const TableOptions& options_;
  const fs::path folder_;
  RunRecord record_;
  std::vector<SequenceFrame> all_frames_;
  TableRow row_;
};

bool IsSequenceFolder(const fs::path& folder) {
  return fs::is_directory(folder) &&
         (fs::is_regular_file(folder / "pose.txt") || fs::is_regular_file(folder / "sequence.toml"));
}

std::string Described(const TableRow& row) {
  if (!row.surveyed || !row.extended) return "no surface that a frame sees";
  return fmt::format("{:.2f} and {:.2f} mm", row.surveyed->mae_mm, row.extended->mae_mm);
}

}  // namespace

std::vector<TableSubject> FindTableSubjects(const fs::path& folder) {
  if (IsSequenceFolder(folder)) {
    throw InputError(folder.string() + ": is one sequence; give the folder that holds it");
  }
  if (!fs::is_directory(folder)) throw InputError(folder.string() + ": no such folder");
  std::vector<TableSubject> subjects;
  for (const auto& entry : fs::directory_iterator(folder)) {
    const fs::path& path = entry.path();
    const bool is_scene = fs::is_regular_file(path) && path.extension() == ".toml";
    if (is_scene) subjects.push_back({path.stem().string(), path, true});
    if (IsSequenceFolder(path)) subjects.push_back({path.filename().string(), path, false});
  }
  if (subjects.empty()) {
    throw InputError(folder.string() +
                     ": holds neither scenes (*.toml) nor sequence folders (with pose.txt)");
  }
  std::ranges::sort(subjects, {}, &TableSubject::name);
  return subjects;
}

Table MeasureTable(const std::vector<TableSubject>& subjects, const TableOptions& options) {
  Table table;
  table.preset = options.train.preset;
  table.level = options.level;
  for (const TableSubject& subject : subjects) {
    SequenceMeasurement measurement(subject, options);
    const bool known = measurement.Known();
    table.rows.push_back(measurement.Measure());
    const TableRow& row = table.rows.back();
    Say(fmt::format("{}/{} {}: {}, {}", table.rows.size(), subjects.size(), subject.name, Described(row),
                    known ? "measured before" : fmt::format("{:.0f} s", row.seconds)));
  }
  return table;
}

bool IsShort(const TableRow& row) { return row.span_mm < kShort_mm; }

}  // namespace lumen
