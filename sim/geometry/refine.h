// Triangles for a smooth surface: few where it is flat, many where it bends.
#pragma once

#include <functional>
#include <vector>

#include "common/mesh.h"

namespace lumen {

// A surface as a map from a domain: itself a surface in space, so that it may be closed.
struct ParametricSurface {
  std::function<Vec3d(const Vec3d&)> onto_domain;  // a point near the domain → the domain's point
  std::function<Vec3d(const Vec3d&)> at;           // the domain's point → mm. Called from any thread
};

// Splits the edges of a mesh of the domain until the surface is nowhere farther than tolerance_mm from the
// triangles, as judged at the edges' middles (features narrower than the given edges may be missed). A
// triangle that is split is split at its longest edge first (Rivara, "Algorithms for refining triangular
// grids", 1984), so that angles don't degenerate; the result has the topology and orientation of the domain's
// mesh.
Mesh Refine(const Mesh& domain, const ParametricSurface& surface, double tolerance_mm);

}  // namespace lumen
