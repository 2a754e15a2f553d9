// Every gradient of the reconstructor but those of ray weights (volume_test.cpp) against central differences
// in double, second order included.
#include <gtest/gtest.h>

#include <cmath>

#include "recon/training/ray_loss.h"
#include "tests/finite_difference.h"

namespace lumen {
namespace {

using test::Difference;
using test::Dot;
using test::Fill;
using test::Random;

class MlpGradients : public testing::TestWithParam<MlpShape> {};

// loss = output · A + q · B with random A, B: covers Backward, InputGradient and the second order at once.
TEST_P(MlpGradients, MatchFiniteDifferences) {
  const MlpShape shape = GetParam();
  const Mlp<double> mlp(shape);
  std::vector<double> parameters(mlp.parameter_count()), gradient(mlp.parameter_count(), 0.0);
  mlp.Initialise(5, 1, parameters.data());
  uint64_t state = 11;
  for (double& p : parameters) p += 0.1 * Random(state);
  Panel<double> input(shape.inputs, 2), by_output(shape.outputs, 2), by_gradient(shape.inputs, 2),
      input_delta;
  Fill(&input, state);
  Fill(&by_output, state, 0.1);
  Fill(&by_gradient, state, 0.1);
  Mlp<double>::Pass pass;
  auto loss = [&] {
    mlp.Forward(parameters.data(), input, shape.outputs, Mlp<double>::Keep::kBends, &pass);
    mlp.InputGradient(parameters.data(), &pass);
    return Dot(pass.value.back(), by_output) + Dot(pass.input_gradient, by_gradient);
  };
  loss();
  mlp.BackwardSecondOrder(parameters.data(), input, by_output, by_gradient, &pass, gradient.data(),
                          &input_delta);
  // Softplus bends within 1/β = 0.01: the smaller step leaves 1e-14 β³ of truncation and 1e-8 of rounding.
  const double step = shape.activation == Activation::kSoftplus ? 1e-7 : 1e-5;
  for (size_t i = 0; i < parameters.size(); i += 3) {
    const double expected = Difference(loss, &parameters[i], step);
    EXPECT_NEAR(gradient[i], expected, 1e-6 * std::max(1.0, std::abs(expected))) << "parameter " << i;
  }
  for (int i = 0; i < shape.inputs; ++i) {
    const double expected = Difference(loss, &input.At(i, 70), step);
    EXPECT_NEAR(input_delta.At(i, 70), expected, 1e-6 * std::max(1.0, std::abs(expected))) << "input " << i;
  }
}

INSTANTIATE_TEST_SUITE_P(Shapes, MlpGradients,
                         testing::Values(MlpShape{19, {32}, 16, Activation::kSquareplus},
                                         MlpShape{5, {7, 6, 5}, 3, Activation::kSquareplus},
                                         MlpShape{3, {}, 2, Activation::kSquareplus},
                                         MlpShape{1, {1}, 1, Activation::kSquareplus},
                                         MlpShape{5, {7, 9, 6}, 3, Activation::kSquareplus, 2},
                                         MlpShape{3, {5}, 2, Activation::kSquareplus, 1},
                                         MlpShape{9, {20, 20, 20, 20}, 6, Activation::kSoftplus, 2}));

// ReLU has no second order but must have a right first one.
TEST(Mlp, ReluFirstOrderMatchesFiniteDifferences) {
  const Mlp<double> mlp({6, {9, 8}, 3, Activation::kRelu});
  std::vector<double> parameters(mlp.parameter_count()), gradient(mlp.parameter_count(), 0.0);
  mlp.Initialise(3, 1, parameters.data());
  uint64_t state = 1;
  Panel<double> input(6, 1), by_output(3, 1);
  Fill(&input, state);
  Fill(&by_output, state);
  Mlp<double>::Pass pass;
  auto loss = [&] {
    mlp.Forward(parameters.data(), input, 3, Mlp<double>::Keep::kSlopes, &pass);
    return Dot(pass.value.back(), by_output);
  };
  loss();
  mlp.Backward(parameters.data(), input, by_output, &pass, gradient.data(), nullptr);
  for (size_t i = 0; i < parameters.size(); ++i) {
    EXPECT_NEAR(gradient[i], Difference(loss, &parameters[i], 1e-7), 1e-5) << "parameter " << i;
  }
}

const Eigen::AlignedBox3d kBox(Vec3d(-20, -20, -20), Vec3d(20, 22, 25));

TEST(Grid, JacobianAndTableGradientsMatchFiniteDifferences) {
  GridOptions options;
  options.levels = 4;
  options.log2_table_size = 8;  // small, so that fine levels are hashed and collide
  const Grid<double> grid(options, kBox);
  std::vector<double> tables(grid.parameter_count()), gradient(grid.parameter_count(), 0.0);
  uint64_t state = 17;
  for (double& value : tables) value = Random(state);
  Panel<double> positions(3, 1), encoding(grid.outputs(), 1), jacobian(3 * grid.outputs(), 1);
  Panel<double> delta(grid.outputs(), 1), pull(grid.outputs(), 1), direction(3, 1),
      by_jacobian(3 * grid.outputs(), 1);
  Fill(&positions, state, 19);
  Fill(&delta, state, 0.1);
  Fill(&pull, state, 0.1);
  Fill(&direction, state);
  for (int d = 0; d < 3; ++d)
    for (int r = 0; r < grid.outputs(); ++r)
      for (int s = 0; s < kTile; ++s)
        by_jacobian.Row(0, d * grid.outputs() + r)[s] = direction.Row(0, d)[s] * pull.Row(0, r)[s];
  auto loss = [&] {
    grid.EncodeWithJacobian(tables.data(), positions, &encoding, &jacobian);
    return Dot(encoding, delta) + Dot(jacobian, by_jacobian);
  };
  loss();
  for (int l = 0; l < grid.levels(); ++l)
    grid.BackwardSecondOrder(l, positions, delta, pull, direction, kTile, gradient.data());
  for (size_t i = 0; i < tables.size(); i += 7) {
    EXPECT_NEAR(gradient[i], Difference(loss, &tables[i], 1e-4), 1e-9)
        << "entry " << i;  // linear in the tables
  }
  const Panel<double> slopes = jacobian;
  Panel<double> plain(grid.outputs(), 1);
  for (int d = 0; d < 3; ++d) {
    for (int r = 0; r < grid.outputs(); ++r) {
      auto value = [&] {
        grid.Encode(tables.data(), positions, &plain);
        return plain.At(r, 9);
      };
      const double expected = Difference(value, &positions.At(d, 9), 1e-6);
      EXPECT_NEAR(slopes.At(d * grid.outputs() + r, 9), expected, 1e-7);
    }
  }
}

TEST(Loss, TermsMatchFiniteDifferences) {
  const double floor = std::pow(0.5 / 255, 2.2);
  for (double x : {0.0, 0.5 * floor, 2 * floor, 1e-3, 0.4, 3.0}) {
    auto value = [&] { return Compress(x, 1 / 2.2, floor).value; };
    EXPECT_NEAR(Compress(x, 1 / 2.2, floor).slope, Difference(value, &x, 1e-3 * std::max(x, floor)),
                1e-4 * Compress(x, 1 / 2.2, floor).slope);
  }
  // The continuation stays below half an 8-bit step, and no slope passes the bound.
  EXPECT_LT(Compress(0.0, 1 / 2.2, floor).value, 0.5 / 255);
  const double bound = std::pow(floor, 1 / 2.2 - 1) / 2.2;
  EXPECT_NEAR(Compress(0.0, 1 / 2.2, floor).slope, bound, 1e-12 * bound);
  for (double x : {-0.5, -0.05, 0.02, 0.7}) {
    auto value = [&] { return HuberLoss(x, 0.1).value; };
    EXPECT_NEAR(HuberLoss(x, 0.1).slope, Difference(value, &x), 1e-9);
  }
  Vec3d g(0.3, -0.5, 0.9), slope, unused;
  EikonalLoss(g, &slope);
  for (int d = 0; d < 3; ++d) {
    auto value = [&] { return EikonalLoss(g, &unused); };
    EXPECT_NEAR(slope[d], Difference(value, &g[d]), 1e-9);
  }
}

TEST(Loss, BoundsCountFromOneSideOnly) {
  EXPECT_EQ(PhotometricLoss(0.9, 0.8, PixelBound::kAtLeast).value, 0);
  EXPECT_GT(PhotometricLoss(0.7, 0.8, PixelBound::kAtLeast).value, 0);
  EXPECT_EQ(PhotometricLoss(0.01, 0.02, PixelBound::kAtMost).value, 0);
  EXPECT_GT(PhotometricLoss(0.03, 0.02, PixelBound::kAtMost).value, 0);
}

TEST(Shading, DerivativesMatchFiniteDifferences) {
  FrameLight<double> light;
  light.sources.push_back({Vec3d(3, 0.5, 0), Vec3d(0, 0, 1), 2.7, Vec3d(900, 800, 700)});
  light.sources.push_back({Vec3d(-2, 2, 1), Vec3d(0.1, 0, 1).normalized(), 1.1, Vec3d(300, 500, 400)});
  const Vec3d point(4, -6, 20);
  for (Reflectance kind :
       {Reflectance::kLambertian, Reflectance::kCoat, Reflectance::kFree, Reflectance::kUnlit}) {
    Vec3d output(-0.5, -1, 0.2), normal = Vec3d(-0.2, 0.4, -1).normalized();
    Vec3d ambient(0.3, 0.2, 0.1);
    const Shading<double> shading = Shade(kind, output, normal, light, point, ambient);
    for (int c = 0; c < 3; ++c) {
      auto radiance = [&] { return Shade(kind, output, normal, light, point, ambient).radiance[c]; };
      EXPECT_NEAR(shading.by_output[c], Difference(radiance, &output[c]), 1e-9);
      for (int d = 0; d < 3; ++d)
        EXPECT_NEAR(shading.by_normal(c, d), Difference(radiance, &normal[d]), 1e-9);
      EXPECT_NEAR(shading.ambient[c], ambient[c] * Difference(radiance, &ambient[c]), 1e-9);
    }
  }
}

FieldOptions SmallField(Reflectance reflectance, Interreflection interreflection) {
  FieldOptions options;
  options.reflectance = reflectance;
  options.interreflection = interreflection;
  options.ambient_hidden = {7};
  options.grid.levels = 3;
  options.grid.log2_table_size = 9;
  options.initial.radius_mm = 8;
  options.initial.reach_mm = 10;
  options.sdf_hidden = {9, 8};
  options.color_hidden = {10};
  options.features = 5;
  return options;
}

// The whole loss of a batch of rays in a lumen with two lights, by every kind of parameter.
struct LookOfWall {
  Reflectance reflectance;
  Interreflection interreflection;
  bool bounded = false;   // albedo, beside a power that is learnt
  bool as_paper = false;  // frequencies, softplus, a skip and the sphere that the network starts as
  bool linear = false;    // weights that are exact for linear colours
};
// Without it a test's name would hold the bytes of the struct's padding.
void PrintTo(const LookOfWall& look, std::ostream* out) {
  *out << "reflectance " << int(look.reflectance) << " interreflection " << int(look.interreflection)
       << (look.bounded ? " bounded" : "") << (look.as_paper ? " as the paper's" : "")
       << (look.linear ? " linear" : "");
}

// Of the first frame, with all channels exact.
RayBatch<double>::Ray RandomRay(uint64_t& state, const Vec3d& origin, double exposure,
                                const Vec3d& observed) {
  RayBatch<double>::Ray ray;
  ray.origin = origin;
  ray.direction = Vec3d(Random(state), Random(state), 1.2).normalized();
  ray.frame = 0;
  ray.exposure = exposure;
  ray.floor = 1e-6;
  ray.observed = observed;
  ray.bound = {PixelBound::kExact, PixelBound::kExact, PixelBound::kExact};
  ray.eikonal_sample = 2;
  return ray;
}
class RayLossGradient : public testing::TestWithParam<LookOfWall> {};

TEST_P(RayLossGradient, MatchesFiniteDifferences) {
  FieldOptions options = SmallField(GetParam().reflectance, GetParam().interreflection);
  options.bound_albedo = GetParam().bounded;
  options.coat.learn_ior = GetParam().interreflection == Interreflection::kNone;
  if (GetParam().as_paper) {
    options.grid.levels = 0;
    options.place_octaves = 2;
    options.direction_octaves = 2;
    options.sdf_hidden = {20, 22, 18};
    options.sdf_activation = Activation::kSoftplus;
    options.sdf_skip = 2;
    options.initial.shape = InitialShape::kSphere;
    options.unit_mm = 15;
  }
  Pose pose = Pose::Identity();
  const InitialSurface initial(options.initial, {pose}, Vec3d::Zero());
  const Field<double> field(options, initial, kBox);
  std::vector<double> parameters(field.parameter_count());
  field.Initialise(1, parameters.data());
  uint64_t state = 31;
  for (double& p : parameters) p += 0.05 * Random(state);
  if (field.has_ambient())
    parameters[field.ambient_bias_begin() + 2] = -0.3;  // so that the light between walls counts

  Light light;
  light.sources.push_back({Vec3d(1, 0.5, 0), Vec3d::UnitZ(), 2.0, Vec3d(300, 200, 150)});
  light.sources.push_back({Vec3d(-1, 0.2, 0), Vec3d::UnitZ(), 1.0, Vec3d(100, 200, 150)});
  std::vector<FrameLight<double>> lights = {LightOfFrame<double>(light, pose, Vec3d::Zero())};
  lights[0].mean_radiance = Vec3d(0.3, 0.2, 0.1);
  if (options.interreflection == Interreflection::kRadiosity) {
    auto& map = lights[0].surroundings.emplace();
    for (Vec3d& value : map.values) value = Vec3d(1 + Random(state), 1 + Random(state), 1);
  }
  std::vector<double> log_gain = {0.1};

  RayBatch<double> batch;
  batch.samples = 12;
  for (int r = 0; r < 6; ++r) {
    batch.rays.push_back(RandomRay(state, Vec3d(0.3, 0.1, -0.2), 1.3, Vec3d(0.5, 0.4, 0.3)));
    for (int k = 0; k < 12; ++k) batch.distance.push_back(1 + 1.2 * k + 0.3 * Random(state));
  }
  LossSettings<double> settings{0.9, 1 / 2.2, 0.1, 0.0, 0.1, 0.0, 0.0, 0.0, 1.0 / 6, GetParam().linear};

  RayLoss<double> ray_loss(&field);
  std::vector<double> unused(field.network_size());
  double unused_gain;
  auto loss = [&] {
    const LossTerms terms = ray_loss.Evaluate(parameters.data(), batch, lights, log_gain, settings,
                                              unused.data(), &(unused_gain = 0));
    return terms.Sum();
  };
  std::vector<double> gradient;
  double gain_gradient = 0, by_log_sharpness = 0;
  auto analytic = [&] {
    gradient.assign(field.parameter_count(), 0.0);
    const LossTerms terms = ray_loss.Evaluate(parameters.data(), batch, lights, log_gain, settings,
                                              gradient.data() + field.grid_size(), &(gain_gradient = 0));
    Field<double>::GridTrace trace;
    ray_loss.LeaveForGrid(&trace);
    for (int l = 0; l < field.grid().levels(); ++l) field.GridBackward(l, trace, gradient.data());
    by_log_sharpness = terms.by_log_sharpness;
    EXPECT_EQ(terms.active_samples, 72);
    EXPECT_GT(terms.photometric, 0.01);
  };
  int compared = 0;
  double largest = 0;
  auto compare = [&](size_t i) {
    const double expected = Difference(loss, &parameters[i], 1e-6);
    EXPECT_NEAR(gradient[i], expected, 2e-6 * std::max(0.1, std::abs(expected))) << "parameter " << i;
    largest = std::max(largest, std::abs(expected));
    compared += expected != 0;
  };
  analytic();
  for (size_t i = 0; i < field.grid_size(); i += 3) compare(i);
  for (size_t i = field.grid_size(); i < parameters.size(); ++i) compare(i);
  EXPECT_GT(compared, 200);
  EXPECT_GT(largest, 1e-2);
  auto of_log_sharpness = [&, log_sharpness = std::log(settings.sharpness)]() mutable {
    auto by = [&] {
      settings.sharpness = std::exp(log_sharpness);
      return loss();
    };
    return Difference(by, &log_sharpness);
  };
  const double kept = settings.sharpness;
  EXPECT_NEAR(by_log_sharpness, of_log_sharpness(), 1e-7);
  EXPECT_GT(std::abs(by_log_sharpness), 1e-5);
  settings.sharpness = kept;
  if (GetParam().reflectance != Reflectance::kUnlit) {
    EXPECT_NEAR(gain_gradient, Difference(loss, &log_gain[0]), 1e-7);
  }
  if (!HasAlbedo(GetParam().reflectance)) return;
  if (field.has_coat()) {
    // Without weight it is the diffuse wall, to the last bit.
    FieldOptions diffuse = options;
    diffuse.reflectance = Reflectance::kLambertian;
    const Field<double> bare(diffuse, initial, kBox);
    RayLoss<double> bare_loss(&bare);
    const double weight = parameters[field.coat_begin()];
    EXPECT_NE(
        bare_loss.Evaluate(parameters.data(), batch, lights, log_gain, settings, unused.data(), &unused_gain)
            .Sum(),
        loss());
    parameters[field.coat_begin()] = -1e4;
    EXPECT_EQ(
        bare_loss.Evaluate(parameters.data(), batch, lights, log_gain, settings, unused.data(), &unused_gain)
            .Sum(),
        loss());
    parameters[field.coat_begin()] = weight;
  }
  // The pulls act on the networks that put the numbers out and not on the weights of the samples.
  const size_t color_end = field.color_bias_begin() + 3;
  const std::vector<double> without = gradient;
  settings.albedo_weight = 0.3;
  settings.ambient_weight = 0.2;
  analytic();
  for (size_t i = color_end - 123; i < parameters.size(); ++i) compare(i);  // 10·(5 + 3) + 10 + 3·10 + 3
  // Nor do they push the level, which the last biases set.
  double pulled = 0;  // a single weight may belong to a unit that is off everywhere
  for (size_t i = color_end - 123; i < color_end - 3; ++i)
    pulled = std::max(pulled, std::abs(gradient[i] - without[i]));
  EXPECT_GT(pulled, 1e-6);
  // (of a bounded albedo the biases are not the level of its logarithm)
  for (size_t i = color_end - 3; !GetParam().bounded && i < color_end; ++i)
    EXPECT_NEAR(gradient[i], without[i], 1e-12);
  if (!field.has_ambient()) return;
  for (size_t i = field.ambient_bias_begin(); i < gradient.size(); ++i)
    EXPECT_NEAR(gradient[i], without[i], 1e-12);
  // Channels weighted by trust: the gradient is that of each channel alone times its weight, which the losses
  // of a channel alone say.
  settings.albedo_weight = settings.ambient_weight = settings.eikonal_weight = 0;
  batch.rays.resize(1);
  batch.distance.resize(batch.samples);
  const auto gradient_of = [&](double doubt, int only, double* value) {
    settings.ambient_doubt = doubt;
    for (int c = 0; c < 3; ++c) {
      const bool counts = only < 0 || c == only;
      batch.rays[0].bound[c] = counts ? PixelBound::kExact : PixelBound::kAtLeast;
      batch.rays[0].observed[c] = counts ? 0.5 : 0;  // at least black: says nothing
    }
    std::vector<double> result(field.parameter_count());
    *value = ray_loss
                 .Evaluate(parameters.data(), batch, lights, log_gain, settings,
                           result.data() + field.grid_size(), &unused_gain)
                 .photometric;
    return result;
  };
  std::vector<double> weighted(field.parameter_count());
  double trusts = 0, least = 3;
  for (int c = 0; c < 3; ++c) {
    double plain, trusted;
    const std::vector<double> alone = gradient_of(0, c, &plain);
    gradient_of(500, c, &trusted);
    trusts += trusted / plain;
    least = std::min(least, trusted / plain);
    for (size_t i = 0; i < alone.size(); ++i) weighted[i] += trusted / plain * alone[i];
  }
  EXPECT_NEAR(trusts, 3, 1e-9);
  EXPECT_LT(least, 0.9);
  double together;
  const std::vector<double> all = gradient_of(500, -1, &together);
  for (size_t i = field.grid_size(); i < all.size(); ++i) EXPECT_NEAR(all[i], weighted[i], 1e-12) << i;
}

TEST(ChannelTrust, IsLessWhereMoreComesFromTheWall) {
  const Vec3d radiance(2, 1, 0.5);
  // By hand: parts of .5, .25 and 0 with a doubt of 16 give 1/2, 16/17 and 1, in sum 83/34.
  const Vec3d trust = ChannelTrust(radiance, Vec3d(1, 0.25, 0), 16.0);
  EXPECT_NEAR(trust[0], 3 * 34.0 / 83 / 2, 1e-14);
  EXPECT_NEAR(trust[1], 3 * 34.0 / 83 * 16 / 17, 1e-14);
  EXPECT_NEAR(trust[2], 3 * 34.0 / 83, 1e-14);
  // None doubted, none lit by the wall, all alike, all black: each counts one.
  EXPECT_EQ(ChannelTrust(radiance, Vec3d(1, 0.25, 0), 0.0), Vec3d::Ones());
  EXPECT_EQ(ChannelTrust<double>(radiance, Vec3d::Zero(), 16), Vec3d::Ones());
  EXPECT_TRUE(ChannelTrust<double>(radiance, radiance / 3, 16).isApprox(Vec3d::Ones(), 1e-14));
  EXPECT_EQ(ChannelTrust<double>(Vec3d::Zero(), Vec3d::Zero(), 16), Vec3d::Ones());
  // The largest doubt, and all light from the wall: still numbers, in float too.
  const Vec3f edge = ChannelTrust(Vec3f(1, 1, 1), Vec3f(1, 1, 0), 1e6f);
  EXPECT_NEAR(edge.sum(), 3, 1e-6f);
  EXPECT_NEAR(edge[2], 3, 1e-5f);
}

// Moves a frame's camera with its rays and lights.
void MoveFrame(const double motion[kPoseNumbers], const Light& light, RayBatch<double>* batch,
               FrameLight<double>* placed) {
  const Vec3d shift(motion[0], motion[1], motion[2]), turn(motion[3], motion[4], motion[5]);
  const double angle = turn.norm();
  Pose pose = Pose::Identity();
  if (angle > 0) pose.linear() = Eigen::AngleAxisd(angle, turn / angle).toRotationMatrix();
  pose.translation() = shift;
  for (auto& ray : batch->rays) {
    ray.origin = shift;
    ray.direction = pose.linear() * ray.direction;
  }
  *placed = LightOfFrame<double>(light, pose, Vec3d::Zero());
}

// Where the colours don't see the normal, the gradient by a camera's motion is exact.
TEST(PoseGradient, MatchesFiniteDifferences) {
  const FieldOptions options = SmallField(Reflectance::kUnlit, Interreflection::kNone);
  const InitialSurface initial(options.initial, {Pose::Identity()}, Vec3d::Zero());
  const Field<double> field(options, initial, kBox);
  std::vector<double> parameters(field.parameter_count());
  field.Initialise(1, parameters.data());
  uint64_t state = 31;
  for (double& p : parameters) p += 0.05 * Random(state);
  // Directions and normals, which an unlit wall's colours see, are left out of the gradient too: take the
  // columns of the first layer that look at them.
  const size_t first = field.color_bias_begin() + 3 - (10 * (5 + 9) + 10 + 3 * 10 + 3);
  const Vec3d looks(0.9, 0.1, 0.2);
  Light light;
  light.sources.push_back({Vec3d(1, 0.5, 0), Vec3d::UnitZ(), 2.0, Vec3d(300, 200, 150)});
  RayBatch<double> start;
  start.samples = 12;
  for (int r = 0; r < 6; ++r) {
    start.rays.push_back(RandomRay(state, Vec3d::Zero(), 1, looks));
    for (int k = 0; k < 12; ++k) start.distance.push_back(1 + 1.2 * k + 0.3 * Random(state));
  }
  for (int row = 0; row < 10; ++row) {
    for (int column = 8; column < 14; ++column) parameters[first + size_t(row) * 14 + column] = 0;
  }
  LossSettings<double> settings{0.9, 1 / 2.2, 0.0, 0.0, 0.1, 0.0, 0.0, 0.0, 1.0 / 6};
  RayLoss<double> ray_loss(&field);
  std::vector<double> unused(field.network_size());
  double motion[kPoseNumbers] = {0.3, 0.1, -0.2, 0.02, -0.03, 0.05}, unused_gain = 0;
  std::vector<double> log_gain = {0.0};
  auto loss = [&](double* pose_gradient) {
    RayBatch<double> batch = start;
    std::vector<FrameLight<double>> lights(1);
    MoveFrame(motion, light, &batch, &lights[0]);
    return ray_loss
        .Evaluate(parameters.data(), batch, lights, log_gain, settings, unused.data(), &unused_gain,
                  pose_gradient)
        .Sum();
  };
  double gradient[kPoseNumbers] = {};
  loss(gradient);
  for (int i = 0; i < 3; ++i) {
    const double expected = Difference([&] { return loss(nullptr); }, &motion[i]);
    EXPECT_NEAR(gradient[i], expected, 1e-9) << i;
    EXPECT_GT(std::abs(expected), 1e-6) << i;
  }
  // A rotation on top of the one that is there: its vector adds to first order about none.
  for (double& m : motion) m = 0;
  std::fill_n(gradient, kPoseNumbers, 0.0);
  loss(gradient);
  for (int i = 3; i < kPoseNumbers; ++i) {
    const double expected = Difference([&] { return loss(nullptr); }, &motion[i]);
    EXPECT_NEAR(gradient[i], expected, 1e-9) << i;
    EXPECT_GT(std::abs(expected), 1e-6) << i;
  }
}

// On a smooth wall that the light turns against, by differences of normals over 1 mm and with one sample a
// ray for all: not exact, but a few parts in a hundred of the steepest number.
TEST(PoseGradient, FollowsTheNormalsOfALitWall) {
  FieldOptions options = SmallField(Reflectance::kLambertian, Interreflection::kNone);
  options.grid.levels = 0;
  const InitialSurface initial(options.initial, {Pose::Identity()}, Vec3d::Zero());
  const Field<double> field(options, initial, kBox);
  std::vector<double> parameters(field.parameter_count());
  field.Initialise(1, parameters.data());
  uint64_t state = 31;
  for (double& p : parameters) p += 0.05 * Random(state);
  Light light;
  light.sources.push_back({Vec3d(1, 0.5, 0), Vec3d::UnitZ(), 2.0, Vec3d(300, 200, 150)});
  RayBatch<double> start;
  constexpr int kRays = 20;
  start.samples = 400;  // 0.06 mm apart: a tenth of the wall's thickness
  for (int r = 0; r < kRays; ++r) {
    start.rays.push_back(RandomRay(state, Vec3d::Zero(), 1, Vec3d(0.3, 0.1, 0.2)));
    for (int k = 0; k < start.samples; ++k) start.distance.push_back(1 + 0.06 * k);
  }
  const LossSettings<double> settings{8, 1 / 2.2, 0.0, 0.0, 0.1, 0.0, 0.0, 0.0, 1.0 / kRays};
  RayLoss<double> ray_loss(&field);
  std::vector<double> unused(field.network_size());
  double motion[kPoseNumbers] = {}, gradient[kPoseNumbers] = {}, unused_gain = 0;
  std::vector<double> log_gain = {0.0};
  const auto loss = [&](double* pose_gradient) {
    RayBatch<double> batch = start;
    std::vector<FrameLight<double>> lights(1);
    MoveFrame(motion, light, &batch, &lights[0]);
    return ray_loss
        .Evaluate(parameters.data(), batch, lights, log_gain, settings, unused.data(), &unused_gain,
                  pose_gradient)
        .Sum();
  };
  loss(gradient);
  double expected[kPoseNumbers], steepest[2] = {0, 0};
  for (int i = 0; i < kPoseNumbers; ++i) {
    expected[i] = Difference([&] { return loss(nullptr); }, &motion[i]);
    steepest[i / 3] = std::max(steepest[i / 3], std::abs(expected[i]));
  }
  for (int i = 0; i < kPoseNumbers; ++i) EXPECT_NEAR(gradient[i], expected[i], 0.05 * steepest[i / 3]) << i;
}

INSTANTIATE_TEST_SUITE_P(
    Looks, RayLossGradient,
    testing::Values(LookOfWall{Reflectance::kLambertian, Interreflection::kNone},
                    LookOfWall{Reflectance::kLambertian, Interreflection::kNone, false, false, true},
                    LookOfWall{Reflectance::kLambertian, Interreflection::kMean},
                    LookOfWall{Reflectance::kLambertian, Interreflection::kRadiosity},
                    LookOfWall{Reflectance::kLambertian, Interreflection::kRadiosity, true},
                    LookOfWall{Reflectance::kCoat, Interreflection::kRadiosity, true},
                    LookOfWall{Reflectance::kCoat, Interreflection::kNone},
                    LookOfWall{Reflectance::kCoat, Interreflection::kRadiosity},
                    LookOfWall{Reflectance::kFree, Interreflection::kNone},
                    LookOfWall{Reflectance::kUnlit, Interreflection::kNone},
                    LookOfWall{Reflectance::kFree, Interreflection::kNone, false, true},
                    LookOfWall{Reflectance::kUnlit, Interreflection::kNone, false, true}));

}  // namespace
}  // namespace lumen
