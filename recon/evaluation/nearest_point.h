// The closest of a set of points, through CGAL's k-d tree.
#pragma once

#include <memory>
#include <vector>

#include "common/math.h"

namespace lumen {

// Const members may be called from any thread.
class NearestPoint {
 public:
  explicit NearestPoint(const std::vector<Vec3d>& points);
  ~NearestPoint();

  // mm; infinity where the set is empty.
  double Distance(const Vec3d& point) const;

 private:
  struct State;
  std::unique_ptr<State> state_;
};

}  // namespace lumen
