// A mesh with what is needed to trace paths in it, for the tests that hold the tracer against physics.
#pragma once

#include <gtest/gtest.h>

#include <functional>
#include <vector>

#include "common/mesh.h"
#include "sim/imaging/path.h"

namespace lumen::test {

// Its axis goes through the middle of the picture.
CameraIntrinsics CentredPinhole(int width, int height, double focal_px);

// Places of a surface over the grid (along 0…1 × around 0…2π), joined to triangles.
Mesh Lathe(int along, int around, const std::function<Vec3d(double, double)>& place);
// A sphere of meridians and parallels around the origin.
Mesh Globe(double radius_mm, int rings);
// Around the z axis, open at ±half_length_mm.
Mesh Tube(double radius_mm, double half_length_mm, int along, int around);
// A rectangle across z.
void AddPlate(Mesh* mesh, double x0, double x1, double y0, double y1, double z);

Vec3d PixelOf(const ImageF& image, int x, int y);

struct Stage {
  Mesh mesh;
  RayScene wall;
  std::vector<Vec3d> vertex_normals;
  CameraIntrinsics intrinsics;
  Image8 valid;
  Surface surface;
  Light light;
  Pose world_from_camera = Pose::Identity();
  PathOptions options;  // one sample, direct light

  // The light: at the camera, the same in all directions.
  Stage(Mesh geometry, const CameraIntrinsics& intrinsics, double intensity = 500);

  PathCount Render(uint64_t seed, bool with_parts, Film* film, const Defocus* defocus = nullptr) const;
  // Expects everything to be finite.
  Film Render(uint64_t seed = 1, bool with_parts = false) const;
};

// Of independent estimates.
struct Estimate {
  double mean = 0, standard_error = 0;
};
Estimate EstimateOf(const std::vector<double>& values);
// Of a channel's mean over the frame, from `seeds` renders.
Estimate MeanOver(const Stage& stage, int seeds, const std::function<const ImageF&(const Film&)>& part,
                  int channel = 0);

}  // namespace lumen::test
