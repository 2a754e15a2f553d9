// Binning: frames at a whole part of their size, as a sensor that reads squares of pixels together gives
// them.
#pragma once

#include <cstdint>
#include <functional>
#include <vector>

#include "common/response.h"
#include "common/sequence.h"

namespace lumen {

// The same frames with squares of factor × factor pixels as one each, from the upper left corner on; what is
// left over at the right and at the bottom is cut off. The camera's pixel edges are divided by the factor. A
// square carries image where all of its pixels do. Frames are read as before: what has other files (depth,
// normals, flow, occlusion) is gone. Throws InputError for a factor below 1 or larger than a frame, and for a
// sequence that is binned already.
Sequence Binned(const Sequence& sequence, int factor);

// Takes a frame's rows and gives those of squares: the mean of their pixels in linear light, to 8 bits again.
// Gain and vignetting hardly differ within a square, and drop out. Saturated pixels count as full scale.
class RowBinner {
 public:
  // width: of the rows given, in squares. row(y, rgb): gets them.
  RowBinner(const Response& response, int factor, int width,
            const std::function<void(int, const uint8_t*)>& row);

  // Rows from the top on; at least width · factor pixels.
  void AddRow(int y, const uint8_t* rgb);

 private:
  const Response& response_;
  const int factor_;
  const std::function<void(int, const uint8_t*)>& row_;
  double linear_[256];
  std::vector<double> sums_;  // a channel of a square
  std::vector<uint8_t> binned_;
};

}  // namespace lumen
