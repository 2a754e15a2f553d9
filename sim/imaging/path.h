// The path tracer: light from the endoscope's guides by way of the wall to the camera, direct and from wall
// to wall.
#pragma once

#include <cstdint>
#include <vector>

#include "common/camera.h"
#include "common/image.h"
#include "common/light.h"
#include "common/math.h"
#include "common/ray_scene.h"
#include "sim/imaging/defocus.h"
#include "sim/imaging/sampler.h"
#include "sim/imaging/shutter.h"
#include "sim/imaging/surface.h"

namespace lumen {

struct PathOptions {
  int samples = 8;         // a pixel
  int bounces = 0;         // from wall to wall; 0 = direct light only
  int roulette_after = 8;  // bounces that every path may make before Russian roulette
  int shared_paths = 16;   // that a tile's pixels share for each sample; 0 = a path for each pixel of its own
  Sampling sampler = Sampling::kSobol;
  int direct_oversampling = 1;  // samples of direct light for each of light between walls: they cost less
};

// What there is to see. All of it is referred to. A wall that moves takes a View with motion, and its times
// 0…1 are the frame's duration.
struct PathScene {
  const RayScene* wall;
  const Surface* surface;
  uint64_t surface_seed;
  // VertexNormals of the wall, for a surface with a coat; for a wall that moves, an array of them: each
  // step's.
  const std::vector<Vec3d>* vertex_normals = nullptr;
  const Mesh* rest = nullptr;         // the wall at rest, which carries the texture; none: the wall itself
  Vec3d rest_anchor = Vec3d::Zero();  // RayScene::anchor of the wall at rest
};

struct View {
  const Camera<float>* camera;
  const Image8* valid;  // pixels that are rendered; the others stay 0
  Pose world_from_camera;
  const Light* light;                    // in camera axes
  const CameraMotion* motion = nullptr;  // while the frame is taken; none: it is taken in an instant
  const Defocus* defocus = nullptr;      // of the lens; none: a pinhole
};

// Linear radiance, RGB, 1 = full scale; the parts only if asked for.
struct Film {
  ImageF radiance;
  ImageF direct, indirect;
  ImageF glint;       // of direct light on the coat; empty without one
  ImageF subsurface;  // light that left the tissue towards the camera; empty without
};

// A radiance that was not finite: it is left out of its pixel's mean, counted, and the first is named.
struct Failure {
  int64_t count = 0;
  int x = -1, y = -1, sample = -1;  // of the first, in reading order
};

struct PathCount {
  int64_t samples = 0, rays = 0;
  Failure failure;
};

// Renders one frame. Randomness is a function of (seed, frame, pixel, sample, dimension). A single sample
// goes through the pixel's centre, several are spread over its square. The film must be empty or of the
// camera's size; with_parts asks for the parts of the radiance as well. Same bytes for any number of
// threads.
PathCount RenderFrame(const PathScene& scene, const View& view, const PathOptions& options, uint64_t seed,
                      int frame, bool with_parts, Film* film);

}  // namespace lumen
