// Effect: the sensor's shutter, [sensor.shutter]: what moves is blurred over the exposure, and a rolling
// shutter reads the rows one after the other. A pixel of row y gathers light evenly over the times
//
//   readout · ((y + 1/2)/height − 1/2) + exposure · (u − 1/2),   u in 0…1,
//
// in frame intervals from the moment of the frame's pose, its truth and its middle row's middle. Light guides
// move with the camera; between frames its position moves on straight lines and its rotation evenly (slerp),
// before the first frame and after the last as it does beside them. A wall that moves (peristalsis) is where
// it is at that time, too.
//
//   exposure  0.5  of the frame interval, 0…1
//   readout   0    from the first row to the last, of the frame interval, −1…1: 0 is a global shutter
//
// Four rows at a time are read out together (for light from wall to wall: sixteen), and the samples of 4 × 4
// pixels share their times (for light between walls that move, those of 16 × 16), which fill the exposure
// evenly from sample to sample: use 16 samples or more. The automatic gain's small picture stands still.
#pragma once

#include <cmath>
#include <vector>

#include "common/config.h"
#include "common/math.h"

namespace lumen {

struct Shutter {
  double exposure = 0.5;
  double readout = 0;

  // From the first row's beginning to the last row's end, in frame intervals; the frame's moment is its
  // middle.
  double Duration() const { return exposure + std::abs(readout); }
};

// Reads the scene's [sensor.shutter].
Shutter ReadShutter(const ConfigTable& table);

// Where the camera is while a frame is taken.
class CameraMotion {
 public:
  // world_from_camera: of all frames, at least one. A scene of one frame stands still.
  CameraMotion(const Shutter& shutter, const std::vector<Pose>& world_from_camera, int frame);

  // time: in frame intervals from the frame's moment, within ±1.
  Pose At(double time) const;
  // The time of a sample, u in [0, 1), at a height of the image: 0 its upper border, 1 its lower.
  double Time(double height_fraction, double u) const {
    return shutter_.readout * (height_fraction - 0.5) + shutter_.exposure * (u - 0.5);
  }
  // What part of the frame's duration, which must not be 0, has passed by then. Within [0, 1] without a
  // clamp: no sum that Time rounds is beyond half the rounded duration, and no quotient beyond a half.
  float Part(double time) const { return static_cast<float>(0.5 + time / shutter_.Duration()); }

 private:
  // A stretch between the poses of two frames, its first one's moment at start.
  struct Stretch {
    Pose first, second;
    double start;
  };
  Shutter shutter_;
  Stretch before_, after_;
};

}  // namespace lumen
