// The command line's say in studies that train on a scene many times: `budget` and `cost train`.
#pragma once

#include <CLI/CLI.hpp>
#include <filesystem>
#include <string>
#include <vector>

#include "tools/train_arguments.h"

namespace lumen {

struct StudyArguments {
  std::filesystem::path scene, folder;
  std::vector<std::string> settings;  // of the scene
  double scale = 0;                   // of the picture's width and height; 0 = not said
  int seeds = 0;                      // 0 = not said
  bool quick = false;
  TrainArguments train;
};

// What differs in the help: the name of what is written, the default scale, what --quick is.
struct StudyHelp {
  std::string name, scale, quick;
};

// Adds the scene, -o, --set, --scale, --seeds, --quick and training's options.
void AddStudyArguments(CLI::App* command, const StudyHelp& help, StudyArguments* arguments);

// What the frames follow from: a text that is another where they would be others.
std::string SubjectOf(const StudyArguments& arguments, double scale, uint64_t seed);

}  // namespace lumen
