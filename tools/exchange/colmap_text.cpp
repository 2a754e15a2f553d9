#include <fmt/format.h>

#include <algorithm>
#include <limits>
#include <map>
#include <set>

#include "common/error.h"
#include "common/files.h"
#include "common/line_reader.h"
#include "tools/exchange/colmap_model.h"

namespace lumen {
namespace {

namespace fs = std::filesystem;

constexpr double kHalfPixel = 0.5;

uint32_t Id(LineReader* reader, std::string_view what) {
  const int64_t id = reader->Integer(what);
  if (id < 0 || id > std::numeric_limits<uint32_t>::max()) reader->Fail(std::string(what) + " is no id");
  return static_cast<uint32_t>(id);
}

int Size(LineReader* reader, std::string_view what) {
  const int64_t size = reader->Integer(what);
  if (size < 1 || size > std::numeric_limits<int>::max()) reader->Fail(std::string(what) + " is no size");
  return static_cast<int>(size);
}

uint8_t Channel(LineReader* reader) {
  const int64_t value = reader->Integer("the colour");
  if (value < 0 || value > 255) reader->Fail("the colour must lie within 0 and 255");
  return static_cast<uint8_t>(value);
}

// The next line that isn't a comment; with `filled`, nor empty.
bool NextElement(LineReader* reader, bool filled) {
  while (reader->NextLine()) {
    const size_t first = reader->rest().find_first_not_of(" \t");
    if (first == std::string_view::npos) {
      if (!filled) return true;
    } else if (reader->rest()[first] != '#') {
      return true;
    }
  }
  return false;
}

void ReadCameras(const fs::path& file, ColmapModel* model) {
  const std::string text = ReadFile(file);
  LineReader reader(file, text);
  while (NextElement(&reader, true)) {
    ColmapCamera camera;
    camera.place = file.string() + ":" + std::to_string(reader.line_number());
    camera.id = Id(&reader, "the camera's id");
    camera.model = reader.Word();
    const int count = ColmapParameterCount(camera.model);
    if (count < 0) reader.Fail("\"" + camera.model + "\" is no camera model of COLMAP");
    camera.width = Size(&reader, "the width");
    camera.height = Size(&reader, "the height");
    for (int i = 0; i < count; ++i) {
      camera.parameters.push_back(reader.Number("parameter " + std::to_string(i)));
    }
    if (!reader.Word().empty()) reader.Fail(camera.model + " has " + std::to_string(count) + " parameters");
    model->cameras.push_back(camera);
  }
}

ColmapImage ReadImage(LineReader* reader) {
  ColmapImage image;
  image.id = Id(reader, "the image's id");
  double quaternion[4];
  for (double& q : quaternion) q = reader->Number("the quaternion");
  Vec3d translation;
  for (int i = 0; i < 3; ++i) translation[i] = reader->Number("the translation");
  if (!ToPose(quaternion, translation, &image.camera_from_world)) {
    reader->Fail("the quaternion is no rotation");
  }
  image.camera = Id(reader, "the camera's id");
  // Names may hold blanks.
  const std::string_view rest = reader->rest();
  const size_t begin = rest.find_first_not_of(" \t");
  if (begin == std::string_view::npos) reader->Fail("the line ends where the image's name should be");
  image.name = rest.substr(begin, rest.find_last_not_of(" \t") + 1 - begin);
  return image;
}

void ReadImages(const fs::path& file, ColmapModel* model) {
  const std::string text = ReadFile(file);
  LineReader reader(file, text);
  while (NextElement(&reader, true)) {
    ColmapImage image = ReadImage(&reader);
    // The second line is empty where the image has no points; at the end of the file it may be missing.
    if (NextElement(&reader, false)) {
      for (std::string_view word = reader.Word(); !word.empty(); word = reader.Word()) {
        ColmapObservation observation;
        observation.pixel.x() = reader.ToNumber(word, "x") - kHalfPixel;
        observation.pixel.y() = reader.Number("y") - kHalfPixel;
        const int64_t point = reader.Integer("the point's id");
        if (point < 0) continue;  // −1: belongs to none
        observation.point = static_cast<uint64_t>(point);
        image.observations.push_back(observation);
      }
    }
    model->images.push_back(std::move(image));
  }
}

void ReadPoints(const fs::path& file, ColmapModel* model) {
  const std::string text = ReadFile(file);
  LineReader reader(file, text);
  while (NextElement(&reader, true)) {
    const int64_t id = reader.Integer("the point's id");
    ColmapPoint point;
    for (int i = 0; i < 3; ++i) point.position[i] = reader.Number("the position");
    for (uint8_t& channel : point.color) channel = Channel(&reader);
    point.error_px = reader.Number("the error");
    model->points[static_cast<uint64_t>(id)] = point;
  }
}

}  // namespace

bool ToPose(const double (&quaternion)[4], const Vec3d& translation, Pose* pose) {
  const Eigen::Quaterniond rotation(quaternion[0], quaternion[1], quaternion[2], quaternion[3]);
  // Written so that NaN fails.
  if (!(rotation.norm() > 0) || !std::isfinite(rotation.norm()) || !translation.allFinite()) return false;
  pose->linear() = rotation.normalized().toRotationMatrix();
  pose->translation() = translation;
  return true;
}

void ReadColmapText(const fs::path& folder, ColmapModel* model) {
  ReadCameras(folder / "cameras.txt", model);
  ReadImages(folder / "images.txt", model);
  if (fs::exists(folder / "points3D.txt")) ReadPoints(folder / "points3D.txt", model);
}

ColmapModel ReadColmapModel(const fs::path& folder) {
  ColmapModel model;
  const bool binary = fs::exists(folder / "cameras.bin");
  if (!binary && !fs::exists(folder / "cameras.txt")) {
    throw InputError(folder.string() + ": no COLMAP model: neither cameras.bin nor cameras.txt is here");
  }
  binary ? ReadColmapBinary(folder, &model) : ReadColmapText(folder, &model);
  const std::string images = (folder / (binary ? "images.bin" : "images.txt")).string();
  std::set<uint32_t> cameras;
  for (const ColmapCamera& camera : model.cameras) cameras.insert(camera.id);
  for (const ColmapImage& image : model.images) {
    if (!cameras.contains(image.camera)) {
      throw InputError(images + ": image " + image.name + " is of camera " + std::to_string(image.camera) +
                       ", which isn't in the model");
    }
    for (const ColmapObservation& observation : image.observations) {
      if (model.points.empty() || model.points.contains(observation.point)) continue;
      throw InputError(images + ": image " + image.name + " sees point " + std::to_string(observation.point) +
                       ", which isn't in the model");
    }
  }
  if (model.images.empty()) throw InputError(images + ": no image");
  return model;
}

namespace {

// A line a point, by id.
std::string PointsText(const ColmapModel& model) {
  std::map<uint64_t, std::string> tracks;
  for (const ColmapImage& image : model.images) {
    for (size_t i = 0; i < image.observations.size(); ++i) {
      tracks[image.observations[i].point] += fmt::format(" {} {}", image.id, i);
    }
  }
  std::string text = "# POINT3D_ID, X, Y, Z, R, G, B, ERROR, TRACK[] as (IMAGE_ID, POINT2D_IDX)\n";
  for (const auto& [id, track] : tracks) {
    const ColmapPoint& point = model.points.at(id);
    text += std::to_string(id);
    for (double coordinate : point.position) AppendNumber(&(text += ' '), coordinate);
    text += fmt::format(" {} {} {} ", point.color[0], point.color[1], point.color[2]);
    AppendNumber(&text, point.error_px);
    text += track + "\n";
  }
  return text;
}

}  // namespace

void WriteColmapText(const ColmapModel& model, const fs::path& folder) {
  std::string cameras = "# CAMERA_ID, MODEL, WIDTH, HEIGHT, PARAMS[]\n";
  for (const ColmapCamera& camera : model.cameras) {
    cameras += std::to_string(camera.id) + " " + camera.model + " " + std::to_string(camera.width) + " " +
               std::to_string(camera.height);
    for (double parameter : camera.parameters) AppendNumber(&(cameras += ' '), parameter);
    cameras += '\n';
  }
  std::string images =
      "# IMAGE_ID, QW, QX, QY, QZ, TX, TY, TZ, CAMERA_ID, NAME\n# POINTS2D[] as (X, Y, POINT3D_ID)\n";
  for (const ColmapImage& image : model.images) {
    const Eigen::Quaterniond q(image.camera_from_world.linear());
    const Vec3d& t = image.camera_from_world.translation();
    images += std::to_string(image.id);
    for (double value : {q.w(), q.x(), q.y(), q.z(), t.x(), t.y(), t.z()}) {
      AppendNumber(&(images += ' '), value);
    }
    images += " " + std::to_string(image.camera) + " " + image.name + "\n";
    for (size_t i = 0; i < image.observations.size(); ++i) {
      const ColmapObservation& observation = image.observations[i];
      if (i > 0) images += ' ';
      AppendNumber(&images, observation.pixel.x() + kHalfPixel);
      AppendNumber(&(images += ' '), observation.pixel.y() + kHalfPixel);
      images += " " + std::to_string(observation.point);
    }
    images += '\n';
  }
  CreateFolder(folder);
  WriteFile(folder / "cameras.txt", cameras);
  WriteFile(folder / "images.txt", images);
  WriteFile(folder / "points3D.txt", PointsText(model));
}

}  // namespace lumen
