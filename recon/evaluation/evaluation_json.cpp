#include "recon/evaluation/evaluation_json.h"

#include <nlohmann/json.hpp>

namespace lumen {
namespace {

nlohmann::json OrNull(const std::optional<double>& value) { return value ? nlohmann::json(*value) : nullptr; }

nlohmann::json Figures(const std::optional<ErrorFigures>& error) {
  if (!error) return {{"medae_mm", nullptr}, {"mae_mm", nullptr}, {"rmse_mm", nullptr}};
  return {{"medae_mm", error->medae_mm}, {"mae_mm", error->mae_mm}, {"rmse_mm", error->rmse_mm}};
}

nlohmann::json Region(const RegionError& region) {
  nlohmann::json json = Figures(region.error);
  json["vertices"] = region.vertices;
  return json;
}

}  // namespace

nlohmann::json ToJson(const Evaluation& evaluation) {
  nlohmann::json completeness = Figures(evaluation.completeness.error);
  completeness["within_1mm"] = OrNull(evaluation.completeness.within_1mm);
  completeness["within_3mm"] = OrNull(evaluation.completeness.within_3mm);
  nlohmann::json mesh = {{"watertight", evaluation.mesh.watertight},
                         {"components", evaluation.mesh.components},
                         {"faces", evaluation.mesh.faces}};
  const auto& crossings = evaluation.mesh.self_intersections;
  mesh["self_intersections"] = crossings ? nlohmann::json(*crossings) : nullptr;
  return {{"surveyed", Region(evaluation.surveyed)},
          {"extended", Region(evaluation.extended)},
          {"completeness", completeness},
          {"coverage",
           {{"surveyed_area_mm2", evaluation.coverage.surveyed_area_mm2},
            {"extended_area_mm2", evaluation.coverage.extended_area_mm2},
            {"observed_fraction", evaluation.coverage.observed_fraction},
            {"truth_share", OrNull(evaluation.coverage.truth_share)},
            {"reconstruction_share", OrNull(evaluation.coverage.reconstruction_share)},
            {"difference_percentage_points", OrNull(evaluation.coverage.DifferencePoints())}}},
          {"mesh", mesh}};
}

}  // namespace lumen
