#include <fmt/core.h>

#include "tools/exchange/export_sequence.h"
#include "tools/options.h"
#include "tools/sequence_arguments.h"

namespace lumen {
namespace {

struct Arguments {
  SequenceArguments sequence;
  std::filesystem::path folder;
  ExportOptions options;
};

nlohmann::json Run(const Arguments& arguments) {
  const ExportResult result =
      ExportSequence(ReadSequence(arguments.sequence), arguments.options, arguments.folder);
  const CameraIntrinsics& camera = result.camera;
  const bool fisheye = camera.model == CameraModel::kKannalaBrandt;
  nlohmann::json json = {{"frames", result.frames},
                         {"camera",
                          {{"model", fisheye ? "opencv_fisheye" : "pinhole"},
                           {"fx", camera.fx},
                           {"fy", camera.fy},
                           {"cx", camera.cx},
                           {"cy", camera.cy}}},
                         {"masked_part", result.masked_part}};
  fmt::print("frames   {}\n", result.frames);
  fmt::print("camera   {}, {}×{}, {:.1f}% of the pixels masked\n", fisheye ? "OpenCV's fisheye" : "pinhole",
             camera.width, camera.height, 100 * result.masked_part);
  if (result.fit) {
    json["camera"]["k"] = camera.k;
    json["fit"] = {{"max_px", result.fit->max_px},
                   {"rms_px", result.fit->rms_px},
                   {"pixels", result.fit->pixels},
                   {"unfitted", result.fit->unfitted},
                   {"roll_rad", result.fit->roll_rad}};
    fmt::print("fit      off by {:.3g} px at most, {:.3g} RMS, over {} pixels", result.fit->max_px,
               result.fit->rms_px, result.fit->pixels);
    if (result.fit->unfitted > 0) {
      fmt::print("; {} more than 87° off the axis are masked", result.fit->unfitted);
    }
    if (result.fit->roll_rad != 0) {
      fmt::print("; poses turned by {:.3f}° about the axis", -result.fit->roll_rad * 180 / kPi);
    }
    fmt::print("\n");
  }
  if (result.points > 0) {
    json["points"] = {{"count", result.points}, {"observations", result.observations}};
    fmt::print("points   {}, seen {:.1f} times each\n", result.points,
               static_cast<double>(result.observations) / result.points);
  }
  if (result.sphere_radius_mm > 0) {
    json["sphere_radius_mm"] = result.sphere_radius_mm;
    fmt::print("sphere   the unit sphere is {:.1f} mm\n", result.sphere_radius_mm);
  }
  return json;
}

}  // namespace

void AddExport(CLI::App* app) {
  const auto arguments = std::make_shared<Arguments>();
  CLI::App* command =
      AddSubcommand(app, "export", "writes a sequence for COLMAP, nerfstudio or NeuS",
                    [=](const CommonOptions&) { return OfferingToSkip([&] { return Run(*arguments); }); });
  AddSequenceArguments(command, &arguments->sequence, "SEQ");
  ExportOptions& options = arguments->options;
  command->add_option("-o,--output", arguments->folder, "folder, empty or new")->required();
  command->add_option("--format", options.format, "colmap, nerfstudio or neus")
      ->required()
      ->transform(CLI::CheckedTransformer(
          std::map<std::string, ExportFormat>{{"colmap", ExportFormat::kColmap},
                                              {"nerfstudio", ExportFormat::kNerfstudio},
                                              {"neus", ExportFormat::kNeus}}));
  command->add_flag("--rectify", options.rectify, "pinhole images; NeuS gets them anyway");
  command->add_option("--fov-deg", options.fov_deg, "what a pinhole sees across the image")
      ->capture_default_str();
  command->add_option("--max-fit-px", options.max_fit_px, "an OpenCV fisheye that is off by more is refused")
      ->capture_default_str();
  command
      ->add_option("--points", options.points,
                   "colmap: places on the true wall, of which those that two frames see are written")
      ->check(CLI::Range(0, 10'000'000))
      ->capture_default_str();
  command->add_flag("--link", options.link, "symbolic links in place of copies of the images");
}

}  // namespace lumen
