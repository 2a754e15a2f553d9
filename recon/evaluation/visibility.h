// Which frames of a sequence see which places of a surface.
#pragma once

#include <cstdint>
#include <vector>

#include "common/camera.h"
#include "common/math.h"
#include "common/ray_scene.h"
#include "common/sequence.h"
#include "recon/evaluation/surface_points.h"

namespace lumen {

// Where a sequence's frames look; pixels aren't read.
class FrameViews {
 public:
  explicit FrameViews(const Sequence& sequence);

  int size() const { return static_cast<int>(camera_from_world_.size()); }
  // World position of a frame's camera, mm.
  const Vec3d& Centre(int frame) const { return centres_[frame]; }
  // Whether the point projects onto a pixel of the frame that carries image: within the borders and the mask,
  // and with a ray. Says nothing of what lies between.
  bool Frames(int frame, const Vec3d& world) const;

 private:
  Camera<double> camera_;
  Image8 valid_;
  std::vector<Pose> camera_from_world_;
  std::vector<Vec3d> centres_;
};

struct Visibility {
  std::vector<int> frames_seeing;    // one a place: the number of frames that see it
  std::vector<int64_t> places_seen;  // one a frame: the number of places it sees
};

// A frame sees a place if the place projects onto one of its pixels (Frames above) and nothing of the scene's
// mesh lies between. A vertex isn't hidden by the faces it belongs to, nor a point by its own: a straight
// line meets a plane once, so such a hit can only be a rounding error.
Visibility SeeVertices(const RayScene& scene, const FrameViews& views);
// frames: if given, those that see each point, ascending.
Visibility SeePoints(const RayScene& scene, const std::vector<SurfacePoint>& points, const FrameViews& views,
                     std::vector<std::vector<int>>* frames = nullptr);

}  // namespace lumen
