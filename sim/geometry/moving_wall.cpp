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

double MovingWall::StretchesOver(double frames) const {
  return moves() ? peristaltic_->StretchesOver(frames) : 0;
}

std::unique_ptr<const WallMotion> MovingWall::During(int frame, double frames) const {
  const int stretches = static_cast<int>(StretchesOver(frames));
  if (stretches == 0) return nullptr;
  std::vector<Mesh> steps(static_cast<size_t>(stretches) + 1);
  for (int i = 0; i <= stretches; ++i) {
    steps[i] = peristaltic_->At(frame + frames * (double(i) / stretches - 0.5));
  }
  auto motion = std::make_unique<WallMotion>(std::move(steps));
  for (size_t i = 0; vertex_normals_ && i < motion->steps.size(); ++i) {
    motion->vertex_normals.push_back(VertexNormals(motion->steps[i]));
  }
  return motion;
}

std::shared_ptr<const WallMoment> MovingWall::Build(int frame) const {
  const auto wall = moves()
                        ? std::make_shared<WallMoment>(std::make_unique<const Mesh>(peristaltic_->At(frame)))
                        : std::make_shared<WallMoment>(geometry_.mesh);
  if (vertex_normals_) wall->vertex_normals = VertexNormals(wall->mesh());
  return wall;
}

}  // namespace lumen
