#include <bit>
#include <cstring>
#include <limits>

#include "common/error.h"
#include "common/files.h"
#include "tools/exchange/colmap_model.h"

namespace lumen {
namespace {

namespace fs = std::filesystem;

static_assert(std::endian::native == std::endian::little, "COLMAP's binary files are little endian");

constexpr double kHalfPixel = 0.5;
constexpr uint64_t kNoPoint = std::numeric_limits<uint64_t>::max();

class Reader {
 public:
  explicit Reader(const fs::path& file) : file_(file.string()), bytes_(ReadFile(file)) {}

  // What is being read, for messages: "camera 3".
  void Begin(const std::string& element) { element_ = element; }

  template <class T>
  T Next() {
    T value;
    if (bytes_.size() - at_ < sizeof value) Fail("the file ends here");
    std::memcpy(&value, bytes_.data() + at_, sizeof value);
    at_ += sizeof value;
    return value;
  }

  double Number() {
    const double value = Next<double>();
    if (!std::isfinite(value)) Fail("a number is not finite");
    return value;
  }

  std::string Name() {
    const size_t end = bytes_.find('\0', at_);
    if (end == std::string::npos) Fail("the file ends within a name");
    const std::string name = bytes_.substr(at_, end - at_);
    at_ = end + 1;
    return name;
  }

  void Skip(uint64_t count, uint64_t size) {
    if (count > (bytes_.size() - at_) / size) Fail("the file ends here");
    at_ += count * size;
  }

  void End() {
    if (at_ != bytes_.size()) Fail("bytes behind the last element");
  }

  [[noreturn]] void Fail(const std::string& problem) const {
    throw InputError(file_ + ": " + element_ + ", byte " + std::to_string(at_) + ": " + problem);
  }

 private:
  std::string file_, bytes_, element_ = "the number of elements";
  size_t at_ = 0;
};

void ReadCameras(const fs::path& file, ColmapModel* model) {
  Reader reader(file);
  const uint64_t count = reader.Next<uint64_t>();
  for (uint64_t i = 0; i < count; ++i) {
    reader.Begin("camera " + std::to_string(i));
    ColmapCamera camera;
    camera.place = file.string() + ": camera " + std::to_string(i);
    camera.id = reader.Next<uint32_t>();
    const int32_t number = reader.Next<int32_t>();
    camera.model = ColmapModelName(number);
    if (camera.model.empty()) reader.Fail(std::to_string(number) + " is no camera model of COLMAP");
    for (int* size : {&camera.width, &camera.height}) {
      const uint64_t value = reader.Next<uint64_t>();
      if (value < 1 || value > std::numeric_limits<int>::max()) reader.Fail("the image has no size");
      *size = static_cast<int>(value);
    }
    for (int p = ColmapParameterCount(camera.model); p > 0; --p) camera.parameters.push_back(reader.Number());
    model->cameras.push_back(camera);
  }
  reader.End();
}

void ReadImages(const fs::path& file, ColmapModel* model) {
  Reader reader(file);
  const uint64_t count = reader.Next<uint64_t>();
  for (uint64_t i = 0; i < count; ++i) {
    reader.Begin("image " + std::to_string(i));
    ColmapImage image;
    image.id = reader.Next<uint32_t>();
    double quaternion[4];
    for (double& q : quaternion) q = reader.Number();
    Vec3d translation;
    for (int axis = 0; axis < 3; ++axis) translation[axis] = reader.Number();
    if (!ToPose(quaternion, translation, &image.camera_from_world)) {
      reader.Fail("the quaternion is no rotation");
    }
    image.camera = reader.Next<uint32_t>();
    image.name = reader.Name();
    const uint64_t observations = reader.Next<uint64_t>();
    for (uint64_t k = 0; k < observations; ++k) {
      ColmapObservation observation;
      for (int axis = 0; axis < 2; ++axis) observation.pixel[axis] = reader.Number() - kHalfPixel;
      observation.point = reader.Next<uint64_t>();
      if (observation.point != kNoPoint) image.observations.push_back(observation);
    }
    model->images.push_back(std::move(image));
  }
  reader.End();
}

void ReadPoints(const fs::path& file, ColmapModel* model) {
  Reader reader(file);
  const uint64_t count = reader.Next<uint64_t>();
  for (uint64_t i = 0; i < count; ++i) {
    reader.Begin("point " + std::to_string(i));
    const uint64_t id = reader.Next<uint64_t>();
    ColmapPoint point;
    for (int axis = 0; axis < 3; ++axis) point.position[axis] = reader.Number();
    for (uint8_t& channel : point.color) channel = reader.Next<uint8_t>();
    point.error_px = reader.Number();
    model->points[id] = point;
    reader.Skip(reader.Next<uint64_t>(), 2 * sizeof(uint32_t));
  }
  reader.End();
}

}  // namespace

void ReadColmapBinary(const fs::path& folder, ColmapModel* model) {
  ReadCameras(folder / "cameras.bin", model);
  ReadImages(folder / "images.bin", model);
  if (fs::exists(folder / "points3D.bin")) ReadPoints(folder / "points3D.bin", model);
}

}  // namespace lumen
