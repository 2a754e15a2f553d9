// The command line's say in reading a sequence, for the subcommands that can do with a part of one.
#pragma once

#include <CLI/CLI.hpp>
#include <filesystem>
#include <string>

#include "common/error.h"
#include "common/sequence.h"

namespace lumen {

struct SequenceArguments {
  std::filesystem::path folder;
  bool skip_damaged = false;
};

// Adds the folder as positional argument `name` and --skip-damaged.
void AddSequenceArguments(CLI::App* command, SequenceArguments* arguments, const std::string& name);

// Says what is left out. With --skip-damaged every colour file is read once. calibration: false leaves
// calibration.toml unread.
Sequence ReadSequence(const SequenceArguments& arguments, bool calibration = true);

// run(), whose complaint of a damaged frame gains the remedy.
template <class Run>
auto OfferingToSkip(const Run& run) {
  try {
    return run();
  } catch (const DamagedFrame& error) {
    throw InputError(std::string(error.what()) + "; --skip-damaged uses the other frames");
  }
}

}  // namespace lumen
