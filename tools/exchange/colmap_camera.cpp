#include <algorithm>
#include <array>

#include "common/error.h"
#include "tools/exchange/colmap_model.h"

namespace lumen {
namespace {

// COLMAP's pixels have their centres at halves.
constexpr double kHalfPixel = 0.5;

struct Model {
  std::string_view name;
  int parameters;
  int focal_lengths;  // one for both axes, or fx and fy
  bool fisheye;       // r(θ) rather than r(tanθ)
  int radial;         // leading distortion parameters that are Kannala–Brandt's k1 …, if it is a fisheye
};

// In the order of COLMAP's numbers.
constexpr std::array<Model, 11> kModels = {{
    {"SIMPLE_PINHOLE", 3, 1, false, 0},
    {"PINHOLE", 4, 2, false, 0},
    {"SIMPLE_RADIAL", 4, 1, false, 0},
    {"RADIAL", 5, 1, false, 0},
    {"OPENCV", 8, 2, false, 0},
    {"OPENCV_FISHEYE", 8, 2, true, 4},
    {"FULL_OPENCV", 12, 2, false, 0},
    {"FOV", 5, 2, false, 0},
    {"SIMPLE_RADIAL_FISHEYE", 4, 1, true, 1},
    {"RADIAL_FISHEYE", 5, 1, true, 2},
    {"THIN_PRISM_FISHEYE", 12, 2, true, 0},
}};

const Model* Find(std::string_view name) {
  const auto model = std::ranges::find(kModels, name, &Model::name);
  return model == kModels.end() ? nullptr : &*model;
}

}  // namespace

int ColmapParameterCount(std::string_view model) {
  const Model* found = Find(model);
  return found ? found->parameters : -1;
}

std::string ColmapModelName(int number) {
  const bool known = number >= 0 && number < static_cast<int>(kModels.size());
  return known ? std::string(kModels[number].name) : "";
}

CameraIntrinsics FromColmap(const ColmapCamera& camera) {
  const Model& model = *Find(camera.model);
  const std::vector<double>& p = camera.parameters;
  CameraIntrinsics in;
  in.model = model.fisheye ? CameraModel::kKannalaBrandt : CameraModel::kPinhole;
  in.width = camera.width;
  in.height = camera.height;
  in.fx = p[0];
  in.fy = p[model.focal_lengths - 1];
  in.cx = p[model.focal_lengths] - kHalfPixel;
  in.cy = p[model.focal_lengths + 1] - kHalfPixel;
  const size_t first = model.focal_lengths + 2;  // of the distortion
  for (int i = 0; i < model.radial; ++i) in.k[i] = p[first + i];
  // FOV's ω = 0 is a pinhole as well.
  const auto unknown = p.begin() + static_cast<std::ptrdiff_t>(first + model.radial);
  if (std::any_of(unknown, p.end(), [](double distortion) { return distortion != 0; })) {
    throw InputError(camera.place + ": a camera of model " + camera.model +
                     " has no counterpart here; use OPENCV_FISHEYE, or let COLMAP undistort the images");
  }
  try {
    const Camera<double> describes_a_camera(in);
  } catch (const InputError& error) {
    throw InputError(camera.place + ": " + error.what());
  }
  return in;
}

ColmapCamera ToColmap(const CameraIntrinsics& camera) {
  ColmapCamera out;
  out.id = 1;
  out.model = camera.model == CameraModel::kPinhole ? "PINHOLE" : "OPENCV_FISHEYE";
  out.width = camera.width;
  out.height = camera.height;
  out.parameters = {camera.fx, camera.fy, camera.cx + kHalfPixel, camera.cy + kHalfPixel};
  if (camera.model == CameraModel::kKannalaBrandt) {
    out.parameters.insert(out.parameters.end(), camera.k.begin(), camera.k.end());
  }
  return out;
}

}  // namespace lumen
