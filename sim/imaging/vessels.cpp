#include "sim/imaging/vessels.h"

#include <algorithm>
#include <bit>
#include <cmath>

#include "common/error.h"
#include "sim/imaging/vessel_growth.h"

namespace lumen {
namespace {

// By how much more than its box a segment is listed, in cubes: a float place may be put into the cube beside
// its own by the rounding of place / side, 2^-23 of some thousands at most.
constexpr double kMargin = 0x1p-10;

// In steps. A step's middle is its length / (8 · radius) of it below a wall that bends, so this reaches it
// down to a radius of 3/8 step. In front of a segment and behind it there is no other wall so near but at a
// sharp edge.
constexpr double kDepth = 1.0 / 3;

// A segment as the places see it: across its box's axes.
struct DrawnSegment {
  Vec3f from_mm, along, aside, normal;  // axes unit
  float length_mm, radius_mm2;          // its square
};

LanesU CubeHash(const LanesI& x, const LanesI& y, const LanesI& z) {
  LanesU h = (LanesU)x * 0x8da6b343u + (LanesU)y * 0xd8163841u + (LanesU)z * 0xcb1ab31fu;
  h = (h ^ (h >> 15)) * 0x85ebca6bu;
  return h ^ (h >> 13);
}

// The square of half the way through the vessel; not positive beside it. A vessel's ends are round.
Lanes SquaredHalfChord(const DrawnSegment& segment, float depth_mm, const Lanes3& place) {
  const Lanes3 offset = {place.x - segment.from_mm[0], place.y - segment.from_mm[1],
                         place.z - segment.from_mm[2]};
  const auto on_axis = [&](const Vec3f& axis) {
    return offset.x * axis[0] + offset.y * axis[1] + offset.z * axis[2];
  };
  const Lanes along = on_axis(segment.along), aside = on_axis(segment.aside);
  const Lanes beyond = along - Min(Max(along, Lanes{}), Broadcast(segment.length_mm));
  const Lanes squared = segment.radius_mm2 - (beyond * beyond + aside * aside);
  return Abs(on_axis(segment.normal)) <= depth_mm ? squared : Lanes{};
}

std::vector<VesselSegment> SegmentsOf(const std::vector<VesselNode>& nodes, double width_mm) {
  int most_twigs = 1;
  for (const VesselNode& node : nodes) {
    if (node.parent >= 0) most_twigs = std::max(most_twigs, node.twigs);
  }
  std::vector<VesselSegment> segments;
  std::vector<int> ending_at(nodes.size(), -1);
  for (size_t i = 0; i < nodes.size(); ++i) {
    const VesselNode& node = nodes[i];
    if (node.parent < 0) continue;
    const VesselNode& from = nodes[node.parent];
    const Vec3d along = (node.place_mm - from.place_mm).normalized(), normal = from.normal + node.normal;
    ending_at[i] = static_cast<int>(segments.size());
    segments.push_back({from.place_mm, node.place_mm, (normal - along * along.dot(normal)).normalized(),
                        width_mm * std::cbrt(static_cast<double>(node.twigs) / most_twigs),
                        ending_at[node.parent]});
  }
  return segments;
}

}  // namespace

struct Vessels::Network {
  std::vector<VesselSegment> segments;
  float depth_mm, cubes_per_mm, chord_per_mm;
  uint32_t mask;                // of a hash: the number of lists, a power of two, less 1
  std::vector<uint32_t> begin;  // of each list in `listed`, and the end of the last
  std::vector<DrawnSegment> listed;

  Network(const VesselOptions& options, const Mesh& wall, uint64_t seed)
      : segments(SegmentsOf(GrowVessels(wall, options.spacing_mm, seed), options.width_mm)),
        depth_mm(static_cast<float>(kDepth * VesselStep(options.spacing_mm))),
        cubes_per_mm(static_cast<float>(1 / std::max(VesselStep(options.spacing_mm), options.width_mm))),
        chord_per_mm(static_cast<float>(2 / options.width_mm)) {
    std::vector<std::pair<uint32_t, int>> entries;  // hash of a cube, segment
    for (size_t i = 0; i < segments.size(); ++i) {
      ForEachCube(segments[i], [&](uint32_t hash) { entries.emplace_back(hash, static_cast<int>(i)); });
    }
    // Most lists stay empty, as most cubes along the wall are.
    mask = std::bit_ceil(static_cast<uint32_t>(entries.size()) + 1) - 1;
    for (auto& [hash, segment] : entries) hash &= mask;
    std::sort(entries.begin(), entries.end());
    entries.erase(std::unique(entries.begin(), entries.end()), entries.end());
    begin.assign(size_t(mask) + 2, 0);
    for (const auto& [hash, segment] : entries) {
      ++begin[hash + 1];
      listed.push_back(Drawn(segments[segment]));
    }
    for (size_t list = 0; list <= mask; ++list) begin[list + 1] += begin[list];
  }

  static DrawnSegment Drawn(const VesselSegment& segment) {
    const Vec3d way = segment.to_mm - segment.from_mm, along = way.normalized();
    return {segment.from_mm.cast<float>(),
            along.cast<float>(),
            segment.normal.cross(along).cast<float>(),
            segment.normal.cast<float>(),
            static_cast<float>(way.norm()),
            static_cast<float>(segment.width_mm * segment.width_mm / 4)};
  }

  // Cubes that the segment's box may meet: those that none of the box's three axes separates from it.
  template <class Body>
  void ForEachCube(const VesselSegment& segment, const Body& body) const {
    const double side_mm = 1 / static_cast<double>(cubes_per_mm), radius_mm = segment.width_mm / 2;
    const Vec3d middle_mm = (segment.from_mm + segment.to_mm) / 2;
    const Vec3d along = (segment.to_mm - segment.from_mm).normalized();
    Mat3<double> axes;
    axes << along, segment.normal.cross(along), segment.normal;
    const Vec3d half_mm((segment.to_mm - segment.from_mm).norm() / 2 + radius_mm, radius_mm, depth_mm);
    const Vec3d margin_mm = Vec3d::Constant(side_mm * kMargin), bounds_mm = axes.cwiseAbs() * half_mm;
    const auto cube_of = [&](const Vec3d& place_mm) -> Vec3i {
      return (place_mm / side_mm).array().floor().template cast<int>();
    };
    const Vec3i first = cube_of(middle_mm - bounds_mm - margin_mm);
    const Vec3i last = cube_of(middle_mm + bounds_mm + margin_mm);
    // Half the cube, seen along each axis.
    const Vec3d reach_mm = half_mm + margin_mm + side_mm / 2 * (axes.cwiseAbs().transpose() * Vec3d::Ones());
    for (int z = first[2]; z <= last[2]; ++z) {
      for (int y = first[1]; y <= last[1]; ++y) {
        for (int x = first[0]; x <= last[0]; ++x) {
          const Vec3d offset_mm = side_mm * Vec3d(x + 0.5, y + 0.5, z + 0.5) - middle_mm;
          if (((axes.transpose() * offset_mm).cwiseAbs().array() <= reach_mm.array()).all())
            body(CubeHash(BroadcastI(x), BroadcastI(y), BroadcastI(z))[0]);
        }
      }
    }
  }
};

Vessels::Vessels(const VesselOptions& options, const Mesh& wall, uint64_t seed)
    : options_(options), network_(std::make_shared<const Network>(options, wall, seed)) {}

const std::vector<VesselSegment>& Vessels::segments() const { return network_->segments; }
double Vessels::depth_mm() const { return network_->depth_mm; }

Lanes Vessels::BloodAt(const Lanes3& places_mm) const {
  const Network& network = *network_;
  const Lanes3 scaled = places_mm * Broadcast(network.cubes_per_mm);
  const LanesU list = CubeHash(FloorInt(scaled.x), FloorInt(scaled.y), FloorInt(scaled.z)) & network.mask;
  // Segments of other lanes' lists that aren't in a lane's own lie out of its sight and add nothing.
  Lanes squared{};
  LanesI left = BroadcastI(-1);
  for (int lane = 0; lane < kLanes; ++lane) {
    if (!left[lane]) continue;
    const uint32_t here = list[lane];
    for (uint32_t i = network.begin[here]; i < network.begin[here + 1]; ++i)
      squared = Max(squared, SquaredHalfChord(network.listed[i], network.depth_mm, places_mm));
    left &= list != here;
    if (!Any(left)) break;
  }
  // At a place in the middle of the widest, rounding may make it more than a whole width.
  return Min(Sqrt(squared) * network.chord_per_mm, Broadcast(1));
}

Vessels ReadVessels(const ConfigTable& table, const Mesh& wall, uint64_t seed) {
  VesselOptions options;
  options.spacing_mm = table.Number("spacing_mm", options.spacing_mm, {1e-3, 1e6});
  options.width_mm = table.Number("width_mm", options.width_mm, {1e-4, 1e6});
  options.absorption = table.Vector("absorption", options.absorption, {0, 50});
  if (options.width_mm > options.spacing_mm) table.Fail("width_mm", "vessels are wider than they are apart");
  try {
    return Vessels(options, wall, seed);
  } catch (const InputError& error) {
    table.Fail("spacing_mm", error.what());
  }
}

}  // namespace lumen
