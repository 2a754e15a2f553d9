#include "recon/surface/field.h"

#include <cmath>
#include <utility>

namespace lumen {
namespace {

MlpShape SdfShape(const FieldOptions& options) {
  const int encoded =
      options.grid.levels * Grid<float>::kFeatures + Frequency<float>(options.place_octaves).outputs();
  return {encoded + 3, options.sdf_hidden, 1 + options.features, options.sdf_activation, options.sdf_skip};
}

MlpShape ColorShape(const FieldOptions& options) {
  const int view =
      HasAlbedo(options.reflectance) ? 0 : 6 + Frequency<float>(options.direction_octaves).outputs();
  return {options.features + 3 + view, options.color_hidden, 3, Activation::kRelu};
}

MlpShape AmbientShape(const FieldOptions& options) {
  const bool none = options.interreflection == Interreflection::kNone || !HasAlbedo(options.reflectance);
  if (none) return {0, {}, 0, Activation::kSquareplus};
  return {3, options.ambient_hidden, 3, Activation::kSquareplus};
}

const Bfloat16Kernels* RoundingOf(const FieldOptions& options) {
  return options.network_precision == Precision::kBfloat16 ? &FastestBfloat16Kernels() : nullptr;
}

// The distance network starts close to nothing, so that training starts from the initial surface; colours
// start near the middle of their range.
constexpr double kSdfStart = 0.02;
constexpr double kColorStart = 0.1;

// Log of the ambient factor at the start. The mean of what a camera sees is what a place receives in a closed
// cavity that is seen whole (the integrating sphere); a lumen is open and unevenly lit, so less of it.
// Radiosity starts with a thirtieth of itself: what the first, wrong surface would send itself holds that
// surface where it is, and from below the factor finds its level within some hundred steps. Where the frames'
// colours say that there is such light, training starts with all of it.
constexpr double kMeanStart = -1, kRadiosityStart = -3.5;

}  // namespace

template <class T>
Field<T>::Field(const FieldOptions& options, const InitialSurface& initial, const Eigen::AlignedBox3d& box)
    : options_(options),
      initial_(initial),
      box_(box),
      grid_(options.grid, box),
      place_frequency_(options.place_octaves),
      direction_frequency_(options.direction_octaves),
      sdf_(SdfShape(options), RoundingOf(options)),
      color_(ColorShape(options), RoundingOf(options)),
      ambient_(AmbientShape(options), RoundingOf(options)),
      unit_(static_cast<T>(options.unit_mm)) {}

template <class T>
void Field<T>::Initialise(uint64_t seed, T* parameters) const {
  grid_.Initialise(seed * 3, parameters);
  if (initial_.is_learnt()) {
    sdf_.InitialiseAsSphere(seed * 3 + 1, initial_.radius_mm() / unit_, encoded(), parameters + grid_size());
  } else if (options_.place_octaves > 0) {
    sdf_.InitialiseSmooth(seed * 3 + 1, kSdfStart, encoded(), parameters + grid_size());
  } else {
    sdf_.Initialise(seed * 3 + 1, kSdfStart, parameters + grid_size());
  }
  color_.Initialise(seed * 3 + 2, kColorStart, parameters + grid_size() + sdf_.parameter_count());
  if (bounds_albedo()) parameters[power_begin()] = 0;
  if (has_coat()) InitialiseCoat(options_.coat, parameters + coat_begin());
  if (!has_ambient()) return;
  T* ambient = parameters + grid_size() + sdf_.parameter_count() + color_.parameter_count();
  ambient_.Initialise(seed * 3 + 3, kColorStart, ambient);
  const double start = options_.interreflection == Interreflection::kRadiosity ? kRadiosityStart : kMeanStart;
  std::fill_n(parameters + ambient_bias_begin(), 3, static_cast<T>(start));
}

template <class T>
T Field<T>::OutputOfLogAlbedo(T log_albedo) const {
  if (!bounds_albedo()) return log_albedo;
  constexpr double kPalestStart = 0.9;  // where the slope by the output still is a tenth
  const T albedo = std::min(std::exp(log_albedo), T(kPalestStart));
  return std::log(albedo / (1 - albedo));
}

template <class T>
WeightNorm<T> Field<T>::Normalisation() const {
  if (!options_.weight_norm) return {};
  WeightNorm<T> norm(parameter_count());
  for (const auto& matrix : sdf_.matrices())
    norm.Add(grid_size() + matrix.begin, matrix.rows, matrix.columns);
  for (const auto& matrix : color_.matrices())
    norm.Add(grid_size() + sdf_.parameter_count() + matrix.begin, matrix.rows, matrix.columns);
  return norm;
}

template <class T>
void Field<T>::StartFromInitial(const T* positions, T* value, T* gradient) const {
  if (!initial_.is_learnt()) return initial_.Evaluate<T>(positions, value, gradient);
  std::fill(value, value + kTile, T(0));
  if (gradient) std::fill(gradient, gradient + 3 * kTile, T(0));
}

template <class T>
void Field<T>::FillInput(const T* parameters, const Panel<T>& positions, Panel<T>* jacobian,
                         Panel<T>* input) const {
  input->Resize(encoded() + 3, positions.tiles());
  if (jacobian) {
    jacobian->Resize(3 * grid_.outputs(), positions.tiles());
    grid_.EncodeWithJacobian(parameters, positions, input, jacobian);
  } else {
    grid_.Encode(parameters, positions, input);
  }
  for (int tile = 0; tile < positions.tiles(); ++tile) {
    const T* x = positions.Tile(tile);
    T* out = input->Row(tile, encoded());
    for (int i = 0; i < 3 * kTile; ++i) out[i] = x[i] / unit_;
    place_frequency_.Encode(out, input->Row(tile, grid_.outputs()));
  }
}

template <class T>
void Field<T>::CutOff(const Panel<T>& positions, Panel<T>* value, Panel<T>* gradient, Panel<T>* free) const {
  for (int tile = 0; tile < positions.tiles(); ++tile) {
    T* f = value->Row(tile, 0);
    T* own = free ? free->Row(tile, 0) : nullptr;
    if (own) std::fill(own, own + kTile, T(1));
    for (int d = 0; d < 3; ++d) {
      const T low = static_cast<T>(box_.min()[d]), high = static_cast<T>(box_.max()[d]);
      const T* x = positions.Row(tile, d);
      for (int s = 0; s < kTile; ++s) {
        const T to_low = x[s] - low, to_high = high - x[s];
        const T bound = to_low < to_high ? to_low : to_high;
        if (bound >= f[s]) continue;
        f[s] = bound;
        if (own) own[s] = 0;
        if (!gradient) continue;
        for (int e = 0; e < 3; ++e) gradient->Row(tile, e)[s] = 0;
        gradient->Row(tile, d)[s] = to_low < to_high ? T(1) : T(-1);
      }
    }
  }
}

template <class T>
void Field<T>::Value(const T* parameters, ValuePass* pass) const {
  const int tiles = pass->positions.tiles();
  FillInput(parameters, pass->positions, nullptr, &pass->input);
  sdf_.Forward(parameters + grid_size(), pass->input, 1, Mlp<T>::Keep::kNothing, &pass->sdf);
  pass->value.Resize(1, tiles);
  for (int tile = 0; tile < tiles; ++tile) {
    T* f = pass->value.Row(tile, 0);
    StartFromInitial(pass->positions.Tile(tile), f, nullptr);
    const T* out = pass->sdf.value.back().Row(tile, 0);
    for (int s = 0; s < kTile; ++s) f[s] += unit_ * out[s];
  }
  CutOff(pass->positions, &pass->value, nullptr, nullptr);
}

template <class T>
void Field<T>::Surface(const T* parameters, SurfacePass* pass) const {
  const int tiles = pass->positions.tiles();
  const int from_grid = grid_.outputs();
  FillInput(parameters, pass->positions, &pass->jacobian, &pass->input);
  sdf_.Forward(parameters + grid_size(), pass->input, 1 + options_.features, Mlp<T>::Keep::kBends,
               &pass->sdf);
  sdf_.InputGradient(parameters + grid_size(), &pass->sdf);
  pass->value.Resize(1, tiles);
  pass->gradient.Resize(3, tiles);
  pass->free.Resize(1, tiles);
  for (int tile = 0; tile < tiles; ++tile) {
    T* f = pass->value.Row(tile, 0);
    StartFromInitial(pass->positions.Tile(tile), f, pass->gradient.Tile(tile));
    const T* out = pass->sdf.value.back().Row(tile, 0);
    for (int s = 0; s < kTile; ++s) f[s] += unit_ * out[s];
    for (int d = 0; d < 3; ++d) {
      T* g = pass->gradient.Row(tile, d);
      const T* by_place = pass->sdf.input_gradient.Row(tile, encoded() + d);
      for (int s = 0; s < kTile; ++s) g[s] += by_place[s];
      for (int r = 0; r < from_grid; ++r) {
        const T* q = pass->sdf.input_gradient.Row(tile, r);
        const T* slope = pass->jacobian.Row(tile, d * from_grid + r);
        for (int s = 0; s < kTile; ++s) g[s] += unit_ * q[s] * slope[s];
      }
    }
    // Of place over unit, times unit: 1.
    place_frequency_.AddGradient(pass->input.Row(tile, from_grid),
                                 pass->sdf.input_gradient.Row(tile, from_grid), T(1),
                                 pass->gradient.Tile(tile));
  }
  CutOff(pass->positions, &pass->value, &pass->gradient, &pass->free);
}

template <class T>
void Field<T>::Color(const T* parameters, SurfacePass* pass) const {
  const int tiles = pass->positions.tiles();
  const int features = options_.features;
  pass->color_input.Resize(color_.shape().inputs, tiles);
  for (int tile = 0; tile < tiles; ++tile) {
    T* in = pass->color_input.Tile(tile);
    const T* feature = pass->sdf.value.back().Row(tile, 1);
    std::copy(feature, feature + features * kTile, in);
    const T* place = pass->input.Row(tile, encoded());
    std::copy(place, place + 3 * kTile, in + features * kTile);
    if (!sees_view()) continue;
    const T* normal = pass->normal.Tile(tile);
    std::copy(normal, normal + 3 * kTile, in + (features + 3) * kTile);
    const T* direction = pass->directions.Tile(tile);
    std::copy(direction, direction + 3 * kTile, in + (features + 6) * kTile);
    direction_frequency_.Encode(direction, in + (features + 9) * kTile);
  }
  color_.Forward(parameters + grid_size() + sdf_.parameter_count(), pass->color_input, 3,
                 Mlp<T>::Keep::kSlopes, &pass->color);
  if (!has_ambient()) return;
  pass->ambient_input.Resize(3, tiles);
  for (int tile = 0; tile < tiles; ++tile) {
    const T* place = pass->input.Row(tile, encoded());
    std::copy(place, place + 3 * kTile, pass->ambient_input.Tile(tile));
  }
  ambient_.Forward(parameters + grid_size() + sdf_.parameter_count() + color_.parameter_count(),
                   pass->ambient_input, 3, Mlp<T>::Keep::kSlopes, &pass->ambient);
}

template <class T>
void Field<T>::ColorBackward(const T* parameters, SurfacePass* pass, T* network_gradient) const {
  color_.Backward(parameters + grid_size() + sdf_.parameter_count(), pass->color_input, pass->color_delta,
                  &pass->color, network_gradient + sdf_.parameter_count(), &pass->color_input_delta);
  if (has_ambient()) {
    const size_t begin = sdf_.parameter_count() + color_.parameter_count();
    ambient_.Backward(parameters + grid_size() + begin, pass->ambient_input, pass->ambient_delta,
                      &pass->ambient, network_gradient + begin, nullptr);
  }
  pass->normal_delta.Resize(3, pass->positions.tiles());
  if (!sees_view()) return pass->normal_delta.SetZero();
  for (int tile = 0; tile < pass->positions.tiles(); ++tile) {
    const T* delta = pass->color_input_delta.Row(tile, options_.features + 3);
    std::copy(delta, delta + 3 * kTile, pass->normal_delta.Tile(tile));
  }
}

template <class T>
void Field<T>::SurfaceBackward(const T* parameters, SurfacePass* pass, T* network_gradient) const {
  const int tiles = pass->positions.tiles();
  const int from_grid = grid_.outputs();
  FillOutputDelta(pass);
  pass->direction.Resize(encoded() + 3, tiles);
  pass->scaled_direction.Resize(3, tiles);
  for (int tile = 0; tile < tiles; ++tile) {
    const T* own = pass->free.Row(tile, 0);
    for (int d = 0; d < 3; ++d) {
      const T* u = pass->gradient_delta.Row(tile, d);
      T* by_place = pass->direction.Row(tile, encoded() + d);
      T* scaled = pass->scaled_direction.Row(tile, d);
      for (int s = 0; s < kTile; ++s) {
        by_place[s] = u[s] * own[s];
        scaled[s] = unit_ * by_place[s];
      }
    }
    const T* u = pass->scaled_direction.Tile(tile);
    for (int r = 0; r < from_grid; ++r) {
      const T* jx = pass->jacobian.Row(tile, r);
      const T* jy = pass->jacobian.Row(tile, from_grid + r);
      const T* jz = pass->jacobian.Row(tile, 2 * from_grid + r);
      T* v = pass->direction.Row(tile, r);
      for (int s = 0; s < kTile; ++s) v[s] = jx[s] * u[s] + jy[s] * u[kTile + s] + jz[s] * u[2 * kTile + s];
    }
    place_frequency_.Push(pass->input.Row(tile, from_grid), pass->direction.Row(tile, encoded()),
                          pass->direction.Row(tile, from_grid));
  }
  sdf_.BackwardSecondOrder(parameters + grid_size(), pass->input, pass->output_delta, pass->direction,
                           &pass->sdf, network_gradient, &pass->input_delta);
}

template <class T>
void Field<T>::FillOutputDelta(SurfacePass* pass) const {
  const int features = options_.features;
  pass->output_delta.Resize(1 + features, pass->positions.tiles());
  for (int tile = 0; tile < pass->positions.tiles(); ++tile) {
    const T* own = pass->free.Row(tile, 0);
    const T* value_delta = pass->value_delta.Row(tile, 0);
    T* out = pass->output_delta.Row(tile, 0);
    for (int s = 0; s < kTile; ++s) out[s] = unit_ * value_delta[s] * own[s];
    const T* feature_delta = pass->color_input_delta.Tile(tile);
    std::copy(feature_delta, feature_delta + features * kTile, pass->output_delta.Row(tile, 1));
  }
}

template <class T>
void Field<T>::PositionsBackward(const T* parameters, SurfacePass* backward, T* unused_gradient,
                                 Panel<T>* positions_delta) const {
  FillOutputDelta(backward);
  backward->direction.Resize(encoded() + 3, backward->positions.tiles());
  backward->direction.SetZero();
  sdf_.BackwardSecondOrder(parameters + grid_size(), backward->input, backward->output_delta,
                           backward->direction, &backward->sdf, unused_gradient, &backward->input_delta);
  const SurfacePass& pass = *backward;
  const int from_grid = grid_.outputs();
  positions_delta->Resize(3, pass.positions.tiles());
  for (int tile = 0; tile < pass.positions.tiles(); ++tile) {
    T base[kTile];
    T* delta = positions_delta->Tile(tile);
    StartFromInitial(pass.positions.Tile(tile), base, delta);
    const T* value_delta = pass.value_delta.Row(tile, 0);
    const T* own = pass.free.Row(tile, 0);
    for (int d = 0; d < 3; ++d) {
      T* out = delta + d * kTile;
      const T* by_place = pass.input_delta.Row(tile, encoded() + d);
      const T* by_color = pass.color_input_delta.Row(tile, options_.features + d);
      for (int s = 0; s < kTile; ++s)
        out[s] = out[s] * value_delta[s] * own[s] + (by_place[s] + by_color[s]) / unit_;
      for (int r = 0; r < from_grid; ++r) {
        const T* q = pass.input_delta.Row(tile, r);
        const T* slope = pass.jacobian.Row(tile, d * from_grid + r);
        for (int s = 0; s < kTile; ++s) out[s] += q[s] * slope[s];
      }
    }
    place_frequency_.AddGradient(pass.input.Row(tile, from_grid), pass.input_delta.Row(tile, from_grid),
                                 1 / unit_, delta);
  }
}

template <class T>
void Field<T>::LeaveForGrid(SurfacePass* pass, int count, GridTrace* trace) const {
  trace->count = count;
  std::swap(trace->positions, pass->positions);
  std::swap(trace->delta, pass->input_delta);
  std::swap(trace->pull, pass->sdf.input_gradient);
  std::swap(trace->direction, pass->scaled_direction);
}

template <class T>
void Field<T>::GridBackward(int level, const GridTrace& trace, T* grid_gradient) const {
  grid_.BackwardSecondOrder(level, trace.positions, trace.delta, trace.pull, trace.direction, trace.count,
                            grid_gradient);
}

template class Field<float>;
template class Field<double>;

}  // namespace lumen
