#include "common/c3vd_camera.h"

#include <map>
#include <string>

#include "common/error.h"
#include "common/files.h"
#include "common/line_reader.h"

namespace lumen {

CameraIntrinsics C3vdV2Intrinsics() {
  CameraIntrinsics in;
  in.model = CameraModel::kScaramuzza;
  in.width = 1350;
  in.height = 1080;
  in.cx = 677.739464094188;
  in.cy = 543.057997844875;
  in.a = {767.733695862103, 0.0, -0.000592506426558248, -2.69440266600040e-07, -2.16380341010063e-10};
  in.stretch = {0.9999, 1.10e-4, -1.83e-4};
  return in;
}

CameraIntrinsics ReadC3vdIntrinsics(const std::filesystem::path& file) {
  CameraIntrinsics in;
  in.model = CameraModel::kScaramuzza;
  double width = 0, height = 0;
  std::map<std::string, double*, std::less<>> missing = {
      {"width", &width}, {"height", &height},   {"cx", &in.cx},        {"cy", &in.cy},
      {"a0", &in.a[0]},  {"a1", &in.a[1]},      {"a2", &in.a[2]},      {"a3", &in.a[3]},
      {"a4", &in.a[4]},  {"c", &in.stretch[0]}, {"d", &in.stretch[1]}, {"e", &in.stretch[2]}};
  const std::string text = ReadFile(file);
  LineReader reader(file, text);
  while (reader.NextFilledLine()) {
    const std::string_view name = reader.Word();
    if (name.starts_with(';')) continue;
    const auto entry = missing.find(name);
    if (entry == missing.end()) {
      reader.Fail("\"" + std::string(name) + "\" is no number of the camera, or stands here twice");
    }
    if (reader.Word() != "=") reader.Fail("\"" + entry->first + " = number\" is needed");
    *entry->second = reader.Number(entry->first);
    missing.erase(entry);
  }
  if (!missing.empty()) throw InputError(file.string() + ": says nothing of " + missing.begin()->first);
  in.width = static_cast<int>(width);
  in.height = static_cast<int>(height);
  try {
    const Camera<double> describes_a_camera(in);
  } catch (const InputError& error) {
    throw InputError(file.string() + ": " + error.what());
  }
  return in;
}

}  // namespace lumen
