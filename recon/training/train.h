// A training run from sequence to mesh, in a folder: mesh.ply, log.jsonl, config.toml, checkpoint and
// checkpoint.before.
#pragma once

#include <cstdint>
#include <filesystem>
#include <string>
#include <vector>

#include "common/sequence.h"
#include "recon/training/options.h"

namespace lumen {

struct TrainRun {
  std::filesystem::path folder;
  uint64_t seed = 0;
  bool resume = false;  // go on from the folder's checkpoint, if there is one
  // Parts of the run, ascending, from 0 to below 1: the mesh as it is then is written too, as MeshAtFile
  // says, if it has a face.
  std::vector<double> meshes_at;
};

// FOLDER/mesh_at_0.038.ply for the part 0.038 of a run.
std::filesystem::path MeshAtFile(const std::filesystem::path& folder, double part);

struct TrainResult {
  double seconds = 0;      // of training; reading frames and extracting the mesh come on top
  double cpu_seconds = 0;  // of it, of all threads; since the run was resumed
  int64_t iterations = 0;
  double rays_per_second = 0;
  double final_loss = 0;
  std::string stopped_by;  // "iterations" or "seconds"
  int64_t skipped_steps = 0;
};

// Throws InputError: what the sequence or the folder is at fault for; a run that fails or has no surface at
// its end (recon/training/plausible.h), which leaves no mesh.ply. An earlier run's mesh in the folder is removed
// first, unless this one resumes it.
TrainResult Train(const Sequence& sequence, const TrainOptions& options, const TrainRun& run);

}  // namespace lumen
