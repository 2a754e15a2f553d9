// From a heap of triangles to a closed, smooth surface, through CGAL (the only file of the simulator that
// knows it).
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "common/mesh.h"
#include "sim/geometry/centreline.h"

namespace lumen {

// What was done to a mesh, a phrase each: "filled 2 holes".
using RepairLog = std::vector<std::string>;

// Triangles that share their corners: equal vertices are one, degenerate and doubled faces are left out.
Mesh Weld(const Mesh& soup, RepairLog* log);

// Whether a surface of welded triangles has one side only, as a Moebius strip: there is no way to turn its
// faces so that they agree over every edge that joins two.
bool OneSided(const Mesh& welded);

// The largest piece of a triangle soup, welded, as an oriented manifold, perhaps with holes: faces turned to
// agree, vertices and edges that join more than one sheet taken apart, stitched where borders coincide. Empty
// where nothing is left.
Mesh MakeManifold(const Mesh& soup, RepairLog* log);

// Fills every hole of a manifold with a patch that continues the surface smoothly; turns the normals outward.
Mesh FillHoles(const Mesh& mesh, RepairLog* log);

// The part of a tube between two cross-sections of its centreline, open there. Places whose nearest point of
// the centreline lies more than 10 mm outside of [from_mm, to_mm] go first, so that the planes meet no other
// loop.
Mesh CutTube(const Mesh& mesh, const Centreline& centreline, double from_mm, double to_mm);

// Taubin's smoothing ("A signal processing approach to fair surface design", SIGGRAPH 1995): steps and noise
// go, volume stays. Topology and vertex count stay.
Mesh SmoothMesh(const Mesh& mesh, int iterations);

// Loop subdivision until the mean edge is at most edge_mm long.
Mesh SubdivideMesh(const Mesh& mesh, double edge_mm);

// Where the surface goes through itself, cuts the place out and fills it again. Whether that sufficed is
// Problem()'s to say.
Mesh RemoveSelfIntersections(const Mesh& mesh, RepairLog* log);

// Why a mesh is no closed surface that bounds a volume, normals outward; nothing where it is.
std::optional<std::string> Problem(const Mesh& mesh);

}  // namespace lumen
