// Poses learnt with the surface: every frame has a small motion of its camera on top of the given pose, a
// translation and a rotation about the camera's own place, that follows the photometric gradient.
#pragma once

#include <vector>

#include "common/math.h"
#include "recon/network/adam.h"
#include "recon/training/ray_loss.h"

namespace lumen {

// Six numbers a frame, world axes: mm, then a rotation vector, rad.
struct PoseMotions {
  std::vector<float> values, first, second;  // and Adam's moments; empty where poses stay as they are given

  void Resize(int frames);
  int frames() const { return static_cast<int>(values.size() / kPoseNumbers); }
};

// The pose that a frame's motion makes of the given one.
Pose Moved(const Pose& world_from_camera, const PoseMotions& motions, int frame);

// The same motion of a ray of the frame.
void Move(const PoseMotions& motions, RayBatch<float>::Ray* ray);

// A step against the gradient (kPoseNumbers a frame; cleared). What all frames' motions have in common is
// taken out again, translations and rotations each. A common translation no picture tells of, the surface
// would follow it. A common turn of every camera about its own place is no such freedom, but on a nearly
// straight path hardly anything holds it: it is supposed to be none.
void UpdateMotions(const AdamStep& translation, const AdamStep& rotation, std::vector<float>* gradient,
                   PoseMotions* motions);

}  // namespace lumen
