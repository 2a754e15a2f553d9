// Poses learnt with the surface: every frame has a small motion of its camera on top of the given pose, a
// translation and a rotation about the camera's own place, that follows the photometric gradient.
#pragma once

#include <vector>

#include "common/math.h"
#include "common/similarity.h"
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

// By how much given poses are off: root mean squares over frames of shift and turn.
struct GivenPoseError {
  double shift_mm, turn_rad;
};

// Adds the gradient of the pull to the given poses: weight times the mean over frames of half the squares of
// all six numbers, each in units of its own root mean square.
void AddPull(double weight, const GivenPoseError& noise, const PoseMotions& motions,
             std::vector<float>* gradient);

// A step against the gradient (kPoseNumbers a frame; cleared). The means over frames of the translations and
// of the rotations are taken out again: of a common motion no picture tells, surface and path would drift
// off.
void UpdateMotions(const AdamStep& translation, const AdamStep& rotation, std::vector<float>* gradient,
                   PoseMotions* motions);

// What takes refined poses back to where the given ones are, as many. Of a scale no picture tells, either (a
// lumen twice as large, four times as pale, seen from twice as far looks the same), and it drifts by some
// percent; held fixed in each step it would hold up the poses on their way. The given path tells it as well
// as its noise allows: by the less, the shorter it is, the less the drift is taken back.
Similarity BackToGiven(const std::vector<Pose>& refined, const std::vector<Pose>& given,
                       const GivenPoseError& noise);

}  // namespace lumen
