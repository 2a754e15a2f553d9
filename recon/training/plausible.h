// Whether poses and gains can be what they are said to be, before training and after it.
#pragma once

#include <filesystem>
#include <vector>

#include "common/math.h"
#include "recon/surface/field.h"

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

}  // namespace lumen
