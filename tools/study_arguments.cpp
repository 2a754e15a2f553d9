#include "tools/study_arguments.h"

#include <fmt/core.h>

#include "common/files.h"

namespace lumen {

void AddStudyArguments(CLI::App* command, const StudyHelp& help, StudyArguments* arguments) {
  command->add_option("scene", arguments->scene, "scene file (see scenes/README.md)")
      ->required()
      ->check(CLI::ExistingFile);
  command
      ->add_option(
          "-o,--output", arguments->folder,
          "folder for " + help.name + ".csv, .svg and .png; what it holds already isn't measured again")
      ->required();
  command->add_option("--set", arguments->settings, "a key of the scene: path.to.key=value");
  command
      ->add_option("--scale", arguments->scale,
                   "of the picture's width and height (default: " + help.scale + ")")
      ->check(CLI::Range(1e-3, 8.0));
  command->add_option("--seeds", arguments->seeds, "runs of everything (default: 3)")
      ->check(CLI::Range(1, 1000));
  command->add_flag("--quick", arguments->quick, help.quick);
  AddTrainArguments(command, &arguments->train, "--train-set");
}

std::string SubjectOf(const StudyArguments& arguments, double scale, uint64_t seed) {
  std::string subject = fmt::format("scale = {}\nseed = {}\n", scale, seed);
  for (const std::string& setting : arguments.settings) subject += setting + "\n";
  return subject + ReadFile(arguments.scene);
}

}  // namespace lumen
