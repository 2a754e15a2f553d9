#include "tools/exchange/wall_points.h"

#include <cmath>

#include "common/ray_scene.h"
#include "recon/evaluation/evaluate.h"
#include "recon/evaluation/surface_points.h"
#include "recon/evaluation/visibility.h"

namespace lumen {
namespace {

// Pixels are written to a thousandth: the fits of other cameras are not nearer, and the files half as large.
Vec2d Rounded(const Vec2d& pixel) { return (pixel * 1000).array().round() / 1000; }

// A frame's colour at a place that it sees.
Vec3d ColorAt(const Image8& color, const Camera<double>& camera, const Vec3d& local) {
  const Vec2d pixel = camera.Project(local).value();
  const uint8_t* rgb = color.Pixel(static_cast<int>(std::floor(pixel.x() + 0.5)),
                                   static_cast<int>(std::floor(pixel.y() + 0.5)));
  return Vec3d(rgb[0], rgb[1], rgb[2]);
}

}  // namespace

void AddWallPoints(const Sequence& sequence, int count,
                   const std::function<std::optional<Vec2d>(size_t, const Vec3d&)>& shown,
                   ColmapModel* model) {
  const Mesh wall = ReadGroundTruth(sequence);
  const std::vector<SurfacePoint> places = SpreadPoints(wall, count, 0);
  std::vector<std::vector<int>> frames;
  SeePoints(RayScene(wall), places, FrameViews(sequence), &frames);

  const Camera<double> exported(FromColmap(model->cameras.at(0))), own(sequence.calibration.camera);
  struct Sums {
    Vec3d color = Vec3d::Zero();
    double error_px = 0;
    int count = 0;
  };
  std::vector<std::vector<std::pair<size_t, Vec2d>>> seen(sequence.frames.size());  // place, pixel
  std::vector<Sums> sums(places.size());
  for (size_t i = 0; i < places.size(); ++i) {
    for (int frame : frames[i]) {
      const Vec3d& world = places[i].position;
      const auto pixel = shown(frame, world);
      const auto expected = exported.Project(model->images[frame].camera_from_world * world);
      if (!pixel || !expected) continue;
      seen[frame].push_back({i, Rounded(*pixel)});
      sums[i].error_px += (Rounded(*pixel) - *expected).norm();
      ++sums[i].count;
    }
  }
  for (size_t frame = 0; frame < seen.size(); ++frame) {
    const Image8 color = ReadColor(sequence, sequence.frames[frame]);
    const Pose camera_from_world = sequence.frames[frame].world_from_camera.inverse();
    for (const auto& [place, pixel] : seen[frame]) {
      if (sums[place].count < 2) continue;
      sums[place].color += ColorAt(color, own, camera_from_world * places[place].position);
      model->images[frame].observations.push_back({pixel, place + 1});
    }
  }
  for (size_t i = 0; i < places.size(); ++i) {
    if (sums[i].count < 2) continue;
    ColmapPoint point{places[i].position, {}, sums[i].error_px / sums[i].count};
    for (int c = 0; c < 3; ++c)
      point.color[c] = static_cast<uint8_t>(std::lround(sums[i].color[c] / sums[i].count));
    model->points[i + 1] = point;
  }
}

}  // namespace lumen
