// Effect: the recorder's JPEG, [sensor.jpeg]: the developed frame is encoded and decoded before it is
// written, as PNG, so that it has JPEG's blocks, ringing and coarse colours. What isn't valid is black before
// and takes part.
//
//   quality  85  1…100, libjpeg's scale: its tables of quantisation steps are those of ITU-T T.81, annex K,
//   times
//                2 − quality/50 from 50 on, 50/quality below
//
// The chroma has half the resolution (4:2:0). common/jpeg.h does it.
#pragma once

#include "common/config.h"

namespace lumen {

struct Jpeg {
  int quality = 85;
};

// Reads the scene's [sensor.jpeg].
inline Jpeg ReadJpeg(const ConfigTable& table) {
  Jpeg jpeg;
  jpeg.quality = static_cast<int>(table.Integer("quality", jpeg.quality, {1, 100}));
  return jpeg;
}

}  // namespace lumen
