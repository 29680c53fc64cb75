// SPDX-License-Identifier: Apache-2.0
#include "kinematics/core/parallel_for.h"

#include <atomic>
#include <stdexcept>
#include <string>
#include <vector>

#include <gtest/gtest.h>

#include "kinematics/core/memo.h"

namespace kinescope {
namespace {

TEST(ParallelFor, CallsEachIndexOnce) {
  for (const int threads : {0, 1, 2, 7}) {
    std::vector<int> calls(1000, 0);
    parallel_for(calls.size(), [&](std::size_t i) { ++calls[i]; }, threads);
    EXPECT_EQ(calls, std::vector<int>(1000, 1)) << threads;
  }
  parallel_for(0, [](std::size_t) { FAIL(); });
}

TEST(ParallelFor, ThrowsTheErrorOfTheFirstIndexThatFailed) {
  for (const int threads : {1, 4}) {
    std::atomic<int> done = 0;
    try {
      parallel_for(
          100,
          [&](std::size_t i) {
            if (i % 10 == 3) throw std::runtime_error(std::to_string(i));
            ++done;
          },
          threads);
      FAIL() << "no error";
    } catch (const std::runtime_error& error) {
      EXPECT_STREQ(error.what(), "3");
    }
    EXPECT_EQ(done, 90);
  }
}

TEST(Memo, ManyThreadsMakeAValueOnce) {
  const Memo<int, std::string> memo;
  std::atomic<int> made = 0;
  std::vector<const std::string*> seen(400);
  parallel_for(
      seen.size(),
      [&](std::size_t i) {
        const int key = static_cast<int>(i) % 5;
        seen[i] = &memo.get(key, [&] {
          ++made;
          return std::to_string(key);
        });
      },
      4);
  EXPECT_EQ(made, 5);
  for (std::size_t i = 0; i < seen.size(); ++i) {
    EXPECT_EQ(seen[i], seen[i % 5]);
    EXPECT_EQ(*seen[i], std::to_string(i % 5));
  }
}

TEST(Memo, AValueThatCouldNotBeMadeIsTriedAgain) {
  const Memo<int, int> memo;
  EXPECT_THROW(memo.get(1, []() -> int { throw std::runtime_error("no"); }), std::runtime_error);
  EXPECT_EQ(memo.get(1, [] { return 7; }), 7);
}

}  // namespace
}  // namespace kinescope
