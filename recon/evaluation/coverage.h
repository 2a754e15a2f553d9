// How much of a surface was surveyed.
#pragma once

#include <optional>
#include <vector>

#include "recon/evaluation/surface_points.h"

namespace lumen {

struct SurveyedShare {
  double whole = 0;            // of the surface's whole area, the part that some frame sees
  std::optional<double> near;  // of its area within reach_mm of what is seen; nothing where nothing is
};

// points: spread evenly over the surface; frames_seeing: how many frames see each of them.
SurveyedShare MeasureShare(const std::vector<SurfacePoint>& points, const std::vector<int>& frames_seeing,
                           double reach_mm);

}  // namespace lumen
