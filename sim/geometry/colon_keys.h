// The keys of a scene's [geometry] that shape a colon's wall, whatever its centreline follows.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "common/config.h"
#include "sim/geometry/colon_wall.h"

namespace lumen {

// What a named segment takes where the scene doesn't say otherwise.
struct SegmentDefaults {
  const char* name;
  std::vector<double> diameters_mm;
  double haustra_spacing_mm, fold_height_mm, taenia_depth_mm, bend_rad;
};

// That of the key `segment`.
const SegmentDefaults& ReadSegment(const ConfigTable& geometry);

// Throws InputError with file and line.
ColonShape ReadColonShape(const ConfigTable& geometry, const SegmentDefaults& segment, uint64_t seed);

// Refuses, with file and line, a wall that would meet itself: bent too sharply for its radius (curve_key is
// blamed), folds that close the lumen, polyps that touch. A tube of distance r from a curve of curvature k is
// one-to-one where k·r < 1 and no two places of the curve come nearer than 2r.
void CheckColonWall(const ConfigTable& geometry, const ColonShape& shape, const ColonWall& wall,
                    const std::string& curve_key);

}  // namespace lumen
