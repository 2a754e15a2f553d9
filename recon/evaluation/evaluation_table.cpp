#include "recon/evaluation/evaluation_table.h"

#include <fmt/format.h>

namespace lumen {
namespace {

std::string Figures(const std::optional<ErrorFigures>& error) {
  if (!error) return fmt::format("{:>9}{:>9}{:>9}", "-", "-", "-");
  return fmt::format("{:9.3f}{:9.3f}{:9.3f}", error->medae_mm, error->mae_mm, error->rmse_mm);
}

std::string Percent(const std::optional<double>& fraction) {
  return fraction ? fmt::format("{:.1f}%", 100 * *fraction) : "-";
}

}  // namespace

std::string ToTable(const Evaluation& evaluation) {
  const Completeness& completeness = evaluation.completeness;
  const MeshFigures& mesh = evaluation.mesh;
  std::string table = fmt::format("{:<13}{:>9}{:>9}{:>9}\n", "error, mm", "MedAE", "MAE", "RMSE");
  table += "surveyed     " + Figures(evaluation.surveyed.error) +
           fmt::format("   {} vertices, {:.0f} mm²\n", evaluation.surveyed.vertices,
                       evaluation.coverage.surveyed_area_mm2);
  table += "extended     " + Figures(evaluation.extended.error) +
           fmt::format("   {} vertices, {:.0f} mm²\n", evaluation.extended.vertices,
                       evaluation.coverage.extended_area_mm2);
  table += "completeness " + Figures(completeness.error) + "   within 1 mm " +
           Percent(completeness.within_1mm) + ", within 3 mm " + Percent(completeness.within_3mm) + "\n";
  table += "observed     " + Percent(evaluation.coverage.observed_fraction) + " of the truth's area\n";
  const Coverage& coverage = evaluation.coverage;
  table += "coverage     " + Percent(coverage.reconstruction_share) + " by the reconstruction alone, " +
           Percent(coverage.truth_share) + " by the truth";
  if (const auto difference = coverage.DifferencePoints()) {
    table += fmt::format(": {:+.1f} percentage points", *difference);
  }
  table += "\n";
  table += fmt::format("mesh         {}, {} component{}, {} faces",
                       mesh.watertight ? "watertight" : "not watertight", mesh.components,
                       mesh.components == 1 ? "" : "s", mesh.faces);
  if (mesh.self_intersections) {
    table += fmt::format(", {} self-intersections", *mesh.self_intersections);
  }
  table += "\n";
  if (evaluation.surveyed.vertices == 0) {
    table += "no frame sees the reconstruction: is it in the sequence's world axes and in mm?\n";
  }
  return table;
}

}  // namespace lumen
