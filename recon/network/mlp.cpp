#include "recon/network/mlp.h"

#include <cmath>

#include "common/random.h"
#include "recon/network/product.h"

namespace lumen {
namespace {

constexpr double kSquareplusBend = 0.01;

// In place: a becomes σ(a); slope and bend may be null.
template <class T>
void Activate(Activation activation, int count, T* a, T* slope, T* bend) {
  if (activation == Activation::kRelu) {
    if (slope)
      for (int i = 0; i < count; ++i) slope[i] = a[i] > 0 ? T(1) : T(0);
    if (bend) std::fill(bend, bend + count, T(0));
    for (int i = 0; i < count; ++i) a[i] = a[i] > 0 ? a[i] : T(0);
    return;
  }
  constexpr T b = T(kSquareplusBend);
  if (!slope) {
    for (int i = 0; i < count; ++i) a[i] = T(0.5) * (a[i] + std::sqrt(a[i] * a[i] + b));
  } else if (!bend) {
    for (int i = 0; i < count; ++i) {
      const T root = std::sqrt(a[i] * a[i] + b);
      slope[i] = T(0.5) + T(0.5) * a[i] / root;
      a[i] = T(0.5) * (a[i] + root);
    }
  } else {
    for (int i = 0; i < count; ++i) {
      const T root = std::sqrt(a[i] * a[i] + b);
      const T inverse = 1 / root;
      slope[i] = T(0.5) + T(0.5) * a[i] * inverse;
      bend[i] = T(0.5) * b * inverse * inverse * inverse;
      a[i] = T(0.5) * (a[i] + root);
    }
  }
}

}  // namespace

template <class T>
Mlp<T>::Mlp(const MlpShape& shape) : shape_(shape) {
  std::vector<int> widths = {shape.inputs};
  widths.insert(widths.end(), shape.hidden.begin(), shape.hidden.end());
  widths.push_back(shape.outputs);
  for (size_t l = 0; l + 1 < widths.size(); ++l) {
    Layer layer{widths[l], widths[l + 1], parameter_count_, 0};
    layer.bias = layer.weight + size_t(layer.inputs) * layer.outputs;
    parameter_count_ = layer.bias + layer.outputs;
    layers_.push_back(layer);
  }
}

template <class T>
void Mlp<T>::Initialise(uint64_t seed, double last_layer_scale, T* parameters) const {
  for (int l = 0; l < layer_count(); ++l) {
    const Layer& layer = layers_[l];
    const double bound = std::sqrt(6.0 / layer.inputs) * (l + 1 == layer_count() ? last_layer_scale : 1.0);
    for (size_t i = layer.weight; i < layer.bias; ++i) {
      parameters[i] = static_cast<T>(bound * (2 * UniformDouble(RandomBits(seed, i)) - 1));
    }
    std::fill(parameters + layer.bias, parameters + layer.bias + layer.outputs, T(0));
  }
}

template <class T>
void Mlp<T>::Forward(const T* parameters, const Panel<T>& input, int outputs, Keep keep, Pass* pass) const {
  const int tiles = input.tiles();
  const bool with_slopes = keep != Keep::kNothing;
  const bool with_bends = keep == Keep::kBends;
  pass->value.resize(layer_count());
  pass->slope.resize(layer_count() - 1);
  pass->bend.resize(layer_count() - 1);
  for (int l = 0; l < layer_count(); ++l) {
    const bool last = l + 1 == layer_count();
    pass->value[l].Resize(last ? outputs : layers_[l].outputs, tiles);
    if (last) break;
    if (with_slopes) pass->slope[l].Resize(layers_[l].outputs, tiles);
    if (with_bends) pass->bend[l].Resize(layers_[l].outputs, tiles);
  }
  for (int tile = 0; tile < tiles; ++tile) {
    const T* x = input.Tile(tile);
    for (int l = 0; l < layer_count(); ++l) {
      const Layer& layer = layers_[l];
      T* y = pass->value[l].Tile(tile);
      Multiply(parameters + layer.weight, parameters + layer.bias, pass->value[l].rows(), layer.inputs, x, y);
      if (l + 1 < layer_count()) {
        Activate(shape_.activation, layer.outputs * kTile, y,
                 with_slopes ? pass->slope[l].Tile(tile) : nullptr,
                 with_bends ? pass->bend[l].Tile(tile) : nullptr);
      }
      x = y;
    }
  }
}

template <class T>
void Mlp<T>::InputGradient(const T* parameters, Pass* pass) const {
  const int tiles = pass->value[0].tiles();
  const int last = layer_count() - 1;
  pass->pulled.resize(last);
  pass->adjoint.resize(last);
  for (int l = 0; l < last; ++l) {
    pass->pulled[l].Resize(layers_[l].outputs, tiles);
    pass->adjoint[l].Resize(layers_[l].outputs, tiles);
  }
  pass->input_gradient.Resize(shape_.inputs, tiles);
  for (int tile = 0; tile < tiles; ++tile) {
    for (int l = last; l >= 0; --l) {
      const Layer& layer = layers_[l];
      T* pulled = l > 0 ? pass->pulled[l - 1].Tile(tile) : pass->input_gradient.Tile(tile);
      if (l == last) {  // b_L = e₀: the transposed product is the first row of W_L
        for (int i = 0; i < layer.inputs; ++i)
          std::fill(pulled + i * kTile, pulled + (i + 1) * kTile, parameters[layer.weight + i]);
      } else {
        MultiplyTransposed(parameters + layer.weight, layer.outputs, layer.inputs,
                           pass->adjoint[l].Tile(tile), pulled);
      }
      if (l == 0) break;
      const T* slope = pass->slope[l - 1].Tile(tile);
      T* adjoint = pass->adjoint[l - 1].Tile(tile);
      for (int i = 0; i < layer.inputs * kTile; ++i) adjoint[i] = slope[i] * pulled[i];
    }
  }
}

template <class T>
void Mlp<T>::PushTangent(const T* parameters, const Panel<T>& direction, Pass* pass) const {
  const int hidden = layer_count() - 1;
  pass->pushed.resize(hidden);
  pass->tangent.resize(hidden);
  for (int l = 0; l < hidden; ++l) {
    pass->pushed[l].Resize(layers_[l].outputs, direction.tiles());
    pass->tangent[l].Resize(layers_[l].outputs, direction.tiles());
  }
  for (int tile = 0; tile < direction.tiles(); ++tile) {
    const T* x = direction.Tile(tile);
    for (int l = 0; l < hidden; ++l) {
      const Layer& layer = layers_[l];
      T* pushed = pass->pushed[l].Tile(tile);
      T* tangent = pass->tangent[l].Tile(tile);
      Multiply<T>(parameters + layer.weight, nullptr, layer.outputs, layer.inputs, x, pushed);
      const T* slope = pass->slope[l].Tile(tile);
      for (int i = 0; i < layer.outputs * kTile; ++i) tangent[i] = slope[i] * pushed[i];
      x = tangent;
    }
  }
}

template <class T>
void Mlp<T>::BackwardImpl(const T* parameters, const Panel<T>& input, const Panel<T>& output_delta,
                          const Panel<T>* direction, Pass* pass, T* gradient, Panel<T>* input_delta) const {
  const int tiles = input.tiles();
  const int last = layer_count() - 1;
  pass->delta.resize(last);
  for (int l = 0; l < last; ++l) pass->delta[l].Resize(layers_[l].outputs, tiles);
  if (input_delta) input_delta->Resize(shape_.inputs, tiles);
  for (int tile = 0; tile < tiles; ++tile) {
    for (int l = last; l >= 0; --l) {
      const Layer& layer = layers_[l];
      if (l == 0 && !input_delta) break;
      const T* delta = l == last ? output_delta.Tile(tile) : pass->delta[l].Tile(tile);
      T* below = l > 0 ? pass->delta[l - 1].Tile(tile) : input_delta->Tile(tile);
      const int outputs = l == last ? output_delta.rows() : layer.outputs;
      MultiplyTransposed(parameters + layer.weight, outputs, layer.inputs, delta, below);
      if (l == 0) break;
      const T* slope = pass->slope[l - 1].Tile(tile);
      const int count = layer.inputs * kTile;
      if (direction) {
        const T* bend = pass->bend[l - 1].Tile(tile);
        const T* pushed = pass->pushed[l - 1].Tile(tile);
        const T* pulled = pass->pulled[l - 1].Tile(tile);
        for (int i = 0; i < count; ++i) below[i] = slope[i] * below[i] + bend[i] * pushed[i] * pulled[i];
      } else {
        for (int i = 0; i < count; ++i) below[i] *= slope[i];
      }
    }
  }
  for (int l = 0; l <= last; ++l) {
    const Panel<T>& delta = l == last ? output_delta : pass->delta[l];
    const Panel<T>& below = l > 0 ? pass->value[l - 1] : input;
    AccumulateOuter(delta, below, gradient + layers_[l].weight, gradient + layers_[l].bias);
  }
}

template <class T>
void Mlp<T>::Backward(const T* parameters, const Panel<T>& input, const Panel<T>& output_delta, Pass* pass,
                      T* gradient, Panel<T>* input_delta) const {
  BackwardImpl(parameters, input, output_delta, nullptr, pass, gradient, input_delta);
}

template <class T>
void Mlp<T>::BackwardSecondOrder(const T* parameters, const Panel<T>& input, const Panel<T>& output_delta,
                                 const Panel<T>& direction, Pass* pass, T* gradient,
                                 Panel<T>* input_delta) const {
  PushTangent(parameters, direction, pass);
  BackwardImpl(parameters, input, output_delta, &direction, pass, gradient, input_delta);
  const int last = layer_count() - 1;
  for (int l = 0; l < last; ++l) {
    const Panel<T>& below = l > 0 ? pass->tangent[l - 1] : direction;
    AccumulateOuter<T>(pass->adjoint[l], below, gradient + layers_[l].weight, nullptr);
  }
  // b_L = e₀: only the first row of W_L gains, Σ_samples φ_(L−1).
  const Panel<T>& below = last > 0 ? pass->tangent[last - 1] : direction;
  for (int tile = 0; tile < below.tiles(); ++tile) {
    for (int i = 0; i < layers_[last].inputs; ++i) {
      T total = 0;
      for (int s = 0; s < kTile; ++s) total += below.Row(tile, i)[s];
      gradient[layers_[last].weight + i] += total;
    }
  }
}

template class Mlp<float>;
template class Mlp<double>;

}  // namespace lumen
