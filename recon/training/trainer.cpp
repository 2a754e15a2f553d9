#include "recon/training/trainer.h"

#include <algorithm>
#include <atomic>
#include <cmath>
#include <limits>
#include <numeric>
#include <span>

#include "common/parallel.h"
#include "common/random.h"
#include "recon/training/hue_slope.h"
#include "recon/training/initial_reach.h"
#include "recon/training/meet_surface.h"
#include "recon/training/memory.h"
#include "recon/training/surroundings.h"

namespace lumen {
namespace {

constexpr int64_t kSurroundingsEvery = 250;  // iterations

constexpr size_t kCamerasAStep = 2 * kTile;  // that are kept in the lumen

constexpr int kSettledLooks = 2;  // times as many look-ups find the surface of a run that settles

// Of the logarithm of the learnt power to that of the one that is given. Between power and albedo pixels tell
// by the light between walls alone, so that little is enough; and a power that is given wrong, such that
// albedos would have to pass 1, is learnt against it.
constexpr float kPowerPull = 1e-4f;

// Logarithm of how many times too small a given power is taken to be at the start. Where the frames ask for
// more than a thousand, the light's shape is wrong rather than its power: under too narrow a beam the rim
// asks for any power, and with that the middle is so bright that the wall flees it.
constexpr float kLargestPowerStart = 6.9f;

constexpr double kLongestFog = 0.2;  // as a part of the run: a short one, too, is to end with a wall

// In lanes, so that no addition waits for the one before.
template <class Vector>
double SumOfSizes(const Vector& values) {
  constexpr size_t kLanes = 8;
  double lanes[kLanes] = {};
  size_t i = 0;
  for (; i + kLanes <= values.size(); i += kLanes)
    for (size_t lane = 0; lane < kLanes; ++lane) lanes[lane] += std::abs(values[i + lane]);
  for (; i < values.size(); ++i) lanes[0] += std::abs(values[i]);
  return std::accumulate(lanes, lanes + kLanes, 0.0);
}

// Whether all that goes back to the grid is below kLargestGradient: a sum of sizes isn't if any of them
// isn't. A sum a lane, so that it takes no time.
bool IsFinite(const Field<float>::GridTrace& trace) {
  float sum[kTile] = {};
  for (const Panel<float>* panel : {&trace.delta, &trace.direction, &trace.pull}) {
    for (int row = 0; row < panel->tiles() * panel->rows(); ++row)
      for (int s = 0; s < kTile; ++s) sum[s] += std::abs(panel->Tile(0)[row * kTile + s]);
  }
  float total = 0;
  for (float lane : sum) total += lane;
  return total < static_cast<float>(kLargestGradient);
}

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
  InitialSurfaceOptions start = options.field.initial;
  if (start.fit_reach && start.shape == InitialShape::kTube &&
      options.field.reflectance != Reflectance::kUnlit) {
    start.reach_mm = FitReach(frames, start, options.bounds.ahead_mm, RandomBits(seed, 0x7265616368ull));
  }
  const InitialSurface initial(start, frames.world_from_camera(), origin_);
  field_ = std::make_unique<Field<float>>(options.field, initial, Eigen::AlignedBox3d(-half, half));
  for (const Pose& pose : frames.world_from_camera()) {
    lights_.push_back(LightOfFrame<float>(frames.light(), pose, origin_));
    if (!field_->has_ambient() || has_surroundings()) continue;
    lights_.back().mean_radiance = frames.MeanRadiance(static_cast<int>(lights_.size()) - 1).cast<float>();
  }
  for (int begin = 0; begin < options.sampling.rays; begin += kChunkRays) {
    Chunk chunk;
    chunk.rays = std::min(kChunkRays, options.sampling.rays - begin);
    chunk.log_gain_gradient.assign(frames.size(), 0.0f);
    if (options.poses.refine) chunk.pose_gradient.assign(size_t(frames.size()) * kPoseNumbers, 0.0f);
    chunks_.push_back(std::move(chunk));
  }
  update_clocks_.resize(field_->grid().levels() + 1);
  free_space_ = std::make_unique<FreeSpace<float>>(field_.get());
  network_gradients_ = std::make_unique<OrderedSum>(field_->network_size());
  norm_ = field_->Normalisation();
  const size_t count = field_->parameter_count() + norm_.lengths();
  state_.parameters.resize(count);
  state_.first.assign(count, 0.0f);
  state_.second.assign(count, 0.0f);
  gradient_.assign(count, 0.0f);
  state_.log_gain.assign(frames.size(), 0.0f);
  state_.log_gain_first = state_.log_gain_second = state_.log_gain;
  state_.log_sharpness[0] = static_cast<float>(std::log(options.schedule.sharpness_start_per_mm));
  if (options.poses.refine) state_.poses.Resize(frames.size());
  if (has_surroundings()) {
    state_.surroundings.assign(static_cast<size_t>(frames.size()) * DirectionMap<float>::kCells * 3, 0.0f);
  }
  field_->Initialise(seed, state_.parameters.data());
  norm_.Initialise(state_.parameters.data());
  // While a wall's share of other walls' light is taken for nothing it looks lit from nearer, and a far one
  // that has been brought nearer hardly goes back. A single frame has no parallax to tell its depth from its
  // share.
  if (has_surroundings() && frames.size() > 1 && frames.hue_slope() < kHueSlopeOfWallLight) {
    std::fill_n(&state_.parameters[field_->ambient_bias_begin()], 3, 0.0f);
  }
  if (options.field.reflectance != Reflectance::kUnlit) MatchBrightnessToInitialSurface(initial);
}

// Starts the colours, and the power where it is learnt, where they explain the pixels' median brightness on
// the initial surface. From anywhere else the first steps would move the surface, which answers faster, to
// make up for the colours, and a wrong scale is a trap: a dark wall that is near looks much like a bright one
// that is far.
void Trainer::MatchBrightnessToInitialSurface(const InitialSurface& initial) {
  constexpr int kRays = 1024;
  RayBatch<float> batch;
  batch.rays.resize(kRays);
  const uint64_t key = RandomBits(seed_, 0x636f6c6f7273ull);
  frames_.Draw(key, 0, origin_, &batch.rays);
  const Panel<float> positions = MeetSurface(*field_, Weights(), options_.sampling, key, &batch);
  Panel<float> value(1, TilesFor(kRays)), normal(3, TilesFor(kRays));
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
  float palest = -std::numeric_limits<float>::infinity();
  for (int c = 0; c < 3; ++c) {
    if (log_ratio[c].empty()) continue;
    auto middle = log_ratio[c].begin() + static_cast<std::ptrdiff_t>(log_ratio[c].size() / 2);
    std::nth_element(log_ratio[c].begin(), middle, log_ratio[c].end());
    bias[c] = *middle;
    palest = std::max(palest, *middle);
  }
  if (!field_->bounds_albedo()) return;
  // The palest channel starts in the middle of its range, or below it where the given power says so.
  float log_power = std::isfinite(palest) ? palest - std::log(0.5f) : 0.0f;
  if (KnowsPower()) log_power = std::clamp(log_power, 0.0f, kLargestPowerStart);
  state_.parameters[field_->power_begin()] = log_power;
  for (int c = 0; c < 3; ++c) {
    if (!log_ratio[c].empty()) bias[c] = field_->OutputOfLogAlbedo(bias[c] - log_power);
  }
}

const float* Trainer::Weights() {
  const float* learnt = state_.parameters.data();
  const Grid<float>& grid = field_->grid();
  if (norm_.empty() && !grid.packed()) return learnt;
  weights_.resize(field_->parameter_count());
  if (norm_.empty()) {
    std::copy_n(learnt + field_->grid_size(), field_->network_size(), &weights_[field_->grid_size()]);
  } else {
    norm_.Expand(learnt, weights_.data());
  }
  if (grid.packed()) {
    ParallelFor(0, grid.levels(),
                [&](int64_t level) { grid.Pack(static_cast<int>(level), learnt, weights_.data()); });
  }
  return weights_.data();
}

// Of guides whose power is unknown, or under gains of which none is known, an albedo has no scale of its own.
bool Trainer::KnowsPower() const { return frames_.light().calibrated && !frames_.gains_relative(); }

double Trainer::Settling(double progress) const {
  const auto& schedule = options_.schedule;
  if (schedule.settle_from == 0) return 0;
  return std::min(static_cast<double>(state_.iteration) / static_cast<double>(schedule.settle_from),
                  progress / schedule.settle_part);
}

double Trainer::SharpnessAt(double progress) const {
  const auto& schedule = options_.schedule;
  const double grown = std::max(progress, std::min(1.0, Settling(progress)));
  const double set = LogInterpolate(schedule.sharpness_start_per_mm, schedule.sharpness_end_per_mm, grown);
  if (schedule.fog_iterations == 0) return set;
  const double lifted =
      std::max(static_cast<double>(state_.iteration) / static_cast<double>(schedule.fog_iterations),
               progress / kLongestFog);
  if (lifted >= 1) return set;
  return set * std::pow(schedule.fog_per_mm / schedule.sharpness_start_per_mm, 1 - lifted);
}

LossSettings<float> Trainer::SettingsAt(double progress) const {
  const auto& schedule = options_.schedule;
  LossSettings<float> settings;
  settings.sharpness = static_cast<float>(schedule.sharpness_rate > 0 ? std::exp(state_.log_sharpness[0])
                                                                      : SharpnessAt(progress));
  settings.inverse_gamma = static_cast<float>(frames_.inverse_gamma());
  settings.eikonal_weight = static_cast<float>(options_.loss.eikonal);
  settings.albedo_weight =
      HasAlbedo(options_.field.reflectance)
          ? static_cast<float>(options_.loss.albedo * std::pow(options_.loss.albedo_final, progress))
          : 0.0f;
  settings.albedo_width = static_cast<float>(options_.loss.albedo_width);
  settings.ambient_weight = static_cast<float>(options_.loss.ambient);
  settings.ambient_doubt = static_cast<float>(options_.loss.ambient_doubt);
  settings.weight_threshold = static_cast<float>(options_.sampling.weight_threshold);
  settings.per_ray = 1.0f / static_cast<float>(options_.sampling.rays);
  settings.linear_sections = Settling(progress) >= 1;
  return settings;
}

double Trainer::RateAt(double progress) const {
  const auto& schedule = options_.schedule;
  const double start = schedule.learning_rate / std::sqrt(std::max(1.0, Settling(progress)));
  const double end = start * schedule.learning_rate_final;
  if (progress < schedule.warm_up) return start * progress / schedule.warm_up;
  const double at = (progress - schedule.warm_up) / (1 - schedule.warm_up);
  if (schedule.decay == Decay::kCosine) return end + (start - end) * (1 + std::cos(kPi * at)) / 2;
  return LogInterpolate(start, end, at);
}

void Trainer::MeasurePhases() {
  for (Chunk& chunk : chunks_) chunk.clock = std::make_unique<PhaseClock>();
  for (auto& clock : update_clocks_) clock = std::make_unique<PhaseClock>();
}

PhaseSeconds Trainer::phase_seconds() const {
  PhaseSeconds sum = {};
  const auto add = [&](const std::unique_ptr<PhaseClock>& clock) {
    for (size_t i = 0; clock && i < sum.size(); ++i) sum[i] += clock->seconds()[i];
  };
  for (const Chunk& chunk : chunks_) add(chunk.clock);
  for (const auto& clock : update_clocks_) add(clock);
  return sum;
}

std::unique_ptr<Trainer::Workspace> Trainer::TakeWorkspace() {
  const std::lock_guard lock(idle_mutex_);
  if (idle_.empty()) return std::make_unique<Workspace>(options_.sampling, field_.get());
  std::unique_ptr<Workspace> workspace = std::move(idle_.back());
  idle_.pop_back();
  return workspace;
}

void Trainer::LeaveWorkspace(std::unique_ptr<Workspace> workspace) {
  const std::lock_guard lock(idle_mutex_);
  idle_.push_back(std::move(workspace));
}

void Trainer::RunChunk(int index, const float* weights, const LossSettings<float>& settings,
                       float* network_gradient) {
  Chunk& chunk = chunks_[index];
  std::unique_ptr<Workspace> workspace = TakeWorkspace();
  RayBatch<float>& batch = workspace->batch;
  PhaseClock* clock = chunk.clock.get();
  workspace->loss.set_clock(clock);
  if (clock) clock->Start();
  const uint64_t step_key = RandomBits(seed_, 0x7261797300ull, static_cast<uint64_t>(state_.iteration));
  const uint64_t places_key = RandomBits(step_key, static_cast<uint64_t>(index), 1);
  const int piece = RaysAtOnce(options_);
  TrainOptions::Sampling sampling = options_.sampling;
  if (settings.linear_sections) sampling.coarse *= kSettledLooks;
  chunk.terms = {};
  for (int begin = 0; begin < chunk.rays; begin += piece) {
    batch.rays.resize(std::min(piece, chunk.rays - begin));
    batch.first = begin;
    frames_.Draw(step_key, static_cast<uint64_t>(index) * kChunkRays + begin, origin_, &batch.rays);
    if (refines_poses())
      for (auto& ray : batch.rays) Move(state_.poses, &ray);
    Lap(clock, Phase::kRays);
    workspace->sampler->Place(weights, sampling, settings.sharpness, places_key, &batch);
    Lap(clock, Phase::kPlaces);
    chunk.terms += workspace->loss.Evaluate(
        weights, batch, lights_, state_.log_gain, settings, network_gradient, chunk.log_gain_gradient.data(),
        chunk.pose_gradient.empty() ? nullptr : chunk.pose_gradient.data());
  }
  if (has_grid()) workspace->loss.LeaveForGrid(&chunk.to_grid);
  LeaveWorkspace(std::move(workspace));
  const double sum = std::abs(chunk.terms.Sum()) + std::abs(chunk.terms.by_log_sharpness) +
                     SumOfSizes(std::span(network_gradient, field_->network_size())) +
                     SumOfSizes(chunk.log_gain_gradient) + SumOfSizes(chunk.pose_gradient);
  // Written so that NaN fails.
  chunk.finite = sum < kLargestGradient && (!has_grid() || IsFinite(chunk.to_grid));
}

LossTerms Trainer::RunChunks(const float* weights, const LossSettings<float>& settings) {
  network_gradients_->Start(&gradient_[field_->grid_size()]);
  std::atomic<int> next = 0;
  LossTerms sum;
  ParallelFor(0, static_cast<int64_t>(chunks_.size()), [&](int64_t) {
    // In order, so that few gradients wait for the ones before them; the loop's own index says nothing of
    // when.
    const int index = next++;
    OrderedSum::Term gradient = network_gradients_->Take();
    RunChunk(index, weights, settings, gradient.data());
    if (index == 0) sum.free_space = KeepCamerasFree(weights, gradient.data());
    network_gradients_->Add(index, std::move(gradient));
  });
  for (const Chunk& chunk : chunks_) sum += chunk.terms;
  return sum;
}

// With the first chunk, after its rays. Of many cameras so many take their turn.
double Trainer::KeepCamerasFree(const float* weights, float* network_gradient) {
  if (options_.loss.free_space == 0) return 0;
  const size_t all = lights_.size(), some = std::min(all, kCamerasAStep);
  camera_places_.resize(some);
  for (size_t i = 0; i < some; ++i) {
    camera_places_[i] = lights_[(static_cast<size_t>(state_.iteration) * some + i) % all].camera;
  }
  return free_space_->Evaluate(weights, camera_places_, static_cast<float>(options_.loss.clearance_mm),
                               static_cast<float>(options_.loss.free_space), network_gradient);
}

bool Trainer::GradientsAreFinite() const {
  return std::all_of(chunks_.begin(), chunks_.end(), [](const Chunk& chunk) { return chunk.finite; });
}

void Trainer::ClearGradients() {
  std::fill_n(&gradient_[field_->grid_size()], field_->network_size(), 0.0f);
  for (Chunk& chunk : chunks_) {
    std::fill(chunk.log_gain_gradient.begin(), chunk.log_gain_gradient.end(), 0.0f);
    std::fill(chunk.pose_gradient.begin(), chunk.pose_gradient.end(), 0.0f);
  }
}

void Trainer::UpdateNetworks(const AdamStep& step) {
  const size_t begin = field_->grid_size();
  if (field_->bounds_albedo() && KnowsPower())
    gradient_[field_->power_begin()] += kPowerPull * state_.parameters[field_->power_begin()];
  norm_.PullBack(state_.parameters.data(), gradient_.data());
  AdamUpdate(step, field_->network_size() + norm_.lengths(), &state_.parameters[begin], &gradient_[begin],
             &state_.first[begin], &state_.second[begin]);
}

void Trainer::UpdateGains(const AdamStep& step) {
  std::vector<float> gradient(state_.log_gain.size(), 0.0f);
  for (Chunk& chunk : chunks_) {
    for (size_t i = 0; i < gradient.size(); ++i) gradient[i] += chunk.log_gain_gradient[i];
    std::fill(chunk.log_gain_gradient.begin(), chunk.log_gain_gradient.end(), 0.0f);
  }
  if (frames_.gains_known() || options_.field.reflectance == Reflectance::kUnlit) return;
  // Gains are relative to the first frame's, but where it is unknown beside some that are given.
  const size_t first = frames_.learns_first_gain() ? 0 : 1;
  AdamUpdate(step, gradient.size() - first, state_.log_gain.data() + first, gradient.data() + first,
             state_.log_gain_first.data() + first, state_.log_gain_second.data() + first);
  for (size_t i = first; i < gradient.size(); ++i) {
    const auto reach = static_cast<float>(frames_.LogGainReach(static_cast<int>(i)));
    state_.log_gain[i] = std::clamp(state_.log_gain[i], -reach, reach);
  }
}

// Not before the surface has taken some shape, and ever more slowly in the second half.
void Trainer::UpdatePoses(double progress) {
  const auto& poses = options_.poses;
  std::vector<float> gradient(state_.poses.values.size(), 0.0f);
  for (Chunk& chunk : chunks_) {
    for (size_t i = 0; i < gradient.size(); ++i) gradient[i] += chunk.pose_gradient[i];
    std::fill(chunk.pose_gradient.begin(), chunk.pose_gradient.end(), 0.0f);
  }
  if (progress < poses.start) return;
  const double decay = std::min(1.0, 2 * (1 - progress));
  const double beta2 = options_.schedule.adam_beta2;
  AddPull(poses.pull, {poses.noise_mm, poses.noise_rad}, state_.poses, &gradient);
  UpdateMotions(AdamStep(poses.translation_rate_mm * decay, state_.iteration, beta2),
                AdamStep(poses.rotation_rate_rad * decay, state_.iteration, beta2), &gradient, &state_.poses);
}

std::vector<Pose> Trainer::Poses() const {
  std::vector<Pose> poses = frames_.world_from_camera();
  for (int i = 0; refines_poses() && i < frames_.size(); ++i) poses[i] = Moved(poses[i], state_.poses, i);
  return poses;
}

// The guides move with the camera.
void Trainer::PlaceLights() {
  const std::vector<Pose> poses = Poses();
  for (size_t i = 0; i < lights_.size(); ++i) {
    FrameLight<float> moved = LightOfFrame<float>(frames_.light(), poses[i], origin_);
    moved.mean_radiance = lights_[i].mean_radiance;
    moved.surroundings = std::move(lights_[i].surroundings);
    lights_[i] = std::move(moved);
  }
}

void Trainer::UpdateSharpness(double rate, double gradient) {
  const auto& schedule = options_.schedule;
  if (!(schedule.sharpness_rate > 0)) return;
  float slope = static_cast<float>(gradient);
  auto& [value, first, second] = state_.log_sharpness;
  AdamUpdate(AdamStep(rate * schedule.sharpness_rate, state_.iteration, schedule.adam_beta2), 1, &value,
             &slope, &first, &second);
}

bool Trainer::has_surroundings() const {
  return field_->has_ambient() && options_.field.interreflection == Interreflection::kRadiosity;
}

// The state's maps are what a run that is taken up again goes on with.
void Trainer::UpdateSurroundings() {
  const bool due = state_.iteration % kSurroundingsEvery == 0;
  if (!due && lights_.front().surroundings) return;
  const float* weights = Weights();
  ParallelFor(0, static_cast<int64_t>(lights_.size()), [&](int64_t i) {
    float* stored = &state_.surroundings[static_cast<size_t>(i) * DirectionMap<float>::kCells * 3];
    auto& map = lights_[i].surroundings;
    if (due) map = SurroundingsOf(*field_, weights, options_.sampling, lights_[i]);
    if (!due) map.emplace();
    for (Vec3f& value : map->values) {
      if (due) std::copy_n(value.data(), 3, stored);
      value = Vec3f(stored[0], stored[1], stored[2]);
      stored += 3;
    }
  });
}

StepReport Trainer::Step(double progress) {
  if (refines_poses()) PlaceLights();
  if (has_surroundings()) UpdateSurroundings();
  const LossSettings<float> settings = SettingsAt(progress);
  const float* weights = Weights();
  StepReport report;
  report.sharpness_per_mm = settings.sharpness;
  report.loss = RunChunks(weights, settings);
  ++state_.iteration;
  if (!GradientsAreFinite()) {
    report.skipped = true;
    if (state_.skipped_steps++ == 0) state_.first_skipped_step = state_.iteration - 1;
    ClearGradients();
    return report;
  }
  const double rate = RateAt(progress);
  const auto& schedule = options_.schedule;
  const AdamStep step(rate, state_.iteration, schedule.adam_beta2);
  AdamStep table_step = step;
  if (state_.iteration > schedule.table_epsilon_from)
    table_step.epsilon = static_cast<float>(schedule.table_epsilon);
  const int levels = field_->grid().levels();
  ParallelFor(0, levels + 1, [&](int64_t task) {
    PhaseClock* clock = update_clocks_[task].get();
    if (clock) clock->Start();
    if (task == levels) {
      UpdateNetworks(step);
      return Lap(clock, Phase::kAdam);
    }
    // From the finest level on, which has the most to do.
    const int level = levels - 1 - static_cast<int>(task);
    for (Chunk& chunk : chunks_) field_->GridBackward(level, chunk.to_grid, gradient_.data());
    free_space_->GridBackward(level, gradient_.data());
    Lap(clock, Phase::kGrid);
    const size_t begin = field_->grid().level_begin(level);
    AdamUpdate(table_step, field_->grid().level_size(level), &state_.parameters[begin], &gradient_[begin],
               &state_.first[begin], &state_.second[begin]);
    Lap(clock, Phase::kAdam);
  });
  UpdateGains(step);
  if (refines_poses()) UpdatePoses(progress);
  UpdateSharpness(rate, report.loss.by_log_sharpness);
  return report;
}

}  // namespace lumen
