// Loops over a range on several threads. What a loop body writes may depend on its index only, never on the
// thread or on the order, so that one thread and many give the same bytes.
#pragma once

#include <cstdint>
#include <functional>
#include <memory>

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

// Work that the loops' threads do beside whatever else there is to do: one piece at a time, in the order in
// which the pieces come. With one thread a piece is done when the next comes.
class BackgroundWork {
 public:
  BackgroundWork();
  ~BackgroundWork();  // waits; what the last piece throws is lost

  // Waits for the piece before and starts this one. Rethrows what the one before threw; then this one isn't
  // begun.
  void Start(std::function<void()> piece);
  // Waits for the last piece and rethrows what it threw.
  void Finish();

 private:
  struct Tasks;
  std::unique_ptr<Tasks> tasks_;
};

}  // namespace lumen
