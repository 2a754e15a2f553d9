// The wall at each frame's moment and while a frame is taken, ready for rays.
#pragma once

#include <list>
#include <memory>
#include <optional>
#include <utility>
#include <vector>

#include "common/mesh.h"
#include "common/ray_scene.h"
#include "sim/geometry/geometry.h"
#include "sim/geometry/peristalsis.h"

namespace lumen {

// One moment's. Its faces are those of the wall at rest, in their order.
struct WallMoment {
  explicit WallMoment(const Mesh& rest) : rays(rest) {}
  explicit WallMoment(std::unique_ptr<const Mesh> moved) : moved(std::move(moved)), rays(*this->moved) {}

  std::unique_ptr<const Mesh> moved;  // none where the wall is at rest
  RayScene rays;
  std::vector<Vec3d> vertex_normals;  // empty if they aren't asked for

  const Mesh& mesh() const { return rays.mesh(); }
};

// While a frame is taken, at steps in time that are spread evenly over its duration. Faces likewise.
struct WallMotion {
  explicit WallMotion(std::vector<Mesh> steps) : steps(std::move(steps)), rays(this->steps) {}

  std::vector<Mesh> steps;                         // two or more
  RayScene rays;                                   // time: 0 its beginning, 1 its end
  std::vector<std::vector<Vec3d>> vertex_normals;  // of each step; empty if they aren't asked for
};

// Without an effect that moves it, the wall is the geometry's own mesh, built once.
class MovingWall {
 public:
  struct Options {
    std::optional<Peristalsis> peristalsis;
    bool vertex_normals = false;
  };
  // The geometry is referred to: it must outlive this and what At gives.
  MovingWall(const Geometry& geometry, const Options& options);

  bool moves() const { return peristaltic_.has_value(); }

  // The wall when a frame is taken. The last few that were asked for are kept. Not to be called by two
  // threads at a time.
  std::shared_ptr<const WallMoment> At(int frame);

  // The wall over a time of so many frame intervals, as long before the frame's moment as after; null if it
  // stands still. The time must not ask for more than kMostStretches.
  std::unique_ptr<const WallMotion> During(int frame, double frames) const;
  static constexpr int kMostStretches = RayScene::kMostSteps - 1;
  // How many it asks for: PeristalticWall::StretchesOver, or 0.
  double StretchesOver(double frames) const;

 private:
  std::shared_ptr<const WallMoment> Build(int frame) const;

  const Geometry& geometry_;
  bool vertex_normals_;
  std::optional<PeristalticWall> peristaltic_;
  struct Kept {
    int frame;
    std::shared_ptr<const WallMoment> wall;
  };
  std::list<Kept> kept_;  // the last used first
};

}  // namespace lumen
