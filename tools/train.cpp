#include <iostream>

#include "common/sequence.h"
#include "tools/options.h"
#include "tools/train_arguments.h"

namespace lumen {

void AddTrain(CLI::App* app) {
  struct Arguments {
    std::filesystem::path sequence, run;
    TrainArguments train;
    bool resume = false;
  };
  auto arguments = std::make_shared<Arguments>();
  auto* command =
      AddSubcommand(app, "train", "reconstructs a sequence", [arguments](const CommonOptions& common) {
        const TrainOptions options = ReadTrainOptions(arguments->train.preset, arguments->train.Settings());
        TrainRun run;
        run.folder = arguments->run;
        run.seed = common.seed;
        run.resume = arguments->resume;
        const TrainResult result = Train(ReadSequence(arguments->sequence), options, run);
        std::cout << "trained " << result.iterations << " iterations in " << result.seconds
                  << " s; the mesh is " << (run.folder / "mesh.ply").string() << "\n";
        return ToJson(result);
      });
  command->add_option("sequence", arguments->sequence, "sequence folder")->required();
  command->add_option("-o", arguments->run, "folder of the run")->required();
  AddTrainArguments(command, &arguments->train);
  command->add_flag("--resume", arguments->resume, "go on from the folder's checkpoint");
}

}  // namespace lumen
