// Light that comes to places of the wall from its other places, as the frames themselves show it: a
// Lambertian wall sends the same radiance to the camera as to the rest of the wall. Nothing of the light
// guides, the albedo or the gain has to be known for the part of the wall that a frame shows; what it doesn't
// show is filled in by radiosity.
#pragma once

#include "common/ray_scene.h"
#include "recon/calibration/places.h"

namespace lumen {

// Row i: what share of what leaves each place is place i's irradiance. cosθ cosθ' A/(π d² + A), as
// recon/surface/radiosity.h, and 0 where the mesh lies between.
Eigen::MatrixXf FormFactors(const RayScene& scene, const Sightings& sightings);

// How places answer to light: value = response · (gain · irradiance/π + strength · bounced).
struct WallModel {
  Eigen::VectorXd log_gain;          // a frame
  Eigen::ArrayXXf log_response;      // places × 3; NaN where nothing is known
  Eigen::Array3d strength{0, 0, 0};  // of bounced light in units of the frames' values; 0 = there is none
};

// Places × frames: the mean, weighted by form factors, of the linear values of what each place sees.
Eigen::ArrayXXf BouncedLight(const Eigen::MatrixXf& factors, const Sightings& sightings,
                             const WallModel& model, int channel);

}  // namespace lumen
