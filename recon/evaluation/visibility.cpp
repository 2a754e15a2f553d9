#include "recon/evaluation/visibility.h"

#include <algorithm>
#include <atomic>
#include <cmath>
#include <functional>

#include "common/parallel.h"

namespace lumen {
namespace {

// A hit this near before the target, relative to the numbers that the ray is made of, is the target's own
// place. Origin, direction and vertices are rounded to float, each by at most 2⁻²⁴ of its coordinates, which
// are at most |origin| + d from the anchor: together 3·√3·2⁻²⁴ < 2⁻²¹ of that length. On a surface met at an
// angle of θ to its normal this moves the hit by 1/cosθ of it; 64 covers all but the last degree before
// grazing. At 100 mm it comes to 3 µm. It only matters where the index can't tell a place's own faces: at a
// point by an edge, and at vertices that the file holds twice.
constexpr float kRelativeTolerance = 64 * 0x1p-21f;

struct Target {
  Vec3d position;
  int index;  // of the vertex or the point
};

// Whether a face that a ray has hit belongs to the target.
using IsOwnFace = std::function<bool(int target, uint32_t face)>;

class Shooter {
 public:
  Shooter(const RayScene& scene, const Vec3d& centre)
      : scene_(scene), origin_(scene.ToLocal(centre)), centre_(centre) {}

  // Adds a target to the packet; Full() says when it has to be shot.
  void Add(const Target& target) {
    const Vec3d offset = target.position - centre_;
    const double distance = offset.norm();
    const Vec3f direction = (offset / distance).cast<float>();
    const float d = static_cast<float>(distance);
    for (int axis = 0; axis < 3; ++axis) {
      rays_.origin[axis][count_] = origin_[axis];
      rays_.direction[axis][count_] = direction[axis];
    }
    rays_.tnear[count_] = 0;
    rays_.tfar[count_] = d - kRelativeTolerance * (origin_.norm() + d);
    targets_[count_++] = target.index;
  }

  bool Full() const { return count_ == RayPacket::kSize; }

  // Calls seen(target) for each target that nothing hides, and empties the packet.
  template <class Seen>
  void Shoot(const IsOwnFace& is_own_face, const Seen& seen) {
    if (count_ == 0) return;
    for (int lane = count_; lane < RayPacket::kSize; ++lane) {
      for (int axis = 0; axis < 3; ++axis) {
        rays_.origin[axis][lane] = origin_[axis];
        rays_.direction[axis][lane] = axis == 2;
      }
      rays_.tnear[lane] = 0;
      rays_.tfar[lane] = -1;
    }
    HitPacket hits;
    scene_.Intersect(rays_, &hits);
    for (int lane = 0; lane < count_; ++lane) {
      if (hits.face[lane] == kNoFace || is_own_face(targets_[lane], hits.face[lane])) seen(targets_[lane]);
    }
    count_ = 0;
  }

 private:
  const RayScene& scene_;
  Vec3f origin_;
  Vec3d centre_;
  RayPacket rays_;
  int targets_[RayPacket::kSize];
  int count_ = 0;
};

Visibility See(const RayScene& scene, const FrameViews& views, int64_t count,
               const std::function<Vec3d(int)>& position, const IsOwnFace& is_own_face,
               std::vector<std::vector<int>>* frames) {
  Visibility result;
  if (frames) frames->assign(count, {});
  result.frames_seeing.assign(count, 0);
  std::vector<std::atomic<int64_t>> seen_by(views.size());
  // Neighbouring places from one camera make coherent packets; the grain only has to outweigh a task's cost.
  ParallelChunks(0, count, 1024, [&](int64_t first, int64_t last) {
    for (int frame = 0; frame < views.size(); ++frame) {
      Shooter shooter(scene, views.Centre(frame));
      int64_t seen = 0;
      const auto count_seen = [&](int target) {
        ++result.frames_seeing[target];
        if (frames) (*frames)[target].push_back(frame);
        ++seen;
      };
      for (int64_t i = first; i < last; ++i) {
        const Target target{position(static_cast<int>(i)), static_cast<int>(i)};
        if (!views.Frames(frame, target.position)) continue;
        shooter.Add(target);
        if (shooter.Full()) shooter.Shoot(is_own_face, count_seen);
      }
      shooter.Shoot(is_own_face, count_seen);
      seen_by[frame] += seen;
    }
  });
  result.places_seen.assign(seen_by.begin(), seen_by.end());
  return result;
}

}  // namespace

FrameViews::FrameViews(const Sequence& sequence)
    : camera_(sequence.calibration.camera), valid_(ValidPixels(sequence.calibration)) {
  for (const SequenceFrame& frame : sequence.frames) {
    camera_from_world_.push_back(frame.world_from_camera.inverse());
    centres_.push_back(frame.world_from_camera.translation());
  }
}

bool FrameViews::Frames(int frame, const Vec3d& world) const {
  const auto pixel = camera_.Project(camera_from_world_[frame] * world);
  if (!pixel) return false;
  // Compared before the cast: a projection may lie further out than an int reaches.
  const double x = std::floor(pixel->x() + 0.5), y = std::floor(pixel->y() + 0.5);
  if (!(x >= 0 && y >= 0 && x < valid_.width && y < valid_.height)) return false;
  return *valid_.Pixel(static_cast<int>(x), static_cast<int>(y)) != 0;
}

Visibility SeeVertices(const RayScene& scene, const FrameViews& views) {
  const Mesh& mesh = scene.mesh();
  return See(
      scene, views, static_cast<int64_t>(mesh.vertices.size()), [&](int v) { return mesh.vertices[v]; },
      [&](int v, uint32_t face) { return (mesh.faces[face].array() == v).any(); }, nullptr);
}

Visibility SeePoints(const RayScene& scene, const std::vector<SurfacePoint>& points, const FrameViews& views,
                     std::vector<std::vector<int>>* frames) {
  return See(
      scene, views, static_cast<int64_t>(points.size()), [&](int p) { return points[p].position; },
      [&](int p, uint32_t face) { return static_cast<uint32_t>(points[p].face) == face; }, frames);
}

}  // namespace lumen
