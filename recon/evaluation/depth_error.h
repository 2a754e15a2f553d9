// By how much a reconstruction's depth is off in each frame, up to scale, beside what two guesses without any
// reconstruction come to.
#pragma once

#include <cstdint>
#include <nlohmann/json_fwd.hpp>
#include <string>
#include <vector>

#include "common/mesh.h"
#include "common/sequence.h"

namespace lumen {

// Root mean square of log(depth/truth) about its mean: what one scale can't mend (Eigen, Puhrsch, Fergus,
// "Depth map prediction from a single image", NIPS 2014, eq. 1 with λ = 1). And that scale: what the depths
// are to be multiplied by so that log(depth/truth) is 0 in the mean. Both lists have the same length, all
// numbers are positive; 0 and 1 for lists without a number.
struct ScaleInvariantError {
  double error = 0;
  double scale = 1;
};
ScaleInvariantError ScaleInvariantLogError(const std::vector<double>& depth,
                                           const std::vector<double>& truth);

struct FrameDepthError {
  int number = 0;       // NNNN of the frame's files
  int64_t pixels = 0;   // valid ones with a true depth where the reconstruction has a surface: these count
  int64_t missing = 0;  // those where it has none
  ScaleInvariantError reconstruction;
  ScaleInvariantError constant;  // the same z everywhere
  // Distance² inversely proportional to the pixel's linear value, channels averaged, over vignetting and the
  // light's pattern on its ray: as if albedo and incidence were the same everywhere.
  ScaleInvariantError brightness;
};

// One for each frame with a depth file. Throws InputError: no frame has one, a file of another size than the
// camera, the mesh not usable.
std::vector<FrameDepthError> DepthErrors(const Mesh& reconstruction, const Sequence& sequence);

// As a table for people, with the frames' mean.
std::string ToTable(const std::vector<FrameDepthError>& frames);

// A list of {frame, pixels, missing, scale, reconstruction, constant, brightness}.
nlohmann::json ToJson(const std::vector<FrameDepthError>& frames);

}  // namespace lumen
