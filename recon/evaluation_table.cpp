#include "recon/evaluation_table.h"

#include <cstdarg>
#include <cstdio>

namespace lumen {
namespace {

// printf's formatting into a string.
[[gnu::format(printf, 1, 2)]] std::string Format(const char* format, ...) {
  char line[256];
  va_list arguments;
  va_start(arguments, format);
  std::vsnprintf(line, sizeof line, format, arguments);
  va_end(arguments);
  return line;
}

std::string Figures(const std::optional<ErrorFigures>& error) {
  if (!error) return Format("%9s%9s%9s", "-", "-", "-");
  return Format("%9.3f%9.3f%9.3f", error->medae_mm, error->mae_mm, error->rmse_mm);
}

std::string Percent(const std::optional<double>& fraction) {
  return fraction ? Format("%.1f%%", 100 * *fraction) : "-";
}

}  // namespace

std::string ToTable(const Evaluation& evaluation) {
  const Completeness& completeness = evaluation.completeness;
  const MeshFigures& mesh = evaluation.mesh;
  std::string table = Format("%-13s%9s%9s%9s\n", "error, mm", "MedAE", "MAE", "RMSE");
  table += "surveyed     " + Figures(evaluation.surveyed.error) +
           Format("   %lld vertices, %.0f mm2\n", static_cast<long long>(evaluation.surveyed.vertices),
                  evaluation.coverage.surveyed_area_mm2);
  table += "extended     " + Figures(evaluation.extended.error) +
           Format("   %lld vertices, %.0f mm2\n", static_cast<long long>(evaluation.extended.vertices),
                  evaluation.coverage.extended_area_mm2);
  table += "completeness " + Figures(completeness.error) + "   within 1 mm " +
           Percent(completeness.within_1mm) + ", within 3 mm " + Percent(completeness.within_3mm) + "\n";
  table += "observed     " + Percent(evaluation.coverage.observed_fraction) + " of the truth's area\n";
  table +=
      Format("mesh         %s, %d component%s, %lld faces", mesh.watertight ? "watertight" : "not watertight",
             mesh.components, mesh.components == 1 ? "" : "s", static_cast<long long>(mesh.faces));
  if (mesh.self_intersections) {
    table += Format(", %lld self-intersections", static_cast<long long>(*mesh.self_intersections));
  }
  table += "\n";
  if (evaluation.surveyed.vertices == 0) {
    table += "no frame sees the reconstruction: is it in the sequence's world axes and in mm?\n";
  }
  return table;
}

}  // namespace lumen
