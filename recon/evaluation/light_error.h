// By how much the learnt albedo and the learnt light between walls are off, against the simulator's own
// channels.
#pragma once

#include <array>
#include <cstdint>
#include <filesystem>
#include <nlohmann/json_fwd.hpp>
#include <string>
#include <vector>

#include "common/sequence.h"
#include "recon/training/learnt_light.h"

namespace lumen {

// The frame's exact channels, where the sequence was rendered with truth.exact = ["albedo", "direct",
// "indirect", "distance"] or more. Throws InputError: no such file, a channel missing, another size than the
// camera's.
LightFrame TrueLight(const Sequence& sequence, const SequenceFrame& frame, int stride);

// What share of the light that the wall scatters has come by other places: indirect/(direct + indirect); NaN
// where there is neither.
double BouncedShare(double direct, double indirect);

// A share below this is too small to be wrong by a part of itself.
inline constexpr double kLeastShare = 0.01;

// Of some pixels, relative to the truth.
struct RelativeErrors {
  int64_t pixels = 0;
  double median = 0, percentile_90 = 0;  // 0 without pixels
};

struct LightErrors {
  // By the wall's true distance from the camera; the first row is of all.
  struct Row {
    double from_mm, to_mm;
    std::array<RelativeErrors, 3> albedo, share;  // a channel
  };
  std::vector<Row> rows;
  // What the learnt albedo of a channel is to be multiplied by, so that it is the truth's in the median.
  Vec3d albedo_factor = Vec3d::Ones();
  // Part of the pixels where the learnt albedo, before that factor, is more than all.
  Vec3d above_one = Vec3d::Zero();
  // Medians of the share, where the truth's is kLeastShare at least.
  Vec3d true_share = Vec3d::Zero(), learnt_share = Vec3d::Zero();
};

// Over all pixels of which both know everything. The lists have a frame each; the truth's shares below
// kLeastShare and black albedos are left out. Throws InputError where nothing is left of the albedo.
LightErrors CompareLight(const std::vector<LightFrame>& learnt, const std::vector<LightFrame>& truth);

std::string ToTable(const LightErrors& errors);
nlohmann::json ToJson(const LightErrors& errors);

// Albedo and share of bounced light, in green, truth and learnt side by side, for the first, the middle and
// the last frame. numbers: of the frames' files.
void WriteLightPicture(const LightErrors& errors, const std::vector<LightFrame>& learnt,
                       const std::vector<LightFrame>& truth, const std::vector<int>& numbers,
                       const std::filesystem::path& file);

}  // namespace lumen
