#include "recon/training/ordered_sum.h"

#include <utility>

namespace lumen {

void OrderedSum::Start(float* sum) {
  const std::lock_guard lock(mutex_);
  sum_ = sum;
  next_ = 0;
  early_.clear();  // of a round that an exception has ended
}

OrderedSum::Term OrderedSum::Take() {
  Term term;
  {
    const std::lock_guard lock(mutex_);
    if (!idle_.empty()) {
      term = std::move(idle_.back());
      idle_.pop_back();
    }
  }
  term.assign(size_, 0.0f);
  return term;
}

void OrderedSum::Add(int64_t number, Term term) {
  const std::lock_guard lock(mutex_);
  early_.emplace(number, std::move(term));
  for (auto first = early_.begin(); first != early_.end() && first->first == next_; first = early_.begin()) {
    const Term& due = first->second;
    for (size_t i = 0; i < size_; ++i) sum_[i] += due[i];
    idle_.push_back(std::move(first->second));
    early_.erase(first);
    ++next_;
  }
}

}  // namespace lumen
