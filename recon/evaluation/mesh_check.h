// What a mesh is as a surface: closed or not, in how many pieces, crossing itself or not.
#pragma once

#include <cstdint>
#include <optional>
#include <string>

#include "common/mesh.h"

namespace lumen {

struct MeshFigures {
  bool watertight = false;  // IsManifoldAndClosed
  int components = 0;       // sets of faces connected by shared vertices
  int64_t faces = 0;
  // Pairs of faces that cross or touch without being neighbours, by exact predicates. Nothing where the mesh
  // is no manifold, for which CGAL doesn't tell.
  std::optional<int64_t> self_intersections;
};

MeshFigures CheckMesh(const Mesh& mesh);

// Whether the faces bound a volume: every edge belongs to two faces that run along it in opposite directions,
// the faces around a vertex form one fan, and there are faces at all.
bool IsManifoldAndClosed(const Mesh& mesh);

// Throws InputError where a mesh is no surface to measure: no faces, an index out of range, a vertex that
// isn't finite, no area. `name` says in the message which mesh it is.
void RequireSurface(const Mesh& mesh, const std::string& name);

}  // namespace lumen
