// What the preset `paper` is made of: the network's activation, its geometric start, frequencies, weight
// normalisation, importance samples; and a small version of it as a whole.
#include <gtest/gtest.h>

#include <cmath>

#include "common/parallel.h"
#include "recon/evaluation/mesh_check.h"
#include "recon/network/product.h"
#include "recon/network/weight_norm.h"
#include "recon/surface/extract.h"
#include "recon/training/importance.h"
#include "recon/training/trainer.h"
#include "tests/finite_difference.h"
#include "tests/mesh_checks.h"
#include "tests/small_sequence.h"

namespace lumen {
namespace {

using test::Difference;
using test::Random;

TEST(Softplus, SingleAndDoublePrecisionFollowTheDefinition) {
  alignas(64) double a[kTile], slope[kTile], bend[kTile];
  alignas(64) float single[kTile], single_slope[kTile], single_bend[kTile];
  const auto in_long = [](double x) { return std::log1p(std::exp(100.0L * x)) / 100; };
  for (double size : {1e-30, 1e-3, 0.01, 0.1, 1.0, 1e3}) {
    uint64_t state = 3;
    for (int i = 0; i < kTile; ++i) single[i] = static_cast<float>(a[i] = float(size * Random(state)));
    double at[kTile];
    std::copy(a, a + kTile, at);
    Activate(Activation::kSoftplus, kTile, a, slope, bend);
    Activate(Activation::kSoftplus, kTile, single, single_slope, single_bend);
    for (int i = 0; i < kTile; ++i) {
      const double expected = at[i] > 1 ? at[i] : double(in_long(at[i]));
      EXPECT_NEAR(a[i], expected, 1e-15 * std::max(1.0, std::abs(expected))) << at[i];
      EXPECT_NEAR(slope[i], 1 / (1 + std::exp(-100 * at[i])), 1e-14);
      EXPECT_NEAR(bend[i], 100 * slope[i] * (1 - slope[i]), 1e-12);
      // Exp is good to 2 units in the last place, the sums around it to a few more.
      EXPECT_NEAR(single[i], a[i], 1e-8 + 2e-7 * std::abs(a[i])) << at[i];
      EXPECT_NEAR(single_slope[i], slope[i], 1e-6) << at[i];
      EXPECT_NEAR(single_bend[i], bend[i], 1e-4) << at[i];
    }
  }
}

TEST(Frequency, RowsAndDerivativesAreThoseOfSinesAndCosines) {
  constexpr int kOctaves = 6;
  const Frequency<double> frequency(kOctaves);
  Panel<double> x(3, 1), encoding(frequency.outputs(), 1), q(frequency.outputs(), 1),
      change(frequency.outputs(), 1), direction(3, 1), gradient(3, 1);
  uint64_t state = 5;
  test::Fill(&x, state);
  test::Fill(&q, state);
  test::Fill(&direction, state);
  auto along = [&] {
    frequency.Encode(x.Tile(0), encoding.Tile(0));
    double sum = 0;
    for (int r = 0; r < frequency.outputs(); ++r) sum += q.At(r, 7) * encoding.At(r, 7);
    return sum;
  };
  along();
  for (int k = 0; k < kOctaves; ++k) {
    for (int d = 0; d < 3; ++d) {
      EXPECT_NEAR(encoding.At(6 * k + d, 7), std::sin(std::ldexp(x.At(d, 7), k)), 1e-13);
      EXPECT_NEAR(encoding.At(6 * k + 3 + d, 7), std::cos(std::ldexp(x.At(d, 7), k)), 1e-13);
    }
  }
  gradient.SetZero();
  frequency.AddGradient(encoding.Tile(0), q.Tile(0), 3.0, gradient.Tile(0));
  frequency.Push(encoding.Tile(0), direction.Tile(0), change.Tile(0));
  double pushed = 0, pulled = 0;
  for (int r = 0; r < frequency.outputs(); ++r) pushed += q.At(r, 7) * change.At(r, 7);
  for (int d = 0; d < 3; ++d) {
    EXPECT_NEAR(gradient.At(d, 7), 3 * Difference(along, &x.At(d, 7)), 1e-5);  // 10⁻¹⁰ · 32³ of truncation
    pulled += gradient.At(d, 7) * direction.At(d, 7) / 3;
  }
  EXPECT_NEAR(pushed, pulled, 1e-12);
}

TEST(WeightNorm, GradientMatchesFiniteDifferences) {
  WeightNorm<double> norm(12);
  norm.Add(1, 2, 3);
  norm.Add(8, 1, 4);
  std::vector<double> learnt(15), weights(12), by_weight(12);
  uint64_t state = 9;
  for (double& value : learnt) value = Random(state);
  for (double& value : by_weight) value = Random(state);
  auto loss = [&] {
    norm.Expand(learnt.data(), weights.data());
    double sum = 0;
    for (int i = 0; i < 12; ++i) sum += by_weight[i] * weights[i] * weights[i];
    return sum;
  };
  loss();
  std::vector<double> gradient(15);
  for (int i = 0; i < 12; ++i) gradient[i] = 2 * by_weight[i] * weights[i];
  norm.PullBack(learnt.data(), gradient.data());
  for (int i = 0; i < 15; ++i) EXPECT_NEAR(gradient[i], Difference(loss, &learnt[i]), 1e-8) << i;
  // The lengths that leave the weights as they are; a row of zeros stays and gets no gradient.
  std::fill(learnt.begin() + 1, learnt.begin() + 4, 0.0);
  norm.Initialise(learnt.data());
  norm.Expand(learnt.data(), weights.data());
  for (int i = 0; i < 12; ++i) EXPECT_NEAR(weights[i], learnt[i], 1e-15);
  std::fill(gradient.begin(), gradient.end(), 1.0);
  norm.PullBack(learnt.data(), gradient.data());
  EXPECT_EQ(gradient[2], 0);
  EXPECT_EQ(gradient[12], 0);
}

// Of panels that are wide, narrow, and too many to go through the cache together.
TEST(Product, OuterProductsAreEigens) {
  using Rows = Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>;
  for (const auto& [outputs, inputs, tiles] :
       {std::tuple(7, 289, 3), {64, 64, 2}, {257, 65, 2}, {5, 63, 2}, {300, 40, 9}, {1, 1, 1}}) {
    Panel<double> y(outputs, tiles), x(inputs, tiles);
    uint64_t state = 77;
    test::Fill(&y, state);
    test::Fill(&x, state);
    Rows gradient = Rows::Constant(outputs, inputs, 0.5), expected = gradient;
    Eigen::VectorXd bias = Eigen::VectorXd::Constant(outputs, 0.25), expected_bias = bias;
    AccumulateOuter(y, x, gradient.data(), bias.data());
    for (int tile = 0; tile < tiles; ++tile) {
      const Eigen::Map<const Rows> a(y.Tile(tile), outputs, kTile), b(x.Tile(tile), inputs, kTile);
      expected += a * b.transpose();
      expected_bias += a.rowwise().sum();
    }
    EXPECT_LT((gradient - expected).cwiseAbs().maxCoeff(), 1e-12) << outputs << " " << inputs;
    EXPECT_LT((bias - expected_bias).cwiseAbs().maxCoeff(), 1e-12);
  }
}

// NeuS's start is a sphere in expectation over the weights; 256 numbers a layer are some tenths off in the
// gradient. Softplus is above 0 at 0, by log 2/100 in every number of every layer, which lowers the top.
TEST(Paper, NetworkStartsAsASphereAroundTheCameras) {
  const TrainOptions options = ReadTrainOptions("paper", {"initial.shape=sphere", "initial.radius_mm=24"});
  Pose pose = Pose::Identity();
  pose.translation() = Vec3d(0, 0, 10);
  const InitialSurface initial(options.field.initial, {pose}, Vec3d::Zero());
  EXPECT_NEAR(initial.radius_mm(), 34, 1e-12);
  const Field<float> field(options.field, initial, {Vec3d::Constant(-80), Vec3d::Constant(80)});
  std::vector<float> parameters(field.parameter_count());
  field.Initialise(0, parameters.data());
  Field<float>::SurfacePass pass;
  pass.positions.Resize(3, 1);
  uint64_t state = 3;
  for (int i = 0; i < 3 * kTile; ++i) pass.positions.Tile(0)[i] = static_cast<float>(45 * Random(state));
  field.Surface(parameters.data(), &pass);
  for (int i = 0; i < kTile; ++i) {
    const Vec3d x(pass.positions.At(0, i), pass.positions.At(1, i), pass.positions.At(2, i));
    EXPECT_NEAR(pass.value.At(0, i), 34 - x.norm(), 10);
    const double inside = x.norm() < 17 ? 1 : x.norm() > 45 ? -1 : 0;  // between them it may be either
    EXPECT_GE(inside * pass.value.At(0, i), 0);
    const Vec3d gradient(pass.gradient.At(0, i), pass.gradient.At(1, i), pass.gradient.At(2, i));
    EXPECT_LT((gradient + x.normalized()).norm(), 0.7);
  }
}

TEST(Importance, SamplesGatherWhereTheSurfaceIs) {
  FieldOptions options;
  options.initial.radius_mm = 20;
  options.initial.reach_mm = 0;
  const InitialSurface initial(options.initial, {Pose::Identity()}, Vec3d::Zero());
  const Field<float> field(options, initial, {Vec3d::Constant(-60), Vec3d::Constant(60)});
  std::vector<float> parameters(field.parameter_count(), 0.0f);  // nothing but the sphere
  TrainOptions::Sampling sampling;
  sampling.kind = SamplerKind::kImportance;
  RayBatch<float> batch;
  batch.rays.resize(5);
  uint64_t state = 1;
  for (auto& ray : batch.rays) {
    ray.origin = Vec3f(3, 0, 0);
    ray.direction = Vec3f(Random(state), Random(state), 1).normalized();
  }
  const auto sampler = MakeRaySampler(sampling, &field);
  sampler->Place(parameters.data(), sampling, 1, 7, &batch);
  ASSERT_EQ(batch.samples, 128);
  ASSERT_EQ(batch.distance.size(), 5u * 128);
  for (size_t r = 0; r < 5; ++r) {
    const float* distance = &batch.distance[r * 128];
    EXPECT_TRUE(std::is_sorted(distance, distance + 128));
    EXPECT_GE(distance[0], kNearest_mm);
    const auto& ray = batch.rays[r];
    EXPECT_LE(distance[127], FarthestSample(field.box(), ray.origin, ray.direction));
    int near = 0;
    for (int k = 0; k < 128; ++k)
      near += std::abs((ray.origin + distance[k] * ray.direction).norm() - 20) < 1;
    // Uniform ones alone would be 64 in some 55 mm or more: two or three.
    EXPECT_GT(near, 40) << r;
  }
}

TrainOptions SmallPaper() {
  return ReadTrainOptions(
      "paper", {"network.sdf_hidden=[64, 64, 64, 64]", "network.sdf_skip=2", "network.color_hidden=[32, 32]",
                "network.features=16", "sampling.rays=48", "sampling.uniform=24", "sampling.rounds=2",
                "sampling.round=8", "schedule.learning_rate=2e-3"});
}

// Whatever the threads, and whether the steps are one trainer's or a state is handed on.
TEST(Paper, AStepFollowsFromTheStateAlone) {
  const TrainOptions options = SmallPaper();
  const TrainingFrames frames(test::SmallSequence(), options.frames, true);
  Trainer whole(frames, options, 5), first(frames, options, 5), second(frames, options, 5);
  SetThreadCount(1);
  for (int step = 0; step < 6; ++step) whole.Step(step / 10.0);
  SetThreadCount(2);
  for (int step = 0; step < 3; ++step) first.Step(step / 10.0);
  second.state() = first.state();
  for (int step = 3; step < 6; ++step) second.Step(step / 10.0);
  SetThreadCount(0);
  EXPECT_EQ(whole.state().parameters, second.state().parameters);
  EXPECT_EQ(whole.state().log_sharpness, second.state().log_sharpness);
  EXPECT_NE(whole.state().parameters, first.state().parameters);
  EXPECT_NE(whole.state().log_sharpness, first.state().log_sharpness);
}

TEST(Paper, ASmallOneLearnsAndEndsWithAClosedMesh) {
  constexpr int kSteps = 200;
  const TrainOptions options = SmallPaper();
  const TrainingFrames frames(test::SmallSequence(), options.frames, true);
  Trainer trainer(frames, options, 0);
  double first = 0, last = 0, sharpness = 0;
  for (int step = 0; step < kSteps; ++step) {
    const StepReport report = trainer.Step(double(step) / kSteps);
    ASSERT_FALSE(report.skipped) << step;
    if (step < 20) first += report.loss.photometric;
    if (step >= kSteps - 20) last += report.loss.photometric;
    sharpness = report.sharpness_per_mm;
  }
  EXPECT_LT(last, 0.75 * first);
  EXPECT_GT(std::abs(std::log(sharpness / options.schedule.sharpness_start_per_mm)), 0.05);  // it is learnt
  ExtractOptions extract;
  extract.cell_mm = 2;
  const Mesh mesh = ExtractMesh(trainer.field(), trainer.Weights(), trainer.origin(), extract);
  EXPECT_TRUE(IsManifoldAndClosed(mesh));
  // It holds the lumen that the cameras were in.
  EXPECT_GT(test::Volume(mesh), 1e4);
}

}  // namespace
}  // namespace lumen
