#include "tools/bench_rays.h"

#include <vector>

#include "common/random.h"
#include "sim/cost/timing.h"
#include "sim/imaging/offset_origin.h"
#include "sim/imaging/surface.h"
#include "sim/imaging/tile.h"

namespace lumen {
namespace {

struct Ray {
  Vec3f origin, direction;
};

std::vector<RayPacket> PrimaryPackets(const Scene& scene, const RayScene& wall) {
  const CameraIntrinsics& intrinsics = scene.calibration.camera;
  const Camera<float> camera(intrinsics);
  const Pose& pose = scene.world_from_camera.front();
  const Vec3f origin = wall.ToLocal(pose.translation());
  std::vector<RayPacket> packets;
  for (int y0 = 0; y0 + kBlockEdge <= intrinsics.height; y0 += kBlockEdge) {
    for (int x0 = 0; x0 + kBlockEdge <= intrinsics.width; x0 += kBlockEdge) {
      RayPacket& packet = packets.emplace_back();
      Lanes3 direction{};
      for (int i = 0; i < kLanes; ++i) {
        const auto seen = camera.Unproject(Vec2f(x0 + i % kBlockEdge, y0 + i / kBlockEdge));
        packet.tnear[i] = 0;
        packet.tfar[i] = seen ? 1e30f : -1;
        if (seen) direction.Set(i, pose.linear().cast<float>() * *seen);
      }
      Store3(Broadcast(origin), packet.origin);
      Store3(direction, packet.direction);
    }
  }
  return packets;
}

int64_t CountOf(const std::vector<RayPacket>& packets) {
  int64_t count = 0;
  for (const RayPacket& packet : packets) count += Count(Load(packet.tfar) > Load(packet.tnear));
  return count;
}

template <class Body>
double Rate(int64_t rays, int runs, const Body& body) {
  std::vector<double> seconds;
  for (int run = 0; run < runs; ++run) seconds.push_back(CpuSecondsOf(body));
  return 1e-6 * static_cast<double>(rays) / MedianOf(seconds);
}

}  // namespace

RayRates MeasureRays(const Scene& scene, const RayScene& wall, int runs) {
  RayRates rates;
  std::vector<RayPacket> packets = PrimaryPackets(scene, wall);
  std::vector<HitPacket> hits(packets.size());
  rates.primary = Rate(CountOf(packets), runs, [&] {
    for (size_t i = 0; i < packets.size(); ++i) wall.Intersect(packets[i], &hits[i]);
  });

  const Vec3f guide = wall.ToLocal(scene.world_from_camera.front() * Vec3d(3.24, 0.55, 0));
  std::vector<Ray> bounces;
  for (size_t p = 0; p < packets.size(); ++p) {
    Lanes3 normals{};
    const Lanes3 points = wall.Points(hits[p]);
    for (int i = 0; i < kLanes; ++i) {
      if (hits[p].face[i] == kNoFace) {
        packets[p].tfar[i] = -1;
        continue;
      }
      Vec3f normal = wall.face_normals()[hits[p].face[i]];
      const Vec3f seen_along(packets[p].direction[0][i], packets[p].direction[1][i],
                             packets[p].direction[2][i]);
      if (normal.dot(seen_along) > 0) normal = -normal;
      normals.Set(i, normal);
      const uint64_t bits = RandomBits(1, p, i);
      const Vec2f random(UniformFloat(bits), UniformFloat(Mix64(bits)));
      bounces.push_back({OffsetOrigin(points[i], normal), lambert::Sample(normal, random)});
      packets[p].tfar[i] = 1;
    }
    const Lanes3 origins = OffsetOrigin(points, normals);
    Store3(origins, packets[p].origin);
    Store3(Broadcast(guide) - origins, packets[p].direction);
  }
  rates.shadow = Rate(CountOf(packets), runs, [&] {
    for (const RayPacket& packet : packets) wall.Occluded(packet);
  });
  rates.bounce = Rate(static_cast<int64_t>(bounces.size()), runs, [&] {
    for (const Ray& ray : bounces) wall.Intersect(ray.origin, ray.direction, 0, 1e30f);
  });
  return rates;
}

}  // namespace lumen
