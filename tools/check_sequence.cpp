#include <fmt/core.h>

#include <algorithm>
#include <cmath>
#include <optional>

#include "common/error.h"
#include "common/parallel.h"
#include "common/ray_scene.h"
#include "recon/evaluation/mesh_check.h"
#include "tools/findings.h"

namespace lumen {
namespace {

// Part of a frame's pixels that may be out of order (silhouettes, rounding of 8-bit sources) before it is a
// finding.
constexpr double kToleratedPart = 0.02;
// Off unit length: what normals decoded from 8 bits are off at most, √3/255, and as much again.
constexpr double kNormalTolerance = 0.015;
// Every so many pixels are compared with other data.
constexpr int kStride_px = 16;
// Half the width of the stencil that estimates normals from depths: wide enough for depth steps of 0.4 mm.
constexpr int kStencil_px = 24;

struct FrameImages {
  Image8 color, occlusion;
  ImageF z_mm, normal, flow_px;  // empty = no such file, or not readable
};

// One frame and its surroundings.
struct FrameContext {
  const Sequence& sequence;
  const SequenceFrame& frame;
  const Camera<double>& camera;
  const Image8& valid;
  const RayScene* truth;  // null = no mesh
  bool truth_is_closed;

  std::string Name(const std::string& problem) const {
    return fmt::format("frame {}: {}", frame.number, problem);
  }
};

// Reads one file by `read`; what is wrong with it becomes a finding and the image stays empty.
template <class Read>
auto Load(const FrameContext& context, const std::filesystem::path& file, const Read& read,
          Findings* findings) {
  decltype(read()) image;
  if (file.empty()) return image;
  try {
    image = read();
  } catch (const InputError& error) {
    findings->Error(error.what());
    return image;
  }
  const CameraIntrinsics& camera = context.sequence.calibration.camera;
  if (image.width != camera.width || image.height != camera.height) {
    findings->Error(fmt::format("{}: has {}×{} pixels, the camera {}×{}", file.string(), image.width,
                                image.height, camera.width, camera.height));
    image = {};
  }
  return image;
}

FrameImages LoadImages(const FrameContext& context, Findings* findings) {
  const SequenceFrame& frame = context.frame;
  FrameImages images;
  images.color = Load(
      context, frame.color, [&] { return ReadImage8(frame.color, 3); }, findings);
  images.z_mm = Load(
      context, frame.depth, [&] { return DecodeDepth(ReadImage16(frame.depth, 1)); }, findings);
  images.normal = Load(
      context, frame.normals, [&] { return DecodeNormals(ReadImage16(frame.normals, 3)); }, findings);
  images.flow_px = Load(
      context, frame.flow, [&] { return DecodeFlow(ReadImage16(frame.flow, 3)); }, findings);
  images.occlusion = Load(
      context, frame.occlusion, [&] { return ReadImage8(frame.occlusion, 1); }, findings);
  return images;
}

// Calls body(x, y) on a grid of the valid pixels.
template <class Body>
void OnGrid(const Image8& valid, const Body& body) {
  for (int y = kStride_px / 2; y < valid.height; y += kStride_px) {
    for (int x = kStride_px / 2; x < valid.width; x += kStride_px) {
      if (*valid.Pixel(x, y)) body(x, y);
    }
  }
}

// The point, camera axes, mm, that a pixel's depth says; nothing where it has none.
std::optional<Vec3d> PointAt(const FrameContext& context, const ImageF& z_mm, int x, int y) {
  if (x < 0 || y < 0 || x >= z_mm.width || y >= z_mm.height || !std::isfinite(*z_mm.Pixel(x, y))) return {};
  const auto ray = context.camera.Unproject(Vec2d(x, y));
  if (!ray || ray->z() <= 0) return {};
  return *ray * (*z_mm.Pixel(x, y) / ray->z());
}

void CheckColor(const FrameContext& context, const Image8& color, Findings* findings) {
  size_t pixels = 0, black = 0, white = 0;
  OnGrid(context.valid, [&](int x, int y) {
    const uint8_t* rgb = color.Pixel(x, y);
    ++pixels;
    black += std::max({rgb[0], rgb[1], rgb[2]}) < 3;
    white += std::min({rgb[0], rgb[1], rgb[2]}) == 255;
  });
  if (pixels && black > 0.9 * pixels) findings->Warn(context.Name("the image is black"));
  if (pixels && white > 0.5 * pixels)
    findings->Warn(context.Name("more than half of the image is saturated"));
}

void CheckOcclusion(const FrameContext& context, const Image8& occlusion, Findings* findings) {
  const auto other =
      std::ranges::count_if(occlusion.data, [](uint8_t value) { return value != 0 && value != 255; });
  if (other) findings->Error(context.Name(fmt::format("{} occlusion values are neither 0 nor 255", other)));
}

void CheckNormals(const FrameContext& context, const FrameImages& images, Findings* findings) {
  size_t pixels = 0, not_unit = 0, turned_away = 0;
  std::vector<double> agreement;
  OnGrid(context.valid, [&](int x, int y) {
    const float* v = images.normal.Pixel(x, y);
    const Vec3d normal(v[0], v[1], v[2]);
    if (!normal.allFinite()) return;
    ++pixels;
    not_unit += std::abs(normal.norm() - 1) > kNormalTolerance;
    turned_away += context.camera.Unproject(Vec2d(x, y))->dot(normal) > kNormalTolerance;
    if (images.z_mm.empty()) return;
    const auto left = PointAt(context, images.z_mm, x - kStencil_px, y);
    const auto right = PointAt(context, images.z_mm, x + kStencil_px, y);
    const auto up = PointAt(context, images.z_mm, x, y - kStencil_px);
    const auto down = PointAt(context, images.z_mm, x, y + kStencil_px);
    if (!left || !right || !up || !down) return;
    // x to the right, y down, z forward: this cross product faces the camera.
    agreement.push_back((*down - *up).cross(*right - *left).normalized().dot(normal));
  });
  if (not_unit > kToleratedPart * pixels) {
    findings->Error(context.Name(fmt::format("{} of {} normals aren't unit vectors", not_unit, pixels)));
  }
  if (turned_away > kToleratedPart * pixels) {
    findings->Error(
        context.Name(fmt::format("{} of {} normals face away from the camera", turned_away, pixels)));
  }
  constexpr size_t kEnough = 50;
  // Estimated normals are within some 20° of the true ones; those with an axis turned round are 45° off or
  // more.
  if (agreement.size() >= kEnough && Median(agreement) < std::cos(kPi / 6)) {
    findings->Error(
        context.Name(fmt::format("normals and depths disagree by {:.0f}° in the median: is an axis turned?",
                                 std::acos(std::clamp(Median(agreement), -1.0, 1.0)) * 180 / kPi)));
  }
}

// Flow says where the pixel's point is in the frame before, less where it is now; so do depth and poses.
void CheckFlow(const FrameContext& context, const FrameImages& images, const SequenceFrame& before,
               Findings* findings) {
  const Pose before_from_now = before.world_from_camera.inverse() * context.frame.world_from_camera;
  std::vector<double> errors_px;
  OnGrid(context.valid, [&](int x, int y) {
    const float* flow = images.flow_px.Pixel(x, y);
    const auto point = PointAt(context, images.z_mm, x, y);
    if (!point || !std::isfinite(flow[0])) return;
    // Clipped values say nothing.
    if (std::max(std::abs(flow[0]), std::abs(flow[1])) > 19.9f) return;
    const auto pixel = context.camera.Project(before_from_now * *point);
    if (pixel) errors_px.push_back((*pixel - Vec2d(x, y) - Vec2d(flow[0], flow[1])).norm());
  });
  // Depth steps of 0.4 mm and flow steps of 0.16 px leave .07 px on a real frame.
  constexpr double kTolerated_px = 0.3;
  if (!errors_px.empty() && Median(errors_px) > kTolerated_px) {
    findings->Error(context.Name(fmt::format(
        "flow is off by {:.1f} px in the median from what depth and poses say", Median(errors_px))));
  }
}

void CheckDepth(const FrameContext& context, const ImageF& z_mm, Findings* findings) {
  size_t pixels = 0, empty = 0;
  std::vector<double> errors_mm;
  const Pose& world_from_camera = context.frame.world_from_camera;
  OnGrid(context.valid, [&](int x, int y) {
    ++pixels;
    empty += std::isnan(*z_mm.Pixel(x, y));
    const auto point = PointAt(context, z_mm, x, y);
    if (!point || !context.truth) return;
    const Vec3d direction = world_from_camera.linear() * point->normalized();
    const RayHit hit = context.truth->Intersect(context.truth->ToLocal(world_from_camera.translation()),
                                                direction.cast<float>(), 0, 1e6f);
    errors_mm.push_back(hit.hit() ? std::abs(hit.t - point->norm()) : HUGE_VAL);
  });
  if (pixels && empty == pixels) findings->Error(context.Name("the depth file is empty"));
  constexpr double kTolerated_mm = 1;
  if (!errors_mm.empty() && Median(errors_mm) > kTolerated_mm) {
    findings->Error(context.Name(fmt::format(
        "depth is off by {:.1f} mm in the median from the ground truth's mesh", Median(errors_mm))));
  }
}

// Rays all around a camera in the lumen meet the wall's inside, whichever way its faces are turned; outside
// of the lumen they meet nothing or the wall's outside.
bool IsInLumen(const RayScene& wall, const Vec3d& place) {
  double volume = 0;  // six times it; > 0 where normals point out of the lumen
  for (const Vec3i& face : wall.mesh().faces) {
    const auto corner = [&](int k) { return Vec3d(wall.mesh().vertices[face[k]] - wall.anchor()); };
    volume += corner(0).dot(corner(1).cross(corner(2)));
  }
  const float outwards = volume > 0 ? 1 : -1;
  int inside = 0, all = 0;
  for (int x = -1; x <= 1; ++x) {
    for (int y = -1; y <= 1; ++y) {
      for (int z = -1; z <= 1; ++z) {
        if (x == 0 && y == 0 && z == 0) continue;
        // Aside of the axes, along which meshes have their edges.
        const Vec3f direction(x + 0.03f, y - 0.02f, z + 0.01f);
        const RayHit hit = wall.Intersect(wall.ToLocal(place), direction, 0, 1e6f);
        inside += hit.hit() && outwards * wall.face_normals()[hit.face].dot(direction) > 0;
        ++all;
      }
    }
  }
  return 2 * inside > all;
}

void CheckFrame(const FrameContext& context, const SequenceFrame* before, Findings* findings) {
  const FrameImages images = LoadImages(context, findings);
  if (context.truth_is_closed && !IsInLumen(*context.truth, context.frame.world_from_camera.translation())) {
    findings->Error(context.Name("the camera lies outside the lumen of the ground truth's mesh"));
  }
  if (!images.color.empty()) CheckColor(context, images.color, findings);
  if (!images.occlusion.empty()) CheckOcclusion(context, images.occlusion, findings);
  if (!images.z_mm.empty()) CheckDepth(context, images.z_mm, findings);
  if (!images.normal.empty()) CheckNormals(context, images, findings);
  const bool follows = before && before->number + 1 == context.frame.number;
  if (!images.flow_px.empty() && !images.z_mm.empty() && follows)
    CheckFlow(context, images, *before, findings);
}

// A kind of file that some frames have and others lack.
void CheckPresence(const Sequence& sequence, const std::string& kind,
                   std::filesystem::path SequenceFrame::*file, bool spare_first, Findings* findings) {
  std::vector<int> missing;
  size_t expected = 0;
  for (const SequenceFrame& frame : sequence.frames) {
    if (spare_first && &frame == &sequence.frames.front()) continue;
    ++expected;
    if ((frame.*file).empty()) missing.push_back(frame.number);
  }
  if (missing.empty() || missing.size() == expected) return;
  findings->Warn(fmt::format("{} of {} frames have no {} file, the first being frame {}", missing.size(),
                             expected, kind, missing[0]));
}

}  // namespace

nlohmann::json CheckSequence(const Sequence& sequence, Findings* findings) {
  CheckLight(sequence.calibration.light, findings);
  CheckPoses(sequence.frames, findings);
  CheckPresence(sequence, "depth", &SequenceFrame::depth, false, findings);
  CheckPresence(sequence, "normals", &SequenceFrame::normals, false, findings);
  CheckPresence(sequence, "flow", &SequenceFrame::flow, true, findings);
  CheckPresence(sequence, "occlusion", &SequenceFrame::occlusion, true, findings);
  const Image8 valid = ValidPixels(sequence.calibration);
  const auto valid_pixels = std::ranges::count(valid.data, 255);
  if (valid_pixels == 0) findings->Error("no pixel carries image: the mask leaves nothing");
  Mesh mesh;
  std::optional<RayScene> truth;
  if (!sequence.ground_truth_mesh.empty()) {
    try {
      mesh = ReadMesh(sequence.ground_truth_mesh);
      truth.emplace(mesh);
    } catch (const InputError& error) {
      findings->Error(error.what());
    }
  }
  const bool closed = truth && IsManifoldAndClosed(mesh);
  const Camera<double> camera(sequence.calibration.camera);
  const auto& frames = sequence.frames;
  std::vector<Findings> by_frame(frames.size());
  ParallelFor(0, static_cast<int64_t>(frames.size()), [&](int64_t i) {
    const FrameContext context{sequence, frames[i], camera, valid, truth ? &*truth : nullptr, closed};
    CheckFrame(context, i > 0 ? &frames[i - 1] : nullptr, &by_frame[i]);
  });
  for (const Findings& of_frame : by_frame) findings->Append(of_frame);
  return {{"frames", frames.size()}, {"valid_pixels", valid_pixels}, {"has_toml", sequence.has_toml}};
}

}  // namespace lumen
