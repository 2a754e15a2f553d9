// A mesh that rays can be shot at, through Embree. The only file that knows Embree (3.13 and 4).
#pragma once

#include <array>
#include <cstdint>
#include <memory>
#include <span>
#include <vector>

#include "common/lanes.h"
#include "common/math.h"
#include "common/mesh.h"

namespace lumen {

inline constexpr uint32_t kNoFace = 0xffffffffu;

struct RayHit {
  uint32_t face = kNoFace;
  float t = 0;         // in units of the direction's length
  float u = 0, v = 0;  // barycentric: point = (1−u−v)·v0 + u·v1 + v·v2
  bool hit() const { return face != kNoFace; }
};

// Sixteen rays with a common origin or nearly so (a pixel block's primary rays, their shadow rays): structure
// of arrays, as packets want it. A lane with tfar < tnear is off.
struct alignas(64) RayPacket {
  static constexpr int kSize = kLanes;
  float origin[3][kSize];
  float direction[3][kSize];
  float tnear[kSize], tfar[kSize];
  float time = 0;  // of all of them, where the mesh moves
};
struct alignas(64) HitPacket {
  uint32_t face[RayPacket::kSize];
  float t[RayPacket::kSize], u[RayPacket::kSize], v[RayPacket::kSize];
};

// A mesh that moves is given at steps in time, spread evenly over the times 0…1; from step to step every
// vertex goes evenly on a straight line. What is asked is asked of one time; of a mesh that stands still all
// times are alike.
//
// Rays are float and relative to anchor(), so that a mesh far from the world's origin keeps its precision.
// Const members may be called from any thread. Both sides of a face are hit; faces without area are not.
//
// No ray slips through a closed mesh between two faces. One aimed at a vertex to the last bit can (one in a
// hundred), so a test whether a vertex is seen asks what is Occluded short of it, not what is hit there.
// Where a ray meets an edge, either face may be reported, and a packet may answer the other one than a single
// ray does; but the same question gets the same answer for any number of threads.
class RayScene {
 public:
  // The mesh is referred to, not copied: it must outlive the scene. Throws InputError for a face that names a
  // vertex which doesn't exist, std::runtime_error where memory runs out.
  explicit RayScene(const Mesh& mesh);
  // The steps, 1 to kMostSteps, are referred to as well; all have the first one's faces.
  explicit RayScene(std::span<const Mesh> steps);
  static constexpr int kMostSteps = 129;
  ~RayScene();
  RayScene(RayScene&&) noexcept;
  RayScene& operator=(RayScene&&) noexcept;

  const Mesh& mesh() const;  // at the first step
  bool moves() const;        // has several steps
  // The world point, mm, that is the origin of the rays' coordinates (the middle of mesh()'s bounds).
  const Vec3d& anchor() const;
  Vec3f ToLocal(const Vec3d& world) const { return (world - anchor()).cast<float>(); }

  RayHit Intersect(const Vec3f& origin, const Vec3f& direction, float tnear, float tfar,
                   float time = 0) const;
  bool Occluded(const Vec3f& origin, const Vec3f& direction, float tnear, float tfar, float time = 0) const;
  void Intersect(const RayPacket& rays, HitPacket* hits) const;
  // −1 in the lanes whose ray meets anything, 0 in the others.
  LanesI Occluded(const RayPacket& rays) const;

  // The places that were met, in the rays' coordinates, from their barycentric coordinates: off the face's
  // plane by no more than the rounding of the corners' own coordinates, as offsetting a ray's origin
  // supposes. Lanes that met nothing give any place.
  Lanes3 Points(const HitPacket& hits, float time = 0) const;

  // Unit normals of the faces of mesh(), by the order of their corners; 0 for a face without area. Computed
  // in double.
  const std::vector<Vec3f>& face_normals() const;
  // Those of the faces that were met, none of which is kNoFace.
  Lanes3 Normals(const HitPacket& hits, float time = 0) const;

  // A time is `part` of the way from a step to the next.
  struct Moment {
    size_t step;
    float part;
  };
  Moment MomentOf(float time) const;
  // A face's corners in double, world coordinates.
  std::array<Vec3d, 3> Corners(uint32_t face, float time = 0) const;

  // Distance in double to the plane of a face of mesh() that a float ray has found, in world coordinates; the
  // ground truth's depth. Units of the direction's length; never outside the face's corners along the ray, so
  // that slivers and faces without area give something near them too.
  double ExactDistance(uint32_t face, const Vec3d& origin, const Vec3d& direction) const;

 private:
  struct State;
  std::unique_ptr<State> state_;
};

}  // namespace lumen
