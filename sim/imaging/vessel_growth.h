// How blood vessels branch over a wall: where they come up through it, trees grow along it until every part
// of it is near a twig (open venation by space colonisation: Runions et al. 2005, "Modeling and visualization
// of leaf venation patterns").
//
// Roots are scattered over the wall, four spacings apart, and a trunk grows from each in a random direction.
// Then places that want blood are scattered, ever nearer to each other. Each draws at the nearest node of a
// tree; a node that is drawn at grows a step on, in the mean direction of those that draw, with some inertia
// and chance, until a place has a node near it and draws no more. So trunks come first, then branches, then
// twigs. Vessels fork in two, and keep apart from vessels that they don't come from: trees have no loops.
// Each step goes along the wall, and drawing goes only where the wall faces alike: no vessel goes through a
// fold.
#pragma once

#include <cstdint>
#include <vector>

#include "common/math.h"
#include "common/mesh.h"

namespace lumen {

// A point of a tree. Nodes stand behind their parents.
struct VesselNode {
  Vec3d place_mm;  // on the wall, from the middle of its bounds
  Vec3d normal;    // of the smooth wall there, unit
  int parent;      // −1: a root
  int twigs = 0;   // ends of the tree that lie beyond it, itself included if it is one
};

// How far a tree grows at a time.
double VesselStep(double spacing_mm);

// Trees over a mesh, closed or open: a function of mesh and seed. Throws InputError, with the least spacing
// that it takes, where the wall is too large for so many.
std::vector<VesselNode> GrowVessels(const Mesh& wall, double spacing_mm, uint64_t seed);

}  // namespace lumen
