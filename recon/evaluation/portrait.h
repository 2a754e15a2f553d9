// Pictures of coloured meshes, lit from the camera: for people, not for measuring.
#pragma once

#include <vector>

#include "common/camera.h"
#include "common/image.h"
#include "common/math.h"
#include "common/ray_scene.h"
#include "recon/evaluation/colormap.h"

namespace lumen {

// Where a picture is taken from.
struct View {
  CameraIntrinsics camera;
  Pose world_from_camera = Pose::Identity();
  Image8 valid;  // as large as the camera's image, 0 = stays background; empty = every pixel
  Rgb8 background = {255, 255, 255};
  double fade_mm = 0;  // the lamp's light falls to half at this distance along the ray; 0 = it doesn't fall
};

class Portrait {
 public:
  // The mesh is referred to, not copied: it must outlive the portrait.
  explicit Portrait(const Mesh& mesh);

  // Three channels, the mean of 4×4 rays a pixel. A surface point has its face's interpolated vertex colour
  // times 0.3 + 0.7·|cos| of the angle between the ray and the interpolated vertex normals: a lamp at the
  // camera, both sides alike; where it fades, times 1/(1 + (distance/fade_mm)²). `colors` has an entry a
  // vertex. Pixels without a ray or a surface are background.
  Image8 Draw(const View& view, const std::vector<Rgb8>& colors) const;

 private:
  RayScene scene_;
  std::vector<Vec3f> normals_;
};

// A pinhole camera outside the points (one at least), looking along the direction in which they extend least,
// the longest one lying across the image, and so far away that all of them are in it.
View OutsideView(const std::vector<Vec3d>& points, int width, int height);

}  // namespace lumen
