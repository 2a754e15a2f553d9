// Loops over a range on several threads. What a loop body writes may depend on its index only, never on the
// thread or on the order, so that one thread and many give the same bytes.
#pragma once

#include <cstdint>
#include <functional>

namespace lumen {

// Threads that the loops below may use from now on; 0 = as many as the machine has.
void SetThreadCount(int count);
int ThreadCount();

// Calls body(i) for every i in [begin, end). An exception thrown by a body is rethrown here.
void ParallelFor(int64_t begin, int64_t end, const std::function<void(int64_t)>& body);

// Calls body(first, last) on consecutive chunks of `grain` indices that cover [begin, end); the chunks are
// the same for any number of threads.
void ParallelChunks(int64_t begin, int64_t end, int64_t grain,
                    const std::function<void(int64_t, int64_t)>& body);

}  // namespace lumen
