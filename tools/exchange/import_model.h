// Poses from elsewhere: a COLMAP model and its images become a sequence folder.
#pragma once

#include <filesystem>
#include <optional>

#include "common/sequence.h"
#include "tools/exchange/light_scale.h"
#include "common/similarity.h"

namespace lumen {

struct ImportOptions {
  std::filesystem::path model, images;
  // A sequence whose light, response and gains (by frame number), and whose mask where it fits, are taken;
  // empty: C3VD's built-in light and response, gains unknown. Where the model's camera is the fisheye that an
  // export of the sequence has in place of its own, that one is taken back, and the poses' turn with it.
  std::filesystem::path calibration;
  // Millimetres of one unit of the model: this; or from given poses (a file in pose.txt's layout, a line a
  // frame, or a line for every number), whose axes are taken as well; or from the light. Of these three one
  // at most.
  double mm_per_unit = 1;
  std::filesystem::path scale_from;
  bool scale_from_light = false;
  double albedo = 0.35;  // of the wall in green, for the scale from light
  bool link = false;     // symbolic links in place of copies, where images are PNG
};

struct ImportResult {
  int frames = 0;
  double mm_per_unit = 1;
  // By how much the poses were turned about the axis, where the calibration's camera was taken back.
  std::optional<double> turned_back_rad;
  std::optional<SimilarityFit> from_poses;
  std::optional<LightScale> from_light;
};

// Frames are numbered as their names are (the first number in each), or in the order of their names where
// that says nothing. Throws InputError: a damaged model, cameras that differ, an image that isn't there, a
// scale that can't be told, a folder that isn't empty.
ImportResult ImportModel(const ImportOptions& options, const std::filesystem::path& folder);

}  // namespace lumen
