// The surface of a field as a closed triangle mesh.
#pragma once

#include "common/mesh.h"
#include "recon/surface/continuation.h"
#include "recon/surface/field.h"

namespace lumen {

struct ExtractOptions {
  double cell_mm = 0.75;
  const Continuation* continuation = nullptr;  // null: the field's own surface, wherever it is
  // Places in the lumen, relative to the field's origin.
  std::vector<Vec3d> inside;
};

// Marching tetrahedra (six to a cube, so that the mesh is a closed manifold by construction) on a lattice
// over the field's box; only blocks that the surface passes through are looked at. Keeps the wall around the
// places inside (recon/surface/wall_around.h): beyond it, where nothing holds the field, it can have blobs.
// Vertices in world mm (`origin` is the field's), faces oriented away from the lumen. Empty where the field
// has no surface. Throws InputError where the field is not finite.
Mesh ExtractMesh(const Field<float>& field, const float* parameters, const Vec3d& origin,
                 const ExtractOptions& options);

}  // namespace lumen
