#include "recon/evaluation/light_error.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <nlohmann/json.hpp>

#include "common/error.h"
#include "common/statistics.h"

namespace lumen {
namespace {

constexpr const char* kRemedy =
    "; render with --set 'truth.exact=[\"albedo\", \"direct\", \"indirect\", \"distance\"]'";

const std::vector<double> kBinEnds_mm = {0, 15, 30, 45, 60, std::numeric_limits<double>::infinity()};

// One pixel's channel as both have it.
struct Pair {
  double distance_mm, learnt, truth;
};
using Pairs = std::array<std::vector<Pair>, 3>;

// Where the EXR's channels stand of which `names` are asked for.
std::vector<size_t> PlacesOf(const std::filesystem::path& file, const std::vector<std::string>& channels,
                             const std::vector<std::string>& names) {
  std::vector<size_t> places;
  for (const std::string& name : names) {
    const auto found = std::ranges::find(channels, name);
    if (found == channels.end()) {
      throw InputError(file.string() + ": has no channel " + name + kRemedy);
    }
    places.push_back(static_cast<size_t>(found - channels.begin()));
  }
  return places;
}

ImageF Picked(const ImageF& all, const std::vector<size_t>& places, int stride) {
  ImageF image((all.width + stride - 1) / stride, (all.height + stride - 1) / stride,
               static_cast<int>(places.size()));
  for (int y = 0; y < image.height; ++y) {
    for (int x = 0; x < image.width; ++x) {
      for (size_t i = 0; i < places.size(); ++i)
        image.Pixel(x, y)[i] = all.Pixel(x * stride, y * stride)[places[i]];
    }
  }
  return image;
}

void Collect(const LightFrame& learnt, const LightFrame& truth, Pairs* albedo, Pairs* share) {
  for (int y = 0; y < truth.albedo.height; ++y) {
    for (int x = 0; x < truth.albedo.width; ++x) {
      const double distance_mm = *truth.distance_mm.Pixel(x, y);
      for (int c = 0; c < 3; ++c) {
        const double a = learnt.albedo.Pixel(x, y)[c], b = truth.albedo.Pixel(x, y)[c];
        // Written so that NaN fails.
        if (a > 0 && b > 0) (*albedo)[c].push_back({distance_mm, a, b});
        const double s = BouncedShare(learnt.direct.Pixel(x, y)[c], learnt.indirect.Pixel(x, y)[c]);
        const double t = BouncedShare(truth.direct.Pixel(x, y)[c], truth.indirect.Pixel(x, y)[c]);
        if (t >= kLeastShare && s >= 0) (*share)[c].push_back({distance_mm, s, t});
      }
    }
  }
}

double MedianOfPairs(const std::vector<Pair>& pairs, double (*of)(const Pair&)) {
  if (pairs.empty()) return 0;
  std::vector<double> values;
  for (const Pair& pair : pairs) values.push_back(of(pair));
  return MedianOf(values);
}

double MeanOfPairs(const std::vector<Pair>& pairs, double (*of)(const Pair&)) {
  double sum = 0;
  for (const Pair& pair : pairs) sum += of(pair);
  return sum / static_cast<double>(pairs.size());
}

RelativeErrors ErrorsOf(const std::vector<Pair>& pairs, double factor, double from_mm, double to_mm) {
  std::vector<double> errors;
  for (const Pair& pair : pairs) {
    if (pair.distance_mm >= from_mm && pair.distance_mm < to_mm)
      errors.push_back(std::abs(factor * pair.learnt / pair.truth - 1));
  }
  if (errors.empty()) return {};
  std::ranges::sort(errors);
  // The smallest error that nine tenths of all don't exceed.
  const auto rank = static_cast<size_t>(std::ceil(0.9 * static_cast<double>(errors.size())));
  return {static_cast<int64_t>(errors.size()), MedianOf(errors), errors[rank - 1]};
}

std::string Cell(const RelativeErrors& errors) {
  return errors.pixels == 0
             ? fmt::format("{:>13}", "-")
             : fmt::format("{:>5.1f} / {:>5.1f}", 100 * errors.median, 100 * errors.percentile_90);
}

nlohmann::json ToJson(const std::array<RelativeErrors, 3>& channels) {
  nlohmann::json list = nlohmann::json::array();
  for (const RelativeErrors& errors : channels) {
    list.push_back(
        {{"pixels", errors.pixels}, {"median", errors.median}, {"percentile_90", errors.percentile_90}});
  }
  return list;
}

nlohmann::json ToJson(const Vec3d& rgb) { return {rgb[0], rgb[1], rgb[2]}; }

}  // namespace

double BouncedShare(double direct, double indirect) { return indirect / (direct + indirect); }

LightFrame TrueLight(const Sequence& sequence, const SequenceFrame& frame, int stride) {
  const std::filesystem::path file = sequence.folder / "exact" / fmt::format("{:04d}.exr", frame.number);
  if (!std::filesystem::exists(file)) throw InputError(file.string() + ": there is none" + kRemedy);
  std::vector<std::string> channels;
  const ImageF all = ReadExr(file, &channels);
  const CameraIntrinsics& camera = sequence.calibration.camera;
  if (all.width != camera.width || all.height != camera.height) {
    throw InputError(fmt::format("{}: has {}×{} pixels, the camera {}×{}", file.string(), all.width,
                                 all.height, camera.width, camera.height));
  }
  const auto rgb = [&](const std::string& name) {
    return Picked(all, PlacesOf(file, channels, {name + ".R", name + ".G", name + ".B"}), stride);
  };
  return {rgb("albedo"), rgb("direct"), rgb("indirect"),
          Picked(all, PlacesOf(file, channels, {"distance"}), stride)};
}

LightErrors CompareLight(const std::vector<LightFrame>& learnt, const std::vector<LightFrame>& truth) {
  Pairs albedo, share;
  for (size_t i = 0; i < truth.size(); ++i) Collect(learnt[i], truth[i], &albedo, &share);
  LightErrors errors;
  for (int c = 0; c < 3; ++c) {
    if (albedo[c].empty()) throw InputError("no pixel has both a true and a learnt albedo");
    errors.albedo_factor[c] =
        1 / MedianOfPairs(albedo[c], [](const Pair& pair) { return pair.learnt / pair.truth; });
    errors.above_one[c] =
        MeanOfPairs(albedo[c], [](const Pair& pair) { return pair.learnt > 1 ? 1.0 : 0.0; });
    errors.true_share[c] = MedianOfPairs(share[c], [](const Pair& pair) { return pair.truth; });
    errors.learnt_share[c] = MedianOfPairs(share[c], [](const Pair& pair) { return pair.learnt; });
  }
  for (size_t bin = 0; bin < kBinEnds_mm.size(); ++bin) {
    LightErrors::Row row{
        bin == 0 ? 0 : kBinEnds_mm[bin - 1], bin == 0 ? kBinEnds_mm.back() : kBinEnds_mm[bin], {}, {}};
    for (int c = 0; c < 3; ++c) {
      row.albedo[c] = ErrorsOf(albedo[c], errors.albedo_factor[c], row.from_mm, row.to_mm);
      row.share[c] = ErrorsOf(share[c], 1, row.from_mm, row.to_mm);
    }
    errors.rows.push_back(row);
  }
  return errors;
}

std::string ToTable(const LightErrors& errors) {
  std::string table =
      "relative errors, %, median / 90th percentile: of the albedo after one factor a channel, and of the "
      "share of\n"
      "bounced light, indirect/(direct + indirect)\n"
      "distance, mm    pixels     albedo: red         green          blue     share: red         green       "
      "   blue\n";
  for (const LightErrors::Row& row : errors.rows) {
    const bool last = std::isinf(row.to_mm);
    const std::string name = row.from_mm == 0 && last ? "all"
                             : last                   ? fmt::format("{:.0f}–", row.from_mm)
                                    : fmt::format("{:.0f}–{:.0f}", row.from_mm, row.to_mm);
    table += fmt::format("{:<12} {:>9}", name, row.albedo[1].pixels);
    for (const auto* channels : {&row.albedo, &row.share})
      for (const RelativeErrors& channel : *channels) table += " " + Cell(channel);
    table += "\n";
  }
  const auto triple = [](const Vec3d& rgb) {
    return fmt::format("{:.3f} {:.3f} {:.3f}", rgb[0], rgb[1], rgb[2]);
  };
  table += "albedo: the learnt one times " + triple(errors.albedo_factor) +
           "; before that it is above 1 in " + triple(100 * errors.above_one) + "% of the pixels\n";
  if (errors.rows[0].share[0].pixels + errors.rows[0].share[1].pixels + errors.rows[0].share[2].pixels == 0)
    return table + "share: no light between walls in the truth\n";
  return table + "share: in the median learnt " + triple(errors.learnt_share) + ", true " +
         triple(errors.true_share) + "\n";
}

nlohmann::json ToJson(const LightErrors& errors) {
  nlohmann::json rows = nlohmann::json::array();
  for (const LightErrors::Row& row : errors.rows) {
    nlohmann::json json = {
        {"from_mm", row.from_mm}, {"albedo", ToJson(row.albedo)}, {"share", ToJson(row.share)}};
    if (!std::isinf(row.to_mm)) json["to_mm"] = row.to_mm;
    rows.push_back(json);
  }
  return {{"rows", rows},
          {"albedo_factor", ToJson(errors.albedo_factor)},
          {"above_one", ToJson(errors.above_one)},
          {"true_share", ToJson(errors.true_share)},
          {"learnt_share", ToJson(errors.learnt_share)}};
}

}  // namespace lumen
