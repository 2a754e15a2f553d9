#include "recon/network/mlp.h"

#include <cmath>
#include <type_traits>

#include "common/math.h"
#include "common/random.h"

namespace lumen {
namespace {

// What the joined numbers of a skip are multiplied by, so that their sum of squares stays as it is (NeuS).
constexpr double kSkipScale = 0.70710678118654752440;

// to = scale · from, `count` rows of one tile.
template <class T>
void ScaleRows(int rows, T scale, const T* from, T* to) {
  for (int i = 0; i < rows * kTile; ++i) to[i] = scale * from[i];
}

// Standard normal (Box and Muller), a function of (seed, at).
double Gauss(uint64_t seed, uint64_t at) {
  return std::sqrt(-2 * std::log(1 - UniformDouble(RandomBits(seed, at, 0)))) *
         std::cos(2 * kPi * UniformDouble(RandomBits(seed, at, 1)));
}

template <class T>
void AddScaledRows(int rows, T scale, const T* from, T* to) {
  for (int i = 0; i < rows * kTile; ++i) to[i] += scale * from[i];
}

// Every pass starts by filling it, so that a thread needs one for all networks.
Bfloat16Products::Room& ThreadsRoom() {
  thread_local Bfloat16Products::Room room;
  return room;
}

}  // namespace

template <class T>
Mlp<T>::Mlp(const MlpShape& shape, const Bfloat16Kernels* rounded) : shape_(shape), rounded_(rounded) {
  std::vector<int> widths = {shape.inputs};
  widths.insert(widths.end(), shape.hidden.begin(), shape.hidden.end());
  widths.push_back(shape.outputs);
  for (size_t l = 0; l + 1 < widths.size(); ++l) {
    MlpLayer layer{widths[l], widths[l + 1], parameter_count_, 0};
    if (shape.skip > 0 && static_cast<int>(l) + 1 == shape.skip) layer.outputs -= shape.inputs;
    layer.bias = layer.weight + size_t(layer.inputs) * layer.outputs;
    parameter_count_ = layer.bias + layer.outputs;
    layers_.push_back(layer);
  }
}

template <class T>
void Mlp<T>::Initialise(uint64_t seed, double last_layer_scale, T* parameters) const {
  for (int l = 0; l < layer_count(); ++l) {
    const MlpLayer& layer = layers_[l];
    const double bound = std::sqrt(6.0 / layer.inputs) * (l + 1 == layer_count() ? last_layer_scale : 1.0);
    for (size_t i = layer.weight; i < layer.bias; ++i) {
      parameters[i] = static_cast<T>(bound * (2 * UniformDouble(RandomBits(seed, i)) - 1));
    }
    std::fill(parameters + layer.bias, parameters + layer.bias + layer.outputs, T(0));
  }
}

template <class T>
void Mlp<T>::InitialiseSmooth(uint64_t seed, double last_layer_scale, int place_begin, T* parameters) const {
  for (int l = 0; l < layer_count(); ++l) {
    const MlpLayer& layer = layers_[l];
    std::fill(parameters + layer.bias, parameters + layer.bias + layer.outputs, T(0));
    const double scale = std::sqrt(2.0 / layer.outputs) * (l + 1 == layer_count() ? last_layer_scale : 1.0);
    for (int o = 0; o < layer.outputs; ++o) {
      for (int i = 0; i < layer.inputs; ++i) {
        const size_t at = layer.weight + size_t(o) * layer.inputs + i;
        // Which of the network's inputs this is, if it is one.
        const int input = l == 0 ? i : JoinsInput(l) ? i - layers_[l - 1].outputs : -1;
        const bool counts = input < 0 || (input >= place_begin && input < place_begin + 3);
        parameters[at] = static_cast<T>(counts ? scale * Gauss(seed, at) : 0.0);
      }
    }
  }
}

template <class T>
void Mlp<T>::InitialiseAsSphere(uint64_t seed, double radius, int place_begin, T* parameters) const {
  InitialiseSmooth(seed, 1, place_begin, parameters);
  const MlpLayer& last = layers_.back();
  for (size_t at = last.weight; at < last.bias; ++at)
    parameters[at] = static_cast<T>(-std::sqrt(kPi / last.inputs) + 1e-4 * Gauss(seed, at));
  std::fill(parameters + last.bias, parameters + last.bias + last.outputs, static_cast<T>(radius));
}

template <class T>
std::vector<typename Mlp<T>::Matrix> Mlp<T>::matrices() const {
  std::vector<Matrix> all;
  for (const MlpLayer& layer : layers_) all.push_back({layer.weight, layer.outputs, layer.inputs});
  return all;
}

template <class T>
template <class PassBy>
void Mlp<T>::WithProducts(const T* parameters, const PassBy& pass_by) const {
  if constexpr (std::is_same_v<T, float>) {
    if (rounded_) return pass_by(Bfloat16Products(*rounded_, parameters, &ThreadsRoom()));
  }
  pass_by(ExactProducts<T>(parameters));
}

template <class T>
template <class Products>
void Mlp<T>::ForwardBy(Products products, const T* parameters, const Panel<T>& input, int outputs, Keep keep,
                       Pass* pass) const {
  const int tiles = input.tiles();
  const bool with_slopes = keep != Keep::kNothing;
  const bool with_bends = keep == Keep::kBends;
  pass->value.resize(layer_count());
  pass->slope.resize(layer_count() - 1);
  pass->bend.resize(layer_count() - 1);
  for (int l = 0; l < layer_count(); ++l) {
    const bool last = l + 1 == layer_count();
    // Where nothing asks for them again, a layer's numbers stay until the next tile's.
    pass->value[l].Resize(last ? outputs : layers_[l + 1].inputs, last || with_slopes ? tiles : 1);
    if (last) break;
    if (with_slopes) pass->slope[l].Resize(layers_[l].outputs, tiles);
    if (with_bends) pass->bend[l].Resize(layers_[l].outputs, tiles);
  }
  products.PrepareMultiply(layers_, outputs);
  for (int tile = 0; tile < tiles; ++tile) {
    const T* x = input.Tile(tile);
    for (int l = 0; l < layer_count(); ++l) {
      const MlpLayer& layer = layers_[l];
      const bool last = l + 1 == layer_count();
      T* y = pass->value[l].Tile(last || with_slopes ? tile : 0);
      products.Multiply(layer, parameters + layer.bias, last ? outputs : layer.outputs, x, y);
      if (!last) {
        T* slope = with_slopes ? pass->slope[l].Tile(tile) : nullptr;
        T* bend = with_bends ? pass->bend[l].Tile(tile) : nullptr;
        Activate(shape_.activation, layer.outputs * kTile, y, slope, bend);
        if (JoinsInput(l + 1)) {
          for (T* rows : {y, slope, bend})
            if (rows) ScaleRows(layer.outputs, T(kSkipScale), rows, rows);
          ScaleRows(shape_.inputs, T(kSkipScale), input.Tile(tile), y + layer.outputs * kTile);
        }
      }
      x = y;
    }
  }
}

template <class T>
template <class Products>
void Mlp<T>::InputGradientBy(Products products, const T* parameters, Pass* pass) const {
  const int tiles = pass->value[0].tiles();
  const int last = layer_count() - 1;
  pass->pulled.resize(last);
  pass->adjoint.resize(last);
  for (int l = 0; l < last; ++l) {
    pass->pulled[l].Resize(layers_[l + 1].inputs, tiles);
    pass->adjoint[l].Resize(layers_[l].outputs, tiles);
  }
  pass->input_gradient.Resize(shape_.inputs, tiles);
  products.PrepareTransposed(layers_, 0);
  for (int tile = 0; tile < tiles; ++tile) {
    for (int l = last; l >= 0; --l) {
      const MlpLayer& layer = layers_[l];
      T* pulled = l > 0 ? pass->pulled[l - 1].Tile(tile) : pass->input_gradient.Tile(tile);
      if (l == last) {  // b_L = e₀: the transposed product is the first row of W_L
        for (int i = 0; i < layer.inputs; ++i)
          std::fill(pulled + i * kTile, pulled + (i + 1) * kTile, parameters[layer.weight + i]);
      } else {
        products.MultiplyTransposed(layer, layer.outputs, pass->adjoint[l].Tile(tile), pulled);
      }
      if (l == 0) break;
      const T* slope = pass->slope[l - 1].Tile(tile);
      T* adjoint = pass->adjoint[l - 1].Tile(tile);
      const int count = layers_[l - 1].outputs * kTile;
      for (int i = 0; i < count; ++i) adjoint[i] = slope[i] * pulled[i];
    }
    if (shape_.skip > 0) {
      AddScaledRows(shape_.inputs, T(kSkipScale),
                    pass->pulled[shape_.skip - 1].Row(tile, layers_[shape_.skip - 1].outputs),
                    pass->input_gradient.Tile(tile));
    }
  }
}

template <class T>
template <class Products>
void Mlp<T>::PushTangentBy(Products products, const Panel<T>& direction, Pass* pass) const {
  const int hidden = layer_count() - 1;
  pass->pushed.resize(hidden);
  pass->tangent.resize(hidden);
  for (int l = 0; l < hidden; ++l) {
    pass->pushed[l].Resize(layers_[l].outputs, direction.tiles());
    pass->tangent[l].Resize(layers_[l + 1].inputs, direction.tiles());
  }
  products.PrepareMultiply(layers_, 0);
  for (int tile = 0; tile < direction.tiles(); ++tile) {
    const T* x = direction.Tile(tile);
    for (int l = 0; l < hidden; ++l) {
      const MlpLayer& layer = layers_[l];
      T* pushed = pass->pushed[l].Tile(tile);
      T* tangent = pass->tangent[l].Tile(tile);
      products.Multiply(layer, nullptr, layer.outputs, x, pushed);
      const T* slope = pass->slope[l].Tile(tile);
      for (int i = 0; i < layer.outputs * kTile; ++i) tangent[i] = slope[i] * pushed[i];
      if (JoinsInput(l + 1))
        ScaleRows(shape_.inputs, T(kSkipScale), direction.Tile(tile), tangent + layer.outputs * kTile);
      x = tangent;
    }
  }
}

template <class T>
template <class Products>
void Mlp<T>::BackwardBy(Products products, const Panel<T>& input, const Panel<T>& output_delta,
                        const Panel<T>* direction, Pass* pass, T* gradient, Panel<T>* input_delta) const {
  const int tiles = input.tiles();
  const int last = layer_count() - 1;
  pass->delta.resize(last);
  for (int l = 0; l < last; ++l) pass->delta[l].Resize(layers_[l].outputs, tiles);
  if (input_delta) input_delta->Resize(shape_.inputs, tiles);
  if (shape_.skip > 0) pass->joined_delta.Resize(layers_[shape_.skip].inputs, 1);
  products.PrepareTransposed(layers_, output_delta.rows());
  for (int tile = 0; tile < tiles; ++tile) {
    for (int l = last; l >= 0; --l) {
      const MlpLayer& layer = layers_[l];
      if (l == 0 && !input_delta) break;
      const T* delta = l == last ? output_delta.Tile(tile) : pass->delta[l].Tile(tile);
      T* below = l > 0 ? pass->delta[l - 1].Tile(tile) : input_delta->Tile(tile);
      const int outputs = l == last ? output_delta.rows() : layer.outputs;
      T* joined = JoinsInput(l) ? pass->joined_delta.Tile(0) : below;
      products.MultiplyTransposed(layer, outputs, delta, joined);
      if (l == 0) break;
      const T* slope = pass->slope[l - 1].Tile(tile);
      const int count = layers_[l - 1].outputs * kTile;
      if (joined != below) std::copy(joined, joined + count, below);
      if (direction) {
        const T* bend = pass->bend[l - 1].Tile(tile);
        const T* pushed = pass->pushed[l - 1].Tile(tile);
        const T* pulled = pass->pulled[l - 1].Tile(tile);
        for (int i = 0; i < count; ++i) below[i] = slope[i] * below[i] + bend[i] * pushed[i] * pulled[i];
      } else {
        for (int i = 0; i < count; ++i) below[i] *= slope[i];
      }
    }
    if (shape_.skip > 0 && input_delta) {
      AddScaledRows(shape_.inputs, T(kSkipScale), pass->joined_delta.Row(0, layers_[shape_.skip - 1].outputs),
                    input_delta->Tile(tile));
    }
  }
  for (int l = 0; l <= last; ++l) {
    const Panel<T>& delta = l == last ? output_delta : pass->delta[l];
    const Panel<T>& below = l > 0 ? pass->value[l - 1] : input;
    products.AccumulateOuter(delta, below, gradient + layers_[l].weight, gradient + layers_[l].bias);
  }
}

template <class T>
template <class Products>
void Mlp<T>::BackwardSecondOrderBy(Products products, const Panel<T>& input, const Panel<T>& output_delta,
                                   const Panel<T>& direction, Pass* pass, T* gradient,
                                   Panel<T>* input_delta) const {
  PushTangentBy(products, direction, pass);
  BackwardBy(products, input, output_delta, &direction, pass, gradient, input_delta);
  const int last = layer_count() - 1;
  for (int l = 0; l < last; ++l) {
    const Panel<T>& below = l > 0 ? pass->tangent[l - 1] : direction;
    products.AccumulateOuter(pass->adjoint[l], below, gradient + layers_[l].weight, nullptr);
  }
  // b_L = e₀: only the first row of W_L gains, Σ_samples φ_(L−1).
  const Panel<T>& below = last > 0 ? pass->tangent[last - 1] : direction;
  AccumulateRows(below, gradient + layers_[last].weight);
}

template <class T>
void Mlp<T>::Forward(const T* parameters, const Panel<T>& input, int outputs, Keep keep, Pass* pass) const {
  WithProducts(parameters,
               [&](auto products) { ForwardBy(products, parameters, input, outputs, keep, pass); });
}

template <class T>
void Mlp<T>::InputGradient(const T* parameters, Pass* pass) const {
  WithProducts(parameters, [&](auto products) { InputGradientBy(products, parameters, pass); });
}

template <class T>
void Mlp<T>::Backward(const T* parameters, const Panel<T>& input, const Panel<T>& output_delta, Pass* pass,
                      T* gradient, Panel<T>* input_delta) const {
  WithProducts(parameters, [&](auto products) {
    BackwardBy(products, input, output_delta, nullptr, pass, gradient, input_delta);
  });
}

template <class T>
void Mlp<T>::BackwardSecondOrder(const T* parameters, const Panel<T>& input, const Panel<T>& output_delta,
                                 const Panel<T>& direction, Pass* pass, T* gradient,
                                 Panel<T>* input_delta) const {
  WithProducts(parameters, [&](auto products) {
    BackwardSecondOrderBy(products, input, output_delta, direction, pass, gradient, input_delta);
  });
}

template class Mlp<float>;
template class Mlp<double>;

}  // namespace lumen
