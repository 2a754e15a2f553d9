#include "tools/study/convergence.h"

#include <fmt/format.h>

#include <cmath>

#include "common/files.h"
#include "common/mesh.h"
#include "recon/training/train.h"
#include "tools/study/strips.h"

namespace lumen {

namespace fs = std::filesystem;

std::vector<double> ConvergenceParts() {
  constexpr double kWhole = 65'000;
  return {2'500 / kWhole, 5'000 / kWhole, 12'500 / kWhole, 15'000 / kWhole, 1};
}

std::vector<ConvergencePoint> DrawConvergence(const Sequence& sequence, TrainOptions options, uint64_t seed,
                                              const std::filesystem::path& folder) {
  options.schedule.seconds = 0;
  const std::vector<double> parts = ConvergenceParts();
  TrainRun run;
  run.folder = folder / "convergence";
  run.seed = seed;
  run.meshes_at = {parts.begin(), parts.end() - 1};
  // The run that its folder holds is gone on with, from its end too; another's meshes aren't this one's.
  const std::string settings = "seed = " + std::to_string(seed) + "\n" + FormatTrainOptions(options);
  const auto config = run.folder / "config.toml";
  run.resume = fs::exists(config) && ReadFile(config) == settings;
  if (!run.resume) fs::remove_all(run.folder);
  Train(sequence, options, run);
  const Mesh truth = ReadGroundTruth(sequence);
  std::vector<ConvergencePoint> points;
  std::vector<TitledStrip> strips;
  for (const double part : parts) {
    const fs::path mesh_file = part < 1 ? MeshAtFile(run.folder, part) : run.folder / "mesh.ply";
    if (!fs::exists(mesh_file)) continue;
    const Mesh mesh = ReadMesh(mesh_file);
    const Evaluation evaluation = Evaluate(mesh, truth, sequence, {.seed = seed});
    if (!evaluation.surveyed.error || !evaluation.extended.error) continue;
    const auto iteration =
        static_cast<int64_t>(std::ceil(part * static_cast<double>(options.schedule.iterations)));
    points.push_back({iteration, *evaluation.surveyed.error, *evaluation.extended.error});
    const auto file = run.folder / fmt::format("strip_{:.3f}.png", part);
    WriteStrip(evaluation, mesh, sequence, file);
    strips.push_back(
        {fmt::format("{} iterations: MAE {:.2f} mm", iteration, points.back().surveyed.mae_mm), file});
  }
  WriteStripSheet(strips, folder / "convergence.png");
  return points;
}

}  // namespace lumen
