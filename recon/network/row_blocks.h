// The rows of a product in blocks whose sums stay in registers.
#pragma once

#include <type_traits>

namespace lumen {

// body(kRows) with the number of rows as a constant: 1 ≤ rows ≤ kMost.
template <int kMost, class Body>
void WithConstantRows(int rows, const Body& body) {
  if (rows == kMost) return body(std::integral_constant<int, kMost>());
  if constexpr (kMost > 1) WithConstantRows<kMost - 1>(rows, body);
}

// body(kRows, first row) for blocks of equal heights, or one row less, of kMost rows at the most.
template <int kMost, class Body>
void ForRowBlocks(int rows, const Body& body) {
  const int blocks = (rows + kMost - 1) / kMost;
  for (int block = 0, first = 0; block < blocks; ++block) {
    const int end = rows * (block + 1) / blocks;
    WithConstantRows<kMost>(end - first, [&](auto count) { body(count, first); });
    first = end;
  }
}

}  // namespace lumen
