// What JPEG (ITU-T T.81) leaves of an image, in memory, through OpenImageIO.
#pragma once

#include "common/image.h"

namespace lumen {

// Encodes and decodes an RGB image: baseline, the chroma at half the resolution both ways (4:2:0) as
// recorders do. quality: 1…100, libjpeg's scale. Same input gives same output on one version of libjpeg.
// Throws std::runtime_error where the library fails.
Image8 ThroughJpeg(const Image8& image, int quality);

}  // namespace lumen
