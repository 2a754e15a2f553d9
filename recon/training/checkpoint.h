// A training run's state in a file that says whether it is whole.
#pragma once

#include <filesystem>
#include <string>

#include "common/error.h"
#include "recon/training/trainer.h"

namespace lumen {

// `settings`: what the run was started with, as text; a checkpoint of other settings can't be resumed.
// Whole or not at all; the one that was there is kept as CheckpointBefore(file). Throws InputError.
void WriteCheckpoint(const std::filesystem::path& file, const std::string& settings, const TrainState& state);
std::filesystem::path CheckpointBefore(const std::filesystem::path& file);

// Cut short, or changed: its checksum is wrong.
class DamagedCheckpoint : public InputError {
 public:
  using InputError::InputError;
};

// state: of the right sizes already; it stays as it is where the checkpoint is damaged. Throws InputError
// naming the file: DamagedCheckpoint; of other settings; of another size.
void ReadCheckpoint(const std::filesystem::path& file, const std::string& settings, TrainState* state);

// Reads the checkpoint; where that is damaged or absent the one before it, which takes its place, and says so
// in a line. False where there is neither. Throws as ReadCheckpoint does.
bool ReadLatestCheckpoint(const std::filesystem::path& file, const std::string& settings, TrainState* state);

// Removes both.
void RemoveCheckpoints(const std::filesystem::path& file);

}  // namespace lumen
