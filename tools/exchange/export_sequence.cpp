#include "tools/exchange/export_sequence.h"

#include <fmt/format.h>

#include <algorithm>
#include <nlohmann/json.hpp>

#include "common/error.h"
#include "common/files.h"
#include "common/progress.h"
#include "tools/exchange/colmap_model.h"
#include "tools/exchange/npz.h"
#include "tools/exchange/rectification.h"
#include "tools/exchange/wall_points.h"

namespace lumen {
namespace {

namespace fs = std::filesystem;

constexpr double kReach_mm = 100;  // C3VD's largest depth

// What stands for the sequence's camera.
struct Substitute {
  CameraIntrinsics camera;
  std::optional<FisheyeFit> fit;
  std::optional<Rectification> rectification;
  Image8 mask;
};

Substitute SubstituteFor(const Sequence& sequence, const ExportOptions& options) {
  const Calibration& calibration = sequence.calibration;
  Substitute substitute{calibration.camera, {}, {}, ValidPixels(calibration)};
  if (calibration.camera.model == CameraModel::kPinhole) return substitute;
  if (options.rectify || options.format == ExportFormat::kNeus) {
    substitute.rectification.emplace(calibration, options.fov_deg);
    substitute.camera = substitute.rectification->camera();
    substitute.mask = substitute.rectification->mask();
    return substitute;
  }
  substitute.fit = FitFisheye(calibration);
  if (!(substitute.fit->max_px <= options.max_fit_px)) {
    throw InputError(fmt::format(
        "{}: an OpenCV fisheye fits the camera to {:.3g} px only (RMS {:.3g}); export pinhole images "
        "(--rectify), or allow it (--max-fit-px)",
        sequence.folder.string(), substitute.fit->max_px, substitute.fit->rms_px));
  }
  substitute.camera = substitute.fit->camera;
  substitute.mask = FittedPixels(calibration);
  return substitute;
}

std::string ImageName(const SequenceFrame& frame, ExportFormat format) {
  return format == ExportFormat::kNeus ? fmt::format("image/{:04}.png", frame.number)
                                       : "images/" + FrameFile("", frame.number, "color.png").string();
}

void WriteImages(const Sequence& sequence, const ExportOptions& options, const Substitute& substitute,
                 const fs::path& folder) {
  Progress progress("export");
  for (size_t i = 0; i < sequence.frames.size(); ++i) {
    const SequenceFrame& frame = sequence.frames[i];
    const fs::path file = folder / ImageName(frame, options.format);
    CreateFolder(file.parent_path());
    if (substitute.rectification) {
      WriteImage(file, substitute.rectification->Apply(ReadColor(sequence, frame)));
    } else if (options.link) {
      std::error_code error;
      fs::create_symlink(fs::absolute(frame.color), file, error);
      if (error) throw InputError(file.string() + ": cannot link: " + error.message());
    } else {
      WriteFile(file, ReadFile(frame.color));
    }
    if (options.format == ExportFormat::kNeus) {
      CreateFolder(folder / "mask");
      WriteImage(folder / "mask" / file.filename(), substitute.mask);
    }
    progress.Update(static_cast<double>(i + 1) / static_cast<double>(sequence.frames.size()));
  }
  if (options.format != ExportFormat::kNeus) WriteImage(folder / "mask.png", substitute.mask);
}

// Poses of the substitute, which may be turned about its axis.
std::vector<Pose> Poses(const Sequence& sequence, const Substitute& substitute) {
  const double roll_rad = substitute.fit ? substitute.fit->roll_rad : 0;
  std::vector<Pose> poses;
  for (const SequenceFrame& frame : sequence.frames) {
    poses.push_back(frame.world_from_camera);
    if (roll_rad != 0) poses.back().rotate(Eigen::AngleAxisd(-roll_rad, Vec3d::UnitZ()));
  }
  return poses;
}

// The pixel that shows a place in camera axes; nothing where the image is masked.
std::optional<Vec2d> Shown(const Camera<double>& camera, const Image8& mask, const Vec3d& place) {
  const auto pixel = camera.Project(place);
  if (!pixel) return std::nullopt;
  const double x = std::round(pixel->x()), y = std::round(pixel->y());
  if (!(x >= 0 && y >= 0 && x < mask.width && y < mask.height)) return std::nullopt;
  if (*mask.Pixel(static_cast<int>(x), static_cast<int>(y)) == 0) return std::nullopt;
  return pixel;
}

ColmapModel WriteColmap(const Sequence& sequence, const ExportOptions& options, const Substitute& substitute,
                        const fs::path& folder) {
  ColmapModel model;
  model.cameras.push_back(ToColmap(substitute.camera));
  const std::vector<Pose> poses = Poses(sequence, substitute);
  for (size_t i = 0; i < poses.size(); ++i) {
    ColmapImage image;
    image.id = static_cast<uint32_t>(i + 1);
    image.camera = model.cameras[0].id;
    image.name = fs::path(ImageName(sequence.frames[i], ExportFormat::kColmap)).filename();
    image.camera_from_world = poses[i].inverse();
    model.images.push_back(image);
  }
  if (options.points > 0 && sequence.ground_truth_mesh.empty()) {
    Say(sequence.folder.string() + ": no true wall is known: points3D.txt stays empty");
  } else if (options.points > 0) {
    // Images stay as they are but for rectified ones.
    const Camera<double> camera(substitute.rectification ? substitute.camera : sequence.calibration.camera);
    const auto shown = [&](size_t frame, const Vec3d& world) {
      return Shown(camera, substitute.mask, sequence.frames[frame].world_from_camera.inverse() * world);
    };
    AddWallPoints(sequence, options.points, shown, &model);
  }
  WriteColmapText(model, folder / "sparse/0");
  return model;
}

void WriteNerfstudio(const Sequence& sequence, const Substitute& substitute, const fs::path& folder) {
  // nerfstudio takes COLMAP's principal point as it is.
  const CameraIntrinsics& camera = substitute.camera;
  const ColmapCamera colmap = ToColmap(camera);
  const bool fisheye = camera.model == CameraModel::kKannalaBrandt;
  nlohmann::ordered_json json = {{"camera_model", fisheye ? "OPENCV_FISHEYE" : "OPENCV"},
                                 {"w", camera.width},
                                 {"h", camera.height},
                                 {"fl_x", camera.fx},
                                 {"fl_y", camera.fy},
                                 {"cx", colmap.parameters[2]},
                                 {"cy", colmap.parameters[3]}};
  for (int i = 0; i < (fisheye ? 4 : 2); ++i) json["k" + std::to_string(i + 1)] = fisheye ? camera.k[i] : 0.0;
  if (!fisheye) json["p1"] = json["p2"] = 0.0;
  json["frames"] = nlohmann::ordered_json::array();
  const std::vector<Pose> poses = Poses(sequence, substitute);
  for (size_t i = 0; i < poses.size(); ++i) {
    // OpenGL's cameras look along −z, their y axis up.
    const Eigen::Matrix4d matrix = poses[i].matrix() * Eigen::Vector4d(1, -1, -1, 1).asDiagonal();
    nlohmann::ordered_json rows = nlohmann::ordered_json::array();
    for (int r = 0; r < 4; ++r) rows.push_back({matrix(r, 0), matrix(r, 1), matrix(r, 2), matrix(r, 3)});
    json["frames"].push_back({{"file_path", ImageName(sequence.frames[i], ExportFormat::kNerfstudio)},
                              {"mask_path", "mask.png"},
                              {"transform_matrix", rows}});
  }
  WriteFile(folder / "transforms.json", json.dump(2) + "\n");
}

// The sphere's radius, mm.
double WriteNeus(const Sequence& sequence, const Substitute& substitute, const fs::path& folder) {
  const std::vector<Pose> poses = Poses(sequence, substitute);
  Eigen::AlignedBox3d box;
  for (const Pose& pose : poses) box.extend(pose.translation());
  const Vec3d centre = box.center();
  double radius_mm = 0;
  for (const Pose& pose : poses) radius_mm = std::max(radius_mm, (pose.translation() - centre).norm());
  radius_mm += kReach_mm;
  Eigen::Matrix4d scale = Eigen::Matrix4d::Identity(), projection = Eigen::Matrix4d::Identity();
  scale.topLeftCorner<3, 3>() *= radius_mm;
  scale.topRightCorner<3, 1>() = centre;
  const CameraIntrinsics& camera = substitute.camera;
  projection.topLeftCorner<3, 3>() << camera.fx, 0, camera.cx, 0, camera.fy, camera.cy, 0, 0, 1;
  std::vector<NamedMatrix> matrices;
  for (size_t i = 0; i < poses.size(); ++i) {
    matrices.emplace_back("world_mat_" + std::to_string(i), projection * poses[i].inverse().matrix());
    matrices.emplace_back("scale_mat_" + std::to_string(i), scale);
  }
  WriteNpz(folder / "cameras_sphere.npz", matrices);
  return radius_mm;
}

}  // namespace

ExportResult ExportSequence(const Sequence& sequence, const ExportOptions& options, const fs::path& folder) {
  std::error_code ignored;
  if (fs::exists(folder, ignored) && !fs::is_empty(folder, ignored)) {
    throw InputError(folder.string() + ": is not empty; export to a folder of its own");
  }
  const Substitute substitute = SubstituteFor(sequence, options);
  CreateFolder(folder);
  WriteImages(sequence, options, substitute, folder);
  ExportResult result;
  switch (options.format) {
    case ExportFormat::kColmap: {
      const ColmapModel model = WriteColmap(sequence, options, substitute, folder);
      result.points = static_cast<int>(model.points.size());
      for (const ColmapImage& image : model.images)
        result.observations += static_cast<int64_t>(image.observations.size());
      break;
    }
    case ExportFormat::kNerfstudio:
      WriteNerfstudio(sequence, substitute, folder);
      break;
    case ExportFormat::kNeus:
      result.sphere_radius_mm = WriteNeus(sequence, substitute, folder);
      break;
  }
  result.camera = substitute.camera;
  result.fit = substitute.fit;
  result.frames = static_cast<int>(sequence.frames.size());
  const auto& mask = substitute.mask.data;
  result.masked_part = static_cast<double>(std::ranges::count(mask, 0)) / static_cast<double>(mask.size());
  return result;
}

}  // namespace lumen
