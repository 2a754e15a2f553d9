#include "recon/evaluation/nearest_point.h"

#include <CGAL/Orthogonal_k_neighbor_search.h>
#include <CGAL/Search_traits_3.h>
#include <CGAL/Simple_cartesian.h>

#include <cmath>
#include <limits>

namespace lumen {
namespace {

using Kernel = CGAL::Simple_cartesian<double>;
using Search = CGAL::Orthogonal_k_neighbor_search<CGAL::Search_traits_3<Kernel>>;

}  // namespace

struct NearestPoint::State {
  Search::Tree tree;
};

NearestPoint::NearestPoint(const std::vector<Vec3d>& points) : state_(std::make_unique<State>()) {
  for (const Vec3d& p : points) state_->tree.insert(Kernel::Point_3(p.x(), p.y(), p.z()));
  if (!points.empty())
    state_->tree.build();  // otherwise the first question would, in whichever thread asks it
}

NearestPoint::~NearestPoint() = default;

double NearestPoint::Distance(const Vec3d& point) const {
  if (state_->tree.empty()) return std::numeric_limits<double>::infinity();
  const Search search(state_->tree, Kernel::Point_3(point.x(), point.y(), point.z()), 1);
  return std::sqrt(search.begin()->second);
}

}  // namespace lumen
