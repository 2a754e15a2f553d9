#include "recon/evaluation/walk.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "recon/evaluation/colormap.h"
#include "recon/evaluation/layout.h"
#include "recon/evaluation/portrait.h"

namespace lumen {
namespace {

constexpr Rgb8 kSeen = {225, 170, 150};  // flesh
constexpr Rgb8 kUnseen = {200, 20, 20};
constexpr int kStops = 7;
constexpr int kSide_px = 240;
constexpr double kHalfField_rad = 60 * kPi / 180;
constexpr double kFade_mm = 60;  // what is twice as far as this is hardly lit

std::vector<Rgb8> Colors(const std::vector<int>& frames_seeing) {
  std::vector<Rgb8> colors;
  for (int frames : frames_seeing) colors.push_back(frames > 0 ? kSeen : kUnseen);
  return colors;
}

View ViewFrom(const Pose& world_from_camera) {
  View view;
  view.camera.width = view.camera.height = kSide_px;
  view.camera.cx = view.camera.cy = (kSide_px - 1) / 2.0;
  view.camera.fx = view.camera.fy = kSide_px / 2.0 / std::tan(kHalfField_rad);
  view.world_from_camera = world_from_camera;
  view.background = {0, 0, 0};
  view.fade_mm = kFade_mm;
  return view;
}

// mm from the first frame to each.
std::vector<double> AlongPath(const Sequence& sequence) {
  std::vector<double> along_mm = {0};
  for (size_t i = 1; i < sequence.frames.size(); ++i) {
    along_mm.push_back(along_mm.back() + (sequence.frames[i].world_from_camera.translation() -
                                          sequence.frames[i - 1].world_from_camera.translation())
                                             .norm());
  }
  return along_mm;
}

}  // namespace

std::vector<int> StopsAlongPath(const Sequence& sequence, int count) {
  const std::vector<double> along_mm = AlongPath(sequence);
  const int frames = static_cast<int>(along_mm.size());
  std::vector<int> stops;
  if (frames <= count) {
    for (int i = 0; i < frames; ++i) stops.push_back(i);
    return stops;
  }
  for (int i = 0; i < count; ++i) {
    const double wanted_mm = along_mm.back() * i / std::max(count - 1, 1);
    const auto nearest =
        std::ranges::min_element(along_mm, {}, [&](double mm) { return std::abs(mm - wanted_mm); });
    const int stop = static_cast<int>(nearest - along_mm.begin());
    if (stops.empty() || stops.back() < stop) stops.push_back(stop);
  }
  return stops;
}

void WriteWalk(const Mesh& mesh, const std::vector<int>& frames_seeing, const Sequence& sequence,
               const std::filesystem::path& folder) {
  Mesh colored = mesh;
  colored.colors = Colors(frames_seeing);
  WriteMesh(folder / "unseen.ply", colored);
  const Portrait portrait(mesh);
  const std::vector<double> along_mm = AlongPath(sequence);
  const std::vector<int> stops = StopsAlongPath(sequence, kStops);
  std::vector<Panel> panels;
  for (const bool back : {false, true}) {
    for (int stop : stops) {
      Pose pose = sequence.frames[stop].world_from_camera;
      if (back) pose.rotate(Eigen::AngleAxisd(kPi, Vec3d::UnitY()));
      panels.push_back({fmt::format("{:.0f} mm{}", along_mm[stop], back ? ", looking back" : ""),
                        portrait.Draw(ViewFrom(pose), colored.colors)});
    }
  }
  WriteImage(folder / "walk.png", Compose(panels, static_cast<int>(stops.size()), {}));
}

}  // namespace lumen
