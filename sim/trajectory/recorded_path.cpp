#include "sim/trajectory/recorded_path.h"

#include <algorithm>
#include <cmath>
#include <string>

#include "common/error.h"
#include "common/parallel.h"
#include "common/pose_file.h"
#include "sim/trajectory/stand_in.h"

namespace lumen {
namespace {

// Right-handed axes with the given z and x as near as possible to the given one.
Mat3d AxesAround(const Vec3d& z, const Vec3d& x_near) {
  Vec3d x = x_near - z * z.dot(x_near);
  x = x.norm() > 1e-6 ? Vec3d(x.normalized()) : Vec3d(z.unitOrthogonal());
  Mat3d axes;
  axes << x, z.cross(x), z;
  return axes;
}

std::vector<Pose> UniformSubset(const std::vector<Pose>& poses, int64_t count) {
  std::vector<Pose> subset;
  for (int64_t i = 0; i < count; ++i) {
    const double place = count > 1 ? static_cast<double>(i) * (poses.size() - 1) / (count - 1) : 0;
    subset.push_back(poses[std::lround(place)]);
  }
  return subset;
}

// Shifts the poses, all alike and across `axis`, away from where they come nearest to the wall or out of it,
// again and again until they keep the clearance, or as far as that helps.
void ShiftFromWall(const Clearance& wall, const Vec3d& axis, double clearance_mm, std::vector<Pose>* poses) {
  constexpr int kAttempts = 40;
  constexpr double kExtra_mm = 0.05;  // so that a shift isn't undone by rounding
  struct Push {
    double missing_mm;
    Vec3d direction;
  };
  std::vector<Push> pushes(poses->size());
  for (int attempt = 0; attempt < kAttempts; ++attempt) {
    ParallelFor(0, poses->size(), [&](int64_t i) {
      const Vec3d place = (*poses)[i].translation();
      const Clearance::Nearest nearest = wall.At(place);
      const double sign = wall.Encloses(place) ? 1 : -1;
      pushes[i] = {clearance_mm - sign * nearest.distance_mm, sign * (place - nearest.point)};
    });
    const auto worst = std::max_element(pushes.begin(), pushes.end(), [](const Push& a, const Push& b) {
      return a.missing_mm < b.missing_mm;
    });
    if (worst->missing_mm <= 0) return;
    const Vec3d across = worst->direction - axis * axis.dot(worst->direction);
    if (across.norm() < 1e-9) return;
    for (Pose& pose : *poses) pose.translation() += (worst->missing_mm + kExtra_mm) * across.normalized();
  }
}

// All or some of them, as they stand in the file.
std::vector<Pose> PosesOfFile(const ConfigTable& trajectory) {
  std::vector<Pose> poses;
  if (const auto stand_in = trajectory.Optional("stand_in")) {
    poses = StandInPoses(*stand_in);  // read in any case, so that its mistakes show
  }
  if (!IsStandIn(trajectory)) poses = ReadPoses(trajectory.Path("path"));
  if (!trajectory.Has("frames")) return poses;
  const int64_t count = trajectory.Integer("frames", Range{1, 100000});
  if (count > static_cast<int64_t>(poses.size()))
    trajectory.Fail("frames", "the file has " + std::to_string(poses.size()) + " poses only");
  return UniformSubset(poses, count);
}

bool IsAnchored(const ConfigTable& trajectory) {
  return trajectory.Choice("anchor", "none", {"none", "centreline"}) == "centreline";
}

Vec3d MeanAxis(const std::vector<Pose>& poses, int column) {
  Vec3d sum = Vec3d::Zero();
  for (const Pose& pose : poses) sum += pose.linear().col(column);
  return sum / static_cast<double>(poses.size());
}

}  // namespace

Pose AnchorOnCentreline(const std::vector<Pose>& poses, const Centreline& centreline, double at_mm,
                        double roll_rad) {
  const Vec3d mean = MeanAxis(poses, 2);
  if (mean.norm() < 0.1)
    throw InputError(
        "the cameras look all ways: there is no mean viewing direction to anchor; use anchor = \"none\"");
  const Vec3d view = mean.normalized(), first = poses.front().translation();
  double reach_mm = 0;  // along the view, from the first camera to the farthest, either way
  for (const Pose& pose : poses) {
    const double along = view.dot(pose.translation() - first);
    if (std::abs(along) > std::abs(reach_mm)) reach_mm = along;
  }
  const CentrelineFrame start = centreline.At(at_mm);
  const Vec3d chord = centreline.At(at_mm + reach_mm).point - start.point;
  // A path shorter than this says less about the direction than the tangent does.
  constexpr double kShortest_mm = 5;
  const Vec3d deep =
      chord.norm() < kShortest_mm ? start.tangent : Vec3d(chord.normalized() * (reach_mm > 0 ? 1 : -1));
  Pose anchor = Pose::Identity();
  anchor.linear() = AxesAround(deep, start.normal) * Eigen::AngleAxisd(roll_rad, Vec3d::UnitZ()) *
                    AxesAround(view, MeanAxis(poses, 0)).transpose();
  anchor.translation() = start.point - anchor.linear() * first;
  return anchor;
}

bool IsStandIn(const ConfigTable& trajectory) {
  std::error_code ignored;
  return trajectory.Has("stand_in") && !std::filesystem::exists(trajectory.Path("path"), ignored);
}

std::vector<Pose> GivenPoses(const ConfigTable& trajectory) {
  const bool from_file = trajectory.Choice("kind", {"withdrawal", "file"}) == "file";
  if (!from_file || IsAnchored(trajectory)) return {};
  return PosesOfFile(trajectory);
}

std::vector<Pose> RecordedPoses(const ConfigTable& trajectory, const Centreline& centreline,
                                const Clearance& wall) {
  std::vector<Pose> poses = PosesOfFile(trajectory);
  if (!IsAnchored(trajectory)) return poses;
  const double at_mm = trajectory.Number("at_mm", Range{0, centreline.length_mm()});
  const double roll_rad = trajectory.Number("roll_rad", 0, Range{-2 * kPi, 2 * kPi});
  const Pose anchor = AnchorOnCentreline(poses, centreline, at_mm, roll_rad);
  for (Pose& pose : poses) pose = anchor * pose;
  ShiftFromWall(wall, MeanAxis(poses, 2).normalized(), ClearanceKey(trajectory), &poses);
  return poses;
}

}  // namespace lumen
