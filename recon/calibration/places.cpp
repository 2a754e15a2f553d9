#include "recon/calibration/places.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "common/parallel.h"
#include "common/progress.h"
#include "recon/evaluation/surface_points.h"

namespace lumen {
namespace {

constexpr float kNone = std::numeric_limits<float>::quiet_NaN();
constexpr float kSaturated = std::numeric_limits<float>::infinity();
constexpr int kSamplesAside = 2;  // of the square's middle: 5×5 samples

// The surface is off by about as much, so that a ray which is met so shortly before the place isn't stopped.
constexpr double kSlack_mm = 0.7;

Vec3d InterpolatedNormal(const Mesh& mesh, const std::vector<Vec3d>& vertex_normals, const SurfacePoint& at) {
  const Vec3i& face = mesh.faces[at.face];
  double area[3];
  for (int i = 0; i < 3; ++i) {
    const Vec3d a = mesh.vertices[face[(i + 1) % 3]] - at.position;
    const Vec3d b = mesh.vertices[face[(i + 2) % 3]] - at.position;
    area[i] = a.cross(b).norm();
  }
  Vec3d sum = Vec3d::Zero();
  for (int i = 0; i < 3; ++i) sum += area[i] * vertex_normals[face[i]];
  return sum.norm() > 0 ? Vec3d(sum.normalized()) : FaceNormal(mesh, at.face);
}

class Finder {
 public:
  Finder(const Sequence& sequence, const RayScene& scene, const SightingOptions& options, Sightings* all)
      : sequence_(sequence),
        scene_(scene),
        options_(options),
        camera_(sequence.calibration.camera),
        valid_(ValidPixels(sequence.calibration)),
        all_(*all) {
    for (int i = 0; i < 256; ++i)
      decoded_[i] = static_cast<float>(Decode(sequence.calibration.response, i / 255.0));
  }

  void Look(int frame) {
    const Image8 color = ReadColor(sequence_, sequence_.frames[frame]);
    const Pose& world_from_camera = sequence_.frames[frame].world_from_camera;
    const Pose camera_from_world = world_from_camera.inverse();
    ParallelFor(0, all_.count(), [&](int64_t i) {
      const Place& place = all_.places[i];
      const Vec3d point = camera_from_world * place.point;
      const Vec3d normal = camera_from_world.linear() * place.normal;
      const double distance = point.norm();
      all_.distance_mm(i, frame) = static_cast<float>(distance);
      if (!(-normal.dot(point) > 0) || !IsOpen(world_from_camera.translation(), place.point)) return;
      Shine(point, normal, static_cast<int>(i), frame);
      const double cosine = -normal.dot(point) / distance;
      if (Show(color, point, normal, static_cast<int>(i), frame))
        all_.view_cosine(i, frame) = static_cast<float>(cosine);
    });
  }

 private:
  bool IsOpen(const Vec3d& from, const Vec3d& to) const {
    const Vec3f start = scene_.ToLocal(from);
    const Vec3f way = scene_.ToLocal(to) - start;
    const float length = way.norm();
    return length > kSlack_mm && !scene_.Occluded(start, way / length, 0, length - float(kSlack_mm));
  }

  // Shadows of guides off the axis are not looked for.
  void Shine(const Vec3d& point, const Vec3d& normal, int place, int frame) {
    double sum = 0, by_spread = 0, log_cosine = 0;
    for (const LightSource& source : sequence_.calibration.light.sources) {
      const auto light = IrradianceAt<double>(source.position, source.direction, source.spread, point);
      const double cosine = light.toward.dot(normal);
      if (!(cosine > 0) || std::isinf(light.per_intensity)) continue;
      const double irradiance = source.intensity.mean() * light.per_intensity * cosine;
      sum += irradiance;
      by_spread -= irradiance * (1 + source.direction.dot(light.toward));
      log_cosine += irradiance * std::log(cosine);
    }
    if (!(sum > 0)) return;
    all_.irradiance(place, frame) = static_cast<float>(sum);
    all_.by_spread(place, frame) = static_cast<float>(by_spread / sum);
    all_.log_cosine(place, frame) = static_cast<float>(log_cosine / sum);
  }

  // What the square around the place shows; false where a part of it is outside the image.
  bool Show(const Image8& color, const Vec3d& point, const Vec3d& normal, int place, int frame) {
    constexpr int kSamples = (2 * kSamplesAside + 1) * (2 * kSamplesAside + 1);
    std::array<std::array<uint8_t, kSamples>, 3> codes;
    const Vec3d along = normal.unitOrthogonal(), across = normal.cross(along);
    int n = 0;
    for (int i = -kSamplesAside; i <= kSamplesAside; ++i) {
      for (int k = -kSamplesAside; k <= kSamplesAside; ++k, ++n) {
        const Vec3d at = point + options_.half_edge_mm / kSamplesAside * (i * along + k * across);
        const auto pixel = camera_.Project(at);
        if (!pixel) return false;
        // Compared before the cast: a projection may lie further out than an int reaches.
        const double x = std::floor(pixel->x() + 0.5), y = std::floor(pixel->y() + 0.5);
        if (!(x >= 0 && y >= 0 && x < color.width && y < color.height)) return false;
        if (*valid_.Pixel(int(x), int(y)) == 0) return false;
        const uint8_t* rgb = color.Pixel(int(x), int(y));
        for (int c = 0; c < 3; ++c) codes[c][n] = rgb[c];
      }
    }
    const double vignetting = Vignetting(sequence_.calibration.response, point.z() / point.norm());
    if (!(vignetting > 0)) return false;
    for (int c = 0; c < 3; ++c) all_.value[c](place, frame) = MedianValue(&codes[c]) / float(vignetting);
    return true;
  }

  template <class Codes>
  float MedianValue(Codes* codes) const {
    const auto middle = codes->begin() + codes->size() / 2;
    std::nth_element(codes->begin(), middle, codes->end());
    if (*std::max_element(middle, codes->end()) == 255 && *middle > 200) return kSaturated;
    return *middle < options_.min_code ? kNone : decoded_[*middle];
  }

  const Sequence& sequence_;
  const RayScene& scene_;
  const SightingOptions& options_;
  Camera<double> camera_;
  Image8 valid_;
  float decoded_[256];
  Sightings& all_;
};

}  // namespace

Sightings FindSightings(const Sequence& sequence, const RayScene& scene, const SightingOptions& options,
                        uint64_t seed) {
  const Mesh& mesh = scene.mesh();
  Sightings all;
  double area = 0;
  for (size_t f = 0; f < mesh.faces.size(); ++f) area += FaceArea(mesh, static_cast<int>(f));
  all.area_mm2 = area / options.places;
  const std::vector<Vec3d> normals = VertexNormals(mesh);
  for (const SurfacePoint& point : SpreadPoints(mesh, options.places, seed))
    all.places.push_back({point.position, -InterpolatedNormal(mesh, normals, point)});
  const auto frames = static_cast<Eigen::Index>(sequence.frames.size());
  const Eigen::ArrayXXf nothing = Eigen::ArrayXXf::Zero(options.places, frames);
  for (auto& value : all.value) value = Eigen::ArrayXXf::Constant(options.places, frames, kNone);
  all.irradiance = all.by_spread = all.log_cosine = all.view_cosine = all.distance_mm = nothing;
  Finder finder(sequence, scene, options, &all);
  Progress progress("places");
  for (Eigen::Index frame = 0; frame < frames; ++frame) {
    finder.Look(static_cast<int>(frame));
    progress.Update(double(frame + 1) / double(frames));
  }
  return all;
}

}  // namespace lumen
