#include <fmt/core.h>

#include <algorithm>
#include <cmath>

#include "tools/findings.h"

namespace lumen {
namespace {

// A light guide lies in the endoscope's tip, some 6 mm in radius.
constexpr double kFarthestLight_mm = 20;
}  // namespace

double Median(std::vector<double> values) {
  const auto middle = values.begin() + static_cast<ptrdiff_t>(values.size() / 2);
  std::nth_element(values.begin(), middle, values.end());
  return *middle;
}

void CheckLight(const Light& light, Findings* findings) {
  for (size_t i = 0; i < light.sources.size(); ++i) {
    const LightSource& source = light.sources[i];
    if (source.position.norm() > kFarthestLight_mm) {
      findings->Warn(
          fmt::format("light.source.{}: lies {:.1f} mm from the camera, outside any endoscope's tip", i,
                      source.position.norm()));
    }
    if (source.direction.z() <= 0) {
      findings->Warn(fmt::format("light.source.{}: shines backwards, away from what the camera sees", i));
    }
  }
}

// Withdrawal makes 0.13 mm a frame, C3VD's poses up to 5
// mm.
void CheckPoses(const std::vector<SequenceFrame>& frames, Findings* findings) {
  std::vector<double> steps_mm, turns_rad;
  for (size_t i = 1; i < frames.size(); ++i) {
    const Pose motion = frames[i - 1].world_from_camera.inverse() * frames[i].world_from_camera;
    const int numbers = std::max(1, frames[i].number - frames[i - 1].number);
    steps_mm.push_back(motion.translation().norm() / numbers);
    const double cosine = (motion.linear().trace() - 1) / 2;
    turns_rad.push_back(std::acos(std::clamp(cosine, -1.0, 1.0)) / numbers);
  }
  if (steps_mm.empty()) return;
  const double usual_mm = Median(steps_mm), usual_rad = Median(turns_rad);
  if (*std::ranges::max_element(steps_mm) == 0) findings->Warn("poses: the camera never moves");
  for (size_t i = 0; i < steps_mm.size(); ++i) {
    if (steps_mm[i] > std::max(10 * usual_mm, 2.0)) {
      findings->Warn(
          fmt::format("poses: from frame {} to {} the camera jumps by {:.1f} mm a frame (usual: {:.2f})",
                      frames[i].number, frames[i + 1].number, steps_mm[i], usual_mm));
    }
    if (turns_rad[i] > std::max(10 * usual_rad, 0.1)) {
      findings->Warn(fmt::format(
          "poses: from frame {} to {} the camera turns by {:.0f}° a frame (usual: {:.1f}°)", frames[i].number,
          frames[i + 1].number, turns_rad[i] * 180 / kPi, usual_rad * 180 / kPi));
    }
  }
}

nlohmann::json CheckScene(const Scene& scene, Findings* findings) {
  CheckLight(scene.calibration.light, findings);
  std::vector<SequenceFrame> frames;
  for (const Pose& pose : scene.world_from_camera) {
    SequenceFrame frame;
    frame.number = static_cast<int>(frames.size());
    frame.world_from_camera = pose;
    frames.push_back(frame);
  }
  CheckPoses(frames, findings);
  return {{"frames", frames.size()},
          {"effects", scene.effects},
          {"geometry", CheckMesh("geometry", scene.geometry.mesh, findings)}};
}

}  // namespace lumen
