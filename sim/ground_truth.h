// What is where in a frame, in double: the truth that a reconstruction is held against.
#pragma once

#include <vector>

#include "common/camera.h"
#include "common/image.h"
#include "common/math.h"
#include "common/ray_scene.h"

namespace lumen {

// Through the pixels' centres; NaN where there is no surface or no ray.
struct FrameTruth {
  ImageF z;              // mm along the camera's axis
  ImageF distance;       // mm along the ray
  ImageF normal;         // camera axes, unit, facing the camera; of the triangle
  ImageF smooth_normal;  // the same of the smooth wall that the triangles stand for: the vertices' normals,
                         // interpolated, on the side of `normal`
  ImageF position;       // mm, world axes
  ImageF rest_position;  // the same of the wall at rest: the place moves with its face
  ImageF flow;  // px, this frame → the one before: where the place was seen there, minus where it is here
  ImageF seen_before;  // 1 where the frame before sees the same place, 0 where something hides it or it lies
                       // outside
  ImageF flow_next, seen_after;  // the same of the frame after
  Image8 occlusion;  // C3VD's: 255 where the ray, led on behind the surface, meets wall that faces the camera
};

// Distance, mm, to which C3VD's depth and occlusion reach.
inline constexpr double kDepthRange_mm = 100;

// What not every caller asks for; null: the images that need it stay empty.
struct TruthExtras {
  const Pose* world_from_next = nullptr;               // flow_next, seen_after
  const std::vector<Vec3d>* vertex_normals = nullptr;  // VertexNormals of the wall: smooth_normal
  // Where the wall moves: it at the moments of the neighbours, and at rest (rest_position). All have the same
  // faces, and flow follows the places of a face as it moves.
  const RayScene* wall_before = nullptr;
  const RayScene* wall_after = nullptr;
  const Mesh* rest = nullptr;
};

// The ray is found in float and its distance computed in double. world_from_previous: the pose of the frame
// before; null for the first frame, which has no flow (flow and seen_before stay empty).
FrameTruth ComputeTruth(const RayScene& wall, const Camera<double>& camera, const Image8& valid,
                        const Pose& world_from_camera, const Pose* world_from_previous,
                        const TruthExtras& extras = {});

// Marks the faces that a frame sees: the face's centroid or one of its corners, moved a thousandth towards
// the centroid, projects into a valid pixel and nothing hides it; or a pixel's centre ray meets it. observed:
// an entry a face.
void MarkObserved(const RayScene& wall, const Camera<double>& camera, const Image8& valid,
                  const Pose& world_from_camera, std::vector<uint8_t>* observed);

}  // namespace lumen
