#include "sim/imaging/vessel_growth.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <sstream>
#include <unordered_map>

#include "common/error.h"
#include "common/random.h"
#include "sim/imaging/wall_places.h"

namespace lumen {
namespace {

// In spacings: between roots; length of a trunk; between the places that draw, coarse first; a step.
constexpr double kRootDistance = 4, kTrunk = 1.6, kDrawingDistances[] = {1.6, 0.9, 0.5}, kStep = 0.1;
// In distances between places that draw: from how far one draws, how near satisfies it, between a node's
// forks along a vessel.
constexpr double kInfluence = 2.5, kReach = 0.5, kInternode = 0.5;
// mm: a step is straight, and the folds of a colon are 5 mm thick.
constexpr double kLongestStep_mm = 0.75;
// How much of a step's direction is the last one's, and how far it may turn by chance, about rad.
constexpr double kInertia = 0.6, kWander = 0.5;
// Rounds without getting nearer that a place goes on drawing: others that draw at its node may turn first.
constexpr int kPatience = 6;
// In steps: side branches that are shorter than this are left out, and a vessel's path is smoothed so often.
constexpr int kShortestBranch = 3, kSmoothings = 3;

// The numbers that a node draws.
enum : uint64_t { kDirectionNumber, kWanderNumber };

// The trees' nodes while they grow.
class Growth {
 public:
  Growth(const Mesh& wall, double step_mm, uint64_t seed)
      : seed_(seed),
        step_mm_(step_mm),
        wall_(SampleWall(wall, step_mm, seed)),
        wall_cubes_(2 * step_mm),
        node_cubes_(step_mm) {
    for (size_t i = 0; i < wall_.size(); ++i) wall_cubes_.Add(wall_[i].place_mm, static_cast<int>(i));
  }

  const std::vector<WallPlace>& wall() const { return wall_; }
  const std::vector<VesselNode>& nodes() const { return nodes_; }
  std::vector<VesselNode> TakeNodes() { return std::move(nodes_); }

  int Add(const Vec3d& place_mm, const Vec3d& normal, int parent) {
    const int node = static_cast<int>(nodes_.size());
    nodes_.push_back({place_mm, normal, parent});
    children_.push_back(0);
    node_cubes_.Add(place_mm, node);
    if (parent >= 0) ++children_[parent];
    return node;
  }

  // A root and its trunk, in a random direction.
  void AddTrunk(const WallPlace& root, double length_mm) {
    int node = Add(root.place_mm, root.normal, -1);
    const double angle = 2 * kPi * UniformDouble(RandomBits(seed_, node, kDirectionNumber));
    const Vec3d across = root.normal.unitOrthogonal();
    Vec3d direction = std::cos(angle) * across + std::sin(angle) * root.normal.cross(across);
    for (double grown_mm = 0; node >= 0 && grown_mm < length_mm; grown_mm += step_mm_) {
      node = Step(node, direction);
      direction.setZero();  // straight on
    }
  }

  // Vessels fork in two, and not right behind another fork.
  bool MayGrow(int node, double internode_mm) const {
    if (children_[node] != 1) return children_[node] == 0;
    int before = nodes_[node].parent;
    for (double way_mm = step_mm_; before >= 0 && way_mm < internode_mm; way_mm += step_mm_) {
      if (children_[before] == 2) return false;
      before = nodes_[before].parent;
    }
    return true;
  }

  // A node one step on: its number; −1 where there is no wall, or another vessel.
  int Step(int from, const Vec3d& pull) {
    const VesselNode node = nodes_[from];
    Vec3d direction = pull;
    if (node.parent >= 0 && children_[from] == 0)
      direction += kInertia * (node.place_mm - nodes_[node.parent].place_mm).normalized();
    const double turn = kWander * (2 * UniformDouble(RandomBits(seed_, nodes_.size(), kWanderNumber)) - 1);
    direction = Along(node.normal, direction + turn * node.normal.cross(direction));
    if (direction.squaredNorm() == 0) return -1;
    WallPlace place = {node.place_mm + step_mm_ * direction.normalized(), node.normal};
    if (!PutOnWall(&place) || !Free(place, from)) return -1;
    return Add(place.place_mm, place.normal, from);
  }

 private:
  // Moves a place that is near the wall onto it, and gives it the normal there. The plane through the wall's
  // nearest sample that is across the mean of both normals meets the wall to second order: that of a circle's
  // two radii is across the chord between them.
  bool PutOnWall(WallPlace* place) const {
    const WallPlace* nearest = nullptr;
    double least = std::numeric_limits<double>::infinity();
    Vec3d normals = Vec3d::Zero();
    wall_cubes_.ForEachNear(place->place_mm, [&](int i) {
      const double squared = (wall_[i].place_mm - place->place_mm).squaredNorm();
      const double weight = 1 - squared / (4 * step_mm_ * step_mm_);
      if (weight <= 0 || !FacesAlike(wall_[i].normal, place->normal)) return;
      normals += weight * weight * wall_[i].normal;
      if (squared >= least) return;
      least = squared;
      nearest = &wall_[i];
    });
    if (!nearest) return false;
    place->normal = normals.normalized();
    const Vec3d across = (place->normal + nearest->normal).normalized();
    place->place_mm = nearest->place_mm + Along(across, place->place_mm - nearest->place_mm);
    return true;
  }

  // Whether a child of `from` keeps almost a step away from every vessel that it doesn't come from.
  bool Free(const WallPlace& place, int from) const {
    bool free = true;
    node_cubes_.ForEachNear(place.place_mm, [&](int i) {
      if (i == from || i == nodes_[from].parent || nodes_[i].parent == from) return;
      free &= (nodes_[i].place_mm - place.place_mm).squaredNorm() >= 0.9 * step_mm_ * step_mm_ ||
              !FacesAlike(nodes_[i].normal, place.normal);
    });
    return free;
  }

  const uint64_t seed_;
  const double step_mm_;
  const std::vector<WallPlace> wall_;
  CubeMap wall_cubes_;
  std::vector<VesselNode> nodes_;
  std::vector<int> children_;  // of each node, how many
  CubeMap node_cubes_;
};

// Lets branches grow to places scattered over the wall, so far apart.
class Colonisation {
 public:
  Colonisation(double distance_mm, Growth* growth)
      : influence_mm2_(std::pow(kInfluence * distance_mm, 2)),
        reach_mm2_(std::pow(kReach * distance_mm, 2)),
        internode_mm_(kInternode * distance_mm),
        growth_(*growth),
        drawing_cubes_(kInfluence * distance_mm),
        node_cubes_(kInfluence * distance_mm) {
    for (const WallPlace& place : Scatter(growth_.wall(), distance_mm)) {
      drawing_cubes_.Add(place.place_mm, static_cast<int>(drawings_.size()));
      drawings_.push_back({place.place_mm, place.normal, influence_mm2_});
    }
    for (size_t node = 0; node < growth_.nodes().size(); ++node) Note(static_cast<int>(node));
  }

  void Run() {
    while (GrowOnce()) {
    }
  }

 private:
  // A place that wants blood.
  struct Drawing {
    Vec3d place_mm, normal;
    double squared_mm2;  // to the nearest node that may grow
    int nearest = -1;
    int patience = kPatience;  // 0: it is satisfied, or can't be
  };
  struct Pull {
    int node;
    Vec3d direction;
    std::vector<int> drawings;
  };

  bool Draws(const Drawing& drawing, int node, double* squared_mm2) const {
    const VesselNode& at = growth_.nodes()[node];
    *squared_mm2 = (drawing.place_mm - at.place_mm).squaredNorm();
    return *squared_mm2 < drawing.squared_mm2 && FacesAlike(drawing.normal, at.normal);
  }

  // A new node, for the places that it is nearest to.
  void Note(int node) {
    const Vec3d& place_mm = growth_.nodes()[node].place_mm;
    node_cubes_.Add(place_mm, node);
    drawing_cubes_.ForEachNear(place_mm, [&](int i) {
      Drawing& drawing = drawings_[i];
      double squared;
      if (drawing.patience == 0 || !Draws(drawing, node, &squared)) return;
      drawing.squared_mm2 = squared;
      drawing.nearest = node;
      if (squared < reach_mm2_) drawing.patience = 0;
    });
  }

  void FindNearest(Drawing* drawing) const {
    drawing->nearest = -1;
    drawing->squared_mm2 = influence_mm2_;
    node_cubes_.ForEachNear(drawing->place_mm, [&](int node) {
      double squared;
      if (!Draws(*drawing, node, &squared) || !growth_.MayGrow(node, internode_mm_)) return;
      drawing->squared_mm2 = squared;
      drawing->nearest = node;
    });
  }

  std::vector<Pull> CollectPulls() {
    std::vector<Pull> pulls;
    std::unordered_map<int, size_t> of_node;
    for (size_t i = 0; i < drawings_.size(); ++i) {
      Drawing& drawing = drawings_[i];
      if (drawing.patience == 0 || drawing.nearest < 0) continue;
      if (!growth_.MayGrow(drawing.nearest, internode_mm_)) FindNearest(&drawing);
      if (drawing.nearest < 0) continue;
      const auto [entry, is_new] = of_node.try_emplace(drawing.nearest, pulls.size());
      if (is_new) pulls.push_back({drawing.nearest, Vec3d::Zero(), {}});
      Pull& pull = pulls[entry->second];
      const VesselNode& node = growth_.nodes()[drawing.nearest];
      pull.direction += Along(node.normal, drawing.place_mm - node.place_mm).normalized();
      pull.drawings.push_back(static_cast<int>(i));
    }
    return pulls;
  }

  // A step of every node that is drawn at; false if none is. Nodes keep apart and patience goes, so there is
  // an end.
  bool GrowOnce() {
    const std::vector<Pull> pulls = CollectPulls();
    for (const Pull& pull : pulls) {
      const int grown = growth_.Step(pull.node, pull.direction.normalized());
      if (grown >= 0) Note(grown);
      for (const int i : pull.drawings) {
        Drawing& drawing = drawings_[i];
        if (drawing.nearest == pull.node && drawing.patience > 0) --drawing.patience;
      }
    }
    return !pulls.empty();
  }

  const double influence_mm2_, reach_mm2_, internode_mm_;
  Growth& growth_;
  std::vector<Drawing> drawings_;
  CubeMap drawing_cubes_, node_cubes_;
};

std::vector<int> CountChildren(const std::vector<VesselNode>& nodes) {
  std::vector<int> children(nodes.size(), 0);
  for (const VesselNode& node : nodes) {
    if (node.parent >= 0) ++children[node.parent];
  }
  return children;
}

std::vector<VesselNode> WithoutStubs(const std::vector<VesselNode>& nodes) {
  std::vector<int> steps_beyond(nodes.size(), 0), longest(nodes.size(), -1), now(nodes.size(), -1);
  for (size_t i = nodes.size(); i-- > 0;) {
    const int parent = nodes[i].parent;
    if (parent < 0 || steps_beyond[i] < steps_beyond[parent]) continue;
    steps_beyond[parent] = steps_beyond[i] + 1;
    longest[parent] = static_cast<int>(i);
  }
  std::vector<VesselNode> kept;
  for (size_t i = 0; i < nodes.size(); ++i) {
    VesselNode node = nodes[i];
    if (node.parent >= 0) {
      const bool on_the_side = longest[node.parent] != static_cast<int>(i);
      const bool stub = on_the_side && steps_beyond[i] + 1 < kShortestBranch;
      if (stub || now[node.parent] < 0) continue;
      node.parent = now[node.parent];
    }
    now[i] = static_cast<int>(kept.size());
    kept.push_back(node);
  }
  return kept;
}

// Moves every node along the wall half the way to the mean of its parent and its children.
void Smooth(const std::vector<int>& children, std::vector<VesselNode>* nodes) {
  std::vector<Vec3d> middles(nodes->size(), Vec3d::Zero());
  for (const VesselNode& node : *nodes) {
    if (node.parent >= 0) middles[node.parent] += node.place_mm / children[node.parent];
  }
  for (size_t i = 0; i < nodes->size(); ++i) {
    const VesselNode& node = (*nodes)[i];
    if (node.parent >= 0 && children[i] > 0) middles[i] = (middles[i] + (*nodes)[node.parent].place_mm) / 2;
  }
  for (size_t i = 0; i < nodes->size(); ++i) {
    VesselNode& node = (*nodes)[i];
    if (node.parent >= 0 && children[i] > 0)
      node.place_mm += 0.5 * Along(node.normal, middles[i] - node.place_mm);
  }
}

// Before so many places are looked at that memory or time ends.
void CheckBearable(const Mesh& wall, double step_mm) {
  const double least_mm = LeastPitch(wall);
  if (step_mm >= least_mm) return;
  std::ostringstream message;
  message << "there would be too many vessels on this wall; choose "
          << std::ceil(100 * least_mm / kStep) / 100 << " or more";
  throw InputError(message.str());
}

}  // namespace

double VesselStep(double spacing_mm) { return std::min(kStep * spacing_mm, kLongestStep_mm); }

std::vector<VesselNode> GrowVessels(const Mesh& wall, double spacing_mm, uint64_t seed) {
  const double step_mm = VesselStep(spacing_mm);
  CheckBearable(wall, step_mm);
  Growth growth(wall, step_mm, seed);
  for (const WallPlace& root : Scatter(growth.wall(), kRootDistance * spacing_mm))
    growth.AddTrunk(root, kTrunk * spacing_mm);
  for (const double distance : kDrawingDistances) Colonisation(distance * spacing_mm, &growth).Run();
  std::vector<VesselNode> nodes = WithoutStubs(growth.TakeNodes());
  const std::vector<int> children = CountChildren(nodes);
  for (int i = 0; i < kSmoothings; ++i) Smooth(children, &nodes);
  for (size_t i = nodes.size(); i-- > 0;) {
    if (children[i] == 0) nodes[i].twigs = 1;
    if (nodes[i].parent >= 0) nodes[nodes[i].parent].twigs += nodes[i].twigs;
  }
  return nodes;
}

}  // namespace lumen
