// The surface that training starts from: a tube around the camera's path that reaches ahead of it. The
// network learns what the real wall adds to it. All cameras are inside, where the signed distance is
// positive.
#pragma once

#include <vector>

#include "common/math.h"
#include "recon/network/panel.h"

namespace lumen {

struct InitialSurfaceOptions {
  double radius_mm = 24;
  double reach_mm = 55;  // how far the tube goes on in each camera's viewing direction
};

// radius − distance to the nearest of a set of segments.
class InitialSurface {
 public:
  // Segments join consecutive cameras and go ahead of those whose view no earlier segment covers: one whose
  // end lies within half a radius of the others is left out. Positions are relative to `origin`.
  InitialSurface(const InitialSurfaceOptions& options, const std::vector<Pose>& world_from_camera,
                 const Vec3d& origin);

  size_t segments() const { return starts_.size(); }

  // Signed distance of the samples of one tile, mm; gradient (3 rows, null if not wanted): unit, into the
  // lumen, 0 on a segment itself. positions: 3 rows, mm.
  template <class T>
  void Evaluate(const T* positions, T* value, T* gradient) const;

  // Points a step apart along the segments: what is surely meant to be inside.
  std::vector<Vec3d> Spine(double step_mm) const;

 private:
  double radius_mm_;
  std::vector<Vec3d> starts_, spans_;  // mm
};

}  // namespace lumen
