// The true wall as the points of a COLMAP model.
#pragma once

#include <functional>
#include <optional>

#include "common/sequence.h"
#include "tools/exchange/colmap_model.h"

namespace lumen {

// Adds, of `count` places spread evenly over the sequence's true wall, which must stand still, those that two
// images or more show, with their observations. model: one camera, and an image a frame. shown: the pixel of
// an image that shows a place which the frame sees past the wall, nothing where none does. A point's colour
// is the frames' mean. Throws InputError: no true wall, a damaged frame.
void AddWallPoints(const Sequence& sequence, int count,
                   const std::function<std::optional<Vec2d>(size_t frame, const Vec3d& world)>& shown,
                   ColmapModel* model);

}  // namespace lumen
