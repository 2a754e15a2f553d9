#include "recon/training/trainer.h"

#include <algorithm>
#include <cmath>

#include "common/parallel.h"
#include "common/random.h"

namespace lumen {
namespace {

constexpr int kChunkRays = 32;  // also what the pulls on albedo and ambient factor take their means over

double LogInterpolate(double from, double to, double at) { return from * std::pow(to / from, at); }

}  // namespace

Eigen::AlignedBox3d SceneBounds(const std::vector<Pose>& world_from_camera,
                                const TrainOptions::Bounds& bounds) {
  Eigen::AlignedBox3d box;
  const double s = std::sqrt(0.5);
  for (const Pose& pose : world_from_camera) {
    const Vec3d center = pose.translation();
    box.extend(center - Vec3d::Constant(bounds.aside_mm));
    box.extend(center + Vec3d::Constant(bounds.aside_mm));
    for (const Vec3d& ray :
         {Vec3d(0, 0, 1), Vec3d(s, 0, s), Vec3d(-s, 0, s), Vec3d(0, s, s), Vec3d(0, -s, s)}) {
      box.extend(center + bounds.ahead_mm * (pose.linear() * ray));
    }
  }
  return box;
}

Trainer::Trainer(const TrainingFrames& frames, const TrainOptions& options, uint64_t seed)
    : frames_(frames), options_(options), seed_(seed) {
  const Eigen::AlignedBox3d bounds = SceneBounds(frames.world_from_camera(), options.bounds);
  origin_ = bounds.center();
  const Vec3d half = bounds.sizes() / 2;
  const InitialSurface initial(options.field.initial, frames.world_from_camera(), origin_);
  field_ = std::make_unique<Field<float>>(options.field, initial, Eigen::AlignedBox3d(-half, half));
  for (const Pose& pose : frames.world_from_camera()) {
    lights_.push_back(LightOfFrame<float>(frames.light(), pose, origin_));
    if (!field_->has_ambient()) continue;
    lights_.back().mean_radiance = frames.MeanRadiance(static_cast<int>(lights_.size()) - 1).cast<float>();
  }
  for (int begin = 0; begin < options.sampling.rays; begin += kChunkRays) {
    auto chunk = std::make_unique<Chunk>(field_.get());
    chunk->batch.rays.resize(std::min(kChunkRays, options.sampling.rays - begin));
    chunk->network_gradient.assign(field_->network_size(), 0.0f);
    chunk->log_gain_gradient.assign(frames.size(), 0.0f);
    chunks_.push_back(std::move(chunk));
  }
  const size_t count = field_->parameter_count();
  state_.parameters.resize(count);
  state_.first.assign(count, 0.0f);
  state_.second.assign(count, 0.0f);
  gradient_.assign(count, 0.0f);
  state_.log_gain.assign(frames.size(), 0.0f);
  state_.log_gain_first = state_.log_gain_second = state_.log_gain;
  field_->Initialise(seed, state_.parameters.data());
  if (options.field.reflectance != Reflectance::kUnlit) MatchColorsToInitialSurface(initial);
}

// Starts the colours where they explain the pixels' median brightness on the initial surface. From anywhere
// else the first steps would move the surface, which answers faster, to make up for the colours, and a wrong
// scale is a trap: a dark wall that is near looks much like a bright one that is far.
void Trainer::MatchColorsToInitialSurface(const InitialSurface& initial) {
  constexpr int kRays = 1024;
  constexpr float kSharp = 1e3f;  // 1/mm: all surface samples lie within a hundredth of a mm of the surface
  RayBatch<float> batch;
  batch.rays.resize(kRays);
  const uint64_t key = RandomBits(seed_, 0x636f6c6f7273ull);
  for (int r = 0; r < kRays; ++r) frames_.Draw(RandomBits(key, r), origin_, &batch.rays[r]);
  Marcher(field_.get()).Place(state_.parameters.data(), options_.sampling, kSharp, key, &batch);
  Panel<float> positions(3, TilesFor(kRays)), value(1, TilesFor(kRays)), normal(3, TilesFor(kRays));
  for (int r = 0; r < kRays; ++r) {
    const float t = batch.distance[size_t(r + 1) * batch.samples - 1];
    for (int d = 0; d < 3; ++d) positions.At(d, r) = batch.rays[r].origin[d] + t * batch.rays[r].direction[d];
  }
  for (int tile = 0; tile < positions.tiles(); ++tile) {
    initial.Evaluate<float>(positions.Tile(tile), value.Row(tile, 0), normal.Tile(tile));
  }
  std::vector<float> log_ratio[3];
  for (int r = 0; r < kRays; ++r) {
    const auto& ray = batch.rays[r];
    const Vec3f n(normal.At(0, r), normal.At(1, r), normal.At(2, r));
    const Vec3f point(positions.At(0, r), positions.At(1, r), positions.At(2, r));
    const Shading<float> shading =
        Shade<float>(options_.field.reflectance, Vec3f::Zero(), n, lights_[ray.frame], point, Vec3f::Zero());
    for (int c = 0; c < 3; ++c) {
      if (ray.bound[c] != PixelBound::kExact || !(shading.radiance[c] > 0)) continue;
      const float linear = std::pow(ray.observed[c], 1 / static_cast<float>(frames_.inverse_gamma()));
      log_ratio[c].push_back(std::log(linear / (ray.exposure * shading.radiance[c])));
    }
  }
  float* bias = &state_.parameters[field_->color_bias_begin()];
  for (int c = 0; c < 3; ++c) {
    if (log_ratio[c].empty()) continue;
    auto middle = log_ratio[c].begin() + static_cast<std::ptrdiff_t>(log_ratio[c].size() / 2);
    std::nth_element(log_ratio[c].begin(), middle, log_ratio[c].end());
    bias[c] = *middle;
  }
}

LossSettings<float> Trainer::SettingsAt(double progress) const {
  const auto& schedule = options_.schedule;
  LossSettings<float> settings;
  settings.sharpness = static_cast<float>(
      LogInterpolate(schedule.sharpness_start_per_mm, schedule.sharpness_end_per_mm, progress));
  settings.inverse_gamma = static_cast<float>(frames_.inverse_gamma());
  settings.eikonal_weight = static_cast<float>(options_.loss.eikonal);
  const bool lambertian = options_.field.reflectance == Reflectance::kLambertian;
  settings.albedo_weight =
      lambertian ? static_cast<float>(options_.loss.albedo * std::pow(options_.loss.albedo_final, progress))
                 : 0.0f;
  settings.albedo_width = static_cast<float>(options_.loss.albedo_width);
  settings.ambient_weight = static_cast<float>(options_.loss.ambient);
  settings.weight_threshold = static_cast<float>(options_.sampling.weight_threshold);
  settings.per_ray = 1.0f / static_cast<float>(options_.sampling.rays);
  return settings;
}

void Trainer::RunChunk(int index, const LossSettings<float>& settings) {
  Chunk& chunk = *chunks_[index];
  const uint64_t step_key = RandomBits(seed_, 0x7261797300ull, static_cast<uint64_t>(state_.iteration));
  for (size_t r = 0; r < chunk.batch.rays.size(); ++r) {
    frames_.Draw(RandomBits(step_key, static_cast<uint64_t>(index) * kChunkRays + r), origin_,
                 &chunk.batch.rays[r]);
  }
  chunk.marcher.Place(state_.parameters.data(), options_.sampling, settings.sharpness,
                      RandomBits(step_key, static_cast<uint64_t>(index), 1), &chunk.batch);
  chunk.terms = chunk.loss.Evaluate(state_.parameters.data(), chunk.batch, lights_, state_.log_gain, settings,
                                    chunk.network_gradient.data(), chunk.log_gain_gradient.data());
  double sum = chunk.terms.Sum();
  for (float g : chunk.network_gradient) sum += g;
  chunk.finite = std::isfinite(sum) && chunk.loss.GridGradientIsFinite();
}

bool Trainer::GradientsAreFinite() const {
  return std::all_of(chunks_.begin(), chunks_.end(), [](const auto& chunk) { return chunk->finite; });
}

void Trainer::UpdateNetworks(const AdamStep& step) {
  const size_t begin = field_->grid_size();
  for (auto& chunk : chunks_) {
    for (size_t i = 0; i < field_->network_size(); ++i) gradient_[begin + i] += chunk->network_gradient[i];
    std::fill(chunk->network_gradient.begin(), chunk->network_gradient.end(), 0.0f);
  }
  AdamUpdate(step, field_->network_size(), &state_.parameters[begin], &gradient_[begin], &state_.first[begin],
             &state_.second[begin]);
}

void Trainer::UpdateGains(const AdamStep& step) {
  std::vector<float> gradient(state_.log_gain.size(), 0.0f);
  for (auto& chunk : chunks_) {
    for (size_t i = 0; i < gradient.size(); ++i) gradient[i] += chunk->log_gain_gradient[i];
    std::fill(chunk->log_gain_gradient.begin(), chunk->log_gain_gradient.end(), 0.0f);
  }
  if (frames_.gains_known() || options_.field.reflectance == Reflectance::kUnlit) return;
  // The first frame's gain is 1: the others' are relative to it.
  AdamUpdate(step, gradient.size() - 1, state_.log_gain.data() + 1, gradient.data() + 1,
             state_.log_gain_first.data() + 1, state_.log_gain_second.data() + 1);
}

StepReport Trainer::Step(double progress) {
  const LossSettings<float> settings = SettingsAt(progress);
  StepReport report;
  report.sharpness_per_mm = settings.sharpness;
  ParallelFor(0, static_cast<int64_t>(chunks_.size()),
              [&](int64_t i) { RunChunk(static_cast<int>(i), settings); });
  for (const auto& chunk : chunks_) report.loss += chunk->terms;
  ++state_.iteration;
  if (!GradientsAreFinite()) {
    report.skipped = true;
    if (state_.skipped_steps++ == 0) state_.first_skipped_step = state_.iteration - 1;
    for (auto& chunk : chunks_) {
      std::fill(chunk->network_gradient.begin(), chunk->network_gradient.end(), 0.0f);
      std::fill(chunk->log_gain_gradient.begin(), chunk->log_gain_gradient.end(), 0.0f);
    }
    return report;
  }
  const double rate =
      LogInterpolate(options_.schedule.learning_rate,
                     options_.schedule.learning_rate * options_.schedule.learning_rate_final, progress);
  const AdamStep step(rate, state_.iteration);
  const int levels = field_->grid().levels();
  ParallelFor(0, levels + 1, [&](int64_t task) {
    if (task == levels) return UpdateNetworks(step);
    // From the finest level on, which has the most to do.
    const int level = levels - 1 - static_cast<int>(task);
    for (auto& chunk : chunks_) chunk->loss.GridBackward(level, gradient_.data());
    const size_t begin = field_->grid().level_begin(level);
    AdamUpdate(step, field_->grid().level_size(level), &state_.parameters[begin], &gradient_[begin],
               &state_.first[begin], &state_.second[begin]);
  });
  UpdateGains(step);
  return report;
}

}  // namespace lumen
