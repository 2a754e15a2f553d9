#include "tools/exchange/fisheye_fit.h"

#include <Eigen/QR>
#include <algorithm>
#include <cmath>
#include <vector>

#include "common/error.h"
#include "common/parallel.h"

namespace lumen {
namespace {

// 87° off the axis: beyond, x/z passes 20 and others' single precision loses what they divide by.
constexpr double kLeastCosine = 0.05;

struct Sight {
  Vec2d pixel;
  double angle_rad;  // off the axis
  Vec2d direction;   // unit, of the ray's part across the axis; 0 on it
};

// Parameters in order: fx, fy, cx, cy, k1 … k4, roll.
constexpr int kParameters = 9;
using Parameters = Eigen::Matrix<double, kParameters, 1>;

Sight SightOf(const Vec2d& pixel, const Vec3d& ray) {
  const double across = ray.head<2>().norm();
  return {pixel, std::atan2(across, ray.z()),
          across > 0 ? Vec2d(ray.head<2>() / across) : Vec2d(Vec2d::Zero())};
}

double Radius(const Parameters& p, double angle) {
  const double squared = angle * angle;
  return angle * (1 + squared * (p[4] + squared * (p[5] + squared * (p[6] + squared * p[7]))));
}

Vec2d Predict(const Parameters& p, const Sight& sight) {
  const Vec2d turned = Eigen::Rotation2Dd(p[8]) * sight.direction;
  return p.segment<2>(2) + Radius(p, sight.angle_rad) * p.head<2>().cwiseProduct(turned);
}

// Linear where fx = fy = f: in cx, cy, f, f·k1 … f·k4.
Parameters Start(const std::vector<Sight>& sights) {
  Eigen::MatrixXd rows(2 * sights.size(), 7);
  Eigen::VectorXd right(2 * sights.size());
  for (size_t i = 0; i < sights.size(); ++i) {
    for (int axis = 0; axis < 2; ++axis) {
      const auto row = static_cast<Eigen::Index>(2 * i + axis);
      rows(row, 0) = axis == 0;
      rows(row, 1) = axis == 1;
      double power = sights[i].angle_rad;
      for (int term = 0; term < 5; ++term, power *= sights[i].angle_rad * sights[i].angle_rad) {
        rows(row, 2 + term) = power * sights[i].direction[axis];
      }
      right[row] = sights[i].pixel[axis];
    }
  }
  const Eigen::VectorXd x = rows.colPivHouseholderQr().solve(right);
  Parameters p;
  p << x[2], x[2], x[0], x[1], x.segment<4>(3) / x[2], 0;
  return p;
}

// One step of Gauss and Newton; its largest change, in px.
double Step(const std::vector<Sight>& sights, Parameters* p) {
  Eigen::MatrixXd rows = Eigen::MatrixXd::Zero(2 * static_cast<Eigen::Index>(sights.size()), kParameters);
  Eigen::VectorXd residual(rows.rows());
  for (size_t i = 0; i < sights.size(); ++i) {
    const Sight& sight = sights[i];
    const Vec2d turned = Eigen::Rotation2Dd((*p)[8]) * sight.direction;
    const Vec2d across(-turned.y(), turned.x());  // d turned / d roll
    const double radius = Radius(*p, sight.angle_rad);
    const Vec2d left = sight.pixel - Predict(*p, sight);
    for (int axis = 0; axis < 2; ++axis) {
      const auto row = static_cast<Eigen::Index>(2 * i + axis);
      const double focal = (*p)[axis];
      rows(row, axis) = radius * turned[axis];
      rows(row, 2 + axis) = 1;
      double power = sight.angle_rad;
      for (int term = 0; term < 4; ++term) {
        power *= sight.angle_rad * sight.angle_rad;
        rows(row, 4 + term) = focal * power * turned[axis];
      }
      rows(row, 8) = focal * radius * across[axis];
      residual[row] = left[axis];
    }
  }
  const Parameters step = rows.colPivHouseholderQr().solve(residual);
  *p += step;
  return (rows * step).cwiseAbs().maxCoeff();
}

CameraIntrinsics ToCamera(const CameraIntrinsics& like, const Parameters& p) {
  CameraIntrinsics camera;
  camera.model = CameraModel::kKannalaBrandt;
  camera.width = like.width;
  camera.height = like.height;
  camera.fx = p[0];
  camera.fy = p[1];
  camera.cx = p[2];
  camera.cy = p[3];
  for (int i = 0; i < 4; ++i) camera.k[i] = p[4 + i];
  return camera;
}

// Every `stride`th of the fitted pixels both ways.
std::vector<Sight> Sights(const Calibration& calibration, const Image8& fitted, int stride) {
  const Camera<double> camera(calibration.camera);
  std::vector<Sight> sights;
  for (int y = stride / 2; y < fitted.height; y += stride) {
    for (int x = stride / 2; x < fitted.width; x += stride) {
      const Vec2d pixel(x, y);
      if (*fitted.Pixel(x, y)) sights.push_back(SightOf(pixel, *camera.Unproject(pixel)));
    }
  }
  return sights;
}

// The fitted camera's own projection, so that a fold of its polynomial within the image shows.
void Compare(const Calibration& calibration, const Image8& fitted, FisheyeFit* fit) {
  const Camera<double> ours(calibration.camera), theirs(fit->camera);
  const Mat3d roll = Eigen::AngleAxisd(fit->roll_rad, Vec3d::UnitZ()).toRotationMatrix();
  struct Row {
    double max = 0, squares = 0;
    int64_t pixels = 0;
  };
  std::vector<Row> by_row(fitted.height);
  ParallelFor(0, fitted.height, [&](int64_t y) {
    Row& row = by_row[y];
    for (int x = 0; x < fitted.width; ++x) {
      const Vec2d pixel(x, static_cast<double>(y));
      if (*fitted.Pixel(x, static_cast<int>(y)) == 0) continue;
      const auto there = theirs.Project(roll * *ours.Unproject(pixel));
      const double error = there ? (*there - pixel).norm() : HUGE_VAL;
      row.max = std::max(row.max, error);
      row.squares += error * error;
      ++row.pixels;
    }
  });
  double squares = 0;
  for (const Row& row : by_row) {
    fit->max_px = std::max(fit->max_px, row.max);
    squares += row.squares;
    fit->pixels += row.pixels;
  }
  fit->rms_px = std::sqrt(squares / static_cast<double>(fit->pixels));
}

}  // namespace

Image8 FittedPixels(const Calibration& calibration) {
  const Camera<double> camera(calibration.camera);
  Image8 fitted = ValidPixels(calibration);
  ParallelFor(0, fitted.height, [&](int64_t row) {
    const int y = static_cast<int>(row);
    for (int x = 0; x < fitted.width; ++x) {
      uint8_t& pixel = *fitted.Pixel(x, y);
      if (pixel && camera.Unproject(Vec2d(x, y))->z() < kLeastCosine) pixel = 0;
    }
  });
  return fitted;
}

FisheyeFit FitFisheye(const Calibration& calibration) {
  const Image8 valid = ValidPixels(calibration), fitted = FittedPixels(calibration);
  FisheyeFit fit;
  fit.unfitted = std::ranges::count(valid.data, 255) - std::ranges::count(fitted.data, 255);
  if (calibration.camera.model == CameraModel::kKannalaBrandt) {
    fit.camera = calibration.camera;
  } else {
    // Some ten thousand pixels, evenly spread.
    const double pixels = double(fitted.width) * fitted.height;
    const int stride = std::max(1, static_cast<int>(std::sqrt(pixels / 1e4)));
    const std::vector<Sight> sights = Sights(calibration, fitted, stride);
    if (sights.size() < 2 * kParameters) {
      throw InputError("camera: too few pixels carry image to fit a fisheye to it");
    }
    Parameters p = Start(sights);
    constexpr int kMostSteps = 30;
    constexpr double kStill_px = 1e-10;
    for (int step = 0; step < kMostSteps && Step(sights, &p) > kStill_px; ++step) {
    }
    fit.camera = ToCamera(calibration.camera, p);
    fit.roll_rad = p[8];
  }
  Compare(calibration, fitted, &fit);
  return fit;
}

}  // namespace lumen
