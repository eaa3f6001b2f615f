#pragma once

#include <cstdint>

#include "kernels/base/atomic.hpp"
#include "kernels/map/block_key.hpp"
#include "kernels/map/pool_view.hpp"

namespace stillmap {

/// What an insertion answers. Only the first two give a block; the last three are counted and reported.
enum class Insert : uint8_t {
  inserted,    ///< the block is new
  existed,     ///< it was there
  contended,   ///< another thread is inserting the same key right now; it will be there when that one is done
  table_full,  ///< no slot within kMaxProbes
  pool_empty   ///< a slot, but no block
};

struct InsertResult {
  Insert answer;
  BlockId block;  ///< kNoBlock unless inserted or existed
};

/// Open addressing with linear, bounded probing. Keys are never removed one by one; `clear` and insert again.
/// What is here called a block is whatever the pool holds.
struct HashView {
  View<BlockKey> keys;   ///< capacity a power of two; kEmptyKey: free slot
  View<BlockId> blocks;  ///< kNoBlock: key without a block; kPending: being inserted

  static constexpr uint32_t kMaxProbes = 128;
  static constexpr BlockId kPending = kNoBlock - 1;

  /// @return kNoBlock when absent.  @thread any, also while others insert
  STILLMAP_HD BlockId find(BlockKey key) const {
    const uint32_t slot = slot_for(key);
    if (slot == kNoSlot || atomic_load(&keys[slot]) != key) return kNoBlock;
    const BlockId block = atomic_load(&blocks[slot]);
    return block == kPending ? kNoBlock : block;
  }
  /// @return where the block of `key` stands, null when absent.  @thread one, while nobody inserts
  STILLMAP_HD BlockId* slot_of(BlockKey key) const {
    const uint32_t slot = slot_for(key);
    return slot == kNoSlot || keys[slot] != key ? nullptr : &blocks[slot];
  }
  /// Adds a key that is not there, with its block. False: no slot within kMaxProbes.  @thread one, while
  /// nobody inserts
  STILLMAP_HD bool put(BlockKey key, BlockId block) const {
    const uint32_t slot = slot_for(key);
    if (slot == kNoSlot) return false;
    keys[slot] = key;
    blocks[slot] = block;
    return true;
  }

  /// Finds or adds.  @thread any, at the same time as other inserts and finds
  STILLMAP_HD InsertResult insert(BlockKey key, const PoolView& pool) const {
    const uint32_t mask = keys.size - 1;
    uint32_t slot = static_cast<uint32_t>(hash_of(key)) & mask;
    for (uint32_t probe = 0; probe < kMaxProbes; ++probe, slot = (slot + 1) & mask) {
      BlockKey found = atomic_load(&keys[slot]);
      if (found == kEmptyKey) found = atomic_compare_exchange(&keys[slot], kEmptyKey, key);
      if (found == kEmptyKey || found == key) return claim(slot, pool);
    }
    return {Insert::table_full, kNoBlock};
  }

 private:
  static constexpr uint32_t kNoSlot = ~0u;

  /// The slot that holds `key`, or the free one where it would go; kNoSlot: neither within kMaxProbes.
  STILLMAP_HD uint32_t slot_for(BlockKey key) const {
    const uint32_t mask = keys.size - 1;
    uint32_t slot = static_cast<uint32_t>(hash_of(key)) & mask;
    for (uint32_t probe = 0; probe < kMaxProbes; ++probe, slot = (slot + 1) & mask) {
      const BlockKey found = atomic_load(&keys[slot]);
      if (found == key || found == kEmptyKey) return slot;
    }
    return kNoSlot;
  }
  /// The slot has our key: give it a block unless somebody did or does.
  STILLMAP_HD InsertResult claim(uint32_t slot, const PoolView& pool) const {
    BlockId found = atomic_load(&blocks[slot]);
    if (found == kNoBlock) found = atomic_compare_exchange(&blocks[slot], kNoBlock, kPending);
    if (found == kPending) return {Insert::contended, kNoBlock};
    if (found != kNoBlock) return {Insert::existed, found};
    const BlockId block = pool.take();
    atomic_store(&blocks[slot], block);
    return {block == kNoBlock ? Insert::pool_empty : Insert::inserted, block};
  }
};

}  // namespace stillmap
