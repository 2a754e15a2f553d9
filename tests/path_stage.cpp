#include "tests/path_stage.h"

#include <cmath>

namespace lumen::test {

CameraIntrinsics CentredPinhole(int width, int height, double focal_px) {
  CameraIntrinsics intrinsics;
  intrinsics.width = width;
  intrinsics.height = height;
  intrinsics.fx = intrinsics.fy = focal_px;
  intrinsics.cx = (width - 1) / 2.0;
  intrinsics.cy = (height - 1) / 2.0;
  return intrinsics;
}

Mesh Lathe(int along, int around, const std::function<Vec3d(double, double)>& place) {
  Mesh mesh;
  for (int i = 0; i <= along; ++i) {
    for (int j = 0; j < around; ++j) mesh.vertices.push_back(place(double(i) / along, 2 * kPi * j / around));
  }
  for (int i = 0; i < along; ++i) {
    for (int j = 0; j < around; ++j) {
      const int a = i * around + j, b = i * around + (j + 1) % around;
      mesh.faces.push_back({a, b, a + around});
      mesh.faces.push_back({b, b + around, a + around});
    }
  }
  return mesh;
}

Mesh Globe(double radius_mm, int rings) {
  return Lathe(rings, 2 * rings, [=](double along, double turn) {
    const double polar = kPi * along;
    return Vec3d(radius_mm *
                 Vec3d(std::sin(polar) * std::cos(turn), std::sin(polar) * std::sin(turn), std::cos(polar)));
  });
}

Mesh Tube(double radius_mm, double half_length_mm, int along, int around) {
  return Lathe(along, around, [=](double where, double turn) {
    return Vec3d(radius_mm * std::cos(turn), radius_mm * std::sin(turn), (2 * where - 1) * half_length_mm);
  });
}

void AddPlate(Mesh* mesh, double x0, double x1, double y0, double y1, double z) {
  const int first = static_cast<int>(mesh->vertices.size());
  for (const Vec3d& corner : {Vec3d(x0, y0, z), Vec3d(x1, y0, z), Vec3d(x1, y1, z), Vec3d(x0, y1, z)}) {
    mesh->vertices.push_back(corner);
  }
  mesh->faces.push_back({first, first + 1, first + 2});
  mesh->faces.push_back({first, first + 2, first + 3});
}

Vec3d PixelOf(const ImageF& image, int x, int y) {
  return Eigen::Map<const Vec3f>(image.Pixel(x, y)).cast<double>();
}

Stage::Stage(Mesh geometry, const CameraIntrinsics& intrinsics, double intensity)
    : mesh(std::move(geometry)),
      wall(mesh),
      vertex_normals(VertexNormals(mesh)),
      intrinsics(intrinsics),
      valid(intrinsics.width, intrinsics.height, 1, 255) {
  LightSource source;
  source.intensity = Vec3d::Constant(intensity);
  light.sources = {source};
  options.samples = 1;
}

PathCount Stage::Render(uint64_t seed, bool with_parts, Film* film, const Defocus* defocus) const {
  const Camera<float> camera(intrinsics);
  const View view = {&camera, &valid, world_from_camera, &light, nullptr, defocus};
  return RenderFrame({&wall, &surface, 0, &vertex_normals}, view, options, seed, 0, with_parts, film);
}

Film Stage::Render(uint64_t seed, bool with_parts) const {
  Film film;
  EXPECT_EQ(Render(seed, with_parts, &film).failure.count, 0);
  for (const float value : film.radiance.data) EXPECT_TRUE(std::isfinite(value) && value >= 0);
  return film;
}

Estimate EstimateOf(const std::vector<double>& values) {
  Estimate estimate;
  const double count = static_cast<double>(values.size());
  for (const double value : values) estimate.mean += value / count;
  double squares = 0;
  for (const double value : values) squares += (value - estimate.mean) * (value - estimate.mean);
  estimate.standard_error = std::sqrt(squares / (count * (count - 1)));
  return estimate;
}

Estimate MeanOver(const Stage& stage, int seeds, const std::function<const ImageF&(const Film&)>& part,
                  int channel) {
  std::vector<double> means;
  for (int seed = 0; seed < seeds; ++seed) {
    const Film film = stage.Render(100 + seed, true);
    const ImageF& image = part(film);
    double sum = 0;
    for (size_t i = channel; i < image.data.size(); i += 3) sum += image.data[i];
    means.push_back(sum / (double(image.width) * image.height));
  }
  return EstimateOf(means);
}

}  // namespace lumen::test
