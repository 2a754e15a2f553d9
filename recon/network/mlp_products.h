// What a network's passes take the products of its layers by: as recon/network/product.h has them, or with
// factors rounded to bfloat16.
#pragma once

#include <vector>

#include "recon/network/bfloat16_kernels.h"
#include "recon/network/product.h"

namespace lumen {

struct MlpLayer {
  int inputs, outputs;
  size_t weight, bias;  // offsets in the parameters
};

template <class T>
class ExactProducts {
 public:
  explicit ExactProducts(const T* parameters) : parameters_(parameters) {}

  // Before the first Multiply or MultiplyTransposed of a pass. last_outputs: how many of the last layer's
  // outputs these will ask for.
  void PrepareMultiply(const std::vector<MlpLayer>&, int) {}
  void PrepareTransposed(const std::vector<MlpLayer>&, int) {}

  // The first `outputs` rows of a layer's product, for a tile.
  void Multiply(const MlpLayer& layer, const T* bias, int outputs, const T* x, T* y) const {
    lumen::Multiply(parameters_ + layer.weight, bias, outputs, layer.inputs, x, y);
  }
  void MultiplyTransposed(const MlpLayer& layer, int outputs, const T* y, T* x) const {
    lumen::MultiplyTransposed(parameters_ + layer.weight, outputs, layer.inputs, y, x);
  }
  void AccumulateOuter(const Panel<T>& y, const Panel<T>& x, T* gradient, T* bias_gradient) const {
    lumen::AccumulateOuter(y, x, gradient, bias_gradient);
  }

 private:
  const T* parameters_;
};

class Bfloat16Products {
 public:
  // Rounded numbers between the products of one pass. Reuse it: it keeps its memory.
  struct Room {
    LineVector<uint32_t> weights;  // of a layer from its offset on
    LineVector<uint32_t> tile;
  };

  Bfloat16Products(const Bfloat16Kernels& kernels, const float* parameters, Room* room)
      : kernels_(kernels), parameters_(parameters), room_(room) {}

  void PrepareMultiply(const std::vector<MlpLayer>& layers, int last_outputs) {
    MakeRoom(layers);
    for (const MlpLayer& layer : layers)
      kernels_.pair_columns(&layer == &layers.back() ? last_outputs : layer.outputs, layer.inputs,
                            parameters_ + layer.weight, room_->weights.data() + layer.weight);
  }
  void PrepareTransposed(const std::vector<MlpLayer>& layers, int last_outputs) {
    MakeRoom(layers);
    for (const MlpLayer& layer : layers)
      kernels_.pair_rows(&layer == &layers.back() ? last_outputs : layer.outputs, layer.inputs,
                         parameters_ + layer.weight, room_->weights.data() + layer.weight);
  }

  void Multiply(const MlpLayer& layer, const float* bias, int outputs, const float* x, float* y) const {
    const size_t pairs = PairsFor(layer.inputs);
    kernels_.pair_rows(layer.inputs, kTile, x, Tile(pairs));
    kernels_.multiply(room_->weights.data() + layer.weight, pairs, 1, bias, outputs, static_cast<int>(pairs),
                      room_->tile.data(), y);
  }
  void MultiplyTransposed(const MlpLayer& layer, int outputs, const float* y, float* x) const {
    kernels_.pair_rows(outputs, kTile, y, Tile(PairsFor(outputs)));
    kernels_.multiply(room_->weights.data() + layer.weight, 1, layer.inputs, nullptr, layer.inputs,
                      PairsFor(outputs), room_->tile.data(), x);
  }
  // Biases gain by sums, not by products: these stay as they are.
  void AccumulateOuter(const Panel<float>& y, const Panel<float>& x, float* gradient,
                       float* bias_gradient) const {
    kernels_.accumulate_outer(y.Tile(0), y.rows(), x.Tile(0), x.rows(), y.tiles(), Tile(y.rows()), gradient);
    if (bias_gradient) AccumulateRows(y, bias_gradient);
  }

 private:
  // A layer's pairs are no more than its weights, and a pass needs one of the two kinds of pairs.
  void MakeRoom(const std::vector<MlpLayer>& layers) { Grow(layers.back().bias, &room_->weights); }
  // Room for so many rows of pairs, kTile of them each or half as many.
  uint32_t* Tile(size_t rows) const {
    Grow(rows * kTile, &room_->tile);
    return room_->tile.data();
  }
  static void Grow(size_t size, LineVector<uint32_t>* numbers) {
    if (numbers->size() < size) numbers->resize(size);
  }

  const Bfloat16Kernels& kernels_;
  const float* parameters_;
  Room* room_;
};

}  // namespace lumen
