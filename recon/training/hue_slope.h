// Whether light goes from wall to wall, as colours tell it.
//
// Direct light has the wall's hue everywhere. What has been sent from wall to wall has met the wall's colour
// twice or more, and its share grows towards the dark far end: there, a red wall is redder.
#pragma once

#include <array>
#include <cstdint>
#include <functional>
#include <vector>

#include "common/math.h"
#include "common/response.h"

namespace lumen {

class HueSlope {
 public:
  // Of frames of this size. valid: a row's pixels, 0 where there is no image; asked for once a row, from many
  // threads.
  HueSlope(const Response& response, int width, int height,
           const std::function<std::vector<uint8_t>(int y)>& valid);

  // Adds a colour frame, row by row from the top to the last: of squares of pixels that all carry image, the
  // mean linear values, saturated pixels left out.
  void AddRow(int y, const uint8_t* rgb);

  // d log(x/y) / d log y within the frames, x being the channel with the most light and y that with the
  // least: 0 under direct light alone, negative where light goes from wall to wall, and where a coat mirrors
  // white light. 0 for a grey wall, which has no hue to tell it by, and for too few squares.
  double Slope() const;

 private:
  struct Square {
    Vec3d sum = Vec3d::Zero();
    int count = 0;
  };
  void EndSquares(int row);
  void EndFrame();

  // Of log(x/y) and log y, by channels x, y; about each frame's own means.
  struct Sums {
    double xx = 0, xy = 0;
  };
  std::array<double, 256> linear_;
  int height_, edge_, across_;
  std::vector<uint8_t> whole_;   // a square: all of it carries image
  std::vector<Square> squares_;  // a row of them, which the frame has come to
  std::vector<Vec3d> logs_;      // of the frame so far
  std::array<std::array<Sums, 3>, 3> sums_{};
  std::array<double, 3> log_value_{};
};

// Scenes of direct light, the 22 ideal twins of C3VD and seven others, have slopes of −.009 to .002; scenes
// with light between walls, eight full twins and colon_lit, of −.28 to −.10, and so has a coat's glints alone
// (−.11).
inline constexpr double kHueSlopeOfWallLight = -0.03;

}  // namespace lumen
