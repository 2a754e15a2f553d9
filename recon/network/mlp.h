// Small fully connected networks: forward, backward, the gradient of one output by the input, and the
// derivative of that gradient (second order), which the eikonal term and shading by normals need.
//
// Layers l = 1…L: a_l = W_l h_(l−1) + c_l, h_l = σ(a_l) for l < L, the output is a_L. With b_L = e₀,
// B_l = W_(l+1)ᵀ b_(l+1), b_l = σ′(a_l) ⊙ B_l, the gradient of output 0 is q = W_1ᵀ b_1. For a direction v of
// the input, with φ_0 = v, p_l = W_l φ_(l−1), φ_l = σ′(a_l) ⊙ p_l, the number v·q has
//   ∂(v·q)/∂W_l = b_l φ_(l−1)ᵀ  and  ∂(v·q)/∂a_l = σ″(a_l) ⊙ p_l ⊙ B_l,
// the latter joining the ordinary backward pass.
#pragma once

#include <cstdint>
#include <vector>

#include "recon/network/activation.h"
#include "recon/network/mlp_products.h"
#include "recon/network/panel.h"

namespace lumen {

struct MlpShape {
  int inputs = 0;
  std::vector<int> hidden;
  int outputs = 0;
  Activation activation = Activation::kRelu;
  // The layer (counted from 0) that sees the network's input once more: (h, x)/√2. The layer before it is
  // narrower by as many, so that hidden[skip − 1] counts both. 0 = none.
  int skip = 0;
};

// T = float, or double for reference. Holds the shape only; parameters are the caller's: W_1, c_1, W_2, c_2,
// …, each W row-major, outputs × inputs.
template <class T>
class Mlp {
 public:
  // rounded: what the passes round the factors of their products to bfloat16 by; null: they don't. A network
  // of doubles, which is for reference, never does.
  explicit Mlp(const MlpShape& shape, const Bfloat16Kernels* rounded = nullptr);

  const MlpShape& shape() const { return shape_; }
  size_t parameter_count() const { return parameter_count_; }
  // Weights uniform in ±√(6/inputs) (He 2015), biases 0; the last layer's times `last_layer_scale`.
  void Initialise(uint64_t seed, double last_layer_scale, T* parameters) const;
  // NeuS's geometric start (Atzmon and Lipman 2020) but for the last layer, which is normally distributed as
  // the others are: of the inputs only the three from place_begin on count yet, so that the outputs are
  // smooth functions of place.
  void InitialiseSmooth(uint64_t seed, double last_layer_scale, int place_begin, T* parameters) const;
  // And with it, turned inside out: the outputs are about radius − |place|.
  void InitialiseAsSphere(uint64_t seed, double radius, int place_begin, T* parameters) const;
  // Where the weights stand among the parameters.
  struct Matrix {
    size_t begin;
    int rows, columns;
  };
  std::vector<Matrix> matrices() const;

  // What the passes over one batch leave for each other. Reuse it: it keeps its memory.
  struct Pass {
    // h_l; value[L−1] is the output (l counted from 0 here and below). Where a layer joins the input to it,
    // value, pulled and tangent hold the rows of both. Under Keep::kNothing the hidden layers' are one tile.
    std::vector<Panel<T>> value;
    std::vector<Panel<T>> slope;    // σ′(a_l), hidden layers
    std::vector<Panel<T>> bend;     // σ″(a_l), hidden layers, if asked for
    std::vector<Panel<T>> pulled;   // B_l
    std::vector<Panel<T>> adjoint;  // b_l
    std::vector<Panel<T>> pushed;   // p_l
    std::vector<Panel<T>> tangent;  // φ_l
    std::vector<Panel<T>> delta;    // ∂loss/∂a_l
    Panel<T> input_gradient;        // q
    Panel<T> joined_delta;          // ∂loss/∂(h, x)/√2 of one tile, where the shape has a skip
  };

  // What a forward pass keeps for the passes that may follow.
  enum class Keep { kNothing, kSlopes, kBends };

  // The first `outputs` outputs of all tiles of `input` into pass->value.back(). Keep::kSlopes is needed by
  // InputGradient and Backward, kBends by BackwardSecondOrder.
  void Forward(const T* parameters, const Panel<T>& input, int outputs, Keep keep, Pass* pass) const;

  // q, the gradient of output 0 by the input, into pass->input_gradient. After Forward with slopes.
  void InputGradient(const T* parameters, Pass* pass) const;

  // Adds the loss's gradient by the parameters to `gradient` and writes that by the input to input_delta
  // (unless null). output_delta: ∂loss/∂output, a row for each output that Forward computed.
  void Backward(const T* parameters, const Panel<T>& input, const Panel<T>& output_delta, Pass* pass,
                T* gradient, Panel<T>* input_delta) const;

  // The same for a loss that also depends on q: direction = v = ∂loss/∂q, inputs × tiles. After
  // InputGradient.
  void BackwardSecondOrder(const T* parameters, const Panel<T>& input, const Panel<T>& output_delta,
                           const Panel<T>& direction, Pass* pass, T* gradient, Panel<T>* input_delta) const;

 private:
  int layer_count() const { return static_cast<int>(layers_.size()); }
  bool JoinsInput(int layer) const { return layer > 0 && layer == shape_.skip; }
  // pass_by(products), which are ExactProducts<T> or Bfloat16Products.
  template <class PassBy>
  void WithProducts(const T* parameters, const PassBy& pass_by) const;
  template <class Products>
  void ForwardBy(Products products, const T* parameters, const Panel<T>& input, int outputs, Keep keep,
                 Pass* pass) const;
  template <class Products>
  void InputGradientBy(Products products, const T* parameters, Pass* pass) const;
  template <class Products>
  void PushTangentBy(Products products, const Panel<T>& direction, Pass* pass) const;
  template <class Products>
  void BackwardBy(Products products, const Panel<T>& input, const Panel<T>& output_delta,
                  const Panel<T>* direction, Pass* pass, T* gradient, Panel<T>* input_delta) const;
  template <class Products>
  void BackwardSecondOrderBy(Products products, const Panel<T>& input, const Panel<T>& output_delta,
                             const Panel<T>& direction, Pass* pass, T* gradient, Panel<T>* input_delta) const;

  MlpShape shape_;
  const Bfloat16Kernels* rounded_;
  std::vector<MlpLayer> layers_;
  size_t parameter_count_ = 0;
};

}  // namespace lumen
