// What the wall, as it is learnt so far, receives from itself, around every camera.
#pragma once

#include "recon/surface/direction_map.h"
#include "recon/surface/field.h"
#include "recon/surface/shading.h"
#include "recon/training/options.h"

namespace lumen {

// Irradiance from the rest of the wall at the places that lie in each direction from the camera (camera
// axes), at gain 1: radiosity between one patch a direction, found on the surface and with the albedo that
// the field has now. The field must have an albedo; what a coat sends is left out.
DirectionMap<float> SurroundingsOf(const Field<float>& field, const float* parameters,
                                   const TrainOptions::Sampling& sampling, const FrameLight<float>& light);

}  // namespace lumen
