#include "sim/imaging/shutter.h"

#include <algorithm>

namespace lumen {

Shutter ReadShutter(const ConfigTable& table) {
  Shutter shutter;
  shutter.exposure = table.Number("exposure", shutter.exposure, kFraction);
  shutter.readout = table.Number("readout", shutter.readout, {-1, 1});
  return shutter;
}

CameraMotion::CameraMotion(const Shutter& shutter, const std::vector<Pose>& world_from_camera, int frame)
    : shutter_(shutter) {
  const int last = static_cast<int>(world_from_camera.size()) - 1;
  const auto stretch = [&](int first) {
    first = std::clamp(first, 0, std::max(0, last - 1));
    return Stretch{world_from_camera[first], world_from_camera[std::min(first + 1, last)],
                   double(first - frame)};
  };
  before_ = stretch(frame - 1);
  after_ = stretch(frame);
}

Pose CameraMotion::At(double time) const {
  const Stretch& stretch = time < 0 ? before_ : after_;
  const double part = time - stretch.start;
  const Eigen::Quaterniond first(stretch.first.linear()), second(stretch.second.linear());
  Pose pose = Pose::Identity();
  pose.linear() = first.slerp(part, second).toRotationMatrix();
  pose.translation() =
      stretch.first.translation() + part * (stretch.second.translation() - stretch.first.translation());
  return pose;
}

}  // namespace lumen
