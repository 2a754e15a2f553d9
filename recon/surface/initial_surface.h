// The surface that training starts from: a tube around the camera's path that reaches ahead of it, the
// network learning what the real wall adds to it; or a sphere around all cameras, which the network is itself
// at its start, as in NeuS. All cameras are inside, where the signed distance is positive.
#pragma once

#include <vector>

#include "common/math.h"
#include "recon/network/panel.h"

namespace lumen {

enum class InitialShape { kTube, kSphere };

struct InitialSurfaceOptions {
  InitialShape shape = InitialShape::kTube;
  // Of the tube; how far around the cameras the sphere reaches at least. Less than a lumen's: a wall that
  // moves outwards finds what folds hide, one that starts behind them leaves sheets.
  double radius_mm = 14;
  double reach_mm = 55;  // how far a tube goes on in each camera's viewing direction
  // In place of reach_mm what fits the frames' brightness best, where light is modelled.
  bool fit_reach = true;
};

// radius − distance to the nearest of a set of segments.
class InitialSurface {
 public:
  // Segments join consecutive cameras and go ahead of those whose view no earlier segment covers: one whose
  // end lies within half a radius of the others is left out. Positions are relative to `origin`.
  InitialSurface(const InitialSurfaceOptions& options, const std::vector<Pose>& world_from_camera,
                 const Vec3d& origin);

  // Whether it is the network's start and nothing is added to it.
  bool is_learnt() const { return is_learnt_; }
  // Of the tube; of the sphere around the origin.
  double radius_mm() const { return radius_mm_; }
  size_t segments() const { return starts_.size(); }

  // Signed distance of the samples of one tile, mm; gradient (3 rows, null if not wanted): unit, into the
  // lumen, 0 on a segment itself. positions: 3 rows, mm.
  template <class T>
  void Evaluate(const T* positions, T* value, T* gradient) const;

  // Points a step apart along the segments: what is surely meant to be inside.
  std::vector<Vec3d> Spine(double step_mm) const;

 private:
  template <class T, bool kGradient>
  void EvaluateTile(const T* positions, T* value, T* gradient) const;

  bool is_learnt_;
  double radius_mm_;
  std::vector<Vec3d> starts_, spans_;  // mm
};

}  // namespace lumen
