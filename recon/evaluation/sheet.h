// The evaluation's pictures and coloured meshes.
#pragma once

#include <filesystem>

#include "common/mesh.h"
#include "common/sequence.h"
#include "recon/evaluation/evaluate.h"

namespace lumen {

// Writes to the folder (created where it is missing):
//   error.ply, error.png   the reconstruction coloured by its error: blue inside the true surface (too near to
//                          the cameras), grey where it is right, red outside, saturated at ±1 cm
//   views.ply, views.png   the truth coloured by how many frames see each place, unobserved grey
//   sheet.png              input, truth, reconstruction and error of the first, the middle and the deepest
//                          frame, and all from outside
//   unseen.ply, walk.png   what of the reconstruction was never seen in red (recon/evaluation/walk.h)
// error.png and views.png show their mesh from outside and from within. Throws InputError.
void WriteEvaluationPictures(const Evaluation& evaluation, const Mesh& reconstruction, const Mesh& truth,
                             const Sequence& sequence, const std::filesystem::path& folder);

}  // namespace lumen
