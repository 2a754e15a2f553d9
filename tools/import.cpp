#include <fmt/core.h>

#include <cmath>

#include "common/error.h"
#include "tools/exchange/import_model.h"
#include "tools/options.h"

namespace lumen {
namespace {

struct Arguments {
  ImportOptions options;
  std::filesystem::path folder;
};

nlohmann::json Run(const Arguments& arguments) {
  const ImportResult result = ImportModel(arguments.options, arguments.folder);
  nlohmann::json json = {{"frames", result.frames}, {"mm_per_unit", result.mm_per_unit}};
  fmt::print("frames   {}\n", result.frames);
  if (result.turned_back_rad) {
    json["turned_back_rad"] = *result.turned_back_rad;
    fmt::print("camera   the calibration's own, for which the model's stands; poses turned back by {:.3f}°\n",
               *result.turned_back_rad * 180 / kPi);
  }
  fmt::print("scale    {:.6g} mm a unit of the model\n", result.mm_per_unit);
  if (result.from_poses) {
    const SimilarityFit& fit = *result.from_poses;
    json["residual"] = {
        {"rms_mm", fit.rms_mm}, {"max_mm", fit.max_mm}, {"rms_rad", fit.rms_rad}, {"max_rad", fit.max_rad}};
    fmt::print("residual {:.3g} mm RMS, {:.3g} at most; {:.3g}° RMS, {:.3g}° at most\n", fit.rms_mm,
               fit.max_mm, fit.rms_rad * 180 / kPi, fit.max_rad * 180 / kPi);
  }
  if (result.from_light) {
    const LightScale& light = *result.from_light;
    const double albedo = arguments.options.albedo;
    json["light"] = {{"albedo", albedo},
                     {"observations", light.observations},
                     {"lower_mm_per_unit", light.lower_mm},
                     {"upper_mm_per_unit", light.upper_mm}};
    fmt::print("by light {} observations, half of them between {:.4g} and {:.4g}\n", light.observations,
               light.lower_mm, light.upper_mm);
    fmt::print(
        "albedo   {} in green; the scale grows with its root: {:.4g} for {}, {:.4g} for {}; light from wall "
        "to wall makes it too small\n",
        albedo, light.mm_per_unit * std::sqrt(0.5), albedo / 2, light.mm_per_unit * std::sqrt(2.0),
        albedo * 2);
  }
  return json;
}

}  // namespace

void AddImport(CLI::App* app) {
  const auto arguments = std::make_shared<Arguments>();
  CLI::App* command = AddSubcommand(app, "import", "makes a sequence of a COLMAP model and its images",
                                    [=](const CommonOptions&) { return Run(*arguments); });
  ImportOptions& options = arguments->options;
  command->add_option("MODEL", options.model, "folder of cameras, images, points3D (.bin or .txt)")
      ->required();
  command->add_option("--images", options.images, "folder of the model's images")->required();
  command->add_option("-o,--output", arguments->folder, "the sequence's folder, empty or new")->required();
  command->add_option(
      "--calibration", options.calibration,
      "a sequence with the light, response, gains and mask, and the camera where the model is an "
      "export of it (default: C3VD's, gains unknown)");
  auto* scale = command->add_option_group("scale", "millimetres of a unit of the model (default: 1)");
  scale->add_option("--scale", options.mm_per_unit, "given")->check(CLI::PositiveNumber);
  scale->add_option("--scale-from", options.scale_from,
                    "by the similarity to these poses (pose.txt's layout), whose axes are taken too");
  scale->add_flag("--scale-from-light", options.scale_from_light,
                  "by the brightness of the model's points under the calibrated light");
  scale->require_option(0, 1);
  command->add_option("--albedo", options.albedo, "of the wall in green, for --scale-from-light")
      ->check(CLI::Range(0.01, 1.0))
      ->capture_default_str();
  command->add_flag("--link", options.link, "symbolic links in place of copies of the images");
}

}  // namespace lumen
