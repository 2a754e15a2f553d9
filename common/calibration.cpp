#include "common/calibration.h"

#include <algorithm>
#include <cmath>

#include "common/error.h"
#include "common/line_reader.h"

namespace lumen {
namespace {

// Larger than any image; small enough for width · height · channels in 32 bits.
constexpr Range kImageSide{1, 16384};
// Gammas of displays and cameras lie between 1 and 3; 0.1 and 10 are surely slips.
constexpr Range kGamma{0.1, 10};

std::string Line(const std::string& key, double value) {
  std::string line = key + " = ";
  AppendNumber(&line, value);
  return line + "\n";
}

std::string Line(const std::string& key, const Vec3d& value) {
  return key + " = " + ArrayText(value.data(), 3) + "\n";
}

}  // namespace

CameraIntrinsics ReadCamera(const ConfigTable& camera) {
  CameraIntrinsics in;
  const std::string model = camera.Choice("model", {"scaramuzza", "kannala_brandt", "pinhole"});
  in.width = static_cast<int>(camera.Integer("width", kImageSide));
  in.height = static_cast<int>(camera.Integer("height", kImageSide));
  in.cx = camera.Number("cx");
  in.cy = camera.Number("cy");
  if (model == "scaramuzza") {
    in.model = CameraModel::kScaramuzza;
    std::ranges::copy(camera.Numbers("a", in.a.size()), in.a.begin());
    if (camera.Has("stretch"))
      std::ranges::copy(camera.Numbers("stretch", in.stretch.size()), in.stretch.begin());
  } else {
    in.fx = camera.Number("fx", kPositive);
    in.fy = camera.Number("fy", kPositive);
    if (model == "kannala_brandt") {
      in.model = CameraModel::kKannalaBrandt;
      std::ranges::copy(camera.Numbers("k", in.k.size()), in.k.begin());
    }
  }
  try {
    const Camera<double> valid(in);
  } catch (const InputError& error) {
    camera.Fail("model", error.what());
  }
  return in;
}

Light ReadLight(const ConfigTable& table) {
  table.Choice("model", {"sls"});
  Light light;
  light.calibrated = table.Flag("calibrated", true);
  for (const ConfigTable& entry : table.Tables("source")) {
    LightSource source;
    source.position = entry.Vector("position");
    source.direction = entry.Vector("direction");
    source.spread = entry.Number("spread", kNotNegative);
    source.intensity = entry.Vector("intensity", kPositive);
    const double length = source.direction.norm();
    if (length == 0) entry.Fail("direction", "is zero, but must point where the source shines");
    // A unit vector keeps its digits.
    if (std::abs(length - 1) > 1e-12) source.direction /= length;
    light.sources.push_back(source);
  }
  if (light.sources.empty()) table.Fail("source", "a light needs at least one [[light.source]]");
  return light;
}

Response ReadResponse(const ConfigTable& table) {
  Response response;
  if (table.Has("transfer")) {
    table.Choice("transfer", {"srgb"});
    if (table.Has("gamma")) table.Fail("gamma", "excludes transfer = \"srgb\"; keep one of them");
    response.srgb = true;
  } else {
    response.gamma = table.Number("gamma", kGamma);
  }
  response.vignetting = table.Number("vignetting", 0, kNotNegative);
  return response;
}

std::string ArrayText(const double* values, size_t count) {
  std::string text = "[";
  for (size_t i = 0; i < count; ++i) {
    if (i > 0) text += ", ";
    AppendNumber(&text, values[i]);
  }
  return text + "]";
}

std::string CameraText(const CameraIntrinsics& in) {
  const char* model = in.model == CameraModel::kScaramuzza      ? "scaramuzza"
                      : in.model == CameraModel::kKannalaBrandt ? "kannala_brandt"
                                                                : "pinhole";
  std::string text = "[camera]\nmodel = \"" + std::string(model) + "\"\n";
  text += "width = " + std::to_string(in.width) + "\nheight = " + std::to_string(in.height) + "\n";
  text += Line("cx", in.cx) + Line("cy", in.cy);
  if (in.model == CameraModel::kScaramuzza) {
    text += "a = " + ArrayText(in.a.data(), in.a.size()) + "\n";
    return text + "stretch = " + ArrayText(in.stretch.data(), in.stretch.size()) + "\n";
  }
  text += Line("fx", in.fx) + Line("fy", in.fy);
  if (in.model == CameraModel::kKannalaBrandt) text += "k = " + ArrayText(in.k.data(), in.k.size()) + "\n";
  return text;
}

std::string LightText(const Light& light) {
  std::string text = "[light]\nmodel = \"sls\"\n";
  text += light.calibrated ? "calibrated = true\n" : "calibrated = false\n";
  for (const LightSource& source : light.sources) {
    text += "[[light.source]]\n" + Line("position", source.position) + Line("direction", source.direction) +
            Line("spread", source.spread) + Line("intensity", source.intensity);
  }
  return text;
}

std::string ResponseText(const Response& response) {
  return "[response]\n" + (response.srgb ? "transfer = \"srgb\"\n" : Line("gamma", response.gamma)) +
         Line("vignetting", response.vignetting);
}

}  // namespace lumen
