#include "recon/evaluation/evaluate.h"

#include <iostream>

#include "common/files.h"
#include "common/progress.h"
#include "recon/evaluation/depth_error.h"
#include "recon/evaluation/evaluation_json.h"
#include "recon/evaluation/evaluation_table.h"
#include "recon/evaluation/sheet.h"
#include "tools/options.h"
#include "tools/sequence_arguments.h"

namespace lumen {
namespace {

struct Arguments {
  std::filesystem::path mesh, folder;
  SequenceArguments sequence;
  bool depth = false;
};

nlohmann::json CompareDepth(const Mesh& reconstruction, const Sequence& sequence) {
  const std::vector<FrameDepthError> errors = DepthErrors(reconstruction, sequence);
  std::cout << ToTable(errors);
  return {{"depth", ToJson(errors)}};
}

nlohmann::json Run(const Arguments& arguments, const CommonOptions& common) {
  const Sequence sequence = ReadSequence(arguments.sequence);
  const Mesh reconstruction = ReadMesh(arguments.mesh);
  RequireSurface(reconstruction, arguments.mesh.string());
  if (arguments.depth) return CompareDepth(reconstruction, sequence);
  const Mesh truth = ReadGroundTruth(sequence);
  EvaluateOptions options;
  options.seed = common.seed;
  const Evaluation evaluation = Evaluate(reconstruction, truth, sequence, options);
  const nlohmann::json result = ToJson(evaluation);
  std::cout << ToTable(evaluation);
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
  command->add_option("-o,--output", arguments->folder, "folder for the coloured meshes and pictures");
}

}  // namespace lumen
