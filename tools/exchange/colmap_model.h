// COLMAP's sparse models, as text and as binary (https://colmap.github.io/format.html). In memory pixels are
// ours, the centre of the upper left one (0, 0); in COLMAP's files it is (0.5, 0.5). Lengths are the model's
// own units.
#pragma once

#include <cstdint>
#include <filesystem>
#include <string>
#include <string_view>
#include <unordered_map>
#include <vector>

#include "common/camera.h"
#include "common/image.h"
#include "common/math.h"

namespace lumen {

struct ColmapCamera {
  uint32_t id = 0;
  std::string model;  // "OPENCV_FISHEYE", …
  int width = 0, height = 0;
  std::vector<double> parameters;  // as COLMAP orders them; the principal point in its own convention
  std::string place;               // where it stands, for messages
};

struct ColmapObservation {
  Vec2d pixel;
  uint64_t point = 0;  // id
};

struct ColmapImage {
  uint32_t id = 0;
  uint32_t camera = 0;  // id
  std::string name;     // path below the images' folder
  Pose camera_from_world = Pose::Identity();
  std::vector<ColmapObservation> observations;  // those that have a point
};

struct ColmapPoint {
  Vec3d position = Vec3d::Zero();
  Rgb8 color = {};
  // Mean over its observations: from there to where the model's camera sees the position.
  double error_px = 0;
};

struct ColmapModel {
  std::vector<ColmapCamera> cameras;
  std::vector<ColmapImage> images;
  std::unordered_map<uint64_t, ColmapPoint> points;
};

// cameras, images and points3D of a folder, .bin where there is a cameras.bin, else .txt; points3D may be
// missing. Throws InputError naming file and place (line, or element in binary files): truncated, not a
// number, a rotation that is none, an image of a camera that isn't there, an observation of a point that
// isn't.
ColmapModel ReadColmapModel(const std::filesystem::path& folder);

// What ReadColmapModel puts together; `file` stands in messages.
void ReadColmapText(const std::filesystem::path& folder, ColmapModel* model);
void ReadColmapBinary(const std::filesystem::path& folder, ColmapModel* model);

// The rotation of a quaternion (w, x, y, z) of any length, and the translation. False where it is none.
bool ToPose(const double (&quaternion)[4], const Vec3d& translation, Pose* pose);

// How many parameters a camera model has, by name or by the number that binary files give it; −1 and an empty
// name where there is no such model.
int ColmapParameterCount(std::string_view model);
std::string ColmapModelName(int number);

// Our camera for COLMAP's: pinholes and the fisheyes without tangential distortion. Throws InputError for the
// other models, unless their distortion is all 0.
CameraIntrinsics FromColmap(const ColmapCamera& camera);
// COLMAP's for a pinhole or Kannala–Brandt camera: PINHOLE or OPENCV_FISHEYE.
ColmapCamera ToColmap(const CameraIntrinsics& camera);

// cameras.txt, images.txt and points3D.txt, every digit. A point's track is made of the
// images' observations of it; a point without any isn't written.
void WriteColmapText(const ColmapModel& model, const std::filesystem::path& folder);

}  // namespace lumen
