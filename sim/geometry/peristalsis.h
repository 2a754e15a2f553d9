// Effect: peristalsis, [peristalsis]: rings of contraction travel along the colon and squeeze its wall
// towards the centreline. A place x of the resting wall whose nearest point of the centreline is c(s), s its
// arc length from the near end in mm, is at time t in seconds at
//
//   c(s) + (1 − amplitude · cos²(π·(s + speed·t)/wavelength − phase/2) · h) · (x − c(s)),
//
// for positive speeds a wave towards the near end, where the rectum is.
//
//   amplitude      0.3     part of the radius that the tightest ring takes away, 0…0.9
//   wavelength_mm  50      from one ring to the next
//   speed_mm_s     10      of the rings along the centreline, positive towards the near end
//   rate_hz        29.97   frames a second: frame i is taken at i/rate
//   phase_rad      0       0: at frame 0 a ring is tightest at the near end; 2π: one wavelength deeper
//
// Source: the wave is that of Shapiro, Jaffrin and Weinberg 1969, "Peristaltic pumping with long wavelengths
// at low Reynolds number", about a curve; from 0 inwards, since muscle only contracts. In the human colon
// contractions propagate at about 10 mm/s (Narducci et al. 1987, Gut 28:17) to 22–36 mm/s (Cook et al. 2000,
// Am J Physiol 278:G329); cyclic patterns come 11–13 and 3–4 times a minute (Pervez et al. 2020,
// Neurogastroenterol Motil 32:e13807): at 10 mm/s, 12 a minute are 50 mm apart, 3 a minute 200 mm.
//
// One to one, without a fold, for every amplitude below 1, where the lumen would close. R(s), the reach, is a
// radius within which c(s) is nearer than every other point of the centreline (Federer 1959, "Curvature
// measures"), so that x is one pair of s and of a vector across the centreline, of length r. s stays, and r
// becomes r′ = r·(1 − a·h(r/R)), a being the wave there, which rises with r wherever a < 1, since h falls: h
// is 1 up to half the reach, 1 − v³(10 − 15v + 6v²) with v = 2r/R − 1 from there and 0 beyond the reach,
// where nothing moves. The volume of a small piece changes by
//
//   r′/r · dr′/dr · (1 − κr′)/(1 − κr) > (1 − amplitude)²/2,
//
// κ being the curvature towards x, |κ|r < 1 within the reach. Beyond its ends the centreline goes on straight
// past the whole wall. A colon that bends too sharply for its radius is squeezed less at the bend's outer
// side. Triangles stay flat between their moved corners: a wall finely meshed for its shape is fine enough
// for waves of some centimetres.
//
// The lumen that the trajectory is planned in, and the sequence's mesh.ply, are those at rest. A frame's
// truth is of the wall as it is at the frame's moment.
//
// Within an exposure the wall moves if there is a shutter (sim/imaging/shutter.h), from the first row's
// beginning to the last one's end; without one a picture is taken in an instant. That time is cut into equal
// stretches, in which every vertex goes evenly on a straight line. A place's way within a stretch of duration
// T is off its chord by no more than T²/8 of its acceleration, and cos² has no second derivative beyond 2:
//
//   amplitude · h · |x − c| · (π · speed · T/wavelength)²/4,
//
// which there are enough stretches to keep below 0.005 mm (a colon's triangles are up to 0.015 mm off the
// smooth wall): one for a video at the defaults, where the wall moves by less than 0.1 mm an exposure. A
// scene that would need more than 128 is refused.
#pragma once

#include <vector>

#include "common/config.h"
#include "common/mesh.h"
#include "sim/geometry/centreline.h"
#include "sim/geometry/geometry.h"

namespace lumen {

struct Peristalsis {
  double amplitude = 0.3;
  double wavelength_mm = 50;
  double speed_mm_s = 10;
  double rate_hz = 29.97;
  double phase_rad = 0;
};

// Reads the scene's [peristalsis].
Peristalsis ReadPeristalsis(const ConfigTable& table);

// The wave as a map of the space about a centreline. Const members may be called from any thread.
class PeristalticWave {
 public:
  // Beyond its ends the centreline goes on straight, as far as the mesh does.
  PeristalticWave(const Peristalsis& peristalsis, const Geometry& geometry);

  // Where a place belongs on the centreline; the same at all times.
  struct Foot {
    double s_mm;    // arc length from the near end; negative and more than the length beyond the ends
    Vec3d point;    // c(s), mm
    double yields;  // h, 0…1: how much of the contraction reaches the place
  };
  Foot FootOf(const Vec3d& place) const;

  // Where a place with this foot is when a frame is taken.
  Vec3d Moved(const Vec3d& place, const Foot& foot, double frame) const;

  // Over so many frame intervals, how far the way of a place that yields by so much in mm, h · |x − c|, can
  // be off its chord: the head's formula.
  double OffChord_mm(double yielding_mm, double frames) const;

  // How far from the centreline it can be told where a place belongs, mm.
  double Reach_mm(double s_mm) const;

 private:
  Peristalsis peristalsis_;
  Centreline centreline_;  // with its straight ends
  double before_mm_;       // length of the one at the near end
  std::vector<Vec3d> samples_;
  double step_mm_;
  std::vector<double> reach_mm_;  // at the samples
};

// The wall at the moments of the frames.
class PeristalticWall {
 public:
  static constexpr double kOffTheWay_mm = 0.005;

  // The geometry is referred to: it must outlive this.
  PeristalticWall(const Peristalsis& peristalsis, const Geometry& geometry);

  // The same faces, every vertex where it is when the frame is taken. A frame's number needn't be whole.
  Mesh At(double frame) const;

  // Into how many equal stretches a time, in frame intervals, is to be cut so that a vertex that goes evenly
  // on a straight line in each is never more than kOffTheWay_mm off its way: a whole number, 0 if nothing
  // moves, perhaps more than an int holds.
  double StretchesOver(double frames) const;

 private:
  const Mesh& rest_;
  PeristalticWave wave_;
  std::vector<PeristalticWave::Foot> feet_;
};

}  // namespace lumen
