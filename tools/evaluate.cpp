#include "recon/evaluation/evaluate.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <iostream>

#include "common/error.h"
#include "common/files.h"
#include "common/pose_file.h"
#include "common/progress.h"
#include "common/similarity.h"
#include "recon/evaluation/depth_error.h"
#include "recon/evaluation/evaluation_json.h"
#include "recon/evaluation/evaluation_table.h"
#include "recon/evaluation/light_error.h"
#include "recon/evaluation/sheet.h"
#include "tools/options.h"
#include "tools/sequence_arguments.h"

namespace lumen {
namespace {

struct Arguments {
  std::filesystem::path mesh, folder;
  SequenceArguments sequence;
  bool depth = false, light = false, align = false;
};

nlohmann::json CompareDepth(const Mesh& reconstruction, const Sequence& sequence) {
  const std::vector<FrameDepthError> errors = DepthErrors(reconstruction, sequence);
  std::cout << ToTable(errors);
  return {{"depth", ToJson(errors)}};
}

// The mesh lies in the folder of the run that made it.
nlohmann::json CompareLight(const Arguments& arguments, const Sequence& sequence) {
  constexpr double kPixels = 40'000;  // of a frame, about
  const CameraIntrinsics& camera = sequence.calibration.camera;
  const int stride =
      std::max(1, static_cast<int>(std::lround(std::sqrt(double(camera.width) * camera.height / kPixels))));
  // Before the run is read: what the sequence lacks is seen at once.
  const std::vector<LightFrame> first = {TrueLight(sequence, sequence.frames.front(), stride)};
  const LearntLight light(arguments.mesh.parent_path(), sequence);
  std::vector<LightFrame> learnt, truth;
  std::vector<int> numbers;
  Progress progress("light");
  const int count = static_cast<int>(light.frames().size());
  for (int n = 0; n < count; ++n) {
    const SequenceFrame& frame = sequence.frames[light.frames()[n]];
    truth.push_back(n == 0 ? first.front() : TrueLight(sequence, frame, stride));
    learnt.push_back(light.At(n, stride));
    numbers.push_back(frame.number);
    progress.Update(double(n + 1) / count);
  }
  const LightErrors errors = CompareLight(learnt, truth);
  std::cout << ToTable(errors);
  if (!arguments.folder.empty()) {
    CreateFolder(arguments.folder);
    WriteLightPicture(errors, learnt, truth, numbers, arguments.folder / "light.png");
    Say("picture in " + (arguments.folder / "light.png").string());
  }
  return {{"light", ToJson(errors)}};
}

// What takes the refined poses in the mesh's folder, one a frame trained on, to those of the sequence.
SimilarityFit FitToSequence(const std::filesystem::path& file, const Sequence& sequence) {
  if (!std::filesystem::exists(file)) {
    throw InputError(file.string() +
                     ": there is none; --align takes the mesh.ply of a run with poses.refine=true");
  }
  const std::vector<Pose> refined = ReadPoses(file);
  const int count = static_cast<int>(sequence.frames.size());
  if (refined.size() > sequence.frames.size()) {
    throw InputError(fmt::format("{}: {} poses, but {} has {} frames; name the sequence trained on",
                                 file.string(), refined.size(), sequence.folder.string(), count));
  }
  std::vector<Pose> given;
  for (int i : UniformFrames(count, static_cast<int>(refined.size())))
    given.push_back(sequence.frames[i].world_from_camera);
  try {
    return FitSimilarity(refined, given);
  } catch (const InputError& error) {
    throw InputError(file.string() + ": " + error.what());
  }
}

nlohmann::json EvaluateAligned(const std::filesystem::path& file, Mesh reconstruction, const Mesh& truth,
                               const Sequence& sequence, const EvaluateOptions& options) {
  const SimilarityFit fit = FitToSequence(file, sequence);
  const Similarity& to_truth = fit.similarity;
  for (Vec3d& vertex : reconstruction.vertices) vertex = Mapped(to_truth, vertex);
  const Evaluation evaluation = Evaluate(reconstruction, truth, sequence, options);
  Vec3d middle = Vec3d::Zero(), moved = Vec3d::Zero();
  const double share = 1.0 / static_cast<double>(sequence.frames.size());
  for (const SequenceFrame& frame : sequence.frames) {
    middle += share * frame.world_from_camera.translation();
    moved += share * Mapped(to_truth, frame.world_from_camera).translation();
  }
  const double shift_mm = (moved - middle).norm();
  const double turn_rad = Eigen::AngleAxisd(to_truth.rotation).angle();
  fmt::print(
      "\naligned by its poses: scaled by {:.5f}, turned by {:.3f}°, shifted by {:.3f} mm; they leave {:.3f} "
      "mm and {:.3f}° (RMS)\n",
      to_truth.scale, turn_rad * 180 / kPi, shift_mm, fit.rms_mm, fit.rms_rad * 180 / kPi);
  std::cout << ToTable(evaluation);
  nlohmann::json json = ToJson(evaluation);
  json["alignment"] = {{"scale", to_truth.scale},
                       {"turn_rad", turn_rad},
                       {"shift_mm", shift_mm},
                       {"rms_mm", fit.rms_mm},
                       {"rms_rad", fit.rms_rad}};
  return json;
}

nlohmann::json Run(const Arguments& arguments, const CommonOptions& common) {
  const Sequence sequence = ReadSequence(arguments.sequence);
  const Mesh reconstruction = ReadMesh(arguments.mesh);
  RequireSurface(reconstruction, arguments.mesh.string());
  if (arguments.light) return CompareLight(arguments, sequence);
  if (arguments.depth) return CompareDepth(reconstruction, sequence);
  const Mesh truth = ReadGroundTruth(sequence);
  EvaluateOptions options;
  options.seed = common.seed;
  const Evaluation evaluation = Evaluate(reconstruction, truth, sequence, options);
  nlohmann::json result = ToJson(evaluation);
  std::cout << ToTable(evaluation);
  if (arguments.align) {
    std::cout << std::flush;
    result["aligned"] =
        EvaluateAligned(arguments.mesh.parent_path() / "pose.txt", reconstruction, truth, sequence, options);
  }
  if (!arguments.folder.empty()) {
    WriteEvaluationPictures(evaluation, reconstruction, truth, sequence, arguments.folder);
    WriteFile(arguments.folder / "evaluation.json", result.dump(2) + "\n");
    Say("pictures in " + arguments.folder.string());
  }
  return result;
}

}  // namespace

void AddEvaluate(CLI::App* app) {
  const auto arguments = std::make_shared<Arguments>();
  CLI::App* command = AddSubcommand(
      app, "evaluate", "measures a reconstruction against the truth",
      [=](const CommonOptions& common) { return OfferingToSkip([&] { return Run(*arguments, common); }); });
  command->add_option("MESH", arguments->mesh, "the reconstruction (PLY, OBJ, OFF, STL; mm, world axes)")
      ->required();
  AddSequenceArguments(command, &arguments->sequence, "SEQ");
  command->add_flag(
      "--depth", arguments->depth,
      "instead, hold each frame's depth against its depth file, up to scale; needs no true mesh");
  command
      ->add_flag(
          "--light", arguments->light,
          "instead, hold albedo and light between walls, as the run in the mesh's folder has learnt them, "
          "against the channels that the sequence was rendered with")
      ->excludes("--depth");
  command
      ->add_flag("--align", arguments->align,
                 "also once more, moved by the similarity (Umeyama 1991) that takes the refined poses in the "
                 "mesh's folder to the sequence's: no picture tells a common motion of all poses, nor scale")
      ->excludes("--depth")
      ->excludes("--light");
  command->add_option("-o,--output", arguments->folder, "folder for the coloured meshes and pictures");
}

}  // namespace lumen
