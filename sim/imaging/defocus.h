// Effect: defocus, [lens.defocus]: the lens is not a point. Every sample looks through a place of its own on
// the aperture, a disc about the camera's centre across its axis, and all of a pixel's meet at one place,
// which is sharp: at focus_mm along the pixel's ray. For a ray along the unit vector w and a place o on the
// disc
//
//   origin o,   direction (focus · w − o)/|focus · w − o|.
//
//   aperture_mm  0.3   diameter of the entrance pupil, 0…2; 0 is a pinhole
//   focus_mm     10    from the camera's centre, along the ray: what is sharp lies on a sphere, because
//                      a plane would not be met by a fisheye's rays at 90° and more
//
// At a distance d along the ray the samples fill a disc of diameter aperture·|1 − d/focus|, parallel to the
// aperture; seen from the centre that is aperture·|1/d − 1/focus| rad on the axis, times the cosine of the
// angle to the axis towards the image's border and back. The blur of the thin lens (Potmesil and Chakravarty
// 1981, "A lens and aperture camera model for synthetic image generation"; Cook, Porter and Carpenter 1984,
// "Distributed ray tracing"), for a camera of any projection. How much less light comes through the
// foreshortened disc is part of the response's vignetting.
//
// Defaults: no maker publishes them. Endoscopes' lenses have f-numbers of 2.8 and more (Photonics 2021, 8,
// 89, which designs one of 2.2). C3VD's camera has a focal length of 769 px in an image 1350 px wide; on a
// sensor 1.4 mm wide that is 0.8 mm, and at f/2.8 a pupil of 0.3 mm. Colonoscopes' depth of field is stated
// as about 5–100 mm, whose ends are equally blurred, by 0.095·aperture rad, when it is focused at 9.5 mm.
//
// Pictures and the exact channels of radiance have the blur; what is geometry is that of the pixels' own
// rays. The automatic gain's small picture is sharp. A light source at the camera's centre casts shadows that
// the rim of the aperture sees.
#pragma once

#include "common/config.h"
#include "common/math.h"

namespace lumen {

struct Defocus {
  double aperture_mm = 0.3;
  double focus_mm = 10;
};

// Reads the scene's [lens.defocus].
Defocus ReadDefocus(const ConfigTable& table);

// A ray in camera axes.
struct LensRay {
  Vec3f origin;     // mm
  Vec3f direction;  // unit
};

// The ray of a sample of the pixel that sees along `direction` (unit, camera axes). random: in [0, 1)²,
// evenly spread over the aperture.
LensRay ThroughLens(const Defocus& defocus, const Vec3f& direction, const Vec2f& random);

}  // namespace lumen
