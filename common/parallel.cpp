#include "common/parallel.h"

#include <tbb/global_control.h>
#include <tbb/info.h>
#include <tbb/parallel_for.h>
#include <tbb/task_group.h>

#include <algorithm>
#include <memory>
#include <utility>

namespace lumen {
namespace {

std::unique_ptr<tbb::global_control>& Limit() {
  static std::unique_ptr<tbb::global_control> limit;
  return limit;
}

}  // namespace

void SetThreadCount(int count) {
  Limit().reset();
  if (count > 0) {
    Limit() = std::make_unique<tbb::global_control>(tbb::global_control::max_allowed_parallelism,
                                                    static_cast<size_t>(count));
  }
}

int ThreadCount() {
  const auto allowed = tbb::global_control::active_value(tbb::global_control::max_allowed_parallelism);
  return static_cast<int>(allowed);
}

void ParallelFor(int64_t begin, int64_t end, const std::function<void(int64_t)>& body) {
  if (end - begin == 1) return body(begin);
  tbb::parallel_for(begin, end, body, tbb::simple_partitioner());
}

void ParallelChunks(int64_t begin, int64_t end, int64_t grain,
                    const std::function<void(int64_t, int64_t)>& body) {
  const int64_t chunks = (end - begin + grain - 1) / grain;
  ParallelFor(0, chunks, [&](int64_t chunk) {
    const int64_t first = begin + chunk * grain;
    body(first, std::min(first + grain, end));
  });
}

struct BackgroundWork::Tasks {
  tbb::task_group group;
};

BackgroundWork::BackgroundWork() : tasks_(std::make_unique<Tasks>()) {}

BackgroundWork::~BackgroundWork() {
  try {
    Finish();
  } catch (...) {
  }
}

void BackgroundWork::Start(std::function<void()> piece) {
  Finish();
  tasks_->group.run(std::move(piece));
}

void BackgroundWork::Finish() { tasks_->group.wait(); }

}  // namespace lumen
