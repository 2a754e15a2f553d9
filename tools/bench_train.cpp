// How fast the reconstructor's kernels are, forward and backward, each on one thread at the shapes that the
// presets give it: products a second beside Eigen's bare one at the same shape, bytes a second beside a copy.
// flop/s counts the multiplications and additions of the products alone, bytes/s what must be read and
// written.
#include "tools/bench_train.h"

#include <benchmark/benchmark.h>

#include <cstring>

#include "common/math.h"
#include "recon/network/adam.h"
#include "recon/surface/direction_map.h"
#include "recon/surface/field.h"
#include "recon/surface/gather.h"
#include "recon/surface/mucus_coat.h"
#include "recon/surface/shading.h"
#include "recon/surface/volume.h"
#include "recon/training/options.h"

namespace lumen {
namespace {

void StreamCopy(State& state) {
  const auto count = static_cast<size_t>(state.range(0));
  LineVector<float> from(count, 1.0f), to(count);
  for (auto _ : state) {
    std::memcpy(to.data(), from.data(), count * sizeof(float));
    benchmark::DoNotOptimize(to.data());
    benchmark::ClobberMemory();
  }
  CountBytes(state, 2.0 * double(count) * sizeof(float));
}
BENCHMARK(StreamCopy)->Arg(1 << 13)->Arg(1 << 17)->Arg(1 << 24);  // in the first, the second cache, in memory

void Adam(State& state) {
  const auto count = static_cast<size_t>(state.range(0));
  LineVector<float> parameter(count), gradient(count), first(count), second(count);
  FillRandom(&gradient, 1);
  for (auto _ : state) {
    AdamUpdate(AdamStep(1e-3, 100, 0.99), count, parameter.data(), gradient.data(), first.data(),
               second.data());
    benchmark::ClobberMemory();
  }
  CountBytes(state, 8.0 * double(count) * sizeof(float));  // all four read and written
}
BENCHMARK(Adam)->Arg(1 << 13)->Arg(1 << 20);

// Arguments: the activation; whether the derivatives are wanted.
void Activation_(State& state) {
  const auto activation = static_cast<Activation>(state.range(0));
  const bool derivatives = state.range(1) != 0;
  constexpr int kCount = 32 * kTile;
  const Panel<float> from = RandomPanel(32, 1, 0.3);
  Panel<float> a = from, slope(32, 1), bend(32, 1);
  for (auto _ : state) {
    std::copy(from.Tile(0), from.Tile(0) + kCount, a.Tile(0));
    Activate(activation, kCount, a.Tile(0), derivatives ? slope.Tile(0) : nullptr,
             derivatives ? bend.Tile(0) : nullptr);
    benchmark::ClobberMemory();
  }
  CountBytes(state, (derivatives ? 4.0 : 2.0) * kCount * sizeof(float));
}
BENCHMARK(Activation_)->Name("Activation")->ArgsProduct({{0, 1, 2}, {0, 1}});

// A field as a preset makes it, with a batch to compute on.
struct Subject {
  explicit Subject(const std::string& preset)
      : options(ReadTrainOptions(preset, {})),
        field(options.field, InitialSurface(options.field.initial, {Pose::Identity()}, Vec3d::Zero()),
              {Vec3d::Constant(-70), Vec3d::Constant(70)}),
        parameters(field.parameter_count()),
        gradient(field.parameter_count(), 0.0f) {
    field.Initialise(0, parameters.data());
    pass.positions = RandomPanel(3, kTiles, 40);
    pass.directions = RandomPanel(3, kTiles);
    pass.normal = RandomPanel(3, kTiles);
    pass.value_delta = RandomPanel(1, kTiles);
    pass.gradient_delta = RandomPanel(3, kTiles);
    pass.color_delta = RandomPanel(3, kTiles);
    pass.ambient_delta = RandomPanel(1, kTiles);
  }
  TrainOptions options;
  Field<float> field;
  LineVector<float> parameters, gradient;
  Field<float>::SurfacePass pass;
};

void GridEncode(State& state) {
  Subject subject("fast");
  const Grid<float>& grid = subject.field.grid();
  Panel<float> encoding(grid.outputs(), kTiles);
  for (auto _ : state) {
    grid.Encode(subject.parameters.data(), subject.pass.positions, &encoding);
    benchmark::ClobberMemory();
  }
  CountSamples(state, kSamples);
  CountBytes(state, 8.0 * kSamples * grid.outputs() * sizeof(float));
}
BENCHMARK(GridEncode);

void GridEncodeWithJacobian(State& state) {
  Subject subject("fast");
  const Grid<float>& grid = subject.field.grid();
  Panel<float> encoding(grid.outputs(), kTiles), jacobian(3 * grid.outputs(), kTiles);
  for (auto _ : state) {
    grid.EncodeWithJacobian(subject.parameters.data(), subject.pass.positions, &encoding, &jacobian);
    benchmark::ClobberMemory();
  }
  CountSamples(state, kSamples);
  CountBytes(state, 8.0 * kSamples * grid.outputs() * sizeof(float));
}
BENCHMARK(GridEncodeWithJacobian);

void GridBackward(State& state) {
  Subject subject("fast");
  const Grid<float>& grid = subject.field.grid();
  const Panel<float> delta = RandomPanel(grid.outputs(), kTiles), pull = delta,
                     direction = RandomPanel(3, kTiles);
  for (auto _ : state) {
    for (int l = 0; l < grid.levels(); ++l)
      grid.BackwardSecondOrder(l, subject.pass.positions, delta, pull, direction, kSamples,
                               subject.gradient.data());
    benchmark::ClobberMemory();
  }
  CountSamples(state, kSamples);
  CountBytes(state, 2 * 8.0 * kSamples * grid.outputs() * sizeof(float));  // read and written
}
BENCHMARK(GridBackward);

void FrequencyEncode(State& state) {
  const Frequency<float> frequency(6);
  const Panel<float> x = RandomPanel(3, kTiles);
  Panel<float> encoding(frequency.outputs(), kTiles);
  for (auto _ : state) {
    for (int t = 0; t < kTiles; ++t) frequency.Encode(x.Tile(t), encoding.Tile(t));
    benchmark::ClobberMemory();
  }
  CountSamples(state, kSamples);
}
BENCHMARK(FrequencyEncode);

void FrequencyBackward(State& state) {
  const Frequency<float> frequency(6);
  const Panel<float> encoding = RandomPanel(frequency.outputs(), kTiles), direction = RandomPanel(3, kTiles);
  Panel<float> change(frequency.outputs(), kTiles);
  for (auto _ : state) {
    for (int t = 0; t < kTiles; ++t) frequency.Push(encoding.Tile(t), direction.Tile(t), change.Tile(t));
    benchmark::ClobberMemory();
  }
  CountSamples(state, kSamples);
}
BENCHMARK(FrequencyBackward);

// The distance network of a preset; arguments: 0 = fast's, 1 = the paper's; 1 = with products in bfloat16.
struct Network {
  explicit Network(const State& state)
      : mlp(state.range(0) == 0 ? MlpShape{19, {32}, 16, Activation::kSquareplus}
                                : MlpShape{39, std::vector<int>(8, 256), 257, Activation::kSoftplus, 4},
            state.range(1) == 0 ? nullptr : &FastestBfloat16Kernels()),
        parameters(mlp.parameter_count()),
        gradient(mlp.parameter_count(), 0.0f),
        input(RandomPanel(mlp.shape().inputs, kTiles)),
        output_delta(RandomPanel(mlp.shape().outputs, kTiles)),
        direction(RandomPanel(mlp.shape().inputs, kTiles)) {
    mlp.Initialise(1, 1, parameters.data());
    for (const auto& matrix : mlp.matrices()) flops += 2.0 * matrix.rows * matrix.columns * kSamples;
  }
  void Forward() {
    mlp.Forward(parameters.data(), input, mlp.shape().outputs, Mlp<float>::Keep::kBends, &pass);
  }
  Mlp<float> mlp;
  LineVector<float> parameters, gradient;
  Panel<float> input, output_delta, direction, input_delta;
  Mlp<float>::Pass pass;
  double flops = 0;  // of one product with every weight
};

void NetworkForward(State& state) {
  Network network(state);
  for (auto _ : state) {
    network.Forward();
    benchmark::ClobberMemory();
  }
  CountFlops(state, network.flops);
}
BENCHMARK(NetworkForward)->ArgsProduct({{0, 1}, {0, 1}});

void NetworkInputGradient(State& state) {
  Network network(state);
  network.Forward();
  for (auto _ : state) {
    network.mlp.InputGradient(network.parameters.data(), &network.pass);
    benchmark::ClobberMemory();
  }
  // The last layer takes no product.
  const auto last = network.mlp.matrices().back();
  CountFlops(state, network.flops - 2.0 * last.rows * last.columns * kSamples);
}
BENCHMARK(NetworkInputGradient)->ArgsProduct({{0, 1}, {0, 1}});

void NetworkBackward(State& state) {
  Network network(state);
  network.Forward();
  for (auto _ : state) {
    network.mlp.Backward(network.parameters.data(), network.input, network.output_delta, &network.pass,
                         network.gradient.data(), &network.input_delta);
    benchmark::ClobberMemory();
  }
  CountFlops(state, 2 * network.flops);
}
BENCHMARK(NetworkBackward)->ArgsProduct({{0, 1}, {0, 1}});

void NetworkBackwardSecondOrder(State& state) {
  Network network(state);
  network.Forward();
  network.mlp.InputGradient(network.parameters.data(), &network.pass);
  for (auto _ : state) {
    network.mlp.BackwardSecondOrder(network.parameters.data(), network.input, network.output_delta,
                                    network.direction, &network.pass, network.gradient.data(),
                                    &network.input_delta);
    benchmark::ClobberMemory();
  }
  // Four products with every weight, but for the last layer's, which is pushed through no product.
  const auto last = network.mlp.matrices().back();
  CountFlops(state, 4 * network.flops - 4.0 * last.rows * last.columns * kSamples);
}
BENCHMARK(NetworkBackwardSecondOrder)->ArgsProduct({{0, 1}, {0, 1}});

const char* const kPresets[] = {"fast", "paper"};

void FieldValue(State& state) {
  Subject subject(kPresets[state.range(0)]);
  Field<float>::ValuePass pass;
  pass.positions = subject.pass.positions;
  for (auto _ : state) {
    subject.field.Value(subject.parameters.data(), &pass);
    benchmark::ClobberMemory();
  }
  CountSamples(state, kSamples);
}
BENCHMARK(FieldValue)->Arg(0)->Arg(1);

void FieldForward(State& state) {
  Subject subject(kPresets[state.range(0)]);
  for (auto _ : state) {
    subject.field.Surface(subject.parameters.data(), &subject.pass);
    subject.field.Color(subject.parameters.data(), &subject.pass);
    benchmark::ClobberMemory();
  }
  CountSamples(state, kSamples);
}
BENCHMARK(FieldForward)->Arg(0)->Arg(1);

void FieldBackward(State& state) {
  Subject subject(kPresets[state.range(0)]);
  subject.field.Surface(subject.parameters.data(), &subject.pass);
  subject.field.Color(subject.parameters.data(), &subject.pass);
  float* network = subject.gradient.data() + subject.field.grid_size();
  for (auto _ : state) {
    subject.field.ColorBackward(subject.parameters.data(), &subject.pass, network);
    subject.field.SurfaceBackward(subject.parameters.data(), &subject.pass, network);
    benchmark::ClobberMemory();
  }
  CountSamples(state, kSamples);
}
BENCHMARK(FieldBackward)->Arg(0)->Arg(1);

// 32 rays of 17 samples that fall through the surface.
struct Rays {
  static constexpr int kRays = 32, kPerRay = 17;
  std::vector<float> distance, occupancy, transmittance, near_share, weight, weight_delta, distance_delta;
  Rays()
      : distance(kRays * kPerRay),
        occupancy(distance.size()),
        transmittance(distance.size()),
        near_share(distance.size()),
        weight(distance.size()),
        weight_delta(distance.size(), 0.3f),
        distance_delta(distance.size()) {
    for (size_t i = 0; i < distance.size(); ++i)
      distance[i] = static_cast<float>(4 - 0.5 * double(i % kPerRay) + 0.1 * UniformDouble(RandomBits(3, i)));
  }
};

void OpacityForward(State& state) {
  Rays rays;
  for (auto _ : state) {
    for (int r = 0; r < Rays::kRays; ++r) {
      const int at = r * Rays::kPerRay;
      RayWeights(Rays::kPerRay, &rays.distance[at], 2.0f, &rays.occupancy[at], &rays.transmittance[at],
                 &rays.weight[at]);
    }
    benchmark::ClobberMemory();
  }
  CountSamples(state, Rays::kRays * Rays::kPerRay);
}
BENCHMARK(OpacityForward);

void OpacityBackward(State& state) {
  Rays rays;
  for (int r = 0; r < Rays::kRays; ++r) {
    const int at = r * Rays::kPerRay;
    RayWeights(Rays::kPerRay, &rays.distance[at], 2.0f, &rays.occupancy[at], &rays.transmittance[at],
               &rays.weight[at]);
  }
  for (auto _ : state) {
    for (int r = 0; r < Rays::kRays; ++r) {
      const int at = r * Rays::kPerRay;
      RayWeightsBackward(Rays::kPerRay, &rays.distance[at], 2.0f, &rays.occupancy[at],
                         &rays.transmittance[at], &rays.weight_delta[at], &rays.distance_delta[at]);
    }
    benchmark::ClobberMemory();
  }
  CountSamples(state, Rays::kRays * Rays::kPerRay);
}
BENCHMARK(OpacityBackward);

void WeighLinearly(Rays* rays) {
  for (int r = 0; r < Rays::kRays; ++r) {
    const int at = r * Rays::kPerRay;
    LinearRayWeights(Rays::kPerRay, &rays->distance[at], 2.0f, &rays->occupancy[at], &rays->transmittance[at],
                     &rays->near_share[at], &rays->weight[at]);
  }
}

void LinearOpacityForward(State& state) {
  Rays rays;
  for (auto _ : state) {
    WeighLinearly(&rays);
    benchmark::ClobberMemory();
  }
  CountSamples(state, Rays::kRays * Rays::kPerRay);
}
BENCHMARK(LinearOpacityForward);

void LinearOpacityBackward(State& state) {
  Rays rays;
  WeighLinearly(&rays);
  for (auto _ : state) {
    for (int r = 0; r < Rays::kRays; ++r) {
      const int at = r * Rays::kPerRay;
      LinearRayWeightsBackward(Rays::kPerRay, &rays.distance[at], 2.0f, &rays.occupancy[at],
                               &rays.transmittance[at], &rays.near_share[at], &rays.weight_delta[at],
                               &rays.distance_delta[at]);
    }
    benchmark::ClobberMemory();
  }
  CountSamples(state, Rays::kRays * Rays::kPerRay);
}
BENCHMARK(LinearOpacityBackward);

// A place under three guides off the axis; forward and backward are one.
struct Lit {
  FrameLight<float> light;
  Vec3f output{-0.5f, -1, 0.2f}, normal = Vec3f(-0.2f, 0.4f, -1).normalized(), ambient{0.3f, 0.2f, 0.1f};
  Panel<float> points = RandomPanel(3, kTiles, 20);
  Lit() {
    Light guides;
    for (int i = 0; i < 3; ++i)
      guides.sources.push_back({Vec3d(3.0 * (i - 1), i, 0), Vec3d::UnitZ(), 2.7, Vec3d(900, 800, 700)});
    light = LightOfFrame<float>(guides, Pose::Identity(), Vec3d::Zero());
  }
  Vec3f Point(int i) const { return {points.At(0, i), points.At(1, i), 25 + points.At(2, i)}; }
};

void Shading_(State& state) {
  const Lit lit;
  const auto kind = static_cast<Reflectance>(state.range(0));
  for (auto _ : state) {
    for (int i = 0; i < kSamples; ++i)
      benchmark::DoNotOptimize(Shade(kind, lit.output, lit.normal, lit.light, lit.Point(i), lit.ambient));
  }
  CountSamples(state, kSamples);
}
BENCHMARK(Shading_)->Name("Shading")->Arg(0)->Arg(1);  // lambertian, free

void ShadingOfCoat(State& state) {
  const Lit lit;
  ByCoat<float> by_coat;
  for (auto _ : state) {
    for (int i = 0; i < kSamples; ++i) {
      benchmark::DoNotOptimize(ShadeCoated(MucusCoat<float>{0.5f, 0.3f, 1.33f}, lit.output, lit.normal,
                                           lit.light, lit.Point(i), lit.ambient, &by_coat));
      benchmark::DoNotOptimize(by_coat);
    }
  }
  CountSamples(state, kSamples);
}
BENCHMARK(ShadingOfCoat);

void SurroundingsLookUp(State& state) {
  DirectionMap<float> map;
  for (size_t i = 0; i < map.values.size(); ++i) map.values[i] = Vec3f::Constant(static_cast<float>(i));
  const Panel<float> directions = RandomPanel(3, kTiles);
  for (auto _ : state) {
    for (int i = 0; i < kSamples; ++i)
      benchmark::DoNotOptimize(map.At({directions.At(0, i), directions.At(1, i), directions.At(2, i)}));
  }
  CountSamples(state, kSamples);
}
BENCHMARK(SurroundingsLookUp);

// What a camera's patches send each other once; argument: 1 = in lanes of float. A pair is a sample.
void PatchesGather(State& state) {
  constexpr int kPatches = 1024;
  std::vector<Patch> patches(kPatches);
  for (int i = 0; i < kPatches; ++i) {
    const Vec3d d = DirectionMap<double>::Direction(i % DirectionMap<double>::kCells);
    patches[i] = {20 * d, -d, 4, Vec3d::Constant(0.5), Vec3d::Ones()};
  }
  const std::vector<Vec3d> leaving(kPatches, Vec3d::Ones());
  for (auto _ : state)
    benchmark::DoNotOptimize(state.range(0) ? GatherInLanes(patches, leaving) : Gather(patches, leaving));
  CountSamples(state, kPatches * kPatches);
}
BENCHMARK(PatchesGather)->Arg(0)->Arg(1);

void InitialSurfaceEvaluate(State& state) {
  const InitialSurface initial({}, {Pose::Identity()}, Vec3d::Zero());
  const Panel<float> positions = RandomPanel(3, kTiles, 40);
  Panel<float> value(1, kTiles), gradient(3, kTiles);
  for (auto _ : state) {
    for (int t = 0; t < kTiles; ++t)
      initial.Evaluate<float>(positions.Tile(t), value.Tile(t), gradient.Tile(t));
    benchmark::ClobberMemory();
  }
  CountSamples(state, kSamples);
}
BENCHMARK(InitialSurfaceEvaluate);

}  // namespace
}  // namespace lumen

BENCHMARK_MAIN();
