// Effect: blood vessels below the mucosa, [surface.vessels]: trees along the wall (vessel_growth.h) whose
// trunks thin out as they fork. In them the albedo is times exp(−absorption · s), s being the way through the
// vessel in widths of the widest: √(w² − 4ρ²) / width_mm at a distance ρ from the middle of a vessel that is
// w wide.
//
//   spacing_mm  9                how far apart vessels are; trees have roots four times as far apart
//   width_mm    0.6              of the widest trunk on the wall, at most spacing_mm
//   absorption  0.15, 0.7, 0.5   RGB: haemoglobin absorbs green and blue, hardly red
//
// Where a vessel forks the cubes of widths add up (Murray 1926, "The physiological principle of minimum
// work"): w³ is as its twigs, the ends that it leads to. Between forks the width stays.
//
// The trees live on the wall: they are straight segments from place to place on the resting mesh. Each is
// drawn by projection onto the wall along the normal that the wall has there, so that neither the mesh's
// facets nor its curvature between the segment's ends make a vessel sink: ρ is measured across that normal,
// and places up to a third of the growth's step (at most 0.25 mm) in front of the segment or behind it see
// it.
//
// They are grown once, when a scene names them, and kept by cubes of space: a cube's list has every segment
// whose box (length and width, rounded ends included, by twice the depth) meets the cube. So the list of a
// place's cube has all that the place can see. Lists are found by a hash; where two cubes share one, the
// other cube's segments are looked at in vain.
#pragma once

#include <cstdint>
#include <memory>
#include <vector>

#include "common/config.h"
#include "common/lanes.h"
#include "common/math.h"
#include "common/mesh.h"

namespace lumen {

struct VesselOptions {
  double spacing_mm = 9;
  double width_mm = 0.6;
  Vec3d absorption = Vec3d(0.15, 0.7, 0.5);
};

// A straight piece of a vessel, away from the root.
struct VesselSegment {
  Vec3d from_mm, to_mm;  // from the middle of the wall's bounds
  Vec3d normal;          // of the wall, unit, across the segment
  double width_mm;
  int parent;  // the segment that ends where this one begins, before it in the list; −1: none, a root
};

class Vessels {
 public:
  // wall: at rest. Throws InputError where it would bear too many.
  Vessels(const VesselOptions& options, const Mesh& wall, uint64_t seed);

  const VesselOptions& options() const { return options_; }
  const std::vector<VesselSegment>& segments() const;
  // How far in front of a segment and behind it places see it.
  double depth_mm() const;

  // s at places, mm from the middle of the resting wall's bounds: 0 beside the vessels, at most 1. Places
  // that lie close together are cheapest.
  Lanes BloodAt(const Lanes3& places_mm) const;

 private:
  struct Network;
  VesselOptions options_;
  std::shared_ptr<const Network> network_;  // a scene's copies share it
};

// Reads the scene's [surface.vessels] and grows them.
Vessels ReadVessels(const ConfigTable& vessels, const Mesh& wall, uint64_t seed);

}  // namespace lumen
