#include "tools/exchange/light_scale.h"

#include <Eigen/Eigenvalues>
#include <algorithm>
#include <cmath>

#include "common/error.h"
#include "common/parallel.h"
#include "common/response.h"

namespace lumen {
namespace {

constexpr int kGreen = 1;
constexpr int kDarkest = 10, kBrightest = 250;  // green values that say how bright a place is
constexpr size_t kNeighbours = 12;              // of a point, for its plane
constexpr size_t kFewestPoints = 20;
constexpr size_t kMostPoints = 4000;  // whose planes are looked for, each among all points
constexpr double kSteepest = 0.2;     // cosine: beyond, the plane's own error is as large as the cosine

// Unit normal of the plane through a point's nearest neighbours.
Vec3d NormalAt(const std::vector<Vec3d>& points, const Vec3d& place) {
  std::vector<std::pair<double, size_t>> by_distance(points.size());
  for (size_t i = 0; i < points.size(); ++i) by_distance[i] = {(points[i] - place).squaredNorm(), i};
  std::nth_element(by_distance.begin(), by_distance.begin() + kNeighbours, by_distance.end());
  Vec3d mean = Vec3d::Zero();
  for (size_t i = 0; i < kNeighbours; ++i) mean += points[by_distance[i].second] / double(kNeighbours);
  Mat3d spread = Mat3d::Zero();
  for (size_t i = 0; i < kNeighbours; ++i) {
    const Vec3d offset = points[by_distance[i].second] - mean;
    spread += offset * offset.transpose();
  }
  return Eigen::SelfAdjointEigenSolver<Mat3d>(spread).eigenvectors().col(0);  // of the least eigenvalue
}

// Some of the points, evenly over their ids, with their normals.
std::unordered_map<uint64_t, Vec3d> Normals(const std::unordered_map<uint64_t, ColmapPoint>& points) {
  std::vector<uint64_t> ids;
  for (const auto& [id, point] : points) ids.push_back(id);
  std::sort(ids.begin(), ids.end());
  std::vector<Vec3d> positions;
  for (uint64_t id : ids) positions.push_back(points.at(id).position);
  const size_t taken = std::min(ids.size(), kMostPoints);
  std::vector<Vec3d> normals(taken);
  ParallelFor(0, static_cast<int64_t>(taken),
              [&](int64_t i) { normals[i] = NormalAt(positions, positions[i * ids.size() / taken]); });
  std::unordered_map<uint64_t, Vec3d> by_id;
  for (size_t i = 0; i < taken; ++i) by_id[ids[i * ids.size() / taken]] = normals[i];
  return by_id;
}

// What the light sends along a ray from the camera at 1 mm, in green.
double SentAlong(const Light& light, const Vec3d& ray) {
  double sum = 0;
  for (const LightSource& source : light.sources) {
    sum += source.intensity[kGreen] * std::exp(-source.spread * (1 - source.direction.dot(ray)));
  }
  return sum;
}

}  // namespace

LightScale ScaleFromLight(const Sequence& sequence, const std::vector<ColmapImage>& images,
                          const std::unordered_map<uint64_t, ColmapPoint>& points, double albedo) {
  const Calibration& calibration = sequence.calibration;
  if (!calibration.light.calibrated) {
    throw InputError("the light's power is unknown (light.calibrated = false): it can't tell the scale");
  }
  if (points.size() < kFewestPoints) {
    throw InputError("the model has " + std::to_string(points.size()) + " points; a scale from light takes " +
                     std::to_string(kFewestPoints));
  }
  const std::unordered_map<uint64_t, Vec3d> normals = Normals(points);
  std::vector<double> scales;
  for (size_t i = 0; i < images.size(); ++i) {
    const SequenceFrame& frame = sequence.frames[i];
    if (!frame.gain) {
      throw InputError("the gain of frame " + std::to_string(frame.number) +
                       " is unknown: its brightness can't tell the scale");
    }
    const Image8 color = ReadColor(sequence, frame);
    for (const ColmapObservation& observation : images[i].observations) {
      const auto normal = normals.find(observation.point);
      if (normal == normals.end()) continue;
      const Vec3d place = images[i].camera_from_world * points.at(observation.point).position;
      const double x = std::round(observation.pixel.x()), y = std::round(observation.pixel.y());
      if (!(x >= 0 && y >= 0 && x < color.width && y < color.height)) continue;
      const uint8_t value = color.Pixel(static_cast<int>(x), static_cast<int>(y))[kGreen];
      if (value < kDarkest || value > kBrightest) continue;
      const double distance = place.norm();
      const Vec3d ray = place / distance;
      const double cosine = std::abs(ray.dot(images[i].camera_from_world.linear() * normal->second));
      const double vignetting = Vignetting(calibration.response, ray.z());
      if (cosine < kSteepest || !(vignetting > 0)) continue;
      const double radiance = Decode(calibration.response, value / 255.0) / (*frame.gain * vignetting);
      scales.push_back(std::sqrt(albedo / kPi * cosine * SentAlong(calibration.light, ray) / radiance) /
                       distance);
    }
  }
  if (scales.size() < kFewestPoints) {
    throw InputError("only " + std::to_string(scales.size()) +
                     " observations of points are neither dark nor saturated: too few for a scale");
  }
  std::sort(scales.begin(), scales.end());
  LightScale result;
  result.observations = static_cast<int64_t>(scales.size());
  result.mm_per_unit = scales[scales.size() / 2];
  result.lower_mm = scales[scales.size() / 4];
  result.upper_mm = scales[scales.size() * 3 / 4];
  return result;
}

}  // namespace lumen
