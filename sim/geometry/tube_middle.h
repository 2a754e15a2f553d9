// The middle of a tube of triangles, where nobody gives its centreline.
#pragma once

#include <vector>

#include "common/mesh.h"

namespace lumen {

// Points about 5 mm apart from one end of a tube to the other: the centroids of slices at equal distance
// along the edges from one end, an open tube's from its rim, a closed one's from the place farthest from the
// other end. Which end comes first is the mesh's accident. Empty where there are too few slices: the mesh is
// no tube. Expects an oriented manifold in one piece.
std::vector<Vec3d> MiddleOfTube(const Mesh& mesh);

// Points 1 mm apart on the curve through the given ones, each the mean of its surroundings by a Gaussian of
// sigma_mm; the ends stay.
std::vector<Vec3d> SmoothedCurve(const std::vector<Vec3d>& points, double sigma_mm);

}  // namespace lumen
