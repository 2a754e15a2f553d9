#include "recon/calibration/calibrate.h"

#include <iostream>

#include "common/config.h"
#include "common/files.h"
#include "common/progress.h"
#include "recon/calibration/calibration_report.h"
#include "tools/options.h"
#include "tools/sequence_arguments.h"

namespace lumen {
namespace {

struct Arguments {
  SequenceArguments sequence;
  std::vector<std::string> settings;
  bool everything = false;
};

CalibrateOptions ReadOptions(const std::vector<std::string>& settings) {
  const Config config = Config::Parse("", "calibrate", {}, settings);
  const ConfigTable root = config.root();
  CalibrateOptions options;
  options.rounds = static_cast<int>(root.Integer("rounds", options.rounds, {0, 100}));
  options.tells_within = root.Number("tells_within", options.tells_within, kPositive);
  if (const auto surface = root.Optional("surface")) {
    options.surface.frames = static_cast<int>(surface->Integer("frames", options.surface.frames, {2, 1e6}));
    options.surface.iterations = surface->Integer("iterations", options.surface.iterations, {1, 1e12});
    options.surface.cell_mm = surface->Number("cell_mm", options.surface.cell_mm, {0.1, 20});
  }
  if (const auto places = root.Optional("places")) {
    options.sightings.places =
        static_cast<int>(places->Integer("count", options.sightings.places, {10, 1e5}));
    options.sightings.half_edge_mm =
        places->Number("half_edge_mm", options.sightings.half_edge_mm, kNotNegative);
    options.fit.min_places = static_cast<int>(places->Integer("shared", options.fit.min_places, {2, 1e5}));
  }
  config.RejectUnknown();
  return options;
}

nlohmann::json Run(const Arguments& arguments, const CommonOptions& common) {
  CalibrateOptions options = ReadOptions(arguments.settings);
  const Sequence sequence = ReadSequence(arguments.sequence, false);
  options.light = arguments.everything || !sequence.has_toml;
  const SequenceCalibration found = Calibrate(sequence, options, common.seed);
  const Findings findings = FindingsOf(sequence, found, arguments.everything);
  WriteFile(sequence.folder / "calibration.toml", CalibrationText(sequence, found, findings));
  std::cout << ToTable(sequence, found, findings);
  Say("written to " + (sequence.folder / "calibration.toml").string());
  return ToJson(sequence, found, findings);
}

}  // namespace

void AddCalibrate(CLI::App* app) {
  const auto arguments = std::make_shared<Arguments>();
  CLI::App* command = AddSubcommand(
      app, "calibrate",
      "estimates each frame's gain and, where the data tell, spread and gamma, into SEQ/calibration.toml",
      [=](const CommonOptions& common) { return OfferingToSkip([&] { return Run(*arguments, common); }); });
  AddSequenceArguments(command, &arguments->sequence, "SEQ");
  command->add_flag("--everything", arguments->everything,
                    "write also what sequence.toml says itself: it is read in its place from then on");
  command
      ->add_option("--set", arguments->settings,
                   "surface.frames, .iterations, .cell_mm; places.count, .half_edge_mm, .shared; rounds; "
                   "tells_within")
      ->allow_extra_args(false);
}

}  // namespace lumen
