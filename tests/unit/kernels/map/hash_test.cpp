#include "kernels/map/hash_view.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <map>
#include <numeric>
#include <random>
#include <thread>
#include <vector>

namespace stillmap {
namespace {

/// Owner of a table and a pool.
class Table {
 public:
  Table(uint32_t slots, uint32_t pool_blocks)
      : keys_(slots, kEmptyKey), blocks_(slots, kNoBlock), free_ids_(pool_blocks) {
    std::iota(free_ids_.begin(), free_ids_.end(), 0u);
  }
  HashView table() { return {{keys_.data(), size(keys_)}, {blocks_.data(), size(blocks_)}}; }
  PoolView pool() { return {{free_ids_.data(), size(free_ids_)}, &used_}; }
  uint32_t used() const { return used_; }
  void clear() {
    std::fill(keys_.begin(), keys_.end(), kEmptyKey);
    std::fill(blocks_.begin(), blocks_.end(), kNoBlock);
    std::iota(free_ids_.begin(), free_ids_.end(), 0u);
    used_ = 0;
  }

 private:
  template <class T>
  static uint32_t size(const std::vector<T>& v) {
    return static_cast<uint32_t>(v.size());
  }
  std::vector<BlockKey> keys_;
  std::vector<BlockId> blocks_, free_ids_;
  uint32_t used_ = 0;
};

TEST(Hash, InsertedThenExisted) {
  Table t(16, 4);
  EXPECT_EQ(t.table().find(pack({1, 2, 3})), kNoBlock);
  const InsertResult first = t.table().insert(pack({1, 2, 3}), t.pool());
  EXPECT_EQ(first.answer, Insert::inserted);
  ASSERT_LT(first.block, 4u);
  const InsertResult second = t.table().insert(pack({1, 2, 3}), t.pool());
  EXPECT_EQ(second.answer, Insert::existed);
  EXPECT_EQ(second.block, first.block);
  EXPECT_EQ(t.table().find(pack({1, 2, 3})), first.block);
  EXPECT_EQ(t.used(), 1u);
}

TEST(Hash, TableFullWhenNoSlotIsLeft) {
  Table t(8, 100);
  for (int32_t i = 0; i < 8; ++i)
    EXPECT_EQ(t.table().insert(pack({i, 0, 0}), t.pool()).answer, Insert::inserted);
  const InsertResult full = t.table().insert(pack({9, 0, 0}), t.pool());
  EXPECT_EQ(full.answer, Insert::table_full);
  EXPECT_EQ(full.block, kNoBlock);
  EXPECT_EQ(t.table().find(pack({9, 0, 0})), kNoBlock);  // and it ends
  EXPECT_EQ(t.used(), 8u);
  for (int32_t i = 0; i < 8; ++i)
    EXPECT_EQ(t.table().insert(pack({i, 0, 0}), t.pool()).answer, Insert::existed);
}

TEST(Hash, TableFullAfterTheLastProbeThoughThereIsRoomElsewhere) {
  Table t(1024, 1024);
  const uint64_t home = hash_of(pack({0, 0, 0})) & 1023;
  uint32_t inserted = 0;
  Insert last = Insert::inserted;
  for (int32_t i = 0; i < 1000000 && last == Insert::inserted; ++i) {
    const BlockKey key = pack({i % 1000, i / 1000, 0});
    if ((hash_of(key) & 1023) != home) continue;
    last = t.table().insert(key, t.pool()).answer;
    inserted += last == Insert::inserted;
  }
  EXPECT_EQ(last, Insert::table_full);
  EXPECT_EQ(inserted, HashView::kMaxProbes);
}

TEST(Hash, PoolEmptyAndLaterFilled) {
  Table t(64, 2);
  t.table().insert(pack({0, 0, 0}), t.pool());
  const BlockId second = t.table().insert(pack({1, 0, 0}), t.pool()).block;
  const InsertResult none = t.table().insert(pack({2, 0, 0}), t.pool());
  EXPECT_EQ(none.answer, Insert::pool_empty);
  EXPECT_EQ(none.block, kNoBlock);
  EXPECT_EQ(t.table().find(pack({2, 0, 0})), kNoBlock);
  EXPECT_EQ(t.used(), 2u);
  EXPECT_EQ(t.table().insert(pack({2, 0, 0}), t.pool()).answer, Insert::pool_empty);
  t.pool().give_back(second);
  EXPECT_EQ(t.table().insert(pack({2, 0, 0}), t.pool()).answer, Insert::inserted);
}

TEST(Hash, ContendedWhileAnotherInserts) {
  Table t(64, 8);
  const BlockKey key = pack({-4, 5, 6});
  const uint32_t slot = static_cast<uint32_t>(hash_of(key)) & 63;
  t.table().keys[slot] = key;  // as another thread leaves it half way
  t.table().blocks[slot] = HashView::kPending;
  const InsertResult waiting = t.table().insert(key, t.pool());
  EXPECT_EQ(waiting.answer, Insert::contended);
  EXPECT_EQ(waiting.block, kNoBlock);
  EXPECT_EQ(t.table().find(key), kNoBlock);
  EXPECT_EQ(t.used(), 0u);
  t.table().blocks[slot] = 3;
  EXPECT_EQ(t.table().insert(key, t.pool()).answer, Insert::existed);
  EXPECT_EQ(t.table().find(key), 3u);
}

TEST(Pool, TakesEachBlockOnceAndAgainWhatWasGivenBack) {
  Table t(8, 3);
  const PoolView pool = t.pool();
  std::vector<BlockId> taken = {pool.take(), pool.take(), pool.take()};
  EXPECT_EQ(pool.take(), kNoBlock);
  EXPECT_EQ(pool.take(), kNoBlock);
  EXPECT_EQ(t.used(), 3u);
  std::sort(taken.begin(), taken.end());
  EXPECT_EQ(taken, (std::vector<BlockId>{0, 1, 2}));
  pool.give_back(1);
  EXPECT_EQ(pool.take(), 1u);
  EXPECT_EQ(pool.take(), kNoBlock);
}

// Property: a million random operations answer what std::map answers; ten million below, from four threads.
TEST(Hash, BehavesLikeAMap) {
  Table t(4096, 2000);
  std::map<BlockKey, BlockId> model;
  std::mt19937 random(77);
  std::uniform_int_distribution<int32_t> coordinate(-9, 9);
  std::uniform_int_distribution<int32_t> operation(0, 199999);
  std::vector<bool> given(2000);
  for (int32_t i = 0; i < 1000000; ++i) {
    const int32_t what = operation(random);
    const BlockKey key = pack({coordinate(random), coordinate(random), coordinate(random)});
    const auto known = model.find(key);
    if (what == 0) {
      t.clear();
      model.clear();
      std::fill(given.begin(), given.end(), false);
    } else if (what % 2) {
      ASSERT_EQ(t.table().find(key), known == model.end() ? kNoBlock : known->second);
    } else {
      const InsertResult r = t.table().insert(key, t.pool());
      if (known != model.end()) {
        ASSERT_EQ(r.answer, Insert::existed);
        ASSERT_EQ(r.block, known->second);
      } else if (model.size() < 2000) {
        ASSERT_EQ(r.answer, Insert::inserted);
        ASSERT_FALSE(given[r.block]);
        given[r.block] = true;
        model[key] = r.block;
      } else {
        ASSERT_TRUE(r.answer == Insert::pool_empty || r.answer == Insert::table_full);
      }
      ASSERT_EQ(t.used(), model.size());
    }
  }
}

TEST(Hash, FourThreadsInsertTheSameKeysWithoutDuplicates) {
  constexpr uint32_t kKeys = 2000, kThreads = 4;
  std::vector<BlockKey> keys;
  for (uint32_t i = 0; i < kKeys; ++i)
    keys.push_back(pack({static_cast<int32_t>(i) - 1000, static_cast<int32_t>(i % 7), -3}));
  for (uint32_t round = 0; round < 10; ++round) {
    Table t(8192, kKeys);
    const HashView table = t.table();
    const PoolView pool = t.pool();
    uint32_t inserted[kThreads] = {};
    std::vector<std::thread> threads;
    for (uint32_t id = 0; id < kThreads; ++id)
      threads.emplace_back([&, id] {
        std::vector<BlockKey> mine = keys;
        std::shuffle(mine.begin(), mine.end(), std::mt19937(id % 2 + 10 * round));  // two by two the same
        for (const BlockKey key : mine) {
          const InsertResult r = table.insert(key, pool);
          inserted[id] += r.answer == Insert::inserted;
          EXPECT_TRUE(r.answer == Insert::inserted || r.answer == Insert::existed ||
                      r.answer == Insert::contended);
          const BlockId found = table.find(key);
          EXPECT_TRUE(r.block == kNoBlock || found == r.block);
        }
      });
    for (std::thread& thread : threads) thread.join();
    EXPECT_EQ(inserted[0] + inserted[1] + inserted[2] + inserted[3], kKeys);
    EXPECT_EQ(t.used(), kKeys);
    std::vector<bool> given(kKeys);
    for (const BlockKey key : keys) {
      const BlockId id = table.find(key);
      ASSERT_LT(id, kKeys);
      EXPECT_FALSE(given[id]);
      given[id] = true;
    }
  }
}

#if defined(__SANITIZE_THREAD__) || defined(__SANITIZE_ADDRESS__)
constexpr uint32_t kOperations = 1000000;  // each takes many times as long
#else
constexpr uint32_t kOperations = 10000000;
#endif

// Four threads, the same keys, more keys than the pool has blocks: every answer is right at its time, and
// what stands in the table at the end is what a std::map of the answers holds.
TEST(Hash, ManyRandomOperationsFromFourThreadsLeaveWhatTheirAnswersSay) {
  constexpr uint32_t kThreads = 4, kPool = 5000;
  Table t(16384, kPool);
  const HashView table = t.table();
  const PoolView pool = t.pool();
  struct Answers {
    std::map<BlockKey, BlockId> blocks;
    uint64_t count[5] = {};
    uint64_t wrong = 0;
  } answers[kThreads];
  const auto operate = [&](uint32_t id) {
    Answers& mine = answers[id];
    std::mt19937 random(id + 1);
    std::uniform_int_distribution<int32_t> coordinate(-9, 9);
    for (uint32_t i = 0; i < kOperations / kThreads; ++i) {
      const BlockKey key = pack({coordinate(random), coordinate(random), coordinate(random)});
      const auto known = mine.blocks.find(key);
      if (i % 2) {
        const BlockId found = table.find(key);
        mine.wrong +=
            known != mine.blocks.end() ? found != known->second : found != kNoBlock && found >= kPool;
        continue;
      }
      const InsertResult r = table.insert(key, pool);
      ++mine.count[static_cast<int>(r.answer)];
      const bool has_block = r.answer == Insert::inserted || r.answer == Insert::existed;
      mine.wrong += has_block != (r.block < kPool);
      mine.wrong += known != mine.blocks.end() && (r.answer != Insert::existed || r.block != known->second);
      if (has_block) mine.blocks[key] = r.block;
    }
  };
  std::vector<std::thread> threads;
  for (uint32_t id = 0; id < kThreads; ++id) threads.emplace_back(operate, id);
  for (std::thread& thread : threads) thread.join();

  std::map<BlockKey, BlockId> model;
  uint64_t inserted = 0, pool_empty = 0;
  for (const Answers& a : answers) {
    EXPECT_EQ(a.wrong, 0u);
    inserted += a.count[static_cast<int>(Insert::inserted)];
    pool_empty += a.count[static_cast<int>(Insert::pool_empty)];
    for (const auto& [key, block] : a.blocks) {
      const auto [at, is_new] = model.emplace(key, block);
      EXPECT_TRUE(is_new || at->second == block);
    }
  }
  EXPECT_EQ(inserted, model.size());
  EXPECT_EQ(inserted, kPool);
  EXPECT_EQ(t.used(), kPool);
  EXPECT_GT(pool_empty, 0u);
  std::vector<bool> given(kPool);
  for (int32_t z = -9; z <= 9; ++z)
    for (int32_t y = -9; y <= 9; ++y)
      for (int32_t x = -9; x <= 9; ++x) {
        const auto known = model.find(pack({x, y, z}));
        const BlockId found = table.find(pack({x, y, z}));
        ASSERT_EQ(found, known == model.end() ? kNoBlock : known->second);
        if (found == kNoBlock) continue;
        EXPECT_FALSE(given[found]);
        given[found] = true;
      }
}

}  // namespace
}  // namespace stillmap
