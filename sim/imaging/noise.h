// Effect: noise of the sensor, [sensor.noise]. It is in the light before amplification, so that a gain raises
// it with the picture:
//
//   signal = gain · (N + R) / full_scale_e,   N ~ Poisson(full_scale_e · vignetting · radiance),
//                                             R ~ normal(0, read_e²)
//
// Mean: gain · vignetting · radiance. Variance: gain² · (vignetting · radiance / full_scale_e +
// (read_e / full_scale_e)²): shot noise and read noise of the EMVA 1288 standard (release 4.0, section 2).
//
//   full_scale_e  10000  electrons of a channel that give full scale at gain 1. A sensor's full well where
//                        gain 1 is its lowest; smaller pixels hold less
//   read_e        5      electrons, standard deviation in the dark
//
// What falls below black is cut there by the response, as by a sensor without a black level. The channels of
// a pixel are independent: no colour filter array.
#pragma once

#include <cstdint>

#include "common/config.h"
#include "common/image.h"

namespace lumen {

struct SensorNoise {
  double full_scale_e = 10000;
  double read_e = 5;
};

// Reads the scene's [sensor.noise].
SensorNoise ReadSensorNoise(const ConfigTable& noise);

// What the sensor reads of a frame's linear radiance, vignetting included, in parts of full scale at gain 1;
// it may fall below 0. Pixels that aren't valid stay 0. A function of (seed, frame, pixel, channel).
ImageF NoisySignal(const SensorNoise& noise, const ImageF& radiance, const ImageF& vignetting,
                   const Image8& valid, uint64_t seed, int frame);

// A number with Poisson's distribution of this mean (>= 0), a function of key.
double PoissonNumber(double mean, uint64_t key);

}  // namespace lumen
