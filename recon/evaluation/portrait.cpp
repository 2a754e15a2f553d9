#include "recon/evaluation/portrait.h"

#include <Eigen/Eigenvalues>
#include <algorithm>
#include <cmath>
#include <limits>

#include "common/parallel.h"

namespace lumen {
namespace {

constexpr int kSide = 4;  // samples a pixel and axis; a pixel's samples make one packet
static_assert(kSide * kSide == RayPacket::kSize);

// The rays of one pixel's samples. Lanes whose sample has no ray are off.
void AimPacket(const Camera<double>& camera, const View& view, const Vec3f& origin, int x, int y,
               RayPacket* rays) {
  for (int lane = 0; lane < RayPacket::kSize; ++lane) {
    const Vec2d pixel(x - 0.5 + (lane % kSide + 0.5) / kSide, y - 0.5 + (lane / kSide + 0.5) / kSide);
    const auto ray = camera.Unproject(pixel);
    const Vec3f direction = (view.world_from_camera.linear() * ray.value_or(Vec3d::UnitZ())).cast<float>();
    for (int axis = 0; axis < 3; ++axis) {
      rays->origin[axis][lane] = origin[axis];
      rays->direction[axis][lane] = direction[axis];
    }
    rays->tnear[lane] = 0;
    rays->tfar[lane] = ray ? std::numeric_limits<float>::infinity() : -1;
  }
}

}  // namespace

Portrait::Portrait(const Mesh& mesh) : scene_(mesh) {
  for (const Vec3d& normal : VertexNormals(mesh)) normals_.push_back(normal.cast<float>());
}

Image8 Portrait::Draw(const View& view, const std::vector<Rgb8>& colors) const {
  const Camera<double> camera(view.camera);
  const Vec3f origin = scene_.ToLocal(view.world_from_camera.translation());
  const Vec3f background(view.background[0], view.background[1], view.background[2]);
  Image8 image(view.camera.width, view.camera.height, 3);
  const auto shade = [&](const RayPacket& rays, const HitPacket& hits, int lane) -> Vec3f {
    if (hits.face[lane] == kNoFace) return background;
    const Vec3i& face = scene_.mesh().faces[hits.face[lane]];
    const Vec3f weight(1 - hits.u[lane] - hits.v[lane], hits.u[lane], hits.v[lane]);
    Vec3f color = Vec3f::Zero(), normal = Vec3f::Zero();
    for (int corner = 0; corner < 3; ++corner) {
      const Rgb8& c = colors[face[corner]];
      color += weight[corner] * Vec3f(c[0], c[1], c[2]);
      normal += weight[corner] * normals_[face[corner]];
    }
    const Vec3f ray(rays.direction[0][lane], rays.direction[1][lane], rays.direction[2][lane]);
    // normalized() leaves the zero vector as it is, which opposite normals add up to: the darkest shade.
    const float lit = 0.3f + 0.7f * std::min(std::abs(normal.normalized().dot(ray)), 1.0f);
    const float far = view.fade_mm > 0 ? hits.t[lane] / static_cast<float>(view.fade_mm) : 0;
    return color * (lit / (1 + far * far));
  };
  ParallelFor(0, image.height, [&](int64_t row) {
    const int y = static_cast<int>(row);
    RayPacket rays;
    HitPacket hits;
    for (int x = 0; x < image.width; ++x) {
      Vec3f sum = Vec3f::Zero();
      if (!view.valid.empty() && *view.valid.Pixel(x, y) == 0) {
        sum = RayPacket::kSize * background;
      } else {
        AimPacket(camera, view, origin, x, y, &rays);
        scene_.Intersect(rays, &hits);
        for (int lane = 0; lane < RayPacket::kSize; ++lane) sum += shade(rays, hits, lane);
      }
      for (int c = 0; c < 3; ++c) {
        image.Pixel(x, y)[c] =
            static_cast<uint8_t>(std::lround(std::clamp(sum[c] / RayPacket::kSize, 0.f, 255.f)));
      }
    }
  });
  return image;
}

View OutsideView(const std::vector<Vec3d>& points, int width, int height) {
  Vec3d centre = Vec3d::Zero();
  for (const Vec3d& p : points) centre += p / static_cast<double>(points.size());
  Mat3d spread = Mat3d::Zero();
  for (const Vec3d& p : points) spread += (p - centre) * (p - centre).transpose();
  const Mat3d axes = Eigen::SelfAdjointEigenSolver<Mat3d>(spread).eigenvectors();  // by increasing eigenvalue

  View view;
  view.camera.model = CameraModel::kPinhole;
  view.camera.width = width;
  view.camera.height = height;
  view.camera.cx = (width - 1) / 2.0;
  view.camera.cy = (height - 1) / 2.0;
  // A narrow field of view keeps what is near from looking swollen.
  constexpr double kHalfFieldOfView_rad = 15 * kPi / 180;
  view.camera.fx = view.camera.fy = width / 2.0 / std::tan(kHalfFieldOfView_rad);
  Mat3d world_from_view;
  world_from_view.col(0) = axes.col(2);
  world_from_view.col(2) = axes.col(0);
  world_from_view.col(1) = world_from_view.col(2).cross(world_from_view.col(0));

  // A point at (x, y, z) from the centre projects within 95% of the half image if |x|/(distance + z) ≤ reach.
  const Vec2d reach = 0.95 * Vec2d(width / (2 * view.camera.fx), height / (2 * view.camera.fy));
  double distance = 1;  // mm: in front of a single point
  for (const Vec3d& p : points) {
    const Vec3d q = world_from_view.transpose() * (p - centre);
    distance = std::max({distance, std::abs(q.x()) / reach.x() - q.z(), std::abs(q.y()) / reach.y() - q.z()});
  }
  view.world_from_camera.linear() = world_from_view;
  view.world_from_camera.translation() = centre - distance * world_from_view.col(2);
  return view;
}

}  // namespace lumen
