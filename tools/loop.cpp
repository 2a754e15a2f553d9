#include <iostream>

#include "common/files.h"
#include "common/progress.h"
#include "recon/evaluation/evaluate.h"
#include "recon/evaluation/evaluation_json.h"
#include "recon/evaluation/evaluation_table.h"
#include "recon/evaluation/sheet.h"
#include "tools/options.h"
#include "tools/render_arguments.h"
#include "tools/train_arguments.h"

namespace lumen {
namespace {

struct Arguments {
  RenderArguments render;
  TrainArguments train;
  std::filesystem::path folder;
};

nlohmann::json RunLoop(const Arguments& arguments, const CommonOptions& common) {
  // Read first: a mistake in training's options should not wait for the render.
  const TrainOptions options = ReadTrainOptions(arguments.train.preset, arguments.train.Settings());
  const std::filesystem::path sequence_folder = arguments.folder / "sequence";

  const RenderResult rendered = RunRender(arguments.render, common.seed, sequence_folder);
  Say("rendered " + std::to_string(rendered.frames) + " frames in " + std::to_string(rendered.seconds) +
      " s");

  const Sequence sequence = ReadSequence(sequence_folder);
  TrainRun run;
  run.folder = arguments.folder;
  run.seed = common.seed;
  const TrainResult trained = Train(sequence, options, run);
  Say("trained " + std::to_string(trained.iterations) + " iterations in " + std::to_string(trained.seconds) +
      " s");

  const Mesh reconstruction = ReadMesh(arguments.folder / "mesh.ply");
  const Mesh truth = ReadGroundTruth(sequence);
  EvaluateOptions evaluate;
  evaluate.seed = common.seed;
  const Evaluation evaluation = Evaluate(reconstruction, truth, sequence, evaluate);
  WriteEvaluationPictures(evaluation, reconstruction, truth, sequence, arguments.folder);
  const nlohmann::json figures = ToJson(evaluation);
  WriteFile(arguments.folder / "evaluation.json", figures.dump(2) + "\n");
  std::cout << ToTable(evaluation);
  return {{"render", ToJson(rendered)}, {"train", ToJson(trained)}, {"evaluate", figures}};
}

}  // namespace

void AddLoop(CLI::App* app) {
  auto arguments = std::make_shared<Arguments>();
  auto* command =
      AddSubcommand(app, "loop", "renders, trains and evaluates a scene",
                    [arguments](const CommonOptions& common) { return RunLoop(*arguments, common); });
  command->add_option("scene", arguments->render.scene, "scene file (see scenes/README.md)")->required();
  command->add_option("--set", arguments->render.settings, "a key of the scene: path.to.key=value");
  command->add_option("-o", arguments->folder, "folder for the sequence, the mesh and the evaluation")
      ->required();
  AddTrainArguments(command, &arguments->train, "--train-set");
}

}  // namespace lumen
