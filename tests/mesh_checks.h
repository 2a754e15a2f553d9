// What CGAL's exact predicates say about a mesh, for tests of whatever makes meshes.
#pragma once

#include <gtest/gtest.h>

#include "common/mesh.h"

namespace lumen::test {

struct MeshFacts {
  bool manifold = false;  // every edge joins two faces that agree, every corner one fan; the rest holds if so
  bool closed = false;
  bool outward = false;
  size_t self_intersections = 0;  // pairs of faces
  size_t pieces = 0;
};
MeshFacts Examine(const Mesh& mesh);

// True where the facts are those of one closed, outward surface; says what is wrong otherwise.
::testing::AssertionResult BoundsOneVolume(const Mesh& mesh);

// mm³, by the divergence theorem.
double Volume(const Mesh& mesh);

// The distance of a point to the nearest triangle, by CGAL's, of all of them.
double DistanceByBruteForce(const Mesh& mesh, const Vec3d& point);

}  // namespace lumen::test
