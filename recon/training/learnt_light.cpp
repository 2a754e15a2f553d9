#include "recon/training/learnt_light.h"

#include <limits>

#include "common/error.h"
#include "common/files.h"
#include "common/parallel.h"
#include "recon/training/checkpoint.h"
#include "recon/training/meet_surface.h"
#include "recon/training/surroundings.h"
#include "recon/training/trainer.h"

namespace lumen {
namespace {

// More than a look-up a mm of the bounds' 100: training meets folds' edges with many rays, a picture with one
// a pixel.
constexpr int kLookUps = 128;

RunOptions OptionsOf(const std::filesystem::path& run) {
  const std::filesystem::path file = run / "config.toml";
  if (!std::filesystem::exists(file)) {
    throw InputError(file.string() +
                     ": there is none; name the mesh.ply in the folder of the run that made it");
  }
  const RunOptions options = ReadRunOptions(file);
  if (!HasAlbedo(options.train.field.reflectance)) {
    throw InputError(
        file.string() +
        ": this wall has no albedo; train with network.reflectance = \"lambertian\" or \"coat\"");
  }
  return options;
}

}  // namespace

struct LearntLight::State {
  State(const std::filesystem::path& run, const Sequence& sequence)
      : options(OptionsOf(run)),
        indices(UniformFrames(static_cast<int>(sequence.frames.size()), options.train.frames)),
        frames(FramesFor(sequence, options.train, options.seed)),
        trainer(frames, options.train, options.seed),
        camera(sequence.calibration.camera),
        valid(ValidPixels(sequence.calibration)) {
    ReadCheckpoint(run / "checkpoint", options.text, &trainer.state());
    const std::vector<Pose> refined = trainer.Poses();
    weights = trainer.Weights();
    const bool by_radiosity = options.train.field.interreflection == Interreflection::kRadiosity;
    for (int i = 0; i < frames.size(); ++i) {
      lights.push_back(LightOfFrame<float>(frames.light(), refined[i], trainer.origin()));
      lights[i].mean_radiance = frames.MeanRadiance(i).cast<float>();
    }
    ParallelFor(0, by_radiosity ? frames.size() : 0, [&](int64_t i) {
      lights[i].surroundings = SurroundingsOf(trainer.field(), weights, options.train.sampling, lights[i]);
    });
  }

  RunOptions options;
  std::vector<int> indices;
  TrainingFrames frames;
  Trainer trainer;
  Camera<double> camera;
  Image8 valid;
  const float* weights;
  std::vector<FrameLight<float>> lights;
};

LearntLight::LearntLight(const std::filesystem::path& run, const Sequence& sequence)
    : state_(std::make_unique<State>(run, sequence)) {}
LearntLight::~LearntLight() = default;

const std::vector<int>& LearntLight::frames() const { return state_->indices; }

LightFrame LearntLight::At(int n, int stride) const {
  const State& state = *state_;
  const int width = (state.valid.width + stride - 1) / stride,
            height = (state.valid.height + stride - 1) / stride;
  const float nothing = std::numeric_limits<float>::quiet_NaN();
  const ImageF rgb(width, height, 3, nothing);
  LightFrame result{rgb, rgb, rgb, ImageF(width, height, 1, nothing)};
  const FrameLight<float>& light = state.lights[n];
  TrainOptions::Sampling sampling = state.options.train.sampling;
  sampling.coarse = kLookUps;
  ParallelFor(0, height, [&](int64_t row) {
    RayBatch<float> batch;
    std::vector<int> columns;
    for (int x = 0; x < width; ++x) {
      const int pixel_x = x * stride, pixel_y = static_cast<int>(row) * stride;
      if (*state.valid.Pixel(pixel_x, pixel_y) == 0) continue;
      const Vec3f ray = state.camera.Unproject(Vec2d(pixel_x, pixel_y)).value().cast<float>();
      columns.push_back(x);
      auto& added = batch.rays.emplace_back();
      added.origin = light.camera;
      added.direction = light.camera_from_field.transpose() * ray;
      added.frame = n;
    }
    if (columns.empty()) return;
    MeetSurface(state.trainer.field(), state.weights, sampling, 0, &batch);
    RayLoss<float> look(&state.trainer.field());
    const auto walls = look.LookAtLast(state.weights, batch, state.lights, state.trainer.state().log_gain);
    for (size_t i = 0; i < columns.size(); ++i) {
      const auto& wall = walls[i];
      if (wall.beyond) continue;
      const int x = columns[i], y = static_cast<int>(row);
      for (int c = 0; c < 3; ++c) {
        result.albedo.Pixel(x, y)[c] = wall.albedo[c];
        result.direct.Pixel(x, y)[c] = wall.direct[c];
        result.indirect.Pixel(x, y)[c] = wall.indirect[c];
      }
      *result.distance_mm.Pixel(x, y) = batch.distance[(i + 1) * batch.samples - 1];
    }
  });
  return result;
}

}  // namespace lumen
