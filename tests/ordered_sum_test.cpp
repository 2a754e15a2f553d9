// That a sum of vectors doesn't depend on the order in which they come.
#include "recon/training/ordered_sum.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <numeric>

#include "common/parallel.h"
#include "common/random.h"

namespace lumen {
namespace {

constexpr size_t kSize = 37;

// Of so different sizes that their sum depends on their order.
OrderedSum::Term Filled(OrderedSum::Term term, int number) {
  for (size_t i = 0; i < term.size(); ++i)
    term[i] += (UniformFloat(RandomBits(1, number, i)) - 0.5f) * (number % 2 == 0 ? 1e6f : 1.0f);
  return term;
}

std::vector<float> SumIn(const std::vector<int>& order) {
  std::vector<float> sum(kSize, 0.0f);
  for (int number : order) {
    const OrderedSum::Term term = Filled(OrderedSum::Term(kSize, 0.0f), number);
    for (size_t i = 0; i < kSize; ++i) sum[i] += term[i];
  }
  return sum;
}

TEST(OrderedSum, RoundsAsInOrderWhicheverComesFirst) {
  std::vector<int> order = {0, 1, 2, 3, 4};
  const std::vector<float> expected = SumIn(order);
  OrderedSum ordered(kSize);
  int others = 0;
  do {
    std::vector<float> sum(kSize, 0.0f);
    ordered.Start(sum.data());
    for (int number : order) ordered.Add(number, Filled(ordered.Take(), number));
    EXPECT_EQ(sum, expected);
    others += SumIn(order) != expected;
  } while (std::ranges::next_permutation(order).found);
  EXPECT_GT(others, 60);  // of the 119 other orders: plain addition would be caught
}

TEST(OrderedSum, AddsATermWhenThoseBeforeItAreThere) {
  OrderedSum ordered(1);
  float sum = 0;
  ordered.Start(&sum);
  const auto add = [&](int number, float value) {
    OrderedSum::Term term = ordered.Take();
    EXPECT_EQ(term, OrderedSum::Term(1, 0.0f));
    term[0] = value;
    ordered.Add(number, std::move(term));
  };
  add(2, 4);
  add(1, 2);
  EXPECT_EQ(sum, 0);
  add(0, 1);
  EXPECT_EQ(sum, 7);
  add(3, 8);
  EXPECT_EQ(sum, 15);
}

TEST(OrderedSum, StartsAfreshAfterARoundThatWasntFinished) {
  OrderedSum ordered(1);
  float left = 0, sum = 0;
  ordered.Start(&left);
  ordered.Add(1, OrderedSum::Term(1, 5.0f));  // whose 0 never comes
  ordered.Start(&sum);
  for (int number : {0, 1}) ordered.Add(number, OrderedSum::Term(1, 1.0f));
  EXPECT_EQ(left, 0);
  EXPECT_EQ(sum, 2);
}

TEST(OrderedSum, TakesTermsOfSeveralThreads) {
  constexpr int kTerms = 1000;
  std::vector<int> order(kTerms);
  std::iota(order.begin(), order.end(), 0);
  OrderedSum ordered(kSize);
  std::vector<float> sum(kSize, 0.0f);
  ordered.Start(sum.data());
  SetThreadCount(4);
  ParallelFor(0, kTerms, [&](int64_t i) { ordered.Add(i, Filled(ordered.Take(), static_cast<int>(i))); });
  SetThreadCount(0);
  EXPECT_EQ(sum, SumIn(order));
}

}  // namespace
}  // namespace lumen
