#pragma once

// What a frame does to the map on the GPU: which blocks are in view, what they need from the pools, fusion,
// and what can be given back. As CpuEngine::integrate and MapStorage do it one after the other, with the same
// blocks in the same order: whoever needs something of a pool gets it by its rank among all who do.

#include <cstdint>

#include "kernels/backend/cuda/grid.hpp"
#include "kernels/integrate/depth_range.hpp"
#include "kernels/integrate/integrate_pass.hpp"
#include "kernels/integrate/visible_blocks.hpp"
#include "kernels/map/volume_view.hpp"

namespace stillmap {

/// Counters of the map that live beside it; the host has a copy after every step.
struct MapCounters {
  uint32_t used[3] = {};  ///< taken from the pools of voxels, groups, partly seen blocks
  uint32_t table_entries = 0;
  uint32_t archived_groups = 0;
  uint32_t peak_blocks = 0;
  uint64_t peak_bytes = 0;
  uint64_t table_full = 0, pool_empty = 0, dropped_blocks = 0;

  STILLMAP_HD uint64_t bytes_in_use() const {
    return uint64_t{used[0]} * (sizeof(VoxelBlock) + sizeof(BlockKey) + sizeof(uint8_t)) +
           uint64_t{used[1]} * sizeof(BlockGroup) + uint64_t{used[2]} * sizeof(SeenVoxels) +
           uint64_t{table_entries} * (sizeof(BlockKey) + sizeof(BlockRef));
  }
  STILLMAP_HD void note_peak() {
    peak_blocks = used[0] > peak_blocks ? used[0] : peak_blocks;
    const uint64_t bytes = bytes_in_use();
    peak_bytes = bytes > peak_bytes ? bytes : peak_bytes;
  }
};

struct DeviceMap {
  VolumeView view;
  MapCounters* counters = nullptr;
  uint32_t enough = 64;  ///< looks at a free block, after which more say nothing new

  STILLMAP_HD uint32_t looks_more(uint32_t looks) const { return looks < enough ? looks + 1 : enough; }
  /// @return where the state of a group stands; makes an entry when there is none. Null: the table is full
  /// @thread any, different groups at the same time
  STILLMAP_HD BlockRef* slot_for(BlockKey key) const {
    const HashView& table = view.table;
    const uint32_t mask = table.keys.size - 1;
    uint32_t slot = static_cast<uint32_t>(hash_of(key)) & mask;
    for (uint32_t probe = 0; probe < HashView::kMaxProbes; ++probe, slot = (slot + 1) & mask) {
      BlockKey found = atomic_load(&table.keys[slot]);
      if (found == kEmptyKey) found = atomic_compare_exchange(&table.keys[slot], kEmptyKey, key);
      if (found == kEmptyKey || found == key) return &table.blocks[slot];
    }
    return nullptr;
  }
  /// The state of a block of a group that has an id.
  STILLMAP_HD BlockRef& ref_in_group(Int3 block) const {
    return view.groups[view.table.find(pack(group_of_block(block)))].block[index_in_group(block)];
  }
};

/// What groups need of the pools and of the lists.
struct Tally {
  uint32_t groups = 0, entries = 0;        ///< groups of their own blocks; entries of the table
  uint32_t voxels = 0, more_voxels = 0;    ///< blocks with voxels: near surfaces; of free space (dense)
  uint32_t partly = 0, released = 0;       ///< records of partly seen blocks: new; not needed any more
  uint32_t visible = 0, more_visible = 0;  ///< blocks to fuse: near surfaces; of free space

  STILLMAP_HD friend Tally operator+(const Tally& a, const Tally& b) {
    return {
        a.groups + b.groups, a.entries + b.entries,   a.voxels + b.voxels,   a.more_voxels + b.more_voxels,
        a.partly + b.partly, a.released + b.released, a.visible + b.visible, a.more_visible + b.more_visible};
  }
  STILLMAP_HD friend Tally operator-(const Tally& a, const Tally& b) {
    return {
        a.groups - b.groups, a.entries - b.entries,   a.voxels - b.voxels,   a.more_voxels - b.more_voxels,
        a.partly - b.partly, a.released - b.released, a.visible - b.visible, a.more_visible - b.more_visible};
  }
};

/// What one block of a group needs. Bits that are set at most once each.
struct BlockNeeds {
  bool near_surface = false;  ///< it is to have voxels because of a surface
  bool voxels = false;        ///< it has none yet
  bool fuse = false;          ///< goes to the list of visible blocks
  bool partly = false;        ///< needs a record of which voxels were seen
  bool releases = false;      ///< has such a record and will not need it

  STILLMAP_HD Tally tally() const {
    Tally t;
    t.voxels = static_cast<uint32_t>(voxels && near_surface);
    t.more_voxels = static_cast<uint32_t>(voxels && !near_surface);
    t.visible = static_cast<uint32_t>(fuse && near_surface);
    t.more_visible = static_cast<uint32_t>(fuse && !near_surface);
    t.partly = static_cast<uint32_t>(partly);
    t.released = static_cast<uint32_t>(releases);
    return t;
  }
};

/// Group `index` of the box around the view, on its way through one frame.
struct GroupWork {
  GroupView view;
  VisibleGroupPass::GroupLook look;
  BlockRef* slot = nullptr;  ///< in the table
  Tally needs, before;       ///< its own; the sum of those of the groups before it
};

/// Lists and results of one frame.
struct UpdateState {
  VisibleGroupPass visible;  ///< of the last frame; without `first_group` and `groups` until it is looked at
  IntegratePass fuse;
  Se3 T_map_cam;
  float far_plane_m = 0, group_m = 0;
  uint32_t groups_wanted = 0, groups = 0;  ///< in the box; of those, looked at
  uint32_t candidates = 0;                 ///< groups with blocks that matter
  uint32_t failures = 0;                   ///< what was not mapped: no room
  Tally total, base;                       ///< of all groups; pools before
  uint32_t visible_blocks = 0, visible_voxel_blocks = 0;
};

struct UpdateMemory {
  UpdateState* state = nullptr;
  View<GroupWork> groups;
  View<uint32_t> candidates;  ///< indices into `groups`, in no order
  View<VisibleBlock> visible;
  View<uint32_t> outcome;    ///< of visible blocks; see outcome_detail
  View<uint32_t> record;     ///< of those that turn from voxels into a record: its id
  View<BlockId> fresh;       ///< new blocks with voxels ...
  View<BlockRef> fresh_was;  ///< ... and what was known of them
  View<uint32_t> released;   ///< records of partly seen blocks
  DepthRangePyramid ranges;
};

/// What becomes of a visible block after fusion: kind | looks << 8.
namespace outcome_detail {
constexpr uint32_t kStays = 0, kPartlyIsFree = 1, kVoxelsAreFree = 2, kVoxelsArePartly = 3;
STILLMAP_HD uint32_t kind(uint32_t outcome) {
  return outcome & 0xffu;
}
}  // namespace outcome_detail

STILLMAP_HD bool is_uniform(const GroupWork& g, bool dense) {
  return !dense && g.view.free == ~0ull && !has_id(g.look.ref);
}
STILLMAP_HD bool needs_blocks(const GroupWork& g, bool dense) {
  return (g.view.mixed | g.view.free | g.view.partly) != 0 && !is_uniform(g, dense);
}
STILLMAP_HD BlockRef block_ref(const DeviceMap& map, const GroupWork& g, uint32_t bit) {
  return has_id(g.look.ref) ? map.view.groups[g.look.ref].block[bit] : g.look.ref;
}
STILLMAP_HD BlockNeeds needs_of(const DeviceMap& map, const GroupWork& g, uint32_t bit, bool dense) {
  BlockNeeds n;
  const uint64_t flag = 1ull << bit;
  if (!((g.view.mixed | g.view.free | g.view.partly) & flag) || is_uniform(g, dense)) return n;
  const BlockRef ref = block_ref(map, g, bit);
  n.near_surface = (g.view.mixed & flag) != 0;
  if (n.near_surface || (dense && (g.view.free & flag))) {
    n.voxels = !has_id(ref);
    n.releases = is_partly(ref);
    n.fuse = n.near_surface || !has_id(ref) || !map.view.settled_free[ref];
  } else if (g.view.free & flag) {
    n.releases = is_partly(ref);
    n.fuse = has_id(ref) && !map.view.settled_free[ref];
  } else {
    n.partly = ref == kNoBlock;
    n.fuse = n.partly || is_partly(ref);
  }
  return n;
}
/// Of the group itself.
STILLMAP_HD Tally own_needs(const GroupWork& g, bool dense) {
  Tally t;
  const bool blocks = needs_blocks(g, dense);
  t.groups = static_cast<uint32_t>(blocks && !has_id(g.look.ref));
  t.entries = static_cast<uint32_t>((blocks || is_uniform(g, dense)) && g.look.ref == kNoBlock);
  return t;
}

/// Finest tiles of the depth ranges, one a lane.
struct StaticDepthKernel {
  static constexpr uint32_t kLanes = 64;
  using Shared = NoShared;
  const StaticDepthPass* pass;
  int32_t rows, cols;  ///< of tiles

  template <class Block>
  STILLMAP_GRID void operator()(Block& block) const {
    const StaticDepthPass p = *pass;
    for_all(block, static_cast<uint32_t>(rows * cols),
            [&](uint32_t i) { p(static_cast<int32_t>(i) / cols, static_cast<int32_t>(i) % cols); });
  }
};

/// The further levels, and from the farthest depth the box of groups. One block.
struct ViewBoxKernel {
  static constexpr uint32_t kLanes = 256;
  using Shared = NoShared;
  UpdateMemory memory;

  template <class Block>
  STILLMAP_GRID void operator()(Block& block) const {
    const DepthRangePyramid& ranges = memory.ranges;
    for (int32_t l = 1; l < ranges.levels; ++l) {
      const MergeRangesPass merge{ranges.level[l - 1], ranges.level[l]};
      for_all_in_block(block, static_cast<uint32_t>(merge.coarse.pixels()), [&](uint32_t i) {
        merge(static_cast<int32_t>(i) / merge.coarse.cols, static_cast<int32_t>(i) % merge.coarse.cols);
      });
    }
    block.each([&](uint32_t lane) {
      if (lane == 0) set_box(*memory.state, ranges.level[ranges.levels - 1].at(0, 0).max_m);
    });
  }

 private:
  STILLMAP_GRID void set_box(UpdateState& s, float farthest_seen_m) const {
    VisibleGroupPass& pass = s.visible;
    const float farthest_m = min_of(s.far_plane_m, farthest_seen_m + pass.geometry.truncation_m);
    const GroupBox box = box_around_view(s.T_map_cam, pass.geometry.k, farthest_m, pass.margin_m, s.group_m);
    pass.first_group = box.first;
    pass.groups = box.groups;
    const uint64_t wanted = static_cast<uint64_t>(box.groups.x) * static_cast<uint64_t>(box.groups.y) *
                            static_cast<uint64_t>(box.groups.z);
    s.groups_wanted = static_cast<uint32_t>(wanted < ~0u ? wanted : ~0u);
    s.groups = s.groups_wanted < memory.groups.size ? s.groups_wanted : memory.groups.size;
    s.candidates = s.failures = 0;
    s.total = s.base = Tally{};
    s.visible_blocks = s.visible_voxel_blocks = 0;
  }
};

/// A look at each group of the box, one a lane.
struct LookAtGroupsKernel {
  static constexpr uint32_t kLanes = 64;
  using Shared = NoShared;
  UpdateMemory memory;

  template <class Block>
  STILLMAP_GRID void operator()(Block& block) const {
    const VisibleGroupPass& pass = memory.state->visible;
    for_all(block, memory.state->groups, [&](uint32_t g) {
      GroupWork work;
      work.look = pass.look_at_group(pass.group_at(g));
      work.view.archived = work.look.archived;
      memory.groups[g] = work;
      if (work.look.blocks_matter) memory.candidates[atomic_add(&memory.state->candidates, 1u)] = g;
    });
  }
};

/// A look at the blocks of the groups that matter, one a lane, and what they need. A block of lanes a group.
struct LookAtBlocksKernel {
  static constexpr uint32_t kLanes = kGroupBlocks;
  struct Bits {
    uint64_t free, mixed, partly;
    STILLMAP_HD friend Bits operator+(Bits a, Bits b) {
      return {a.free | b.free, a.mixed | b.mixed, a.partly | b.partly};
    }
  };
  struct Shared {
    Bits bits[kLanes / kWarp];
    Tally tally[kLanes / kWarp];
    GroupWork group;
  };
  DeviceMap map;
  UpdateMemory memory;

  template <class Block>
  STILLMAP_GRID void operator()(Block& block) const {
    for (uint32_t i = block.index(); i < memory.state->candidates; i += block.count())
      look(block, memory.candidates[i]);
  }

 private:
  template <class Block>
  STILLMAP_GRID void look(Block& block, uint32_t index) const {
    const VisibleGroupPass& pass = memory.state->visible;
    Shared& s = block.shared();
    const Int3 at = pass.group_at(index);
    block.each([&](uint32_t lane) {
      if (lane == 0) s.group = memory.groups[index];
    });
    PerLane<Block, Bits> bits;
    block.privately([&](uint32_t lane) {
      GroupView own;
      pass.look_at_block(at, s.group.look, static_cast<int32_t>(lane), PlainVoxels{}, own);
      bits[lane] = {own.free, own.mixed, own.partly};
    });
    const Bits all = sum_over_block(block, bits, s.bits);
    block.each([&](uint32_t lane) {
      if (lane == 0) enter(pass, all, pack(at), s.group);
    });
    PerLane<Block, Tally> needs;
    block.privately([&](uint32_t lane) { needs[lane] = needs_of(map, s.group, lane, pass.dense).tally(); });
    const Tally sum = sum_over_block(block, needs, s.tally);
    block.each([&](uint32_t lane) {
      if (lane != 0) return;
      s.group.needs = sum + own_needs(s.group, pass.dense);
      memory.groups[index] = s.group;
    });
  }
  /// Who will be told something needs an entry of the table, also when it turns out later that there is no
  /// room for more.
  STILLMAP_GRID void enter(const VisibleGroupPass& pass, Bits all, BlockKey key, GroupWork& group) const {
    group.view.free = all.free;
    group.view.mixed = all.mixed;
    group.view.partly = all.partly;
    if (!needs_blocks(group, pass.dense) && !is_uniform(group, pass.dense)) return;
    group.slot = map.slot_for(key);
    if (group.slot) return;
    group.view = GroupView{};
    atomic_add(&memory.state->failures, 1u);
    atomic_add(&map.counters->table_full, uint64_t{1});
  }
};

/// Gives everyone a rank among those who need something, and takes it from the pools. One block.
struct PlanUpdateKernel {
  static constexpr uint32_t kLanes = 256;
  struct Shared {
    Tally tally[kLanes / kWarp];
  };
  DeviceMap map;
  UpdateMemory memory;

  template <class Block>
  STILLMAP_GRID void operator()(Block& block) const {
    UpdateState& state = *memory.state;
    const uint32_t left[3] = {map.view.pool.free_ids.size - map.counters->used[0],
                              map.view.group_pool.free_ids.size - map.counters->used[1],
                              map.view.partly_pool.free_ids.size - map.counters->used[2]};
    Tally total = rank(block);
    if (total.voxels + total.more_voxels > left[0] || total.groups > left[1] || total.partly > left[2]) {
      block.each([&](uint32_t lane) {
        if (lane == 0) refuse(left);
      });
      total = rank(block);
    }
    block.each([&](uint32_t lane) {
      if (lane == 0) take(state, total);
    });
  }

 private:
  /// @return the needs of all
  template <class Block>
  STILLMAP_GRID Tally rank(Block& block) const {
    Tally before;
    for (uint32_t first = 0; first < memory.state->groups; first += kLanes) {
      PerLane<Block, Tally> rank;
      block.privately([&](uint32_t lane) {
        rank[lane] = first + lane < memory.state->groups ? memory.groups[first + lane].needs : Tally{};
      });
      const Tally sum = scan_block(block, rank, block.shared().tally);
      block.each([&](uint32_t lane) {
        if (first + lane < memory.state->groups) memory.groups[first + lane].before = before + rank[lane];
      });
      before = before + sum;
    }
    return before;
  }

  STILLMAP_GRID void take(UpdateState& state, const Tally& total) const {
    MapCounters& c = *map.counters;
    state.total = total;
    state.base.voxels = c.used[0];
    state.base.groups = c.used[1];
    state.base.partly = c.used[2];
    c.used[0] += total.voxels + total.more_voxels;
    c.used[1] += total.groups;
    c.used[2] += total.partly;
    c.table_entries += total.entries;
    c.pool_empty += state.failures;
    c.note_peak();
    c.used[2] -= total.released;  // UpdateGroupsKernel gives them back
    state.visible_blocks = total.visible + total.more_visible;
    state.visible_voxel_blocks = 0;
  }

  /// There is not enough for all: in order, first what surfaces need, and who gets nothing is not told
  /// anything. Slow, and rare: the map drops far blocks before it is full.
  STILLMAP_GRID void refuse(const uint32_t* left) const {
    uint32_t voxels = left[0], groups = left[1], partly = left[2];
    const bool dense = memory.state->visible.dense;
    for (int32_t phase = 0; phase < 2; ++phase)
      for (uint32_t g = 0; g < memory.state->groups; ++g) {
        GroupWork& work = memory.groups[g];
        uint64_t bits = phase == 0 ? work.view.mixed : work.view.free | work.view.partly;
        if (!bits || !needs_blocks(work, dense)) continue;
        const bool opens = !has_id(work.look.ref) && (phase == 0 || !work.view.mixed);
        const bool closed = opens && groups == 0;
        if (opens && !closed) --groups;
        for (uint32_t bit = 0; bit < kGroupBlocks; ++bit) {
          if (!(bits >> bit & 1)) continue;
          const BlockNeeds needs = needs_of(map, work, bit, dense);
          const bool fits = !closed && voxels >= uint32_t{needs.voxels} && partly >= uint32_t{needs.partly};
          if (fits) {
            voxels -= needs.voxels;
            partly -= needs.partly;
            continue;
          }
          clear(1ull << bit, work.view);
          ++memory.state->failures;
        }
      }
    for (uint32_t g = 0; g < memory.state->groups; ++g) {
      GroupWork& work = memory.groups[g];
      work.needs = own_needs(work, dense);
      for (uint32_t bit = 0; bit < kGroupBlocks; ++bit)
        work.needs = work.needs + needs_of(map, work, bit, dense).tally();
    }
  }
  STILLMAP_GRID static void clear(uint64_t flag, GroupView& view) {
    view.mixed &= ~flag;
    view.free &= ~flag;
    view.partly &= ~flag;
  }
};

/// Tells the groups what the frame says of them. A block of lanes a group, a lane a block.
struct UpdateGroupsKernel {
  static constexpr uint32_t kLanes = kGroupBlocks;
  struct Shared {
    Tally tally[kLanes / kWarp];
    GroupWork group;
    BlockId id;
  };
  DeviceMap map;
  UpdateMemory memory;

  template <class Block>
  STILLMAP_GRID void operator()(Block& block) const {
    for (uint32_t i = block.index(); i < memory.state->candidates; i += block.count())
      update(block, memory.candidates[i]);
  }

 private:
  template <class Block>
  STILLMAP_GRID void update(Block& block, uint32_t index) const {
    const VisibleGroupPass& pass = memory.state->visible;
    Shared& s = block.shared();
    block.each([&](uint32_t lane) {
      if (lane == 0) s.group = memory.groups[index];
    });
    if (is_uniform(s.group, pass.dense)) {
      block.each([&](uint32_t lane) {
        if (lane == 0) *s.group.slot = free_ref(map.looks_more(looks_of(s.group.look.ref)));
      });
      return;
    }
    if (!needs_blocks(s.group, pass.dense)) return;
    PerLane<Block, Tally> rank;
    block.privately([&](uint32_t lane) { rank[lane] = needs_of(map, s.group, lane, pass.dense).tally(); });
    scan_block(block, rank, s.tally);
    const bool is_new = !has_id(s.group.look.ref);
    block.each([&](uint32_t lane) {
      if (lane != 0) return;
      s.id = is_new ? map.view.group_pool.free_ids[memory.state->base.groups + s.group.before.groups]
                    : s.group.look.ref;
    });
    const Int3 at = pass.group_at(index);
    block.each([&](uint32_t lane) {
      const BlockNeeds needs = needs_of(map, s.group, lane, pass.dense);
      const BlockRef was = block_ref(map, s.group, lane);
      const Int3 where = block_in_group(at, static_cast<int32_t>(lane));
      map.view.groups[s.id].block[lane] = update_block(s.group, lane, needs, was, where, rank[lane]);
    });
    block.each([&](uint32_t lane) {
      if (lane == 0 && is_new) *s.group.slot = s.id;
    });
  }
  STILLMAP_GRID static uint32_t looks_of(BlockRef ref) { return is_free(ref) ? payload(ref) : 0u; }

  /// @param rank within the group  @return the new state of the block
  STILLMAP_GRID BlockRef update_block(const GroupWork& g, uint32_t bit, const BlockNeeds& needs, BlockRef was,
                                      Int3 where, const Tally& rank) const {
    const UpdateState& state = *memory.state;
    if (needs.releases) memory.released[g.before.released + rank.released] = payload(was);
    BlockRef now = was;
    if (needs.voxels) {
      const uint32_t at = needs.near_surface ? g.before.voxels + rank.voxels
                                             : state.total.voxels + g.before.more_voxels + rank.more_voxels;
      now = map.view.pool.free_ids[state.base.voxels + at];
      memory.fresh[at] = now;
      memory.fresh_was[at] = was;
      map.view.block_keys[now] = pack(where);
      map.view.settled_free[now] = 0;
    } else if (needs.partly) {
      const uint32_t id = map.view.partly_pool.free_ids[state.base.partly + g.before.partly + rank.partly];
      map.view.partly[id] = {{}, pack(where), 1};
      now = kPartlyRef | id;
    } else if ((g.view.partly >> bit & 1) && is_partly(was)) {
      SeenVoxels& seen = map.view.partly[payload(was)];
      seen.looks = map.looks_more(seen.looks);
    } else if ((g.view.free >> bit & 1) && !has_id(was)) {
      const uint32_t looks = is_partly(was) ? map.view.partly[payload(was)].looks : looks_of(was);
      now = free_ref(map.looks_more(looks));
    }
    if (needs.fuse) list(g, bit, needs, now, rank);
    return now;
  }
  STILLMAP_GRID void list(const GroupWork& g, uint32_t bit, const BlockNeeds& needs, BlockRef ref,
                          const Tally& rank) const {
    const bool partly = is_partly(ref);
    const uint32_t at = needs.near_surface
                            ? g.before.visible + rank.visible
                            : memory.state->total.visible + g.before.more_visible + rank.more_visible;
    const uint32_t kind = partly                     ? VisibleBlock::kPartly
                          : (g.view.free >> bit & 1) ? VisibleBlock::kFree
                                                     : 0u;
    memory.visible[at] = {(partly ? payload(ref) : ref) | kind};
  }
};

/// Fills new blocks with what was known of them, then the released records go back. A block of lanes a voxel
/// block.
struct FillFreshKernel {
  static constexpr uint32_t kLanes = 128;
  using Shared = NoShared;
  DeviceMap map;
  UpdateMemory memory;

  template <class Block>
  STILLMAP_GRID void operator()(Block& block) const {
    const UpdateState& state = *memory.state;
    const uint32_t fresh = state.total.voxels + state.total.more_voxels;
    for (uint32_t i = block.index(); i < fresh; i += block.count()) {
      VoxelBlock& voxels = map.view.blocks[memory.fresh[i]];
      const BlockRef was = memory.fresh_was[i];
      for_all_in_block(block, static_cast<uint32_t>(kBlockVoxels), [&](uint32_t v) {
        const BlockAt known = read(was);
        VoxelRecord record;
        VoxelSurface surface;
        if (known && (!known.seen || known.seen->has(static_cast<int32_t>(v)))) {
          surface = {kSdfMax, 0};
          record.weight = static_cast<uint8_t>(known.looks < 255 ? known.looks : 255);
        }
        voxels.surface[v] = surface;
        voxels.record[v] = record;
      });
    }
    const uint32_t used = map.counters->used[2];
    for_all(block, state.total.released, [&](uint32_t i) {
      const uint32_t id = memory.released[i];
      map.view.partly_pool.free_ids[used + state.total.released - 1 - i] = id;
    });
  }

 private:
  STILLMAP_GRID BlockAt read(BlockRef was) const {
    if (is_free(was)) return {map.view.free_block, nullptr, payload(was)};
    if (is_partly(was)) {
      const SeenVoxels& seen = map.view.partly[payload(was)];
      return {map.view.free_block, &seen, seen.looks};
    }
    return {};
  }
};

/// Records that were released are not in use. After FillFreshKernel, which still reads them. One a lane.
struct ForgetReleasedKernel {
  static constexpr uint32_t kLanes = 128;
  using Shared = NoShared;
  DeviceMap map;
  UpdateMemory memory;

  template <class Block>
  STILLMAP_GRID void operator()(Block& block) const {
    for_all(block, memory.state->total.released,
            [&](uint32_t i) { map.view.partly[memory.released[i]].key = kEmptyKey; });
  }
};

/// Fuses the frame into the visible blocks, one pass over their memory. A block of lanes a voxel block.
struct FuseKernel {
  static constexpr uint32_t kLanes = 128;
  struct Flags {
    uint32_t unsettled, band, surface, unobserved, looks;  ///< looks: 255 - the fewest of the observed
    STILLMAP_HD friend Flags operator+(Flags a, Flags b) {
      return {a.unsettled | b.unsettled, a.band | b.band, a.surface | b.surface, a.unobserved | b.unobserved,
              a.looks > b.looks ? a.looks : b.looks};
    }
  };
  struct Shared {
    Flags flags[kLanes / kWarp];
    uint32_t complete[kLanes / kWarp];
  };
  DeviceMap map;
  UpdateMemory memory;

  template <class Block>
  STILLMAP_GRID void operator()(Block& block) const {
    for (uint32_t i = block.index(); i < memory.state->visible_blocks; i += block.count()) {
      const VisibleBlock visible = memory.visible[i];
      const uint32_t outcome = visible.partly() ? mark_seen(block, visible.id()) : fuse(block, visible);
      block.each([&](uint32_t lane) {
        if (lane != 0) return;
        memory.outcome[i] = outcome;
        if (!visible.partly()) atomic_add(&memory.state->visible_voxel_blocks, 1u);
      });
    }
  }

 private:
  template <class Block>
  STILLMAP_GRID uint32_t fuse(Block& block, VisibleBlock visible) const {
    const IntegratePass pass = memory.state->fuse;
    VoxelBlock& voxels = map.view.blocks[visible.id()];
    const VoxelGrid grid(pass.T_cam_map, unpack(map.view.block_keys[visible.id()]), map.view.voxel_m);
    PerLane<Block, Flags> flags;
    block.privately([&](uint32_t lane) {
      Flags f = {};
      for (uint32_t v = lane; v < static_cast<uint32_t>(kBlockVoxels); v += kLanes) {
        const auto i = static_cast<int32_t>(v);
        const IntegratePass::Touched touched =
            pass.fuse(visible, voxels, grid, PlainVoxels{}, i & 7, i >> 3 & 7, i >> 6);
        f.unsettled |= static_cast<uint32_t>(touched.unsettled);
        f.band |= static_cast<uint32_t>(touched.band);
      }
      if (!pass.dense) f = f + left_over(voxels, lane);
      flags[lane] = f;
    });
    const Flags all = sum_over_block(block, flags, block.shared().flags);
    const bool no_surface = !pass.dense && !all.band && !all.surface;
    block.each([&](uint32_t lane) {
      if (lane == 0)
        pass.note_settled(visible, visible.all_free() && !all.unsettled, all.band != 0, no_surface);
    });
    if (!no_surface) return outcome_detail::kStays;
    const uint32_t kind = all.unobserved ? outcome_detail::kVoxelsArePartly : outcome_detail::kVoxelsAreFree;
    return kind | (255 - all.looks) << 8;
  }
  /// What the lane's voxels are after fusion.
  STILLMAP_GRID static Flags left_over(const VoxelBlock& voxels, uint32_t lane) {
    Flags f = {};
    for (uint32_t v = lane; v < static_cast<uint32_t>(kBlockVoxels); v += kLanes) {
      const int16_t sdf = voxels.surface[v].sdf;
      const bool observed = sdf != kSdfUnobserved;
      f.surface |= static_cast<uint32_t>(observed && sdf != kSdfMax);
      f.unobserved |= static_cast<uint32_t>(!observed);
      if (!observed) continue;
      const uint32_t few = 255u - voxels.record[v].weight;
      f.looks = few > f.looks ? few : f.looks;
    }
    return f;
  }

  template <class Block>
  STILLMAP_GRID uint32_t mark_seen(Block& block, uint32_t id) const {
    const IntegratePass pass = memory.state->fuse;
    SeenVoxels& seen = map.view.partly[id];
    auto* words = reinterpret_cast<uint32_t*>(seen.layer);
    const VoxelGrid grid(pass.T_cam_map, unpack(seen.key), map.view.voxel_m);
    // Words that are not full yet, and above them words that grew.
    constexpr uint32_t kGrew = 1u << 16;
    PerLane<Block, uint32_t> words_that;
    block.each([&](uint32_t lane) { words_that[lane] = 0; });
    for (uint32_t first = 0; first < static_cast<uint32_t>(kBlockVoxels); first += kLanes) {
      PerLane<Block, uint32_t> free;
      block.privately([&](uint32_t lane) {
        const auto i = static_cast<int32_t>(first + lane);
        const Observation<float> o =
            observe(pass.geometry, grid.position<float>(static_cast<float>(i & 7), i >> 3 & 7, i >> 6));
        free[lane] = static_cast<uint32_t>(o.free);
      });
      const PerLane<Block, uint32_t> bits = block.ballot(free);
      block.each([&](uint32_t lane) {
        if (lane % kWarp != 0) return;
        uint32_t& word = words[(first + lane) / kWarp];
        if (bits[lane] & ~word) words_that[lane] += kGrew;
        word |= bits[lane];
      });
    }
    block.privately([&](uint32_t lane) {
      if (lane < kBlockVoxels / kWarp && words[lane] != ~0u) ++words_that[lane];
    });
    const uint32_t all = sum_over_block(block, words_that, block.shared().complete);
    block.each([&](uint32_t lane) {
      if (lane == 0) seen.grew = all >= kGrew;
    });
    const bool complete = (all & (kGrew - 1)) == 0;
    return complete ? outcome_detail::kPartlyIsFree | seen.looks << 8 : outcome_detail::kStays;
  }
};

/// Who needs no voxels, or no record, any more gives them back; who turns from voxels into a record gets one
/// while there are some. One block.
struct PlanMergeKernel {
  static constexpr uint32_t kLanes = 256;
  struct Counts {
    uint32_t to_free, to_partly, completed;
    STILLMAP_HD friend Counts operator+(Counts a, Counts b) {
      return {a.to_free + b.to_free, a.to_partly + b.to_partly, a.completed + b.completed};
    }
    STILLMAP_HD friend Counts operator-(Counts a, Counts b) {
      return {a.to_free - b.to_free, a.to_partly - b.to_partly, a.completed - b.completed};
    }
  };
  struct Shared {
    Counts counts[kLanes / kWarp];
  };
  DeviceMap map;
  UpdateMemory memory;

  template <class Block>
  STILLMAP_GRID void operator()(Block& block) const {
    using namespace outcome_detail;
    const uint32_t used_voxels = map.counters->used[0], used_partly = map.counters->used[2];
    const uint32_t room = map.view.partly_pool.free_ids.size - used_partly;
    Counts before = {};
    for (uint32_t first = 0; first < memory.state->visible_blocks; first += kLanes) {
      PerLane<Block, Counts> rank;
      block.privately([&](uint32_t lane) {
        const uint32_t k =
            first + lane < memory.state->visible_blocks ? kind(memory.outcome[first + lane]) : kStays;
        rank[lane] = {static_cast<uint32_t>(k == kVoxelsAreFree),
                      static_cast<uint32_t>(k == kVoxelsArePartly),
                      static_cast<uint32_t>(k == kPartlyIsFree)};
      });
      const Counts sum = scan_block(block, rank, block.shared().counts);
      block.each([&](uint32_t lane) {
        if (first + lane < memory.state->visible_blocks)
          settle(first + lane, before + rank[lane], room, used_voxels, used_partly);
      });
      before = before + sum;
    }
    const uint32_t taken = before.to_partly < room ? before.to_partly : room;
    give_back_records(block, used_partly + taken, before.completed);
    block.each([&](uint32_t lane) {
      if (lane != 0) return;
      map.counters->used[0] = used_voxels - before.to_free - taken;
      map.counters->used[2] = used_partly + taken;
      map.counters->note_peak();
      map.counters->used[2] -= before.completed;
    });
  }

 private:
  /// Voxels go back to their pool; the id of a new record is noted with the outcome of the block.
  STILLMAP_GRID void settle(uint32_t i, Counts rank, uint32_t room, uint32_t used_voxels,
                            uint32_t used_partly) const {
    using namespace outcome_detail;
    uint32_t& outcome = memory.outcome[i];
    if (kind(outcome) == kVoxelsArePartly && rank.to_partly >= room) outcome = kStays;
    if (kind(outcome) == kPartlyIsFree) memory.released[rank.completed] = memory.visible[i].id();
    if (kind(outcome) != kVoxelsAreFree && kind(outcome) != kVoxelsArePartly) return;
    const uint32_t partly_before = rank.to_partly < room ? rank.to_partly : room;
    map.view.pool.free_ids[used_voxels - 1 - (rank.to_free + partly_before)] = memory.visible[i].id();
    if (kind(outcome) == kVoxelsArePartly)
      memory.record[i] = map.view.partly_pool.free_ids[used_partly + rank.to_partly];
  }
  template <class Block>
  STILLMAP_GRID void give_back_records(Block& block, uint32_t used, uint32_t completed) const {
    for_all_in_block(block, completed,
                     [&](uint32_t i) { map.view.partly_pool.free_ids[used - 1 - i] = memory.released[i]; });
  }
};

/// Replaces what needs no voxels, or no record, by what is left to say of it. A block of lanes a voxel block.
struct MergeBlocksKernel {
  static constexpr uint32_t kLanes = 64;
  using Shared = NoShared;
  DeviceMap map;
  UpdateMemory memory;

  template <class Block>
  STILLMAP_GRID void operator()(Block& block) const {
    using namespace outcome_detail;
    for (uint32_t i = block.index(); i < memory.state->visible_blocks; i += block.count()) {
      const uint32_t outcome = memory.outcome[i], id = memory.visible[i].id();
      if (kind(outcome) == kStays) continue;
      if (kind(outcome) == kVoxelsArePartly) write_record(block, id, memory.record[i]);
      block.each([&](uint32_t lane) {
        if (lane == 0) replace(kind(outcome), outcome >> 8, id, memory.record[i]);
      });
    }
  }

 private:
  template <class Block>
  STILLMAP_GRID void write_record(Block& block, BlockId id, uint32_t record) const {
    auto* words = reinterpret_cast<uint32_t*>(map.view.partly[record].layer);
    for (uint32_t first = 0; first < static_cast<uint32_t>(kBlockVoxels); first += kLanes) {
      PerLane<Block, uint32_t> observed;
      block.privately([&](uint32_t lane) {
        observed[lane] =
            static_cast<uint32_t>(map.view.blocks[id].surface[first + lane].sdf != kSdfUnobserved);
      });
      const PerLane<Block, uint32_t> bits = block.ballot(observed);
      block.each([&](uint32_t lane) {
        if (lane % kWarp == 0) words[(first + lane) / kWarp] = bits[lane];
      });
    }
  }
  STILLMAP_GRID void replace(uint32_t kind, uint32_t looks, uint32_t id, uint32_t record) const {
    if (kind == outcome_detail::kPartlyIsFree) {
      SeenVoxels& seen = map.view.partly[id];
      map.ref_in_group(unpack(seen.key)) = free_ref(looks);
      seen.key = kEmptyKey;
      return;
    }
    const BlockKey key = map.view.block_keys[id];
    const uint32_t enough_looks = looks < map.enough ? looks : map.enough;
    map.view.block_keys[id] = kEmptyKey;
    if (kind == outcome_detail::kVoxelsAreFree) {
      map.ref_in_group(unpack(key)) = free_ref(enough_looks);
      return;
    }
    map.view.partly[record].key = key;
    map.view.partly[record].looks = enough_looks;
    map.view.partly[record].grew = true;
    map.ref_in_group(unpack(key)) = kPartlyRef | record;
  }
};

/// A group of which all blocks are free for good is one word. A block of lanes a group, a lane a block.
struct MergeGroupsKernel {
  static constexpr uint32_t kLanes = kGroupBlocks;
  struct Shared {
    uint32_t kept[kLanes / kWarp];
  };
  DeviceMap map;
  UpdateMemory memory;

  template <class Block>
  STILLMAP_GRID void operator()(Block& block) const {
    for (uint32_t i = block.index(); i < memory.state->candidates; i += block.count()) {
      const GroupWork& work = memory.groups[memory.candidates[i]];
      if (work.view.free == 0 || !work.slot || !has_id(*work.slot)) continue;
      merge(block, work.slot);
    }
  }

 private:
  template <class Block>
  STILLMAP_GRID void merge(Block& block, BlockRef* slot) const {
    const BlockRef group = *slot;
    PerLane<Block, uint32_t> kept;
    block.privately([&](uint32_t lane) {
      const BlockRef ref = map.view.groups[group].block[lane];
      kept[lane] = static_cast<uint32_t>(!is_free(ref) || payload(ref) < map.enough);
    });
    if (sum_over_block(block, kept, block.shared().kept) != 0) return;
    block.each([&](uint32_t lane) {
      if (lane != 0) return;
      *slot = free_ref(map.enough);
      // In which order they come back does not matter: no result depends on the id of a group.
      const uint32_t used = atomic_add(&map.counters->used[1], ~0u);
      map.view.group_pool.free_ids[used - 1] = group;
    });
  }
};

}  // namespace stillmap
