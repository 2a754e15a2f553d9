// Small meshes and sequences in memory whose evaluation is known in closed form.
#pragma once

#include <vector>

#include "common/mesh.h"
#include "common/sequence.h"

namespace lumen::test {

// Adds the plate corner + [0, 1]·edge_u + [0, 1]·edge_v in n × n squares, its normal along edge_u × edge_v.
void AddPlate(const Vec3d& corner, const Vec3d& edge_u, const Vec3d& edge_v, int n, Mesh* mesh);

// The cube [−half, half]³ with n × n squares a side, its vertices shared, normals outwards.
Mesh Cube(double half_mm, int n);

// A cube's vertices drawn to the sphere of this radius about the origin.
Mesh Sphere(double radius_mm, int n);

// A tube around the z axis from z = 0, with closed ends, normals outwards. The radius swells and shrinks by
// relief_mm in four lobes around and every 40 mm along.
Mesh Tube(double radius_mm, double length_mm, double relief_mm, int around, int along);

// The same faces in which no two share a vertex.
Mesh Soup(const Mesh& mesh);

// Pinhole frames of 200 × 200 px without colour files. half_field_deg is that of the image's sides.
Sequence PinholeSequence(const std::vector<Pose>& world_from_camera, double half_field_deg = 45);

// The camera at a place, looking along +z.
Pose At(double x_mm, double y_mm, double z_mm);

}  // namespace lumen::test
