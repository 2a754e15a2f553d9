// What a survey has missed, shown from within.
#pragma once

#include <filesystem>
#include <vector>

#include "common/mesh.h"
#include "common/sequence.h"

namespace lumen {

// Writes to the folder, which must exist:
//   unseen.ply  the mesh, flesh-coloured where at least one frame sees it, red where none does
//   walk.png    a strip of pictures of it from places along the cameras' path, evenly spaced: above as the
//               endoscope looks there, below looking back. In its own pictures an endoscope sees nothing that
//               it hasn't seen; what folds hide shows on the way back.
// frames_seeing: an entry a vertex. Throws InputError.
void WriteWalk(const Mesh& mesh, const std::vector<int>& frames_seeing, const Sequence& sequence,
               const std::filesystem::path& folder);

// Indices of `count` frames, or of all there are, evenly along the cameras' path.
std::vector<int> StopsAlongPath(const Sequence& sequence, int count);

}  // namespace lumen
