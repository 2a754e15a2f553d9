// The shape of a colon's wall as a smooth function: a tube around a centreline with haustra, semilunar folds,
// taeniae and polyps, rounded off at both ends.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "sim/geometry/centreline.h"

namespace lumen {

// A polyp by its Paris class: Ip (a head on a stalk), Is (a dome), IIa (a flat elevation).
struct Polyp {
  enum class Paris { kIp, kIs, kIIa };
  Paris paris = Paris::kIs;
  double at_mm = 0;      // along the centreline
  double angle_rad = 0;  // around it, from the frame's normal to its binormal
  double size_mm = 0;    // largest width
};

struct ColonShape {
  std::vector<double>
      diameters_mm;  // of the wall between the folds, evenly spaced from the near to the deep end
  double haustra_spacing_mm = 30;  // from fold to fold of one sector
  double haustra_depth_mm = 2;     // outward bulge between two folds
  double fold_height_mm = 5;       // inward, in the middle of a sector
  double fold_thickness_mm = 5;    // full width at half height
  double taenia_width_mm = 10;
  double taenia_depth_mm = 1;    // inward
  double irregularity_mm = 0.3;  // root mean square of the small-scale relief
  std::vector<Polyp> polyps;
  uint64_t seed = 0;  // moves the folds a little, and draws the irregularity
};

// Points of the wall. The domain is the surface of a straight capsule: (x, y, s) with x² + y² = 1 along the
// tube, 0 ≤ s ≤ length, and half-ellipsoids beyond: x² + y² + ((s − length)/CapHeight)² = 1. It has neither
// seam nor pole.
class ColonWall {
 public:
  ColonWall(const ColonShape& shape, Centreline centreline);

  // World point, mm, of a point of the capsule.
  Vec3d At(const Vec3d& capsule) const;

  // The point of the capsule nearest to one that is near it (along x, y in the tube, radially in the caps).
  Vec3d OntoCapsule(const Vec3d& near) const;

  // Height of the rounded end, mm: the wall's radius there.
  double NearCapHeight() const { return Radius(0); }
  double DeepCapHeight() const { return Radius(length_mm_); }

  double length_mm() const { return length_mm_; }
  const Centreline& centreline() const { return centreline_; }

  // No point of the wall without polyps is farther from, or inside the tube nearer to the centreline than
  // this, mm.
  double OuterRadius() const;
  double InnerRadius() const;

  // Radius of the wall's round at the foot of a polyp, and how far it rises towards the lumen, mm.
  static double FootRadius(const Polyp& polyp);
  static double Height(const Polyp& polyp);

 private:
  struct Fold {
    double at_mm, height_mm, tilt_mm, bow_mm;
  };
  struct Wave {
    double amplitude_mm, along, phase;
    int around;
  };
  struct Place {
    double s_mm, angle_rad;
  };

  void PlaceFolds();
  void DrawWaves();
  double Radius(double s_mm) const;  // smooth profile of diameters_mm
  double DistanceFromCentreline(double s_mm, double angle_rad) const;
  double FoldFade(double s_mm, double angle_rad) const;  // 0 at a polyp, 1 far from all
  Vec3d AtPlace(const Place& place, double scale) const;

  ColonShape shape_;
  Centreline centreline_;
  double length_mm_;
  double taenia_rad_;           // of the first taenia
  std::vector<Fold> folds_[3];  // of each sector, by position
  std::vector<Wave> waves_;
};

}  // namespace lumen
