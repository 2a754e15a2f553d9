// Places of the wall, and what each frame of a sequence shows of them.
#pragma once

#include <cstdint>
#include <vector>

#include "common/mesh.h"
#include "common/ray_scene.h"
#include "common/sequence.h"

namespace lumen {

struct Place {
  Vec3d point;   // mm, world
  Vec3d normal;  // unit, into the lumen
};

// Tables have a row a place and a column a frame.
struct Sightings {
  std::vector<Place> places;
  double area_mm2 = 0;  // that each place stands for
  // Linear value of each channel without vignetting, NaN where the frame doesn't show the place or shows it
  // too dark or with glints; infinite where it is saturated.
  Eigen::ArrayXXf value[3];
  // Of the light guides, where they reach the place; 0 where they don't.
  Eigen::ArrayXXf irradiance;  // Σ intensity · exp(−spread·(1 − D·L))/d² · cosine, channels averaged
  Eigen::ArrayXXf by_spread;   // derivative of its logarithm with all spreads
  Eigen::ArrayXXf log_cosine;   // of the incidence, guides averaged by what they send
  Eigen::ArrayXXf view_cosine;  // of the camera's ray; 0 where the place doesn't show
  Eigen::ArrayXXf distance_mm;  // from the camera
  int frames() const { return static_cast<int>(irradiance.cols()); }
  int count() const { return static_cast<int>(places.size()); }
};

struct SightingOptions {
  int places = 2000;
  // Half the edge of the square on the wall whose median brightness is the place's: small glints and the
  // surface's own errors fall out.
  double half_edge_mm = 0.6;
  int min_code = 10;  // as PhotometryOptions::min_code
};

// Spreads places evenly over the mesh (faces oriented away from the lumen) and looks for them in every frame.
// scene: of the mesh. Depth, normals and gains of the sequence are not looked at. Throws InputError.
Sightings FindSightings(const Sequence& sequence, const RayScene& scene, const SightingOptions& options,
                        uint64_t seed);

}  // namespace lumen
