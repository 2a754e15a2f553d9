// A sum of vectors that several threads make: added in the order of their numbers, whichever thread is done
// first, so that it rounds the same for any number of threads; and without holding all of them.
#pragma once

#include <cstdint>
#include <map>
#include <mutex>
#include <vector>

#include "recon/network/panel.h"

namespace lumen {

class OrderedSum {
 public:
  using Term = LineVector<float>;

  explicit OrderedSum(size_t size) : size_(size) {}

  // Terms are counted from 0 again.
  void Start();
  // A vector of zeros to make a term of.
  Term Take();
  // Adds term `number` to sum[0 … size) as soon as those before it are there; until then it is kept. Where
  // threads take up terms in their order, about one a thread is kept at a time.
  void Add(int64_t number, Term term, float* sum);

 private:
  const size_t size_;
  std::mutex mutex_;
  int64_t next_ = 0;
  std::map<int64_t, Term> early_;
  std::vector<Term> idle_;
};

}  // namespace lumen
