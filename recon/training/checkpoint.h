// A training run's state in a file that says whether it is whole.
#pragma once

#include <filesystem>
#include <string>

#include "recon/training/trainer.h"

namespace lumen {

// `settings`: what the run was started with, as text; a checkpoint of other settings can't be resumed.
// Whole or not at all. Throws InputError.
void WriteCheckpoint(const std::filesystem::path& file, const std::string& settings, const TrainState& state);

// state: of the right sizes already. Throws InputError naming the file: cut short, changed (its checksum is
// wrong), of other settings, of another size.
void ReadCheckpoint(const std::filesystem::path& file, const std::string& settings, TrainState* state);

}  // namespace lumen
