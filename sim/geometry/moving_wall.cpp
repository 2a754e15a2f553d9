#include "sim/geometry/moving_wall.h"

#include <algorithm>
#include <utility>

namespace lumen {
namespace {

constexpr size_t kMostKept = 3;  // a frame and its neighbours

}  // namespace

MovingWall::MovingWall(const Geometry& geometry, const Options& options)
    : geometry_(geometry), vertex_normals_(options.vertex_normals) {
  if (options.peristalsis) peristaltic_.emplace(*options.peristalsis, geometry);
}

std::shared_ptr<const WallMoment> MovingWall::At(int frame) {
  if (!moves()) frame = 0;
  const auto known =
      std::find_if(kept_.begin(), kept_.end(), [&](const Kept& kept) { return kept.frame == frame; });
  if (known != kept_.end()) {
    kept_.splice(kept_.begin(), kept_, known);
  } else {
    kept_.push_front({frame, Build(frame)});
    if (kept_.size() > kMostKept) kept_.pop_back();
  }
  return kept_.front().wall;
}

std::shared_ptr<const WallMoment> MovingWall::Build(int frame) const {
  const auto wall = moves()
                        ? std::make_shared<WallMoment>(std::make_unique<const Mesh>(peristaltic_->At(frame)))
                        : std::make_shared<WallMoment>(geometry_.mesh);
  if (vertex_normals_) wall->vertex_normals = VertexNormals(wall->mesh());
  return wall;
}

}  // namespace lumen
