// Weight normalisation (Salimans and Kingma 2016): what is learnt of a row w of a weight matrix is its
// direction v and its length g, w = g v/|v|. The networks compute with w; the optimiser moves v and g.
#pragma once

#include <cstddef>
#include <vector>

namespace lumen {

template <class T>
class WeightNorm {
 public:
  // Nothing is normalised.
  WeightNorm() = default;
  // The networks have `count` parameters; the learnt ones are as many, v standing in w's place, and after
  // them the lengths, one a row.
  explicit WeightNorm(size_t count) : count_(count) {}
  void Add(size_t begin, int rows, int columns) {
    for (int r = 0; r < rows; ++r) rows_.push_back({begin + size_t(r) * columns, columns});
  }

  bool empty() const { return rows_.empty(); }
  size_t lengths() const { return rows_.size(); }
  // The lengths that leave w = v.
  void Initialise(T* learnt) const;
  // learnt: count + lengths() numbers; weights: count.
  void Expand(const T* learnt, T* weights) const;
  // ∂loss/∂learnt from ∂loss/∂weights, in place: gradient holds the latter in its first `count` numbers.
  void PullBack(const T* learnt, T* gradient) const;

 private:
  struct Row {
    size_t begin;
    int size;
  };
  size_t count_ = 0;
  std::vector<Row> rows_;
};

}  // namespace lumen
