#include "recon/evaluation/evaluate.h"

#include <algorithm>
#include <cmath>

#include "common/error.h"
#include "common/parallel.h"
#include "common/progress.h"
#include "common/ray_scene.h"
#include "recon/evaluation/coverage.h"
#include "recon/evaluation/nearest_point.h"
#include "recon/evaluation/point_mesh_distance.h"
#include "recon/evaluation/surface_points.h"
#include "recon/evaluation/visibility.h"

namespace lumen {
namespace {

// Distances are asked for in chunks of this many points: enough to outweigh a task's cost.
constexpr int64_t kGrain = 512;

std::vector<bool> VerticesOfFaces(const Mesh& mesh) {
  std::vector<bool> used(mesh.vertices.size(), false);
  for (const Vec3i& face : mesh.faces) {
    for (int vertex : face) used[vertex] = true;
  }
  return used;
}

// Nothing where there are no distances.
std::optional<ErrorFigures> Figures(std::vector<double> distances_mm) {
  if (distances_mm.empty()) return std::nullopt;
  ErrorFigures figures;
  double squares = 0;
  for (double d : distances_mm) {
    figures.mae_mm += d;
    squares += d * d;
  }
  const double count = static_cast<double>(distances_mm.size());
  figures.mae_mm /= count;
  figures.rmse_mm = std::sqrt(squares / count);
  const auto middle = distances_mm.begin() + static_cast<int64_t>(distances_mm.size() / 2);
  std::nth_element(distances_mm.begin(), middle, distances_mm.end());
  figures.medae_mm = *middle;
  if (distances_mm.size() % 2 == 0) {
    figures.medae_mm = (figures.medae_mm + *std::max_element(distances_mm.begin(), middle)) / 2;
  }
  return figures;
}

RegionError ErrorOver(const std::vector<double>& signed_error_mm, const std::vector<bool>& region) {
  std::vector<double> distances_mm;
  for (size_t v = 0; v < region.size(); ++v) {
    if (region[v]) distances_mm.push_back(std::abs(signed_error_mm[v]));
  }
  RegionError result;
  result.vertices = static_cast<int64_t>(distances_mm.size());
  result.error = Figures(std::move(distances_mm));
  return result;
}

double AreaOver(const Mesh& mesh, const std::vector<bool>& region) {
  double area_mm2 = 0;
  for (size_t f = 0; f < mesh.faces.size(); ++f) {
    const Vec3i& face = mesh.faces[f];
    if (region[face[0]] && region[face[1]] && region[face[2]])
      area_mm2 += FaceArea(mesh, static_cast<int>(f));
  }
  return area_mm2;
}

// Signed so that the side of the truth on which the cameras are (most of them) is negative, however the
// truth's faces are oriented and whether the wall has a thickness or not.
std::vector<double> SignedErrors(const Mesh& reconstruction, const std::vector<bool>& used,
                                 const PointMeshDistance& truth, const FrameViews& views) {
  int inside = 0;
  for (int frame = 0; frame < views.size(); ++frame) inside += truth.SignedDistance(views.Centre(frame)) < 0;
  const double sign = 2 * inside >= views.size() ? 1 : -1;
  std::vector<double> errors(reconstruction.vertices.size(), 0.0);
  ParallelChunks(0, static_cast<int64_t>(errors.size()), kGrain, [&](int64_t first, int64_t last) {
    for (int64_t v = first; v < last; ++v) {
      if (used[v]) errors[v] = sign * truth.SignedDistance(reconstruction.vertices[v]);
    }
  });
  return errors;
}

// The vertices of faces within reach_mm of a vertex of the region.
std::vector<bool> Extend(const Mesh& mesh, const std::vector<bool>& used, const std::vector<bool>& region,
                         double reach_mm) {
  std::vector<Vec3d> points;
  for (size_t v = 0; v < region.size(); ++v) {
    if (region[v]) points.push_back(mesh.vertices[v]);
  }
  const NearestPoint nearest(points);
  std::vector<uint8_t> reached(region.size(), 0);  // bytes, as threads write side by side
  ParallelChunks(0, static_cast<int64_t>(region.size()), kGrain, [&](int64_t first, int64_t last) {
    for (int64_t v = first; v < last; ++v) {
      reached[v] = region[v] || (used[v] && nearest.Distance(mesh.vertices[v]) <= reach_mm);
    }
  });
  return std::vector<bool>(reached.begin(), reached.end());
}

void MeasureCompleteness(const Mesh& reconstruction, const Mesh& truth, const FrameViews& views,
                         const EvaluateOptions& options, Evaluation* result) {
  std::vector<SurfacePoint> points = SpreadPoints(truth, options.completeness_points, options.seed);
  const std::vector<int> frames_seeing = SeePoints(RayScene(truth), points, views).frames_seeing;
  std::vector<Vec3d> observed;
  for (size_t i = 0; i < points.size(); ++i) {
    if (frames_seeing[i] > 0) observed.push_back(points[i].position);
  }
  const SurveyedShare share = MeasureShare(points, frames_seeing, options.extended_mm);
  result->coverage.observed_fraction = share.whole;
  result->coverage.truth_share = share.near;

  const PointMeshDistance to_reconstruction(reconstruction);
  std::vector<double> distances_mm(observed.size());
  ParallelChunks(0, static_cast<int64_t>(observed.size()), kGrain, [&](int64_t first, int64_t last) {
    for (int64_t i = first; i < last; ++i) distances_mm[i] = to_reconstruction.Distance(observed[i]);
  });
  Completeness& completeness = result->completeness;
  completeness.points = static_cast<int64_t>(observed.size());
  if (observed.empty()) return;
  const auto within = [&](double limit_mm) {
    const auto count = std::count_if(distances_mm.begin(), distances_mm.end(),
                                     [&](double distance_mm) { return distance_mm <= limit_mm; });
    return static_cast<double>(count) / static_cast<double>(distances_mm.size());
  };
  completeness.within_1mm = within(1);
  completeness.within_3mm = within(3);
  completeness.error = Figures(std::move(distances_mm));
}

}  // namespace

Mesh ReadGroundTruth(const Sequence& sequence) {
  if (sequence.ground_truth_mesh.empty()) {
    throw InputError(
        sequence.folder.string() +
        ": no ground truth to compare with: sequence.toml names no mesh and there is no coverage_mesh.obj");
  }
  Mesh truth = ReadMesh(sequence.ground_truth_mesh);
  RequireSurface(truth, sequence.ground_truth_mesh.string());
  return truth;
}

Evaluation Evaluate(const Mesh& reconstruction, const Mesh& truth, const Sequence& sequence,
                    const EvaluateOptions& options) {
  RequireSurface(reconstruction, "the reconstruction");
  RequireSurface(truth, "the ground truth");
  Progress progress("evaluate");
  const FrameViews views(sequence);
  const std::vector<bool> used = VerticesOfFaces(reconstruction);
  Evaluation result;

  progress.Update(0, "what the frames see");
  const RayScene scene(reconstruction);
  Visibility seen = SeeVertices(scene, views);
  std::vector<bool> surveyed(used.size());
  for (size_t v = 0; v < used.size(); ++v) {
    if (!used[v]) seen.frames_seeing[v] = 0;
    surveyed[v] = seen.frames_seeing[v] > 0;
  }
  const std::vector<bool> extended = Extend(reconstruction, used, surveyed, options.extended_mm);
  result.frames_seeing = std::move(seen.frames_seeing);
  result.best_frame = static_cast<int>(std::max_element(seen.places_seen.begin(), seen.places_seen.end()) -
                                       seen.places_seen.begin());

  const auto points = SpreadPoints(reconstruction, options.completeness_points, options.seed);
  result.coverage.reconstruction_share =
      MeasureShare(points, SeePoints(scene, points, views).frames_seeing, options.extended_mm).near;

  progress.Update(0.4, "distances to the truth");
  result.signed_error_mm = SignedErrors(reconstruction, used, PointMeshDistance(truth), views);
  result.surveyed = ErrorOver(result.signed_error_mm, surveyed);
  result.extended = ErrorOver(result.signed_error_mm, extended);
  result.coverage.surveyed_area_mm2 = AreaOver(reconstruction, surveyed);
  result.coverage.extended_area_mm2 = AreaOver(reconstruction, extended);

  progress.Update(0.6, "completeness");
  MeasureCompleteness(reconstruction, truth, views, options, &result);
  progress.Update(0.8, "the mesh itself");
  result.mesh = CheckMesh(reconstruction);
  return result;
}

Evaluation Evaluate(const Mesh& reconstruction, const Sequence& sequence, const EvaluateOptions& options) {
  return Evaluate(reconstruction, ReadGroundTruth(sequence), sequence, options);
}

}  // namespace lumen
