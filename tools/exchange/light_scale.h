// Millimetres out of brightness: a light at the camera whose power is known fixes the scale of a model that
// has none, up to the wall's albedo.
#pragma once

#include <vector>

#include "common/sequence.h"
#include "tools/exchange/colmap_model.h"

namespace lumen {

struct LightScale {
  double mm_per_unit = 0;
  double lower_mm = 0, upper_mm = 0;  // quartiles of what the observations say one by one
  int64_t observations = 0;
};

// Each observation of a point at distance d (units) under the cosine c of incidence, with linear green
// radiance I at gain 1, says
//
//   mm_per_unit = √(albedo/π · c · E / I) / d,
//
// E being what the light sends that way at 1 mm (mm², full scale = 1), all guides taken as lying at the
// camera; the answer is their median. c is that of the plane through a point's nearest neighbours. Pixels
// that are nearly black or saturated in green are left out.
//
// How far it goes: the scale is proportional to √albedo. Light from wall to wall that is r times the direct
// light makes it too small by √(1 + r); guides off the axis matter where they are not far less off than the
// wall is distant.
//
// frames[i] is the sequence's frame of images[i]; its light must be calibrated and its gains known. `albedo`:
// of the wall in green. Throws InputError where that is not so, or too few points are seen.
LightScale ScaleFromLight(const Sequence& sequence, const std::vector<ColmapImage>& images,
                          const std::unordered_map<uint64_t, ColmapPoint>& points, double albedo);

}  // namespace lumen
