#include "kernels/backend/cpu/extract.hpp"

#include <algorithm>
#include <type_traits>

#include "kernels/extract/extract_pass.hpp"

namespace stillmap {
namespace {

constexpr uint32_t kBlocksPerTask = 64;
constexpr uint32_t kBatchVertices = 1u << 16;
constexpr uint32_t kBatchTriangles = 1u << 16;
static_assert(kBatchVertices >= 3 * kBlockVoxels && kBatchTriangles >= kMaxCellTriangles * kBlockVoxels,
              "one block must fit");

/// The scratch memory, carved. "By rank" is by place in `order`.
struct Scratch {
  View<BlockId> order;            ///< blocks with a part of the surface, by key
  View<uint32_t> first_vertex;    ///< by block id: vertices before its own
  View<uint32_t> first_triangle;  ///< by rank
  View<uint8_t> classes;          ///< by block id
  View<Vec3> positions_m;
  View<Rgb8> colours;
  View<uint32_t> indices;

  /// @return bytes taken; carves only when there is memory
  uint64_t carve(uint8_t* memory, uint32_t blocks) {
    uint64_t used = 0;
    const auto take = [&](auto& view, uint32_t count) {
      using Element = std::remove_reference_t<decltype(view[0])>;
      view = {memory ? reinterpret_cast<Element*>(memory + used) : nullptr, count};
      used += (uint64_t{count} * sizeof(Element) + 63) / 64 * 64;
    };
    take(order, blocks);
    take(first_vertex, blocks);
    take(first_triangle, blocks);
    take(classes, blocks);
    take(positions_m, kBatchVertices);
    take(colours, kBatchVertices);
    take(indices, 3 * kBatchTriangles);
    return used;
  }
};

class Extraction {
 public:
  Extraction(const VolumeView& map, MeshSink& sink, const Scratch& scratch, ThreadPool& threads)
      : map_(map), pass_{map, &kCubeCases}, sink_(sink), scratch_(scratch), threads_(threads) {}

  Status run() {
    find_candidates();
    if (!count()) return Status::capacity_exhausted;
    const bool done = sink_.begin(vertices_, triangles_) && send_vertices() && send_triangles();
    return done ? Status::ok : Status::unavailable;
  }

 private:
  /// Calls f(i) for i in [first, last), many at a time.
  template <class F>
  void for_each(uint32_t first, uint32_t last, uint32_t per_task, const F& f) {
    threads_.for_each((last - first + per_task - 1) / per_task, [&](uint32_t task) {
      const uint32_t begin = first + task * per_task, end = std::min(begin + per_task, last);
      for (uint32_t i = begin; i < end; ++i) f(i);
    });
  }

  /// Most blocks of a mapped room are free space; a look at each block's range of distances drops those.
  void find_candidates() {
    const uint32_t capacity = map_.block_keys.size;
    for_each(0, capacity, kBlocksPerTask, [&](BlockId id) {
      scratch_.classes[id] = map_.block_keys[id] == kEmptyKey ? uint8_t{0} : pass_.classify(id);
    });
    // Until there are counts, first_vertex says which blocks are candidates.
    for_each(0, capacity, kBlocksPerTask, [&](BlockId id) {
      scratch_.first_vertex[id] =
          map_.block_keys[id] != kEmptyKey && pass_.may_hold_surface(id, scratch_.classes.data);
    });
    blocks_ = 0;
    for (BlockId id = 0; id < capacity; ++id)
      if (scratch_.first_vertex[id]) scratch_.order[blocks_++] = id;
    std::sort(scratch_.order.begin(), scratch_.order.begin() + blocks_,
              [&](BlockId a, BlockId b) { return map_.block_keys[a] < map_.block_keys[b]; });
  }

  /// False: too many for 32-bit indices.
  bool count() {
    for_each(0, blocks_, kBlocksPerTask / 8, [&](uint32_t rank) {
      const BlockCounts counts = pass_.count(scratch_.order[rank]);
      scratch_.first_vertex[scratch_.order[rank]] = counts.vertices;
      scratch_.first_triangle[rank] = counts.triangles;
    });
    for (uint32_t rank = 0; rank < blocks_; ++rank) {
      uint32_t& vertices = scratch_.first_vertex[scratch_.order[rank]];
      const uint32_t own_vertices = vertices, own_triangles = scratch_.first_triangle[rank];
      vertices = static_cast<uint32_t>(vertices_);
      scratch_.first_triangle[rank] = static_cast<uint32_t>(triangles_);
      vertices_ += own_vertices;
      triangles_ += own_triangles;
      if (vertices_ > UINT32_MAX || triangles_ > UINT32_MAX) return false;
    }
    return true;
  }

  uint32_t first_vertex(uint32_t rank) const {
    return rank < blocks_ ? scratch_.first_vertex[scratch_.order[rank]] : static_cast<uint32_t>(vertices_);
  }
  uint32_t first_triangle(uint32_t rank) const {
    return rank < blocks_ ? scratch_.first_triangle[rank] : static_cast<uint32_t>(triangles_);
  }

  /// Calls send(first rank, last rank) for runs of blocks of which no more than `limit` elements come.
  template <class First, class Send>
  bool in_batches(uint32_t limit, const First& first, const Send& send) {
    for (uint32_t begin = 0, end = 0; begin < blocks_; begin = end) {
      while (end < blocks_ && first(end + 1) - first(begin) <= limit) ++end;
      if (first(end) != first(begin) && !send(begin, end)) return false;
    }
    return true;
  }

  bool send_vertices() {
    const auto first = [&](uint32_t rank) { return first_vertex(rank); };
    return in_batches(kBatchVertices, first, [&](uint32_t begin, uint32_t end) {
      for_each(begin, end, kBlocksPerTask / 8, [&](uint32_t rank) {
        const uint32_t at = first(rank) - first(begin);
        if (first(rank + 1) != first(rank))
          pass_.write_vertices(scratch_.order[rank], scratch_.positions_m.data + at,
                               scratch_.colours.data + at);
      });
      const uint32_t count = first(end) - first(begin);
      return sink_.vertices({scratch_.positions_m.data, count}, {scratch_.colours.data, count});
    });
  }

  bool send_triangles() {
    const auto first = [&](uint32_t rank) { return first_triangle(rank); };
    return in_batches(kBatchTriangles, first, [&](uint32_t begin, uint32_t end) {
      for_each(begin, end, kBlocksPerTask / 8, [&](uint32_t rank) {
        if (first(rank + 1) != first(rank))
          pass_.write_triangles(scratch_.order[rank], scratch_.first_vertex.data,
                                scratch_.indices.data + 3 * (first(rank) - first(begin)));
      });
      return sink_.triangles({scratch_.indices.data, 3 * (first(end) - first(begin))});
    });
  }

  const VolumeView& map_;
  ExtractPass pass_;
  MeshSink& sink_;
  Scratch scratch_;
  ThreadPool& threads_;
  uint32_t blocks_ = 0;
  uint64_t vertices_ = 0;
  uint64_t triangles_ = 0;
};

}  // namespace

uint64_t extract_scratch_bytes(uint32_t pool_blocks) {
  return Scratch{}.carve(nullptr, pool_blocks);
}

Status extract_mesh(const VolumeView& map, MeshSink& sink, View<uint8_t> scratch, ThreadPool& threads) {
  const uint32_t capacity = map.block_keys.size;
  if (!scratch.data || scratch.size < extract_scratch_bytes(capacity)) return Status::capacity_exhausted;
  Scratch carved;
  carved.carve(scratch.data, capacity);
  return Extraction(map, sink, carved, threads).run();
}

}  // namespace stillmap
