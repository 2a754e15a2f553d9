// What takes poses of unknown scale and axes to given ones.
#pragma once

#include <vector>

#include "common/math.h"

namespace lumen {

// x ↦ scale · rotation · x + translation.
struct Similarity {
  double scale = 1;
  Mat3d rotation = Mat3d::Identity();
  Vec3d translation = Vec3d::Zero();
};

Vec3d Mapped(const Similarity& similarity, const Vec3d& point);
// The pose of a camera whose world is mapped.
Pose Mapped(const Similarity& similarity, const Pose& world_from_camera);

struct SimilarityFit {
  Similarity similarity;
  // What is left between mapped and given poses.
  double rms_mm = 0, max_mm = 0;    // of the centres
  double rms_rad = 0, max_rad = 0;  // of the orientations
};

// Least squares over the centres for scale and translation, as Umeyama's (IEEE TPAMI 13(4), 1991), with the
// chordal mean of the cameras' own rotations: the path of an endoscope is so nearly a line that its centres
// say little of the rotation about it. `to` in mm, as many as `from`. Throws InputError where there are fewer
// than two or all centres are one.
SimilarityFit FitSimilarity(const std::vector<Pose>& from, const std::vector<Pose>& to);

}  // namespace lumen
