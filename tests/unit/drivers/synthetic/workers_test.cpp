#include "drivers/synthetic/workers.hpp"

#include <gtest/gtest.h>

namespace stillmap::synthetic {
namespace {

TEST(Workers, every_piece_once_in_every_round) {
  for (const int threads : {1, 2, 5}) {
    Workers workers(threads);
    EXPECT_EQ(workers.threads(), threads);
    std::vector<int> done(100, 0);
    for (int round = 1; round <= 50; ++round) {
      workers.run(100, [&](int32_t piece) { ++done[static_cast<size_t>(piece)]; });
      for (const int times : done) ASSERT_EQ(times, round);
    }
  }
}

TEST(Workers, no_pieces_is_no_work) {
  Workers workers(3);
  std::atomic<int> calls{0};
  workers.run(0, [&](int32_t) { ++calls; });
  EXPECT_EQ(calls, 0);
}

TEST(Workers, thread_count_is_kept_in_range) {
  EXPECT_EQ(Workers(0).threads(), 1);
  EXPECT_EQ(Workers(-4).threads(), 1);
}

}  // namespace
}  // namespace stillmap::synthetic
