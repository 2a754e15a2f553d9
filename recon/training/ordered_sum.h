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

  // From now on terms, counted from 0, are added to sum[0 … size), which must stay until they are. Of earlier
  // terms none is left.
  void Start(float* sum);
  // A vector of zeros to make a term of.
  Term Take();
  // Adds term `number`, which comes once, as soon as those before it are there; until then it is kept. Where
  // threads take up terms in their order, about one a thread is kept at a time; more only while one is held
  // up.
  void Add(int64_t number, Term term);

 private:
  const size_t size_;
  std::mutex mutex_;
  float* sum_ = nullptr;
  int64_t next_ = 0;
  std::map<int64_t, Term> early_;
  std::vector<Term> idle_;
};

}  // namespace lumen
