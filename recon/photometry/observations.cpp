#include "recon/photometry/observations.h"

#include <algorithm>
#include <cmath>
#include <numeric>
#include <set>

#include "common/error.h"
#include "common/parallel.h"
#include "common/progress.h"

namespace lumen {
namespace {

using Cell = std::array<int, 3>;

// A frame's pixels, before those of all frames are put in order.
struct FramePixels {
  std::vector<Cell> cell;
  std::vector<std::array<uint8_t, 3>> code;
  std::vector<float> log_vignetting;
  std::vector<SourceGeometry> geometry;
};

struct Wall {
  ImageF z_mm, normal;
};

void RequireSize(const std::filesystem::path& file, int width, int height, const CameraIntrinsics& camera) {
  if (width == camera.width && height == camera.height) return;
  throw InputError(file.string() + ": has " + std::to_string(width) + "×" + std::to_string(height) +
                   " pixels, the camera " + std::to_string(camera.width) + "×" +
                   std::to_string(camera.height));
}

class Observer {
 public:
  Observer(const Sequence& sequence, const PhotometryOptions& options)
      : sequence_(sequence),
        calibration_(sequence.calibration),
        options_(options),
        camera_(calibration_.camera),
        valid_(ValidPixels(calibration_)),
        rays_(size_t(valid_.width) * valid_.height, Vec3f::Zero()) {
    int64_t count = 0;
    for (int y = 0; y < valid_.height; ++y) {
      for (int x = 0; x < valid_.width; ++x) {
        if (*valid_.Pixel(x, y) == 0) continue;
        rays_[Index(x, y)] = camera_.Unproject(Vec2d(x, y)).value().cast<float>();
        ++count;
      }
    }
    const double excess = double(count) * sequence.frames.size() / double(options.max_pixels);
    stride_ = std::max(1, static_cast<int>(std::ceil(std::sqrt(excess))));
  }

  // The counts of what is left out go to `all`.
  FramePixels Read(const SequenceFrame& frame, Observations* all) const {
    const Image8 color = ReadColor(sequence_, frame);
    const Image16 depth = ReadImage16(frame.depth, 1), normals = ReadImage16(frame.normals, 3);
    RequireSize(frame.depth, depth.width, depth.height, calibration_.camera);
    RequireSize(frame.normals, normals.width, normals.height, calibration_.camera);
    const Wall wall = {DecodeDepth(depth), DecodeNormals(normals)};
    FramePixels pixels;
    for (int y = stride_ / 2; y < valid_.height; y += stride_) {
      for (int x = stride_ / 2; x < valid_.width; x += stride_) {
        if (*valid_.Pixel(x, y) != 0) Add(frame, color, wall, x, y, &pixels, all);
      }
    }
    return pixels;
  }

 private:
  size_t Index(int x, int y) const { return size_t(y) * valid_.width + x; }

  void Add(const SequenceFrame& frame, const Image8& color, const Wall& wall, int x, int y,
           FramePixels* pixels, Observations* all) const {
    ++all->taken;
    const float z = *wall.z_mm.Pixel(x, y);
    const Vec3d normal = NormalAt(wall, x, y);
    if (!(z > 0) || std::isinf(z) || !(normal.norm() > 0.5)) {
      ++all->no_surface;
      return;
    }
    const Vec3d ray = rays_[Index(x, y)].cast<double>();
    const Vec3d point = ray * (z / ray.z());
    if (-normal.dot(ray) < options_.min_cos) {
      ++all->grazing;
      return;
    }
    if (IsEdge(wall, x, y, point, normal)) {
      ++all->edges;
      return;
    }
    const double vignetting = Vignetting(calibration_.response, ray.z());
    const size_t before = pixels->geometry.size();
    if (!(vignetting > 0) || !AddGeometry(point, normal, &pixels->geometry)) {
      pixels->geometry.resize(before);
      ++all->grazing;
      return;
    }
    std::array<uint8_t, 3> code{};
    for (int c = 0; c < 3; ++c) {
      const uint8_t value = color.Pixel(x, y)[c];
      if (value == 255) {
        ++all->saturated[c];
      } else if (value < options_.min_code) {
        ++all->dark[c];
      } else {
        code[c] = value;
      }
    }
    const Vec3d place = frame.world_from_camera * point / options_.cell_mm;
    pixels->cell.push_back(
        {int(std::floor(place.x())), int(std::floor(place.y())), int(std::floor(place.z()))});
    pixels->code.push_back(code);
    pixels->log_vignetting.push_back(static_cast<float>(std::log(vignetting)));
  }

  static Vec3d NormalAt(const Wall& wall, int x, int y) {
    const float* n = wall.normal.Pixel(x, y);
    const Vec3d normal(n[0], n[1], n[2]);
    return normal.squaredNorm() > 0 ? Vec3d(normal.normalized()) : Vec3d::Zero();
  }

  bool IsEdge(const Wall& wall, int x, int y, const Vec3d& point, const Vec3d& normal) const {
    constexpr int kNeighbours[4][2] = {{-1, 0}, {1, 0}, {0, -1}, {0, 1}};
    for (const auto& [dx, dy] : kNeighbours) {
      const int u = x + dx, v = y + dy;
      if (u < 0 || v < 0 || u >= valid_.width || v >= valid_.height || *valid_.Pixel(u, v) == 0) continue;
      const Vec3d ray = rays_[Index(u, v)].cast<double>();
      const double expected_z = normal.dot(point) / normal.dot(ray) * ray.z();
      const double z = *wall.z_mm.Pixel(u, v);
      if (!(std::abs(z - expected_z) <= options_.max_jump * expected_z)) return true;  // NaN is an edge too
    }
    return false;
  }

  // False where the light comes too flat to be relied on.
  bool AddGeometry(const Vec3d& point, const Vec3d& normal, std::vector<SourceGeometry>* geometry) const {
    double strongest = 0, cos_of_strongest = 0;
    for (const LightSource& source : calibration_.light.sources) {
      const auto light = IrradianceAt<double>(source.position, source.direction, source.spread, point);
      const double distance = (source.position - point).norm();
      const double cos = light.toward.dot(normal);
      if (distance == 0) return false;
      geometry->push_back({static_cast<float>(std::log(distance)),
                           cos > 0 ? static_cast<float>(std::log(cos)) : -INFINITY,
                           static_cast<float>(1 + source.direction.dot(light.toward))});
      const double irradiance = source.intensity.mean() * light.per_intensity * cos;
      if (irradiance > strongest) {
        strongest = irradiance;
        cos_of_strongest = cos;
      }
    }
    return cos_of_strongest >= options_.min_cos;
  }

  const Sequence& sequence_;
  const Calibration& calibration_;
  const PhotometryOptions& options_;
  Camera<double> camera_;
  Image8 valid_;
  std::vector<Vec3f> rays_;
  int stride_ = 1;
};

// Puts the frames' pixels in the order of their cells, within a cell by frame and reading order.
void Sort(const std::vector<FramePixels>& frames, Observations* all) {
  struct Place {
    Cell cell;
    int frame;
    int pixel;
  };
  std::vector<Place> places;
  for (size_t f = 0; f < frames.size(); ++f) {
    for (size_t i = 0; i < frames[f].cell.size(); ++i) {
      places.push_back({frames[f].cell[i], static_cast<int>(f), static_cast<int>(i)});
    }
  }
  std::stable_sort(places.begin(), places.end(),
                   [](const Place& a, const Place& b) { return a.cell < b.cell; });
  for (size_t i = 0; i < places.size(); ++i) {
    if (i == 0 || places[i].cell != places[i - 1].cell) all->cell_begin.push_back(static_cast<int64_t>(i));
    const FramePixels& from = frames[places[i].frame];
    const int pixel = places[i].pixel;
    all->frame.push_back(places[i].frame);
    all->code.push_back(from.code[pixel]);
    all->log_vignetting.push_back(from.log_vignetting[pixel]);
    const auto geometry = from.geometry.begin() + std::ptrdiff_t(pixel) * all->sources;
    all->geometry.insert(all->geometry.end(), geometry, geometry + all->sources);
  }
  all->cell_begin.push_back(static_cast<int64_t>(places.size()));
}

// Cells in which some channel of some pixel is usable.
int UsableCells(const FramePixels& frame) {
  std::set<Cell> cells;
  for (size_t i = 0; i < frame.cell.size(); ++i) {
    const auto& code = frame.code[i];
    if (code[0] + code[1] + code[2] > 0) cells.insert(frame.cell[i]);
  }
  return static_cast<int>(cells.size());
}

}  // namespace

Observations Observe(const Sequence& sequence, const PhotometryOptions& options) {
  const Observer observer(sequence, options);
  Observations all;
  all.sequence = &sequence;
  const std::vector<LightSource>& sources = sequence.calibration.light.sources;
  all.sources = static_cast<int>(sources.size());
  double mean_spread = 0;
  for (const LightSource& source : sources) mean_spread += source.spread / all.sources;
  for (const LightSource& source : sources) {
    all.constants.push_back({source.intensity.array().log().matrix(), source.spread - mean_spread});
  }
  std::vector<FramePixels> frames;
  Progress progress("photometry");
  bool any_wall = false;
  for (size_t i = 0; i < sequence.frames.size(); ++i) {
    const SequenceFrame& frame = sequence.frames[i];
    progress.Update(double(i) / sequence.frames.size());
    if (!frame.depth.empty() && !frame.normals.empty()) {
      any_wall = true;
      FramePixels pixels = observer.Read(frame, &all);
      if (UsableCells(pixels) >= options.min_cells) {
        all.frames.push_back(static_cast<int>(i));
        frames.push_back(std::move(pixels));
        continue;
      }
    }
    all.left_out.push_back(static_cast<int>(i));
  }
  if (!any_wall) {
    throw InputError(sequence.folder.string() +
                     ": no frame has depth and normals; the fit needs NNNN_depth.tiff and NNNN_normals.tiff");
  }
  if (frames.empty()) {
    throw InputError(
        sequence.folder.string() + ": no frame shows " + std::to_string(options.min_cells) + " places of " +
        std::to_string(static_cast<int>(options.cell_mm)) +
        " mm that are neither black nor saturated nor grazing; use other frames or smaller cells");
  }
  Sort(frames, &all);
  return all;
}

}  // namespace lumen
