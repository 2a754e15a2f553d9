// A sequence for other programs: COLMAP, nerfstudio, NeuS.
#pragma once

#include <filesystem>
#include <optional>

#include "common/sequence.h"
#include "tools/exchange/fisheye_fit.h"

namespace lumen {

enum class ExportFormat { kColmap, kNerfstudio, kNeus };

struct ExportOptions {
  ExportFormat format = ExportFormat::kColmap;
  bool rectify = false;     // pinhole images in any format; NeuS has no others
  double fov_deg = 100;     // of the pinhole, across the image
  double max_fit_px = 1.5;  // a fisheye that fits worse somewhere is refused
  int points = 10'000;      // COLMAP: places spread over the true wall, of which those seen twice are written
  bool link = false;        // symbolic links in place of copies, where images stay as they are
};

struct ExportResult {
  CameraIntrinsics camera;        // as exported
  std::optional<FisheyeFit> fit;  // where a fisheye stands for the camera
  double masked_part = 0;         // of the exported pixels
  int frames = 0;
  int points = 0;               // COLMAP: that two frames or more see
  int64_t observations = 0;     // of them
  double sphere_radius_mm = 0;  // NeuS: what its unit sphere is
};

// Writes into a folder, which must not hold an export already; lengths stay mm, world axes the sequence's:
//   COLMAP       images/, mask.png (for ImageReader.camera_mask_path), sparse/0/ with cameras, images and
//                points3D.txt: AddWallPoints (wall_points.h), none where the sequence has no true wall
//   nerfstudio   images/, mask.png, transforms.json (cameras' axes OpenGL's)
//   NeuS         image/, mask/, cameras_sphere.npz: world_mat_i projects mm of the world to pixels (the
//   centre
//                of the upper left one is 0, 0), scale_mat_i takes the unit sphere to the world: around the
//                cameras and all that lies within 100 mm, the largest depth that C3VD's files hold
// A pinhole camera is exported as it is; others as OpenCV's fisheye, poses turned by the fit's roll, or
// rectified. Throws InputError: a fit worse than max_fit_px, a damaged frame, a folder that isn't empty.
ExportResult ExportSequence(const Sequence& sequence, const ExportOptions& options,
                            const std::filesystem::path& folder);

}  // namespace lumen
