#include "recon/calibration/quick_surface.h"

#include "common/error.h"
#include "common/progress.h"
#include "recon/surface/extract.h"
#include "recon/training/trainer.h"

namespace lumen {

QuickSurface LearnQuickSurface(const Sequence& sequence, const QuickSurfaceOptions& options, uint64_t seed) {
  QuickSurface surface;
  surface.frames = UniformFrames(static_cast<int>(sequence.frames.size()), options.frames);
  Sequence taken = sequence;
  taken.frames.clear();
  for (int index : surface.frames) {
    taken.frames.push_back(sequence.frames[index]);
    taken.frames.back().gain.reset();
    taken.frames.back().log_gain_error.reset();
  }
  TrainOptions training = ReadTrainOptions("fast", {});
  training.schedule.iterations = options.iterations;
  const TrainingFrames frames(taken, static_cast<int>(taken.frames.size()), true);
  Trainer trainer(frames, training, seed);
  Progress progress("surface");
  for (int64_t i = 0; i < options.iterations; ++i) {
    const double done = static_cast<double>(i) / static_cast<double>(options.iterations);
    trainer.Step(done);
    progress.Update(done);
  }
  if (2 * trainer.state().skipped_steps > options.iterations) {
    throw InputError(
        sequence.folder.string() +
        ": no surface can be learnt, half of the steps had no finite gradient; check poses and light");
  }
  surface.log_gain.assign(trainer.state().log_gain.begin(), trainer.state().log_gain.end());
  ExtractOptions extract;
  extract.cell_mm = options.cell_mm;
  surface.mesh = ExtractMesh(trainer.field(), trainer.Weights(), trainer.origin(), extract);
  if (surface.mesh.faces.empty()) {
    throw InputError(sequence.folder.string() + ": no surface can be learnt; check poses and light");
  }
  return surface;
}

}  // namespace lumen
