// By how many millimetres a reconstruction is off: the table of LightNeuS ("Experiments").
#pragma once

#include <cstdint>
#include <optional>
#include <vector>

#include "common/mesh.h"
#include "common/sequence.h"
#include "recon/evaluation/mesh_check.h"

namespace lumen {

struct EvaluateOptions {
  double extended_mm = 20;            // how far from a seen vertex the extended region reaches
  int completeness_points = 100'000;  // spread over the whole ground truth; those that are seen count. As
                                      // many over the reconstruction, for what share of it is seen
  uint64_t seed = 0;                  // of the points
};

// Median, mean and root mean square of distances, mm. The median of an even number is the mean of the middle
// two.
struct ErrorFigures {
  double medae_mm = 0;
  double mae_mm = 0;
  double rmse_mm = 0;
};

// From the reconstruction's vertices to the closest ground-truth triangle.
struct RegionError {
  int64_t vertices = 0;
  std::optional<ErrorFigures> error;  // nothing where the region has no vertex
};

// From points of the ground truth's observed area to the reconstruction's closest triangle.
struct Completeness {
  int64_t points = 0;
  std::optional<ErrorFigures> error;  // this and the next two: nothing where no point is observed
  std::optional<double> within_1mm;   // fraction of the points
  std::optional<double> within_3mm;
};

struct Coverage {
  double surveyed_area_mm2 = 0;  // of the reconstruction's faces all of whose vertices are surveyed
  double extended_area_mm2 = 0;
  double observed_fraction = 0;  // of the ground truth's area

  // The share of mucosa that was surveyed: of a surface's area within extended_mm of what the frames see of
  // it, the part that they see. From the truth, and, by the same rule, from the reconstruction alone, as
  // where there is no truth; farther off the reconstruction claims nothing. Nothing where no frame sees
  // anything.
  std::optional<double> truth_share;
  std::optional<double> reconstruction_share;
  // By how many percentage points the reconstruction's is larger.
  std::optional<double> DifferencePoints() const {
    if (!truth_share || !reconstruction_share) return std::nullopt;
    return 100 * (*reconstruction_share - *truth_share);
  }
};

struct Evaluation {
  RegionError surveyed;  // vertices that at least one frame of the sequence sees (trained on or not)
  RegionError extended;  // vertices within extended_mm of a surveyed one, those included
  Completeness completeness;
  Coverage coverage;
  MeshFigures mesh;

  // One a vertex of the reconstruction. What belongs to no face is neither seen nor counted, its error 0.
  std::vector<double> signed_error_mm;  // distance to the ground truth, negative on the cameras' side of it
  std::vector<int> frames_seeing;
  int best_frame = 0;  // index of the frame that sees the most vertices, the first of them
};

// The mesh that the sequence names as the truth. Throws InputError where it names none or the mesh is no
// surface.
Mesh ReadGroundTruth(const Sequence& sequence);

// Seen is what projects onto a pixel that carries image and isn't hidden by the reconstruction's own surface.
// Not by the truth's: a vertex that lies a little behind the true wall would count as hidden by it, so that
// half of all errors would leave the table because they are errors.
//
// Observed is, of the points spread evenly over the truth, what a frame sees past the truth's own surface.
//
// Throws InputError where one of the meshes is empty, without area or not finite. Where no frame sees the
// reconstruction (it lies elsewhere, or in other units) the regions are empty, which is reported, not an
// error.
Evaluation Evaluate(const Mesh& reconstruction, const Mesh& truth, const Sequence& sequence,
                    const EvaluateOptions& options = {});
// With the sequence's own ground truth.
Evaluation Evaluate(const Mesh& reconstruction, const Sequence& sequence,
                    const EvaluateOptions& options = {});

}  // namespace lumen
