#include "common/parallel.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <atomic>
#include <chrono>
#include <mutex>
#include <set>
#include <stdexcept>
#include <string>
#include <thread>
#include <utility>
#include <vector>

namespace lumen {
namespace {

// Puts the thread count back for the tests that follow.
class Parallel : public testing::Test {
 protected:
  ~Parallel() override { SetThreadCount(0); }
};

std::set<std::pair<int64_t, int64_t>> Chunks(int64_t begin, int64_t end, int64_t grain) {
  std::mutex mutex;
  std::set<std::pair<int64_t, int64_t>> chunks;
  ParallelChunks(begin, end, grain, [&](int64_t first, int64_t last) {
    const std::lock_guard lock(mutex);
    EXPECT_TRUE(chunks.emplace(first, last).second) << "the chunk at " << first << " ran twice";
  });
  return chunks;
}

TEST_F(Parallel, ChunksAreTheSameForAnyThreadCount) {
  const std::set<std::pair<int64_t, int64_t>> expected = {{-3, 4}, {4, 11}, {11, 18}, {18, 20}};
  for (const int threads : {1, 2, 3, 0}) {
    SetThreadCount(threads);
    EXPECT_EQ(Chunks(-3, 20, 7), expected);
    EXPECT_EQ(Chunks(5, 6, 7), (std::set<std::pair<int64_t, int64_t>>{{5, 6}}));
    EXPECT_TRUE(Chunks(5, 5, 7).empty());
    EXPECT_EQ(Chunks(0, 1000, 1).size(), 1000u);
  }
}

TEST_F(Parallel, EveryIndexRunsOnce) {
  for (const int threads : {1, 2, 0}) {
    SetThreadCount(threads);
    for (const int64_t end : {0, 1, 2, 10007}) {
      std::vector<std::atomic<int>> runs(10007);
      ParallelFor(0, end, [&](int64_t i) { ++runs[i]; });
      for (int64_t i = 0; i < 10007; ++i) ASSERT_EQ(runs[i], i < end) << i << " of " << end;
    }
  }
}

TEST_F(Parallel, BackgroundPiecesRunInTheirOrderAndAllOfThem) {
  for (const int threads : {1, 2, 5}) {
    SetThreadCount(threads);
    std::vector<int> done;
    {
      BackgroundWork work;
      for (int i = 0; i < 20; ++i) {
        work.Start([i, &done] { done.push_back(i); });
        std::atomic<int> beside = 0;
        ParallelFor(0, 100, [&](int64_t) { ++beside; });
        EXPECT_EQ(beside, 100);
      }
    }
    ASSERT_EQ(done.size(), 20u) << threads;
    for (int i = 0; i < 20; ++i) EXPECT_EQ(done[i], i);
  }
}

TEST_F(Parallel, BackgroundPieceThatThrowsStopsTheNext) {
  for (const int threads : {1, 2}) {
    SetThreadCount(threads);
    BackgroundWork work;
    bool next_ran = false;
    work.Start([] { throw std::range_error("disk"); });
    EXPECT_THROW(work.Start([&] { next_ran = true; }), std::range_error);
    EXPECT_FALSE(next_ran);
    work.Start([] { throw std::range_error("disk"); });
    EXPECT_THROW(work.Finish(), std::range_error);
    work.Finish();
  }
}

TEST_F(Parallel, ExceptionsOfABodyAreRethrown) {
  for (const int threads : {1, 2, 0}) {
    SetThreadCount(threads);
    for (const int64_t culprit : {0, 500, 999}) {
      const auto run = [&] {
        ParallelFor(0, 1000, [&](int64_t i) {
          if (i == culprit) throw std::range_error("at " + std::to_string(i));
        });
      };
      try {
        run();
        ADD_FAILURE() << "the exception at " << culprit << " was lost";
      } catch (const std::range_error& error) {
        EXPECT_EQ(error.what(), "at " + std::to_string(culprit));
      }
    }
    EXPECT_THROW(ParallelChunks(0, 9, 4, [](int64_t, int64_t) { throw std::range_error("all"); }),
                 std::range_error);
  }
}

// How many bodies are under way at the same time, at most, when each lasts a moment.
int MostAtOnce() {
  std::atomic<int> running = 0, most = 0;
  std::mutex mutex;
  ParallelFor(0, 64, [&](int64_t) {
    const int now = ++running;
    {
      const std::lock_guard lock(mutex);
      most = std::max<int>(most, now);
    }
    std::this_thread::sleep_for(std::chrono::milliseconds(1));
    --running;
  });
  return most;
}

TEST_F(Parallel, ThreadCountIsHonoured) {
  SetThreadCount(1);
  EXPECT_EQ(ThreadCount(), 1);
  EXPECT_EQ(MostAtOnce(), 1);
  SetThreadCount(2);
  EXPECT_EQ(ThreadCount(), 2);
  EXPECT_LE(MostAtOnce(), 2);
  SetThreadCount(0);
  EXPECT_GE(ThreadCount(), 1);
  EXPECT_LE(MostAtOnce(), ThreadCount());
}

// Loops inside loops, as a build inside a frame: all run, none waits for ever.
TEST_F(Parallel, LoopsNest) {
  for (const int threads : {1, 2}) {
    SetThreadCount(threads);
    std::vector<std::atomic<int>> runs(20 * 30);
    ParallelFor(0, 20, [&](int64_t i) { ParallelFor(0, 30, [&](int64_t j) { ++runs[i * 30 + j]; }); });
    for (const auto& count : runs) ASSERT_EQ(count, 1);
  }
}

}  // namespace
}  // namespace lumen
