#include "recon/training/ray_loss.h"

#include "recon/surface/volume.h"

namespace lumen {
namespace {

// Below this length the SDF's gradient has no direction worth shading by: the normal's derivative, which
// grows as 1/length, is left out until the eikonal term has mended the length. Twenty times is as far as one
// sample may outweigh another.
constexpr double kShortestGradient = 0.05;

// A sample's first three numbers.
template <class T>
Vec3<T> Vector(const Panel<T>& panel, size_t sample) {
  const T* column = panel.Column(sample);
  return {column[0], column[kTile], column[2 * kTile]};
}

}  // namespace

LossTerms& LossTerms::operator+=(const LossTerms& other) {
  photometric += other.photometric;
  eikonal += other.eikonal;
  albedo += other.albedo;
  ambient += other.ambient;
  free_space += other.free_space;
  by_log_sharpness += other.by_log_sharpness;
  active_samples += other.active_samples;
  return *this;
}

template <class T>
void RayLoss<T>::FindWeights(const T* parameters, const RayBatch<T>& batch, const LossSettings<T>& settings) {
  const int n = batch.samples;
  const int count = static_cast<int>(batch.rays.size()) * n;
  value_.positions.Resize(3, TilesFor(count));
  for (int i = 0; i < TilesFor(count) * kTile; ++i) {
    const int k = std::min(i, count - 1);  // the last tile is filled up with copies of the last sample
    const auto& ray = batch.rays[k / n];
    T* position = value_.positions.Column(i);
    for (int d = 0; d < 3; ++d) position[d * kTile] = ray.origin[d] + batch.distance[k] * ray.direction[d];
  }
  field_->Value(parameters, &value_);
  signed_distance_.resize(count);
  occupancy_.resize(count);
  transmittance_.resize(count);
  weight_.resize(count);
  for (int i = 0; i < count; ++i) signed_distance_[i] = value_.value.At(0, i);
  if (settings.linear_sections) near_share_.resize(count);
  for (size_t r = 0; r < batch.rays.size(); ++r) {
    const size_t at = r * n;
    if (settings.linear_sections) {
      LinearRayWeights(n, &signed_distance_[at], settings.sharpness, &occupancy_[at], &transmittance_[at],
                       &near_share_[at], &weight_[at]);
    } else {
      RayWeights(n, &signed_distance_[at], settings.sharpness, &occupancy_[at], &transmittance_[at],
                 &weight_[at]);
    }
  }
}

template <class T>
void RayLoss<T>::SelectActive(const RayBatch<T>& batch, const LossSettings<T>& settings) {
  active_.clear();
  const int n = batch.samples;
  for (size_t r = 0; r < batch.rays.size(); ++r) {
    for (int k = 0; k < n; ++k) {
      const size_t i = r * n + k;
      // A sample's own weight, and the light that a change of its distance could still take away.
      const T influence = transmittance_[i] * occupancy_[i];
      const bool seen = weight_[i] >= settings.weight_threshold || influence >= settings.weight_threshold;
      if (!seen && k != batch.rays[r].eikonal_sample) continue;
      active_.push_back({static_cast<int>(r), k, seen ? weight_[i] : T(0)});
    }
  }
}

template <class T>
void RayLoss<T>::ShadeActive(const T* parameters, const RayBatch<T>& batch,
                             const std::vector<FrameLight<T>>& lights, const std::vector<T>& log_gain) {
  const int count = static_cast<int>(active_.size());
  const int tiles = TilesFor(count);
  surface_.positions.Resize(3, tiles);
  surface_.directions.Resize(3, tiles);
  surface_.normal.Resize(3, tiles);
  for (int i = 0; i < tiles * kTile; ++i) {
    const Active& sample = active_[std::min(i, count - 1)];
    const auto& ray = batch.rays[sample.ray];
    const T t = batch.distance[size_t(sample.ray) * batch.samples + sample.sample];
    T* position = surface_.positions.Column(i);
    T* direction = surface_.directions.Column(i);
    for (int d = 0; d < 3; ++d) {
      position[d * kTile] = ray.origin[d] + t * ray.direction[d];
      direction[d * kTile] = ray.direction[d];
    }
  }
  field_->Surface(parameters, &surface_);
  length_.resize(size_t(tiles) * kTile);
  for (int tile = 0; tile < tiles; ++tile) {
    const T* gradient = surface_.gradient.Tile(tile);
    T* normal = surface_.normal.Tile(tile);
    T* length = &length_[size_t(tile) * kTile];
    for (int s = 0; s < kTile; ++s) {
      const T x = gradient[s], y = gradient[kTile + s], z = gradient[2 * kTile + s];
      length[s] = std::sqrt(x * x + (z * z + y * y));  // rounds as Eigen's norm
      const T divisor = length[s] > 0 ? length[s] : T(1);
      for (int d = 0; d < 3; ++d) normal[d * kTile + s] = gradient[d * kTile + s] / divisor;
    }
  }
  Lap(clock_, Phase::kSurface);
  field_->Color(parameters, &surface_);
  if (field_->bounds_albedo()) BoundAlbedo(surface_.color_output());
  const Panel<T>& output = field_->bounds_albedo() ? log_albedo_ : surface_.color_output();
  shading_.resize(count);
  const bool has_coat = field_->has_coat();
  MucusCoat<T> coat;
  if (has_coat) {
    coat = LearntCoat(field_->options().coat, parameters + field_->coat_begin());
    by_coat_.resize(count);
  }
  int looked_along = -1;
  Vec3<T> surroundings;  // on that ray, which is the same at all its samples
  for (int i = 0; i < count; ++i) {
    const Active& sample = active_[i];
    if (!(sample.weight > 0)) continue;
    const Vec3<T> point = Vector(surface_.positions, i), normal = Vector(surface_.normal, i);
    const int frame = batch.rays[sample.ray].frame;
    Vec3<T> ambient = Vec3<T>::Zero();
    if (lights[frame].surroundings) {
      const auto& light = lights[frame];
      if (sample.ray != looked_along)
        surroundings = light.surroundings->At(light.camera_from_field * batch.rays[sample.ray].direction);
      looked_along = sample.ray;
      const T* log_factor = surface_.ambient_output().Column(i);
      for (int c = 0; c < 3; ++c) ambient[c] = surroundings[c] * std::exp(log_factor[c * kTile]);
    } else if (field_->has_ambient()) {
      // What the pixels show of the other places holds the frame's gain already.
      ambient = T(kPi) * lights[frame].mean_radiance;
      const T* log_factor = surface_.ambient_output().Column(i);
      for (int c = 0; c < 3; ++c) ambient[c] *= std::exp(log_factor[c * kTile] - log_gain[frame]);
    }
    const Vec3<T> color = Vector(output, i);
    shading_[i] = has_coat
                      ? ShadeCoated(coat, color, normal, lights[frame], point, ambient, &by_coat_[i])
                      : Shade(field_->options().reflectance, color, normal, lights[frame], point, ambient);
  }
  if (field_->bounds_albedo()) ScaleByPower(std::exp(parameters[field_->power_begin()]));
}

template <class T>
std::vector<typename RayLoss<T>::Wall> RayLoss<T>::LookAtLast(const T* parameters, const RayBatch<T>& batch,
                                                              const std::vector<FrameLight<T>>& lights,
                                                              const std::vector<T>& log_gain) {
  active_.clear();
  for (size_t r = 0; r < batch.rays.size(); ++r)
    active_.push_back({static_cast<int>(r), batch.samples - 1, T(1)});
  ShadeActive(parameters, batch, lights, log_gain);
  std::vector<Wall> walls(active_.size());
  for (size_t i = 0; i < active_.size(); ++i) {
    for (int c = 0; c < 3; ++c)
      walls[i].albedo[c] = std::exp(field_->LogAlbedo(surface_.color_output().At(c, static_cast<int>(i))));
    walls[i].direct = shading_[i].by_output - shading_[i].ambient;
    walls[i].indirect = shading_[i].ambient;
    walls[i].beyond = surface_.free.At(0, static_cast<int>(i)) == 0;
  }
  return walls;
}

template <class T>
void RayLoss<T>::BoundAlbedo(const Panel<T>& output) {
  log_albedo_.Resize(3, output.tiles());
  log_albedo_slope_.Resize(3, output.tiles());
  for (int i = 0; i < output.tiles() * kTile; ++i)
    for (int c = 0; c < 3; ++c)
      log_albedo_.At(c, i) = field_->LogAlbedo(output.At(c, i), &log_albedo_slope_.At(c, i));
}

template <class T>
void RayLoss<T>::ScaleByPower(T power) {
  for (size_t i = 0; i < active_.size(); ++i) {
    if (!(active_[i].weight > 0)) continue;
    Shading<T>& shading = shading_[i];
    shading.radiance *= power;
    shading.by_output *= power;
    shading.by_normal *= power;
    shading.ambient *= power;
    if (!field_->has_coat()) continue;
    by_coat_[i].weight *= power;
    by_coat_[i].roughness *= power;
    by_coat_[i].ior *= power;
  }
}

template <class T>
void RayLoss<T>::PowerBackward(T* network_gradient) const {
  T by_log_power = 0;
  for (size_t i = 0; i < active_.size(); ++i) {
    const Active& sample = active_[i];
    if (sample.weight > 0)
      by_log_power += sample.weight * radiance_delta_[sample.ray].dot(shading_[i].radiance);
  }
  network_gradient[field_->power_begin() - field_->grid_size()] += by_log_power;
}

template <class T>
double RayLoss<T>::ComparePixels(const RayBatch<T>& batch, const std::vector<T>& log_gain,
                                 const LossSettings<T>& settings, T* log_gain_gradient) {
  const bool lit = field_->options().reflectance != Reflectance::kUnlit;
  // Radiosity is of the light guides' light; the mean radiance is what the pixels show.
  const bool follows_gain = field_->options().interreflection == Interreflection::kRadiosity;
  radiance_delta_.assign(batch.rays.size(), Vec3<T>::Zero());
  ambient_.assign(batch.rays.size(), Vec3<T>::Zero());
  for (size_t i = 0; i < active_.size(); ++i) {
    const Active& sample = active_[i];
    if (!(sample.weight > 0)) continue;
    radiance_delta_[sample.ray] += sample.weight * shading_[i].radiance;
    ambient_[sample.ray] += sample.weight * shading_[i].ambient;
  }
  double loss = 0;
  const T share = settings.per_ray / 3;
  for (size_t r = 0; r < batch.rays.size(); ++r) {
    const auto& ray = batch.rays[r];
    const T exposure = ray.exposure * std::exp(log_gain[ray.frame]);
    const Vec3<T> trust = ChannelTrust(radiance_delta_[r], ambient_[r], settings.ambient_doubt);
    for (int c = 0; c < 3; ++c) {
      const T linear = exposure * radiance_delta_[r][c];  // so far it holds the radiance itself
      const Term<T> pixel = lit ? Compress(linear, settings.inverse_gamma, ray.floor) : Term<T>{linear, T(1)};
      const Term<T> error = PhotometricLoss(pixel.value, ray.observed[c], ray.bound[c]);
      loss += share * trust[c] * error.value;
      const T delta = share * trust[c] * error.slope * pixel.slope;  // ∂loss/∂linear
      log_gain_gradient[ray.frame] += delta * (follows_gain ? linear : linear - exposure * ambient_[r][c]);
      radiance_delta_[r][c] = delta * exposure;
    }
  }
  return loss;
}

template <class T>
void RayLoss<T>::BackToSamples(const RayBatch<T>& batch, const LossSettings<T>& settings, LossTerms* terms) {
  const int tiles = surface_.positions.tiles();
  const int n = batch.samples;
  surface_.value_delta.Resize(1, tiles);
  surface_.gradient_delta.Resize(3, tiles);
  surface_.color_delta.Resize(3, tiles);
  surface_.value_delta.SetZero();
  surface_.gradient_delta.SetZero();
  surface_.color_delta.SetZero();
  surface_.ambient_delta.Resize(3, tiles);
  surface_.ambient_delta.SetZero();
  weight_delta_.assign(weight_.size(), T(0));
  distance_delta_.resize(weight_.size());
  for (size_t i = 0; i < active_.size(); ++i) {
    const Active& sample = active_[i];
    if (!(sample.weight > 0)) continue;
    const Vec3<T>& delta = radiance_delta_[sample.ray];
    weight_delta_[size_t(sample.ray) * n + sample.sample] = delta.dot(shading_[i].radiance);
    T *color = surface_.color_delta.Column(i), *ambient = surface_.ambient_delta.Column(i);
    for (int c = 0; c < 3; ++c) {
      color[c * kTile] = delta[c] * sample.weight * shading_[i].by_output[c];
      ambient[c * kTile] = delta[c] * sample.weight * shading_[i].ambient[c];
    }
  }
  const bool bounded = field_->bounds_albedo();
  if (settings.albedo_weight > 0) {
    const Panel<T>& log_albedo = bounded ? log_albedo_ : surface_.color_output();
    const T strength = settings.albedo_weight * settings.per_ray / 3;
    terms->albedo += Pull(strength, settings.albedo_width, log_albedo, &surface_.color_delta);
  }
  for (size_t i = 0; bounded && i < active_.size(); ++i)
    for (int c = 0; c < 3; ++c) surface_.color_delta.At(c, i) *= log_albedo_slope_.At(c, i);
  if (field_->has_ambient()) {
    const T strength = settings.ambient_weight * settings.per_ray / 3;
    terms->ambient +=
        Pull(strength, settings.albedo_width, surface_.ambient_output(), &surface_.ambient_delta);
  }
  for (size_t r = 0; r < batch.rays.size(); ++r) {
    const size_t at = r * n;
    if (settings.linear_sections) {
      LinearRayWeightsBackward(n, &signed_distance_[at], settings.sharpness, &occupancy_[at],
                               &transmittance_[at], &near_share_[at], &weight_delta_[at],
                               &distance_delta_[at]);
    } else {
      RayWeightsBackward(n, &signed_distance_[at], settings.sharpness, &occupancy_[at], &transmittance_[at],
                         &weight_delta_[at], &distance_delta_[at]);
    }
  }
  // The weights depend on s · f only.
  for (size_t i = 0; i < distance_delta_.size(); ++i)
    terms->by_log_sharpness += double(signed_distance_[i]) * double(distance_delta_[i]);
  for (size_t i = 0; i < active_.size(); ++i) {
    *surface_.value_delta.Column(i) = distance_delta_[size_t(active_[i].ray) * n + active_[i].sample];
  }
}

// Pulls the logarithms that a network puts out (of the albedo, of the ambient factor; a channel each) towards
// their means over the batch. A mean is the batch's own and moves with it, so the pull is on the spread alone
// and never on the level: a pull to a fixed mean would hold the whole reconstruction at the scale at which it
// starts. It acts on the output alone: a weight that depended on it would move the surface to where the
// output is mean.
template <class T>
double RayLoss<T>::Pull(T strength, T width, const Panel<T>& output, Panel<T>* delta) {
  const size_t count = active_.size();
  sample_weight_.Resize(1, output.tiles());
  sample_weight_.SetZero();
  for (size_t i = 0; i < count; ++i) *sample_weight_.Column(i) = active_[i].weight;
  T weight = 0, mean[3] = {}, mean_slope[3] = {};
  for (size_t i = 0; i < count; ++i) {
    weight += active_[i].weight;
    const T* out = output.Column(i);
    for (int c = 0; c < 3; ++c) mean[c] += active_[i].weight * out[c * kTile];
  }
  if (!(weight > 0)) return 0;
  for (T& m : mean) m /= weight;
  // All that isn't a sum is computed a row at a time; the sums are in the samples' order.
  pull_.Resize(3, output.tiles());
  pull_slope_.Resize(3, output.tiles());
  pull_share_.Resize(3, output.tiles());
  for (int row = 0; row < 3 * output.tiles(); ++row) {
    const int tile = row / 3, c = row % 3;
    const T *out = output.Row(tile, c), *w = sample_weight_.Tile(tile);
    T *loss = pull_.Row(tile, c), *slope = pull_slope_.Row(tile, c), *share = pull_share_.Row(tile, c);
    for (int s = 0; s < kTile; ++s) {
      const Term<T> pull = HuberLoss(out[s] - mean[c], width);
      slope[s] = pull.slope;
      loss[s] = strength * w[s] * pull.value;
      share[s] = w[s] * pull.slope / weight;
    }
  }
  double loss[3] = {};
  for (size_t i = 0; i < count; ++i) {
    const T *pull = pull_.Column(i), *share = pull_share_.Column(i);
    for (int c = 0; c < 3; ++c) {
      loss[c] += pull[c * kTile];
      mean_slope[c] += share[c * kTile];
    }
  }
  for (int row = 0; row < 3 * output.tiles(); ++row) {
    const int tile = row / 3, c = row % 3;
    const T *slope = pull_slope_.Row(tile, c), *w = sample_weight_.Tile(tile);
    T* to = delta->Row(tile, c);
    for (int s = 0; s < kTile; ++s) to[s] += strength * w[s] * (slope[s] - mean_slope[c]);
  }
  return loss[0] + loss[1] + loss[2];
}

template <class T>
LossTerms RayLoss<T>::Evaluate(const T* parameters, const RayBatch<T>& batch,
                               const std::vector<FrameLight<T>>& lights, const std::vector<T>& log_gain,
                               const LossSettings<T>& settings, T* network_gradient, T* log_gain_gradient,
                               T* pose_gradient) {
  LossTerms terms;
  FindWeights(parameters, batch, settings);
  SelectActive(batch, settings);
  terms.active_samples = static_cast<int64_t>(active_.size());
  Lap(clock_, Phase::kDistances);
  ShadeActive(parameters, batch, lights, log_gain);
  Lap(clock_, Phase::kColors);
  terms.photometric = ComparePixels(batch, log_gain, settings, log_gain_gradient);
  BackToSamples(batch, settings, &terms);
  Lap(clock_, Phase::kPixels);
  field_->ColorBackward(parameters, &surface_, network_gradient);
  if (field_->has_coat()) CoatBackward(parameters, network_gradient);
  if (field_->bounds_albedo()) PowerBackward(network_gradient);
  if (pose_gradient) AddPoseGradient(parameters, batch, pose_gradient);

  const T eikonal_share = settings.eikonal_weight * settings.per_ray / T(batch.samples);
  for (size_t i = 0; i < active_.size(); ++i) {
    const Active& sample = active_[i];
    const Vec3<T> gradient = Vector(surface_.gradient, i);
    Vec3<T> slope;
    terms.eikonal += eikonal_share * EikonalLoss(gradient, &slope);
    Vec3<T> delta = eikonal_share * slope;
    if (sample.weight > 0 && length_[i] > T(kShortestGradient)) {
      const Vec3<T> normal = gradient / length_[i];
      Vec3<T> by_normal = Vector(surface_.normal_delta, i);
      by_normal += sample.weight * shading_[i].by_normal.transpose() * radiance_delta_[sample.ray];
      delta += (by_normal - normal * normal.dot(by_normal)) / length_[i];
    }
    T* gradient_delta = surface_.gradient_delta.Column(i);
    for (int d = 0; d < 3; ++d) gradient_delta[d * kTile] = delta[d];
  }
  field_->SurfaceBackward(parameters, &surface_, network_gradient);
  Lap(clock_, Phase::kBackward);
  return terms;
}

// Evaluate has the same in its loop: called from there it would round otherwise, and change every run's
// bytes.
template <class T>
Vec3<T> RayLoss<T>::ByGradient(size_t i) const {
  const Active& sample = active_[i];
  if (!(sample.weight > 0) || !(length_[i] > T(kShortestGradient))) return Vec3<T>::Zero();
  const Vec3<T> gradient = Vector(surface_.gradient, i);
  const Vec3<T> normal = gradient / length_[i];
  Vec3<T> by_normal = Vector(surface_.normal_delta, i);
  by_normal += sample.weight * shading_[i].by_normal.transpose() * radiance_delta_[sample.ray];
  return (by_normal - normal * normal.dot(by_normal)) / length_[i];
}

template <class T>
void RayLoss<T>::CoatBackward(const T* parameters, T* network_gradient) const {
  MucusCoat<T> delta{0, 0, 0};
  for (size_t i = 0; i < active_.size(); ++i) {
    if (!(active_[i].weight > 0)) continue;
    const Vec3<T> by_radiance = active_[i].weight * radiance_delta_[active_[i].ray];
    delta.weight += by_radiance.dot(by_coat_[i].weight);
    delta.roughness += by_radiance.dot(by_coat_[i].roughness);
    delta.ior += by_radiance.dot(by_coat_[i].ior);
  }
  const size_t begin = field_->coat_begin();
  LearntCoatBackward(field_->options().coat, parameters + begin, delta,
                     network_gradient + (begin - field_->grid_size()));
}

template class RayLoss<float>;
template class RayLoss<double>;

}  // namespace lumen
