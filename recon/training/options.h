// Everything that a training run can be told, and the presets: named sets of these values.
#pragma once

#include <cstdint>
#include <filesystem>
#include <string>
#include <vector>

#include "recon/surface/field.h"

namespace lumen {

enum class SamplerKind {
  kGuided,      // a few look-ups find the surface, most samples go there
  kImportance,  // NeuS's: uniform samples, then rounds of samples drawn from the weights so far
};

enum class Decay {
  kExponential,
  kCosine,  // NeuS's
};

struct TrainOptions {
  std::string preset;
  int frames = 20;  // taken uniformly over the sequence
  int binning = 1;  // so many by so many pixels of a frame as one (common/binning.h)
  FieldOptions field;

  struct Bounds {
    double ahead_mm = 100;  // how far from a camera the wall may lie where it looks
    double aside_mm = 40;   // and in every other direction
  } bounds;

  struct Sampling {
    int rays = 256;  // a step
    SamplerKind kind = SamplerKind::kGuided;
    // Of the guided sampler:
    int coarse = 16;             // look-ups that find where a ray meets the surface
    int surface = 8;             // samples placed around that
    int spread = 9;              // samples spread in front of it
    double surface_spacing = 1;  // of those around it, in units of 1/s
    // Of the importance sampler:
    int uniform = 64;
    int rounds = 4;
    int round = 16;                             // samples a round
    double round_sharpness_per_mm = 64 / 68.0;  // of the first; it doubles from round to round
    // Of both: samples that weigh less are left out of shading and of the eikonal term; 0 = none.
    double weight_threshold = 1e-3;

    int PerRay() const { return kind == SamplerKind::kGuided ? surface + spread : uniform + rounds * round; }
  } sampling;

  struct Loss {
    double eikonal = 0.1;
    double albedo = 2;           // pull of the log albedo to its mean over rays drawn together, at the start
    double albedo_final = 0.02;  // the part of it that is left at the end
    double albedo_width = 0.3;   // of this Huber loss and that of `ambient`
    double ambient = 3;          // the same pull on the log ambient factor, all the time
    double ambient_doubt = 200;  // of ChannelTrust, recon/training/loss.h
    double free_space = 1;       // a mm that a camera lacks of this clearance: recon/training/free_space.h
    double clearance_mm = 0.5;
  } loss;

  struct Schedule {
    int64_t iterations = 9000;
    double seconds = 0;  // > 0: the run is as long as that instead
    double learning_rate = 1e-2;
    double learning_rate_final = 0.05;  // the part of it that is left at the end
    Decay decay = Decay::kExponential;
    double warm_up = 0;  // the part of the run over which the rate rises from 0
    double adam_beta2 = 0.99;
    // The tables' epsilon from that iteration on (AdamStep). Entries that hardly a ray tells of move as far
    // as any other without one: in tens of thousands of steps bubbles grow behind folds and the wall frays.
    double table_epsilon = 1e-4;
    int64_t table_epsilon_from = 8000;
    // When both that iteration and that part of the run have come, a scheduled sharpness has reached its end,
    // and from there on the run settles: a ray's weights are LinearRayWeights, twice as many look-ups find
    // the surface, and the rate falls with 1/sqrt(iteration) as well. Under the trapezoidal rule the wall
    // drifts to where that one fits best; while it is soft, though, the rule's bright front makes up for some
    // of the light that fog around folds takes: a wide lumen with deep folds takes that long to find its
    // shape, and finds it better in longer. 0 iterations: never.
    int64_t settle_from = 6000;
    double settle_part = 0.2;
    double sharpness_start_per_mm = 0.6;
    double sharpness_end_per_mm = 4.4;
    // Before that the wall is a fog of this sharpness, in which all of it can still move: it lifts, the
    // logarithm at an even pace, over so many iterations or a fifth of the run, whichever ends sooner.
    double fog_per_mm = 0.2;
    int64_t fog_iterations = 200;
    // > 0: the sharpness is learnt from its start on, its logarithm at so many times the learning rate. 0: it
    // grows from start to end by schedule.
    double sharpness_rate = 0;
    double checkpoint_seconds = 10;  // between checkpoints
  } schedule;

  struct Poses {
    bool refine = false;
    // Adam's, from `start` (a part of the run) on; from the middle of the run they fall to 0.
    double translation_rate_mm = 5e-3;
    double rotation_rate_rad = 1.5e-4;
    double start = 0.05;
    // How far the given poses may be off, RMS over frames: frames are independent, so that their common
    // drifts are less, and those are what pictures tell least of. `pull` times the mean of half the square of
    // what a number moves by, in units of it, is added to the loss.
    double noise_mm = 0.5;
    double noise_rad = 0.005;
    double pull = 1e-4;
    // Root mean squares of errors that the given poses are disturbed by first, to see what they cost
    // (recon/training/pose_noise.h).
    double disturb_mm = 0, disturb_rad = 0;
  } poses;

  double extract_cell_mm = 0.75;
  bool continue_lumen = true;  // the mesh, beyond what the frames see: recon/surface/continuation.h
};

// Names of the presets: "fast" (ours), "paper" (NeuS's networks and schedule with the changes of LightNeuS),
// and "neus" and "neus_paper", the same without the decline and without normalisation: the baselines.
std::vector<std::string> PresetNames();

// A preset with the command line's settings ("loss.eikonal=0.05") on top. Throws InputError: no such preset,
// unknown key, value out of range.
TrainOptions ReadTrainOptions(const std::string& preset, const std::vector<std::string>& settings);

// What a run was started with, as its config.toml says.
struct RunOptions {
  std::string text;  // of the file
  uint64_t seed = 0;
  TrainOptions train;
};
// Throws InputError as ReadTrainOptions does, and where the file can't be read.
RunOptions ReadRunOptions(const std::filesystem::path& file);

// All of it as TOML, as RUN/config.toml shows it.
std::string FormatTrainOptions(const TrainOptions& options);

}  // namespace lumen
