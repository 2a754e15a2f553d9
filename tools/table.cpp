#include "tools/study/table.h"

#include <fmt/core.h>

#include <algorithm>

#include "common/error.h"
#include "common/files.h"
#include "common/progress.h"
#include "tools/options.h"
#include "tools/study/strips.h"
#include "tools/study/table_text.h"
#include "tools/train_arguments.h"

namespace lumen {
namespace {

namespace fs = std::filesystem;

struct Arguments {
  fs::path scenes, folder;
  std::string level = "full";
  std::vector<std::string> sequences, settings;
  double scale = 0;  // 0 = not said
  TrainArguments train;
  bool quick = false;
};

// What a quick table's sequences are made with.
constexpr double kQuickScale = 1.0 / 3;
constexpr int kQuickPoints = 20'000, kQuickViews = 150;
constexpr int64_t kIterations = 8000, kQuickIterations = 3000, kQuickCalibrateIterations = 600;
// Where the paper's assumptions hold its model of light is exact.
constexpr const char* kPapersLight = "network.interreflection=\"none\"";
constexpr const char* kQuickCell = "extract.cell_mm=1.25";

TableOptions OptionsOf(const Arguments& arguments, const CommonOptions& common) {
  TrainArguments train = arguments.train;
  // In front, so that the command line's own settings count.
  if (arguments.quick) train.settings.insert(train.settings.begin(), kQuickCell);
  if (arguments.level == "ideal") train.settings.insert(train.settings.begin(), kPapersLight);
  if (train.iterations == 0 && train.seconds == 0) {
    train.iterations = arguments.quick ? kQuickIterations : kIterations;
  }
  TableOptions options;
  options.train = ReadTrainOptions(train.preset, train.Settings());
  options.level = arguments.level == "ideal" ? Level::kIdeal : Level::kFull;
  options.settings = arguments.settings;
  options.scale = arguments.scale > 0 ? arguments.scale : arguments.quick ? kQuickScale : 1;
  if (arguments.quick) {
    options.completeness_points = kQuickPoints;
    options.views = kQuickViews;
    options.calibrate_iterations = kQuickCalibrateIterations;
  }
  options.seed = common.seed;
  options.folder = arguments.folder;
  return options;
}

std::vector<TableSubject> SubjectsOf(const Arguments& arguments) {
  const std::vector<TableSubject> all = FindTableSubjects(arguments.scenes);
  if (arguments.sequences.empty()) return all;
  std::vector<TableSubject> named;
  for (const std::string& name : arguments.sequences) {
    const auto subject = std::ranges::find(all, name, &TableSubject::name);
    if (subject == all.end()) {
      std::string known;
      for (const TableSubject& other : all) known += (known.empty() ? "" : ", ") + other.name;
      throw InputError("--sequences " + name + ": not in " + arguments.scenes.string() +
                       "; there are: " + known);
    }
    named.push_back(*subject);
  }
  return named;
}

void WriteSheet(const Table& table, const fs::path& folder, const fs::path& file) {
  std::vector<TitledStrip> strips;
  for (const TableRow& row : table.rows) {
    if (!row.surveyed) continue;
    strips.push_back(
        {fmt::format("{}: MAE {:.2f} mm", row.name, row.surveyed->mae_mm), folder / row.name / "strip.png"});
  }
  if (!strips.empty()) WriteStripSheet(strips, file);
}

nlohmann::json Run(const Arguments& arguments, const CommonOptions& common) {
  const TableOptions options = OptionsOf(arguments, common);
  const Table table = MeasureTable(SubjectsOf(arguments), options);
  // Another preset's table stands beside the first.
  const std::string name = options.train.preset == "fast" ? "table" : "table_" + options.train.preset;
  const std::string text = ToText(table);
  fmt::print("{}", text);
  WriteFile(arguments.folder / (name + ".txt"), text);
  WriteFile(arguments.folder / (name + ".csv"), ToCsv(table));
  WriteFile(arguments.folder / (name + ".tex"), ToLatex(table));
  WriteSheet(table, arguments.folder, arguments.folder / (name + ".png"));
  Say("as " + name + ".txt, .csv, .tex and .png in " + arguments.folder.string());
  return ToJson(table);
}

}  // namespace

void AddTable(CLI::App* app) {
  const auto arguments = std::make_shared<Arguments>();
  CLI::App* command = AddSubcommand(app, "table", "the paper's table over a folder of scenes or sequences",
                                    [=](const CommonOptions& common) { return Run(*arguments, common); });
  command->add_option("scenes", arguments->scenes, "folder of scene files or of sequence folders")
      ->required();
  command
      ->add_option("-o,--output", arguments->folder,
                   "folder for the table and what it is made of; what was measured isn't measured again")
      ->required();
  command
      ->add_option("--level", arguments->level,
                   "of scenes: full (as they are) or ideal (the paper's assumptions hold)")
      ->check(CLI::IsMember({"ideal", "full"}))
      ->capture_default_str();
  command->add_option("--sequences", arguments->sequences, "only these, by name: a,b")->delimiter(',');
  command->add_option("--set", arguments->settings, "a key of the scenes: path.to.key=value");
  command->add_option("--scale", arguments->scale, "of the pictures' width and height (default: 1)")
      ->check(CLI::Range(1e-3, 8.0));
  command->add_flag("--quick", arguments->quick, "small frames and short runs");
  AddTrainArguments(command, &arguments->train, "--train-set");
}

}  // namespace lumen
