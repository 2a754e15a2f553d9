// Whether poses and gains can be what they are said to be, before training, and what is learnt a wall.
#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "common/math.h"
#include "recon/surface/field.h"
#include "recon/training/options.h"
#include "recon/training/ray_loss.h"

namespace lumen {

// numbers: NNNN of the frames' files, as many as poses. Throws InputError naming the first frame whose pose
// is not finite or lies farther from the others than a colon is long. Says in a line where all of them stand
// so close together that their unit is in doubt; such cameras see no parallax, which is allowed.
void CheckPoses(const std::filesystem::path& folder, const std::vector<int>& numbers,
                const std::vector<Pose>& world_from_camera);

// radiance: a frame's mean, its gain taken out. Says in a line which frames are far brighter or darker than
// the others by it.
void CheckGains(const std::filesystem::path& folder, const std::vector<int>& numbers,
                const std::vector<double>& radiance);

// Indices of the places, relative to the field's origin, that don't lie in its lumen.
std::vector<size_t> PlacesOutside(const Field<float>& field, const float* parameters,
                                  const std::vector<Vec3d>& places);

// The learnt wall, as the rays of frames' pixels meet it.
struct WallSeen {
  double beyond = 0;  // share of the rays that meet none before the field's bounds, where nothing is learnt
  double median_mm = 0;  // distance
  // The colour network answers the same wherever the rays meet the wall, to a float's rounding: its units
  // have died, and steps that overshot have killed them. A wall of one colour alone isn't like that.
  bool one_color = false;
};
WallSeen LookAtWall(const Field<float>& field, const float* parameters,
                    const TrainOptions::Sampling& sampling, RayBatch<float>* batch);

// Why nothing can come of it, in words; empty = something can. Asked at any time of a run.
std::string WhyHopeless(const WallSeen& wall);

// Why it is no wall of a colon at a run's end, whose photometric loss is `left` of what it was at the start;
// empty = nothing says so.
std::string WhyUseless(const WallSeen& wall, double left);

// What is odd at a run's end about a wall that may be a colon's all the same; empty = nothing.
std::string WhatIsOdd(const WallSeen& wall, double left);

}  // namespace lumen
