// The paper's Table 1 over a set of scenes or sequences: each is rendered, reconstructed and evaluated.
#pragma once

#include <cstdint>
#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "recon/evaluation/evaluate.h"
#include "recon/training/options.h"
#include "tools/study/levels.h"

namespace lumen {

struct TableOptions {
  TrainOptions train;
  Level level = Level::kFull;         // of scenes
  std::vector<std::string> settings;  // of scenes: "path.to.key=value"
  double scale = 1;                   // of scenes' pictures
  // Of the run that gains nobody recorded are estimated from (recon/calibration/calibrate.h).
  int64_t calibrate_iterations = 1500;
  int completeness_points = 100'000;
  int views = 0;  // whose poses say what is seen, uniformly over the sequence; 0 = all
  uint64_t seed = 0;
  // A folder a sequence is made in here, with what was measured: a sequence that was measured with the same
  // options isn't again, one that was stopped goes on from its frames and its checkpoint.
  std::filesystem::path folder;
};

// One of the table's sequences: a scene file, or a sequence folder.
struct TableSubject {
  std::string name;  // the file's without extension, or the folder's
  std::filesystem::path path;
  bool is_scene;
};

// The scenes (*.toml) and the sequence folders in a folder, by name. Throws InputError where there are none.
std::vector<TableSubject> FindTableSubjects(const std::filesystem::path& folder);

enum class TableData { kTwin, kTwinOfStandIn, kSequence };

struct TableRow {
  std::string name;
  TableData data = TableData::kTwin;
  // Nothing where training left no surface.
  std::optional<ErrorFigures> surveyed, extended;
  int frames = 0;      // of the whole sequence; what is seen follows from all of them
  double path_mm = 0;  // the way from camera to camera
  double span_mm = 0;  // the largest distance between two cameras
  // The share of mucosa that was surveyed (Coverage), by the truth and by the reconstruction alone.
  std::optional<double> truth_share, reconstruction_share;
  double seconds = 0;  // to render, train and evaluate it
};

struct Table {
  std::vector<TableRow> rows;
  std::string preset;
  Level level = Level::kFull;
};

// Frames to train on are uniform over the sequence (options.train.frames of them); a scene's others aren't
// rendered. Gains that these frames lack are estimated before. What is surveyed and covered follows from the
// poses of all.
Table MeasureTable(const std::vector<TableSubject>& subjects, const TableOptions& options);

// The sequence's span is below 1 cm: the paper has means of their own for these.
bool IsShort(const TableRow& row);

}  // namespace lumen
