#include "sim/imaging/path.h"

#include <gtest/gtest.h>

#include <cmath>
#include <cstring>
#include <functional>
#include <limits>
#include <vector>

#include "common/parallel.h"
#include "common/random.h"
#include "sim/ground_truth.h"
#include "sim/imaging/offset_origin.h"
#include "tests/path_stage.h"

namespace lumen {
namespace {

using test::AddPlate;
using test::PixelOf;

Mesh Sphere(double radius, int rings) { return test::Globe(radius, rings); }
Mesh Cylinder(double radius, int rings) { return test::Tube(radius, 100, rings, 2 * rings); }

CameraIntrinsics Pinhole(int width, int height, double focal_px) {
  CameraIntrinsics intrinsics;
  intrinsics.width = width;
  intrinsics.height = height;
  intrinsics.fx = intrinsics.fy = focal_px;
  intrinsics.cx = width / 2.0 - 0.27;
  intrinsics.cy = height / 2.0 - 0.61;
  return intrinsics;
}

Light OneGuide(const Vec3d& position = Vec3d::Zero(), double spread = 2.77, double intensity = 500) {
  Light light;
  light.sources.push_back(
      {position, Vec3d(0.1, -0.2, 1).normalized(), spread, intensity * Vec3d(1, 0.9, 0.8)});
  return light;
}

// A mesh with what is needed to render it.
struct Stage {
  Mesh mesh;
  RayScene wall;
  CameraIntrinsics intrinsics;
  Camera<float> camera;
  Camera<double> exact_camera;
  Image8 valid;
  Surface surface;
  Light light;
  Pose world_from_camera = Pose::Identity();
  PathOptions options;

  Stage(Mesh geometry, const CameraIntrinsics& intrinsics, const Light& light)
      : mesh(std::move(geometry)),
        wall(mesh),
        intrinsics(intrinsics),
        camera(intrinsics),
        exact_camera(intrinsics),
        valid(intrinsics.width, intrinsics.height, 1, 255),
        light(light) {
    options.samples = 1;
  }
  PathCount Render(uint64_t seed, bool with_parts, Film* film) const {
    return RenderFrame({&wall, &surface, 0}, {&camera, &valid, world_from_camera, &light}, options, seed, 0,
                       with_parts, film);
  }
  Film Render(uint64_t seed = 1, bool with_parts = false) const {
    Film film;
    EXPECT_EQ(Render(seed, with_parts, &film).failure.count, 0);
    return film;
  }
};

// DESIGN's formula in double: what a Lambertian place sends back, in camera axes. `envelope`: without the
// cosine.
Vec3d DirectRadiance(const Stage& stage, const Light& light, const Vec3d& place, const Vec3d& normal,
                     double* envelope = nullptr) {
  Vec3d sum = Vec3d::Zero();
  double largest = 0;
  for (const LightSource& source : light.sources) {
    const Vec3d L = (place - source.position).normalized();
    const double fall =
        std::exp(-source.spread * (1 - source.direction.dot(L))) / (place - source.position).squaredNorm();
    sum += std::max(0.0, -L.dot(normal)) * fall / kPi * stage.surface.albedo.cwiseProduct(source.intensity);
    largest += fall / kPi * stage.surface.albedo.cwiseProduct(source.intensity).maxCoeff();
  }
  if (envelope) *envelope = largest;
  return sum;
}

// Against the closed form at the place and with the normal of the very triangle: 1e-5 of the radiance, and
// where the light grazes (cosine below 0.1) of what it would be at 0.1.
// Returns how many pixels are off by more.
int CompareWithClosedForm(const Stage& stage, const Light& expected_light) {
  const Film film = stage.Render();
  const FrameTruth truth =
      ComputeTruth(stage.wall, stage.exact_camera, stage.valid, stage.world_from_camera, nullptr);
  const Pose camera_from_world = stage.world_from_camera.inverse();
  int worse = 0, lit = 0;
  for (int y = 0; y < stage.intrinsics.height; ++y) {
    for (int x = 0; x < stage.intrinsics.width; ++x) {
      const Vec3d found = PixelOf(film.radiance, x, y);
      if (std::isnan(*truth.z.Pixel(x, y))) {
        EXPECT_EQ(found.norm(), 0);
        continue;
      }
      double envelope;
      const Vec3d expected =
          DirectRadiance(stage, expected_light, camera_from_world * PixelOf(truth.position, x, y),
                         PixelOf(truth.normal, x, y), &envelope);
      lit += expected.maxCoeff() > 0;
      const double scale = std::max(expected.maxCoeff(), 0.1 * envelope);
      worse += (found - expected).cwiseAbs().maxCoeff() > 1e-5 * scale;
    }
  }
  EXPECT_GT(lit, stage.intrinsics.width * stage.intrinsics.height / 3);
  return worse;
}

TEST(Path, DirectLightOnSphereCylinderAndPlane) {
  Mesh plane;
  AddPlate(&plane, -300, 300, -300, 300, 25);
  for (const Mesh& mesh : {Sphere(20, 60), Cylinder(22, 60), plane}) {
    for (const Vec3d& position : {Vec3d(0, 0, 0), Vec3d(4, -6, 3)}) {
      for (const Vec3d& guide : {Vec3d(0, 0, 0), Vec3d(3, 0.5, -0.2)}) {
        Stage stage(mesh, Pinhole(48, 36, 24), OneGuide(guide));
        stage.light.sources.push_back({-guide, Vec3d::UnitZ(), 0.5, Vec3d(100, 200, 300)});
        stage.world_from_camera =
            Eigen::Translation3d(position) * Eigen::AngleAxisd(0.3, Vec3d(1, 2, 0.5).normalized());
        // Two rays on an edge may choose differently in float and double.
        EXPECT_LE(CompareWithClosedForm(stage, stage.light), 2);
        Light moved = stage.light;
        moved.sources[0].position.z() += 1e-3;  // mm
        EXPECT_GT(CompareWithClosedForm(stage, moved), 100);
      }
    }
  }
}

// Root mean square error against the smooth shape.
double SmoothError(const Stage& stage, const std::function<Vec3d(const Vec3d&, const Vec3d&, Vec3d*)>& meet) {
  const Film film = stage.Render();
  double sum = 0, scale = 0;
  for (int y = 0; y < stage.intrinsics.height; ++y) {
    for (int x = 0; x < stage.intrinsics.width; ++x) {
      const Vec3d ray = stage.world_from_camera.linear() * *stage.exact_camera.Unproject(Vec2d(x, y));
      Vec3d normal;
      const Vec3d place = meet(stage.world_from_camera.translation(), ray, &normal);
      const Vec3d expected = DirectRadiance(stage, stage.light, stage.world_from_camera.inverse() * place,
                                            stage.world_from_camera.linear().transpose() * normal);
      sum += (PixelOf(film.radiance, x, y) - expected).squaredNorm();
      scale += expected.squaredNorm();
    }
  }
  return std::sqrt(sum / scale);
}

// Flat triangles inscribed in a smooth shape are off by their size in the normal, so halving it must halve
// the error.
TEST(Path, DirectLightConvergesToTheSmoothShape) {
  const double radius = 20;
  for (const int axes : {3, 2}) {  // a sphere; a cylinder about z
    const auto meet = [&](const Vec3d& origin, const Vec3d& ray, Vec3d* normal) {
      const Vec3d o(origin.x(), origin.y(), axes == 3 ? origin.z() : 0),
          d(ray.x(), ray.y(), axes == 3 ? ray.z() : 0);
      const double b = o.dot(d), a = d.squaredNorm();
      const double t = (-b + std::sqrt(b * b + a * (radius * radius - o.squaredNorm()))) / a;
      *normal = -(o + t * d) / radius;
      return Vec3d(origin + t * ray);
    };
    double errors[3];
    for (int i = 0; i < 3; ++i) {
      const int rings = 24 << (2 * i);
      Stage stage(axes == 3 ? Sphere(radius, rings) : Cylinder(radius, rings), Pinhole(32, 24, 16),
                  OneGuide({1, 2, 0}));
      stage.world_from_camera =
          Eigen::Translation3d(3, -2, 1) * Eigen::AngleAxisd(1.2, Vec3d(1, 0.3, 0).normalized());
      errors[i] = SmoothError(stage, meet);
    }
    EXPECT_LT(errors[0], 0.2);
    EXPECT_LT(errors[1], errors[0] / 3);
    EXPECT_LT(errors[2], errors[1] / 3);
  }
}

// A blocker's shadow from a guide beside the camera: all or nothing, as the segment to the guide says.
TEST(Path, ShadowOfAnOffsetGuide) {
  Mesh mesh;
  AddPlate(&mesh, -1.3, 0.7, -1.1, 0.9, 10);
  AddPlate(&mesh, -90, 90, -90, 90, 30);
  const Vec3d guide(3.1, 0.4, 0);
  Stage stage(mesh, Pinhole(160, 120, 110), OneGuide(guide));
  const Film film = stage.Render();
  int dark = 0;
  for (int y = 0; y < stage.intrinsics.height; ++y) {
    for (int x = 0; x < stage.intrinsics.width; ++x) {
      const Vec3d ray((x - stage.intrinsics.cx) / 110, (y - stage.intrinsics.cy) / 110, 1);
      const auto in_blocker = [](const Vec3d& p) {
        return p.x() > -1.3 && p.x() < 0.7 && p.y() > -1.1 && p.y() < 0.9;
      };
      const bool on_blocker = in_blocker(10 * ray);
      const Vec3d place = (on_blocker ? 10 : 30) * ray;
      const bool shadow = !on_blocker && in_blocker(guide + (place - guide) / 3);
      const Vec3d expected =
          shadow ? Vec3d::Zero() : DirectRadiance(stage, stage.light, place, -Vec3d::UnitZ());
      EXPECT_LE((PixelOf(film.radiance, x, y) - expected).norm(), 2e-5 * expected.norm()) << x << ' ' << y;
      dark += shadow;
    }
  }
  EXPECT_GT(dark, 200);
}

// Power that leaves a source, per channel: intensity · ∫ exp(−spread(1 − cos)) dΩ.
Vec3d Power(const LightSource& source) {
  const double s = source.spread;
  return source.intensity * (s == 0 ? 4 * kPi : 2 * kPi * (1 - std::exp(-2 * s)) / s);
}

struct Estimate {
  Vec3d mean, standard_error;
};

Estimate MeanIndirect(const Stage& stage, int seeds) {
  std::vector<Vec3d> means;
  for (int seed = 0; seed < seeds; ++seed) {
    const Film film = stage.Render(100 + seed, true);
    Vec3d mean = Vec3d::Zero();
    for (int y = 0; y < film.indirect.height; ++y) {
      for (int x = 0; x < film.indirect.width; ++x) mean += PixelOf(film.indirect, x, y);
    }
    means.push_back(mean / (film.indirect.width * film.indirect.height));
  }
  Estimate result{Vec3d::Zero(), Vec3d::Zero()};
  for (const Vec3d& mean : means) result.mean += mean / seeds;
  for (const Vec3d& mean : means) result.standard_error += (mean - result.mean).cwiseAbs2();
  result.standard_error = (result.standard_error / (seeds * (seeds - 1.0))).cwiseSqrt();
  return result;
}

// In a closed Lambertian sphere what comes back from the wall falls evenly on all of it, wherever the light
// is: of n bounces Φ/(4πR²) · (ρ + ρ² + … + ρⁿ).
void ExpectIntegratingSphere(const Light& light, const Vec3d& position, double albedo, int bounces,
                             int roulette_after, int shared_paths) {
  const double radius = 20;
  Stage stage(Sphere(radius, 90), Pinhole(16, 12, 8), light);
  stage.surface.albedo = Vec3d::Constant(albedo);
  stage.world_from_camera =
      Eigen::Translation3d(position) * Eigen::AngleAxisd(0.4, Vec3d(1, 2, 0.5).normalized());
  // All pixels share a tile.
  stage.options = {shared_paths == 0 ? 8 : 512 / shared_paths, bounces, roulette_after, shared_paths};
  Vec3d power = Vec3d::Zero();
  for (const LightSource& source : light.sources) power += Power(source);
  const double series = albedo * (1 - std::pow(albedo, bounces)) / (1 - albedo);
  const Vec3d expected = albedo / kPi * series / (4 * kPi * radius * radius) * power;
  const Estimate found = MeanIndirect(stage, 16);
  for (int c = 0; c < 3; ++c) {
    // The inscribed polyhedron's area is smaller by less than (π/90)² = 0.12%, and so is the light's spread.
    EXPECT_NEAR(found.mean[c], expected[c], 5 * found.standard_error[c] + 1.2e-3 * expected[c]);
    EXPECT_LT(found.standard_error[c], 0.01 * expected[c]);  // an interval that could not fail proves nothing
  }
}

TEST(Path, IntegratingSphere) {
  Light guides = OneGuide({3.2, 0.5, 0}, 2.77, 300);
  guides.sources.push_back({{-2.8, 2.7, 0}, Vec3d(-0.2, 0.1, 1).normalized(), 1.5, {100, 200, 300}});
  guides.sources.push_back({{-1.3, -3.1, 0}, Vec3d::UnitZ(), 0, {30, 20, 10}});
  // Each pixel's own paths; few and many that a tile shares.
  ExpectIntegratingSphere(OneGuide(), {0, 0, 0}, 0.5, 20, 20, 3);
  for (const int shared_paths : {0, 32}) {
    ExpectIntegratingSphere(OneGuide(), {0, 0, 0}, 0.5, 1, 9, shared_paths);
    ExpectIntegratingSphere(OneGuide(), {0, 0, 0}, 0.5, 20, 20, shared_paths);
    ExpectIntegratingSphere(OneGuide(), {0, 0, 0}, 0.5, 20, 0, shared_paths);
    ExpectIntegratingSphere(guides, {4, -6, 3}, 0.5, 20, 20, shared_paths);
    ExpectIntegratingSphere(guides, {4, -6, 3}, 0.5, 20, 2, shared_paths);
    ExpectIntegratingSphere(guides, {4, -6, 3}, 0.9, 40, 3, shared_paths);
  }
}

// Light adds up: what several guides send by way of the wall is the sum of what each of them sends, though a
// path asks only one of them at each of its vertices. A plate keeps one guide from much of the sphere.
TEST(Path, OneGuideAVertexStandsForAll) {
  Mesh mesh = Sphere(20, 30);
  AddPlate(&mesh, 2, 9, -6, 6, 4);
  Light guides = OneGuide({3.2, 0.5, 0}, 2.77, 300);
  guides.sources.push_back({{-2.8, 2.7, 0}, Vec3d(-0.2, 0.1, 1).normalized(), 1.5, {100, 200, 300}});
  guides.sources.push_back({{-1.3, -3.1, 0}, Vec3d::UnitZ(), 0, {30, 20, 10}});
  Stage stage(mesh, Pinhole(16, 12, 8), guides);
  stage.options = {8, 2, 9};
  const Estimate together = MeanIndirect(stage, 16);
  Vec3d sum = Vec3d::Zero(), variance = together.standard_error.cwiseAbs2(), smallest = together.mean;
  for (const LightSource& source : guides.sources) {
    stage.light.sources = {source};
    const Estimate alone = MeanIndirect(stage, 16);
    sum += alone.mean;
    smallest = smallest.cwiseMin(alone.mean);
    variance += alone.standard_error.cwiseAbs2();
  }
  for (int c = 0; c < 3; ++c) {
    const double interval = 5 * std::sqrt(variance[c]);
    EXPECT_NEAR(together.mean[c], sum[c], interval);
    EXPECT_LT(interval, smallest[c]);  // leaving one out would be noticed
  }
}

// In a sphere every place couples to every other alike; beside a plate, before a far wall and across its
// edges it doesn't. Pixel by pixel, the shared paths' mean over seeds against that of the pixels' own, in
// units of their standard errors.
TEST(Path, SharedPathsAgreeWithOwnOnesInEveryPixel) {
  Mesh mesh = Sphere(20, 30);
  AddPlate(&mesh, 2, 9, -6, 6, 4);
  AddPlate(&mesh, -9, -1, -3, 8, 2);
  Stage stage(mesh, Pinhole(37, 29, 12), OneGuide({3.2, 0.5, 0}, 2.77, 300));
  stage.world_from_camera.translation() = Vec3d(0, 0, -9);
  stage.surface.mottling.emplace();
  const auto means = [&](int shared_paths, int samples, ImageF* variance) {
    stage.options = {samples, 3, 1, shared_paths};
    constexpr int kSeeds = 12;
    ImageF mean(37, 29, 3);
    *variance = mean;
    std::vector<ImageF> renders;
    for (int seed = 0; seed < kSeeds; ++seed) renders.push_back(stage.Render(40 + seed, true).indirect);
    for (size_t i = 0; i < mean.data.size(); ++i) {
      double sum = 0, squares = 0;
      for (const ImageF& render : renders) sum += render.data[i];
      for (const ImageF& render : renders) squares += std::pow(render.data[i] - sum / kSeeds, 2);
      mean.data[i] = static_cast<float>(sum / kSeeds);
      variance->data[i] = static_cast<float>(squares / (kSeeds * (kSeeds - 1.0)));
    }
    return mean;
  };
  ImageF own_variance, shared_variance;
  const ImageF own = means(0, 128, &own_variance), shared = means(16, 32, &shared_variance);
  double squares = 0, bias = 0, brightness = 0, spread = 0;
  for (size_t i = 0; i < own.data.size(); ++i) {
    const double variance = own_variance.data[i] + shared_variance.data[i];
    const double difference = shared.data[i] - own.data[i];
    squares += difference * difference / variance / own.data.size();
    EXPECT_LT(std::abs(difference), 9 * std::sqrt(variance)) << i / 3 % 37 << ' ' << i / 3 / 37;
    bias += difference / own.data.size();
    brightness += own.data[i] / own.data.size();
    spread += own_variance.data[i] / (double(own.data.size()) * own.data.size());
  }
  // Squares of Student's t with 11 degrees of freedom each side have the mean 11/9, here of 3,219 values that
  // are not all independent.
  EXPECT_NEAR(squares, 11.0 / 9, 0.25);
  EXPECT_LT(std::abs(bias), 0.01 * brightness);
  EXPECT_LT(std::sqrt(spread), 0.01 * brightness);
}

TEST(Path, PartsAddUp) {
  Stage stage(Sphere(20, 30), Pinhole(24, 18, 12), OneGuide({3, 1, 0}));
  stage.world_from_camera.translation() = Vec3d(4, -6, 3);
  stage.options = {4, 3, 2};
  const Film film = stage.Render(5, true), whole = stage.Render(5, false);
  EXPECT_EQ(film.radiance.data, whole.radiance.data);
  EXPECT_TRUE(whole.direct.empty() && whole.indirect.empty());
  for (size_t i = 0; i < film.radiance.data.size(); ++i) {
    EXPECT_GT(film.indirect.data[i], 0);
    EXPECT_FLOAT_EQ(film.direct.data[i] + film.indirect.data[i], film.radiance.data[i]);
  }
  // Light from the wall doesn't change what comes directly.
  stage.options.bounces = 0;
  EXPECT_EQ(stage.Render(5, true).direct.data, film.direct.data);
}

TEST(Path, SameForAnyNumberOfThreads) {
  Stage stage(Sphere(20, 30), Pinhole(61, 47, 30), OneGuide({3, 1, 0}));
  stage.surface.vessels.emplace(VesselOptions{}, stage.mesh, 1);
  stage.options = {4, 3, 1};
  SetThreadCount(1);
  const Film one = stage.Render(5, true);
  SetThreadCount(2);
  const Film two = stage.Render(5, true), other = stage.Render(6, true);
  SetThreadCount(0);
  EXPECT_EQ(one.radiance.data, two.radiance.data);
  EXPECT_EQ(one.indirect.data, two.indirect.data);
  EXPECT_NE(one.radiance.data, other.radiance.data);
}

TEST(Path, PixelsThatAreNotValidStayBlack) {
  Stage stage(Sphere(20, 30), Pinhole(13, 11, 8), OneGuide());
  const Film all = stage.Render();
  for (size_t i = 0; i < stage.valid.data.size(); i += 3) stage.valid.data[i] = 0;
  const Film some = stage.Render();
  for (size_t i = 0; i < stage.valid.data.size(); ++i) {
    EXPECT_EQ(some.radiance.data[3 * i], stage.valid.data[i] ? all.radiance.data[3 * i] : 0);
  }
}

TEST(Path, CountsWhatIsNotFiniteAndNamesTheFirst) {
  Stage stage(Sphere(20, 30), Pinhole(12, 10, 8), OneGuide());
  stage.options.samples = 4;
  stage.light.sources[0].intensity.x() = std::numeric_limits<double>::infinity();
  std::fill_n(stage.valid.data.begin(), 2 * 12 + 5, uint8_t{0});
  Film film;
  const PathCount count = stage.Render(1, false, &film);
  EXPECT_EQ(count.samples, (120 - 29) * 4);
  EXPECT_EQ(count.failure.count, (120 - 29) * 4);
  EXPECT_EQ(count.failure.x, 5);
  EXPECT_EQ(count.failure.y, 2);
  EXPECT_EQ(count.failure.sample, 0);
  for (const float value : film.radiance.data) EXPECT_EQ(value, 0);
}

// Triangles of a few mm, apart from each other, out to `extent` from the anchor: how many of the rays that
// leave them meet the triangle that they leave.
int SelfHits(double extent, bool offset, int* rays) {
  Mesh mesh;
  const auto uniform = [](uint64_t a, uint64_t b) { return 2 * UniformDouble(RandomBits(31, a, b)) - 1; };
  const int count = 512;
  for (int i = 0; i < count; ++i) {
    const Vec3d middle = extent * Vec3d((i % 8) / 3.5 - 1, (i / 8 % 8) / 3.5 - 1, (i / 64) / 3.5 - 1);
    for (int corner = 0; corner < 3; ++corner) {
      Vec3d vertex = middle;
      for (int c = 0; c < 3; ++c) vertex[c] += extent / 20 * uniform(i, 3 * corner + c);
      mesh.vertices.push_back(vertex);
    }
    mesh.faces.push_back({3 * i, 3 * i + 1, 3 * i + 2});
  }
  const RayScene wall(mesh);
  int hits = 0;
  for (int i = 0; i < 200 * count; ++i) {
    const int face = i % count;
    const Vec3d normal = (i & 512 ? 1 : -1) * FaceNormal(mesh, face);
    const double u = UniformDouble(RandomBits(32, i, 0)), v = UniformDouble(RandomBits(32, i, 1)) * (1 - u);
    const Vec3d place = (1 - u - v) * mesh.vertices[3 * face] + u * mesh.vertices[3 * face + 1] +
                        v * mesh.vertices[3 * face + 2];
    const Vec3f point = wall.ToLocal(place), side = normal.cast<float>();
    const Vec2f random(UniformFloat(RandomBits(33, i, 0)), UniformFloat(RandomBits(33, i, 1)));
    const Vec3f direction = lambert::Sample(side, random);
    const RayHit hit = wall.Intersect(offset ? OffsetOrigin(point, side) : point, direction, 0, 1e30f);
    hits += hit.face == static_cast<uint32_t>(face);
    ++*rays;
  }
  return hits;
}

TEST(Path, RaysDontMeetTheTriangleThatTheyLeave) {
  for (const double extent : {0.02, 1.0, 20.0, 300.0}) {
    int rays = 0;
    EXPECT_EQ(SelfHits(extent, true, &rays), 0) << extent;
    EXPECT_GT(SelfHits(extent, false, &rays), rays / 100) << extent;
  }
}

// The offset's two branches at their border, 1/32 mm: neither is shorter than the rounding that it must outdo
// (a few 2⁻²⁴ of the coordinate) nor longer than what matters (a thousandth of a mm at 64 mm).
TEST(Path, OffsetIsShortAndToTheNormalsSide) {
  for (const float coordinate : {0.0f, 0.0312f, 0.0313f, 0.5f, 20.0f, 63.0f}) {
    for (const float sign : {1.0f, -1.0f}) {
      for (const float side : {1.0f, -1.0f}) {
        const float moved = OffsetOrigin({sign * coordinate, 0, 0}, {side, 0, 0}).x() - sign * coordinate;
        EXPECT_GT(moved * side, 8 * 0x1p-24f * coordinate) << sign * coordinate;
        EXPECT_LT(moved * side, 1e-3f) << sign * coordinate;
      }
    }
  }
}

}  // namespace
}  // namespace lumen
