#include <fmt/format.h>

#include <iostream>

#include "common/error.h"
#include "common/files.h"
#include "common/progress.h"
#include "recon/photometry/baseline.h"
#include "recon/photometry/looks.h"
#include "recon/photometry/plot.h"
#include "recon/photometry/report.h"
#include "tools/options.h"

namespace lumen {
namespace {

namespace fs = std::filesystem;

struct Arguments {
  fs::path sequence, folder, baseline, new_baseline, like;
  double errors = 4, tolerance = 0.25;
  bool light_at_camera = false;
  PhotometryOptions options;
};

// One source in the camera's centre that shines along its axis, with the mean spread of those there were.
void MoveLightToCamera(Light* light) {
  LightSource source;
  source.intensity.setZero();
  for (const LightSource& one : light->sources) {
    source.spread += one.spread / static_cast<double>(light->sources.size());
    source.intensity += one.intensity;
  }
  light->sources = {source};
}

nlohmann::json Compare(const Photometry& photometry, const Arguments& arguments) {
  const std::vector<BaselineInterval> baseline = ReadBaseline(arguments.baseline);
  const std::vector<std::string> outside = CompareWithBaseline(photometry, baseline);
  for (const std::string& line : outside) std::cerr << "lumen: " << line << "\n";
  if (outside.empty()) {
    std::cout << fmt::format("baseline: all {} figures of {} are within\n", baseline.size(),
                             arguments.baseline.string());
  }
  return {{"file", arguments.baseline.string()}, {"compared", baseline.size()}, {"outside", outside}};
}

// How the sequence looks beside another one.
nlohmann::json CompareWithOther(const Sequence& sequence, const Photometry& photometry,
                                const Arguments& arguments) {
  const Sequence other = ReadSequence(arguments.like);
  const Looks own = LooksOf(sequence, photometry);
  const Looks others = LooksOf(other, FitPhotometry(Observe(other, arguments.options), arguments.options));
  const std::vector<LookDifference> differences = CompareLooks(own, others, arguments.tolerance);
  std::cout << "\n" << ToTable(own, others, differences);
  if (!arguments.folder.empty()) WriteImage(arguments.folder / "looks.png", LooksPicture(own, others));
  nlohmann::json json = nlohmann::json::array();
  for (const LookDifference& one : differences) {
    json.push_back(
        {{"figure", one.name}, {"value", one.first}, {"other", one.second}, {"alike", one.within}});
  }
  return json;
}

nlohmann::json Run(const Arguments& arguments, const CommonOptions& common) {
  // What is wrong with a baseline is said before the work.
  if (!arguments.baseline.empty()) ReadBaseline(arguments.baseline);
  Sequence sequence = ReadSequence(arguments.sequence);
  if (arguments.light_at_camera) MoveLightToCamera(&sequence.calibration.light);
  const Observations observations = Observe(sequence, arguments.options);
  const Photometry photometry = FitPhotometry(observations, arguments.options);
  nlohmann::json result = ToJson(photometry, observations);
  std::cout << ToTable(photometry, observations);
  if (!arguments.folder.empty()) CreateFolder(arguments.folder);
  if (!arguments.like.empty()) result["like"] = CompareWithOther(sequence, photometry, arguments);
  if (!arguments.folder.empty()) {
    WriteImage(arguments.folder / "photometry.png", PlotPhotometry(photometry));
    WriteFile(arguments.folder / "photometry.json", result.dump(2) + "\n");
    Say("pictures in " + arguments.folder.string());
  }
  if (!arguments.new_baseline.empty()) WriteBaseline(arguments.new_baseline, photometry, arguments.errors);
  if (arguments.baseline.empty()) return result;
  result["baseline"] = Compare(photometry, arguments);
  const size_t outside = result["baseline"]["outside"].size();
  if (outside == 0) return result;
  // The result is due although the command fails.
  if (!common.json.empty()) WriteFile(common.json, result.dump(2) + "\n");
  throw InputError(fmt::format("{}: {} of {} figures left their interval in {}", arguments.sequence.string(),
                               outside, result["baseline"]["compared"].get<size_t>(),
                               arguments.baseline.string()));
}

}  // namespace

void AddPhotometry(CLI::App* app) {
  const auto arguments = std::make_shared<Arguments>();
  CLI::App* command = AddSubcommand(app, "photometry",
                                    "fits the photometric model to frames whose depth and normals are known",
                                    [=](const CommonOptions& common) { return Run(*arguments, common); });
  command->add_option("SEQ", arguments->sequence, "the sequence folder, C3VD's included")->required();
  command->add_option("-o,--output", arguments->folder,
                      "folder for photometry.png, photometry.json and looks.png");
  command->add_option("--baseline", arguments->baseline,
                      "intervals that the figures must stay in: exits 1 and names each that doesn't");
  command->add_option(
      "--write-baseline", arguments->new_baseline,
      "make such a file from this run: each figure ± --errors standard errors; edit it freely");
  command
      ->add_option("--errors", arguments->errors, "half-width of --write-baseline's intervals (default: 4)")
      ->check(CLI::PositiveNumber);
  command->add_option("--like", arguments->like,
                      "another sequence: how alike the two look, figure by figure; looks.png in -o");
  command
      ->add_option("--tolerance", arguments->tolerance,
                   "how far a figure may be from --like's, in parts of it (default: 0.25)")
      ->check(CLI::PositiveNumber);
  command->add_flag("--light-at-camera", arguments->light_at_camera,
                    "take the light as one source in the camera's centre, along its axis");
  command
      ->add_option("--place", arguments->options.cell_mm,
                   "mm, size of a place on the wall: pixels of one place may err together (default: 8)")
      ->check(CLI::PositiveNumber);
  command
      ->add_option("--pixels", arguments->options.max_pixels,
                   "take every k-th pixel and row so that no more than these are used (default: 2000000)")
      ->check(CLI::PositiveNumber);
}

}  // namespace lumen
