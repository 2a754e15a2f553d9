#include "sim/ground_truth.h"

#include <algorithm>
#include <atomic>
#include <cmath>
#include <limits>
#include <optional>

#include "common/parallel.h"

namespace lumen {
namespace {

constexpr float kInfinity = std::numeric_limits<float>::infinity();
constexpr float kNothing = std::numeric_limits<float>::quiet_NaN();

// How far a float ray can pass beside where its double original goes, mm: the origin, the triangle's corners
// and the direction are rounded, each by at most √3·2⁻²⁴ of its size, and the intersection's own arithmetic
// adds some eight roundings. Sizes are at most `extent`, so (3√3 + 8)·2⁻²⁴ of it; 2⁻²⁰ is the power of two
// above. Along the ray, the distance to a plane is off by this over the cosine to its normal.
double RayError_mm(double extent_mm) { return 0x1p-20 * extent_mm; }

// The pixels [first, last) of a row whose rays exist: a packet's lanes.
struct Block {
  int y = 0;
  int count = 0;
  int x[kLanes];
  Vec3d ray[kLanes];        // unit, camera axes
  Vec3d direction[kLanes];  // unit, world axes
};

// Calls body(block) for every block of valid pixels with a ray, in parallel by rows.
template <class Body>
void ForEachBlock(const Camera<double>& camera, const Image8& valid, const Pose& world_from_camera,
                  const Body& body) {
  ParallelFor(0, valid.height, [&](int64_t row) {
    Block block;
    block.y = static_cast<int>(row);
    for (int x = 0; x < valid.width; ++x) {
      if (*valid.Pixel(x, block.y)) {
        if (const auto ray = camera.Unproject(Vec2d(x, block.y))) {
          block.x[block.count] = x;
          block.ray[block.count] = *ray;
          block.direction[block.count++] = world_from_camera.linear() * *ray;
        }
      }
      if (block.count == kLanes || (x + 1 == valid.width && block.count > 0)) {
        body(block);
        block.count = 0;
      }
    }
  });
}

RayPacket EmptyPacket(const Vec3f& origin) {
  RayPacket packet;
  for (int i = 0; i < 3; ++i) {
    std::fill_n(packet.origin[i], kLanes, origin[i]);
    std::fill_n(packet.direction[i], kLanes, i == 2 ? 1.0f : 0.0f);
  }
  std::fill_n(packet.tnear, kLanes, 0.0f);
  std::fill_n(packet.tfar, kLanes, -1.0f);  // off
  return packet;
}

void SetRay(RayPacket* packet, int lane, const Vec3d& direction, float tnear, float tfar) {
  for (int i = 0; i < 3; ++i) packet->direction[i][lane] = static_cast<float>(direction[i]);
  packet->tnear[lane] = tnear;
  packet->tfar[lane] = tfar;
}

RayPacket PacketOf(const Block& block, const Vec3f& origin) {
  RayPacket packet = EmptyPacket(origin);
  for (int lane = 0; lane < block.count; ++lane) SetRay(&packet, lane, block.direction[lane], 0, kInfinity);
  return packet;
}

// A camera and the pixels in which it sees.
struct Eye {
  const RayScene& wall;
  const Camera<double>& camera;
  const Image8& valid;
  Pose camera_from_world;
  Vec3d position;      // mm, world axes
  Vec3f local_origin;  // the rays'

  Eye(const RayScene& wall, const Camera<double>& camera, const Image8& valid, const Pose& world_from_camera)
      : wall(wall),
        camera(camera),
        valid(valid),
        camera_from_world(world_from_camera.inverse()),
        position(world_from_camera.translation()),
        local_origin(wall.ToLocal(position)) {}

  std::optional<Vec2d> Project(const Vec3d& world) const { return camera.Project(camera_from_world * world); }

  bool InValidPixel(const Vec2d& pixel) const {
    const double x = std::floor(pixel.x() + 0.5), y = std::floor(pixel.y() + 0.5);
    return x >= 0 && y >= 0 && x < valid.width && y < valid.height && *valid.Pixel(int(x), int(y));
  }

  // Error of float rays between the eye and a place.
  double Error_mm(const Vec3d& place) const {
    return RayError_mm((position - wall.anchor()).norm() + (place - wall.anchor()).norm() +
                       (place - position).norm());
  }

  // Direction to a place of a face with this unit normal (either way), and how far a ray may go before it
  // could meet the face itself.
  float Aim(const Vec3d& place, const Vec3d& normal, Vec3d* direction) const {
    const Vec3d to_place = place - position;
    const double distance = to_place.norm();
    *direction = to_place / distance;
    return static_cast<float>(distance - Error_mm(place) / std::abs(direction->dot(normal)));
  }
};

// What a block's centre rays meet.
struct Met {
  HitPacket hits;
  double t[kLanes];      // mm, exact
  Vec3d place[kLanes];   // world axes
  Vec3d normal[kLanes];  // world axes, unit, the face's own: away from the lumen
};

Met Meet(const Eye& eye, const Block& block) {
  Met met;
  eye.wall.Intersect(PacketOf(block, eye.local_origin), &met.hits);
  for (int lane = 0; lane < block.count; ++lane) {
    const uint32_t face = met.hits.face[lane];
    if (face == kNoFace) continue;
    met.t[lane] = eye.wall.ExactDistance(face, eye.position, block.direction[lane]);
    met.place[lane] = eye.position + met.t[lane] * block.direction[lane];
    met.normal[lane] = FaceNormal(eye.wall.mesh(), static_cast<int>(face));
  }
  return met;
}

void Store(const Vec3d& value, float* out) {
  for (int i = 0; i < 3; ++i) out[i] = static_cast<float>(value[i]);
}

void StoreGeometry(const Eye& eye, const Block& block, const Met& met, FrameTruth* truth) {
  for (int lane = 0; lane < block.count; ++lane) {
    if (met.hits.face[lane] == kNoFace) continue;
    const int x = block.x[lane], y = block.y;
    *truth->z.Pixel(x, y) = static_cast<float>(met.t[lane] * block.ray[lane].z());
    *truth->distance.Pixel(x, y) = static_cast<float>(met.t[lane]);
    Store(met.place[lane], truth->position.Pixel(x, y));
    const Vec3d normal = eye.camera_from_world.linear() * met.normal[lane];
    Store(normal.dot(block.ray[lane]) > 0 ? Vec3d(-normal) : normal, truth->normal.Pixel(x, y));
  }
}

void StoreSmoothNormal(const Eye& eye, const Block& block, const Met& met, const std::vector<Vec3d>& normals,
                       ImageF* smooth_normal) {
  for (int lane = 0; lane < block.count; ++lane) {
    if (met.hits.face[lane] == kNoFace) continue;
    const Vec3i& corners = eye.wall.mesh().faces[met.hits.face[lane]];
    const double u = met.hits.u[lane], v = met.hits.v[lane];
    const Vec3d mean = (1 - u - v) * normals[corners[0]] + u * normals[corners[1]] + v * normals[corners[2]];
    const bool away = met.normal[lane].dot(block.direction[lane]) > 0;
    const Vec3d facing = away ? Vec3d(-met.normal[lane]) : met.normal[lane];
    Vec3d smooth = mean.norm() > 0 ? mean.normalized() : facing;
    if (smooth.dot(facing) < 0) smooth = -smooth;
    Store(eye.camera_from_world.linear() * smooth, smooth_normal->Pixel(block.x[lane], block.y));
  }
}

// Where a place on a face is when the wall has become another with the same faces: it keeps its weights of
// the face's corners. A face without area gives its first corner.
Vec3d Carried(const Mesh& mesh, uint32_t face, const Vec3d& place, const Mesh& other) {
  const Vec3i& corners = mesh.faces[face];
  const Vec3d& a = mesh.vertices[corners[0]];
  const Vec3d ab = mesh.vertices[corners[1]] - a, ac = mesh.vertices[corners[2]] - a, ap = place - a;
  const Vec3d normal = ab.cross(ac);
  const double squared = normal.squaredNorm();
  const double u = squared > 0 ? ap.cross(ac).dot(normal) / squared : 0;
  const double v = squared > 0 ? ab.cross(ap).dot(normal) / squared : 0;
  const Vec3d& moved_a = other.vertices[corners[0]];
  return moved_a + u * (other.vertices[corners[1]] - moved_a) + v * (other.vertices[corners[2]] - moved_a);
}

void StoreRestPosition(const Eye& eye, const Block& block, const Met& met, const Mesh& rest,
                       ImageF* rest_position) {
  for (int lane = 0; lane < block.count; ++lane) {
    const uint32_t face = met.hits.face[lane];
    if (face == kNoFace) continue;
    Store(Carried(eye.wall.mesh(), face, met.place[lane], rest),
          rest_position->Pixel(block.x[lane], block.y));
  }
}

// Flow to a neighbouring frame, and whether it sees the place.
void StoreMotion(const Eye& eye, const Eye& neighbour, const Block& block, const Met& met, ImageF* flow,
                 ImageF* seen) {
  const bool moves = &neighbour.wall != &eye.wall;
  RayPacket packet = EmptyPacket(neighbour.local_origin);
  bool candidate[kLanes] = {};
  for (int lane = 0; lane < block.count; ++lane) {
    if (met.hits.face[lane] == kNoFace) continue;
    const int x = block.x[lane], y = block.y;
    *seen->Pixel(x, y) = 0;
    const uint32_t face = met.hits.face[lane];
    const Vec3d place =
        moves ? Carried(eye.wall.mesh(), face, met.place[lane], neighbour.wall.mesh()) : met.place[lane];
    const auto pixel = neighbour.Project(place);
    if (!pixel) continue;
    flow->Pixel(x, y)[0] = static_cast<float>(pixel->x() - x);
    flow->Pixel(x, y)[1] = static_cast<float>(pixel->y() - y);
    if (!neighbour.InValidPixel(*pixel)) continue;
    Vec3d direction;
    const Vec3d normal = moves ? FaceNormal(neighbour.wall.mesh(), static_cast<int>(face)) : met.normal[lane];
    const float reach = neighbour.Aim(place, normal, &direction);
    // Seen from the other side it is not the same place.
    if (direction.dot(normal) * block.direction[lane].dot(met.normal[lane]) <= 0) continue;
    candidate[lane] = true;
    SetRay(&packet, lane, direction, 0, reach);
  }
  const LanesI occluded = neighbour.wall.Occluded(packet);
  for (int lane = 0; lane < block.count; ++lane) {
    if (candidate[lane] && !occluded[lane]) *seen->Pixel(block.x[lane], block.y) = 1;
  }
}

// C3VD: "pixels occluding other mesh faces not visible to the camera" within its range of depth.
void StoreOcclusion(const Eye& eye, const Block& block, const Met& met, FrameTruth* truth) {
  RayPacket packet = EmptyPacket(eye.local_origin);
  int open = 0;
  for (int lane = 0; lane < block.count; ++lane) {
    if (met.hits.face[lane] == kNoFace) continue;
    const double cosine = std::abs(block.direction[lane].dot(met.normal[lane]));
    const double z = block.ray[lane].z();
    const float tfar = z > 0 ? static_cast<float>(kDepthRange_mm / z) : kInfinity;
    const float tnear = static_cast<float>(met.t[lane] + eye.Error_mm(met.place[lane]) / cosine);
    SetRay(&packet, lane, block.direction[lane], tnear, tfar);
    open += tnear <= tfar;
  }
  while (open > 0) {
    HitPacket hits;
    eye.wall.Intersect(packet, &hits);
    open = 0;
    for (int lane = 0; lane < block.count; ++lane) {
      if (packet.tnear[lane] > packet.tfar[lane]) continue;
      const uint32_t face = hits.face[lane];
      const bool end = face == kNoFace;
      const bool faces_camera =
          !end && face != met.hits.face[lane] &&
          FaceNormal(eye.wall.mesh(), static_cast<int>(face)).dot(block.direction[lane]) > 0;
      if (faces_camera) *truth->occlusion.Pixel(block.x[lane], block.y) = 255;
      // The same ray meets the same face at the same t again, to a rounding; beyond it the next can be met.
      const float beyond = hits.t[lane] * (1 + 0x1p-20f) + std::numeric_limits<float>::min();
      packet.tnear[lane] = end || faces_camera ? kInfinity : beyond;
      if (end || faces_camera) packet.tfar[lane] = -1;
      open += packet.tnear[lane] <= packet.tfar[lane];
    }
  }
}

// Whether the eye sees one of the face's four points. The wall is closed, so nobody sees a face from the
// wall's side.
bool SeesFace(const Eye& eye, int face) {
  const Mesh& mesh = eye.wall.mesh();
  const Vec3i& corners = mesh.faces[face];
  const Vec3d normal = FaceNormal(mesh, face);
  if (normal.dot(mesh.vertices[corners[0]] - eye.position) <= 0) return false;
  const Vec3d centroid =
      (mesh.vertices[corners[0]] + mesh.vertices[corners[1]] + mesh.vertices[corners[2]]) / 3;
  for (int i = -1; i < 3; ++i) {
    const Vec3d place = i < 0 ? centroid : Vec3d(0.999 * mesh.vertices[corners[i]] + 0.001 * centroid);
    const auto pixel = eye.Project(place);
    if (!pixel || !eye.InValidPixel(*pixel)) continue;
    Vec3d direction;
    const float reach = eye.Aim(place, normal, &direction);
    if (!eye.wall.Occluded(eye.local_origin, direction.cast<float>(), 0, reach)) return true;
  }
  return false;
}

}  // namespace

FrameTruth ComputeTruth(const RayScene& wall, const Camera<double>& camera, const Image8& valid,
                        const Pose& world_from_camera, const Pose* world_from_previous,
                        const TruthExtras& extras) {
  const int width = valid.width, height = valid.height;
  FrameTruth truth;
  truth.z = truth.distance = ImageF(width, height, 1, kNothing);
  truth.normal = truth.position = ImageF(width, height, 3, kNothing);
  truth.occlusion = Image8(width, height, 1);
  if (world_from_previous) {
    truth.flow = ImageF(width, height, 2, kNothing);
    truth.seen_before = ImageF(width, height, 1, kNothing);
  }
  if (extras.world_from_next) {
    truth.flow_next = ImageF(width, height, 2, kNothing);
    truth.seen_after = ImageF(width, height, 1, kNothing);
  }
  if (extras.vertex_normals) truth.smooth_normal = truth.normal;
  if (extras.rest) truth.rest_position = truth.position;
  const Eye eye(wall, camera, valid, world_from_camera);
  std::optional<Eye> previous, next;
  const RayScene& before = extras.wall_before ? *extras.wall_before : wall;
  const RayScene& after = extras.wall_after ? *extras.wall_after : wall;
  if (world_from_previous) previous.emplace(before, camera, valid, *world_from_previous);
  if (extras.world_from_next) next.emplace(after, camera, valid, *extras.world_from_next);
  ForEachBlock(camera, valid, world_from_camera, [&](const Block& block) {
    const Met met = Meet(eye, block);
    StoreGeometry(eye, block, met, &truth);
    if (extras.vertex_normals) {
      StoreSmoothNormal(eye, block, met, *extras.vertex_normals, &truth.smooth_normal);
    }
    if (extras.rest) StoreRestPosition(eye, block, met, *extras.rest, &truth.rest_position);
    if (previous) StoreMotion(eye, *previous, block, met, &truth.flow, &truth.seen_before);
    if (next) StoreMotion(eye, *next, block, met, &truth.flow_next, &truth.seen_after);
    StoreOcclusion(eye, block, met, &truth);
  });
  return truth;
}

void MarkObserved(const RayScene& wall, const Camera<double>& camera, const Image8& valid,
                  const Pose& world_from_camera, std::vector<uint8_t>* observed) {
  const Eye eye(wall, camera, valid, world_from_camera);
  ForEachBlock(camera, valid, world_from_camera, [&](const Block& block) {
    HitPacket hits;
    wall.Intersect(PacketOf(block, eye.local_origin), &hits);
    for (int lane = 0; lane < block.count; ++lane) {
      if (hits.face[lane] == kNoFace) continue;
      // Several pixels may meet one face; they all write the same.
      std::atomic_ref((*observed)[hits.face[lane]]).store(1, std::memory_order_relaxed);
    }
  });
  ParallelChunks(0, static_cast<int64_t>(observed->size()), 1024, [&](int64_t first, int64_t last) {
    for (int64_t face = first; face < last; ++face) {
      if (!(*observed)[face]) (*observed)[face] = SeesFace(eye, static_cast<int>(face));
    }
  });
}

}  // namespace lumen
