#include "recon/surface/gather.h"

#include "common/lanes.h"

namespace lumen {
namespace {

// Patches as lanes want them. Those that fill up the last lanes have neither area nor normal.
struct Senders {
  explicit Senders(const std::vector<Patch>& patches, const std::vector<Vec3d>& leaving)
      : packets((patches.size() + kLanes - 1) / kLanes) {
    for (size_t i = 0; i < patches.size(); ++i) {
      Packet& packet = packets[i / kLanes];
      const int lane = static_cast<int>(i % kLanes);
      packet.point.Set(lane, patches[i].point.cast<float>());
      packet.normal.Set(lane, patches[i].normal.cast<float>());
      packet.area[lane] = static_cast<float>(patches[i].area_mm2);
      packet.leaving.Set(lane, leaving[i].cast<float>());
    }
  }

  struct Packet {
    Lanes3 point{}, normal{}, leaving{};
    Lanes area{};
  };
  std::vector<Packet> packets;
};

double SumOf(const Lanes& lanes) {
  double sum = 0;
  for (int i = 0; i < kLanes; ++i) sum += lanes[i];
  return sum;
}

}  // namespace

double FormFactor(const Patch& to, const Patch& from) {
  const Vec3d d = from.point - to.point;
  const double squared = d.squaredNorm(), near = to.normal.dot(d), far = -from.normal.dot(d);
  if (!(near > 0) || !(far > 0)) return 0;
  return near * far / squared * from.area_mm2 / (kPi * squared + from.area_mm2);
}

std::vector<Vec3d> Gather(const std::vector<Patch>& patches, const std::vector<Vec3d>& leaving) {
  std::vector<Vec3d> received(patches.size(), Vec3d::Zero());
  for (size_t i = 0; i < patches.size(); ++i) {
    double sum = 0;
    for (size_t k = 0; k < patches.size(); ++k) {
      const double factor = FormFactor(patches[i], patches[k]);
      sum += factor;
      received[i] += factor * leaving[k];
    }
    if (sum > 1) received[i] /= sum;
  }
  return received;
}

std::vector<Vec3d> GatherInLanes(const std::vector<Patch>& patches, const std::vector<Vec3d>& leaving) {
  const Senders senders(patches, leaving);
  std::vector<Vec3d> received(patches.size());
  for (size_t i = 0; i < patches.size(); ++i) {
    const Lanes3 point = Broadcast(patches[i].point.cast<float>());
    const Lanes3 normal = Broadcast(patches[i].normal.cast<float>());
    Lanes sum{};
    Lanes3 light{};
    for (const Senders::Packet& from : senders.packets) {
      const Lanes3 d = from.point - point;
      const Lanes squared = Dot(d, d), near = Dot(normal, d), far = -Dot(from.normal, d);
      const Lanes factor =
          near * far * from.area / (squared * (static_cast<float>(kPi) * squared + from.area));
      const Lanes counted = (near > 0.0f) & (far > 0.0f) ? factor : Lanes{};
      sum += counted;
      light = light + from.leaving * counted;
    }
    const double all = SumOf(sum);
    received[i] = Vec3d(SumOf(light.x), SumOf(light.y), SumOf(light.z)) / (all > 1 ? all : 1);
  }
  return received;
}

}  // namespace lumen
