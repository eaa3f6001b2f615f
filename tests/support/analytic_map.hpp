#pragma once

// A map written directly from a formula: what fusion would leave without noise.

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <functional>
#include <memory>
#include <random>
#include <vector>

#include "kernels/backend/cpu/map_storage.hpp"

namespace stillmap {

/// One point of a formula.
struct AnalyticSample {
  bool observed = true;
  double sdf_m = 0;  ///< cut to the truncation distance
  Rgb8 colour = {};
  bool coloured = true;
};
using AnalyticField = std::function<AnalyticSample(Vec3d p_map)>;

/// Owner of a map and its memory.
class AnalyticMap {
 public:
  explicit AnalyticMap(uint32_t pool_blocks, float voxel_m = 0.01f, float truncation_m = 0.1f,
                       FreeSpace free_space = FreeSpace::dense)
      : params_{params_of(pool_blocks, voxel_m, truncation_m, free_space)},
        arena_(std::make_unique<Arena>(bytes(params_))) {
    storage.carve(*arena_, params_, kWeightCap);
    storage.clear();
  }

  /// One voxel seen once, at this distance.
  void observe(Int3 at, int32_t voxel, int16_t sdf) {
    VoxelBlock& out = *block(at);
    out.surface[voxel].sdf = sdf;
    out.record[voxel].weight = 1;
  }

  /// From now on blocks get ids in this random order.
  void shuffle_ids(uint32_t seed) {
    std::mt19937 random(seed);
    const PoolView& pool = view().pool;
    std::shuffle(pool.free_ids.begin() + *pool.used, pool.free_ids.end(), random);
  }

  /// The block at these block coordinates, made when it is not there; null when the pool is empty.
  VoxelBlock* block(Int3 at) {
    const InsertResult result = storage.insert(pack(at));
    return result.block == kNoBlock ? nullptr : &view().blocks[result.block];
  }
  VoxelSurface& surface(Int3 voxel) { return block(block_of_voxel(voxel))->surface[index_in_block(voxel)]; }
  VoxelRecord& record(Int3 voxel) { return block(block_of_voxel(voxel))->record[index_in_block(voxel)]; }

  /// Writes all blocks from `first` to `last` (block coordinates, both included), in `order_seed`'s order (0:
  /// sorted).
  void fill(Int3 first, Int3 last, const AnalyticField& field, uint32_t order_seed = 0) {
    std::vector<Int3> order;
    for (int32_t z = first.z; z <= last.z; ++z)
      for (int32_t y = first.y; y <= last.y; ++y)
        for (int32_t x = first.x; x <= last.x; ++x) order.push_back({x, y, z});
    if (order_seed) std::shuffle(order.begin(), order.end(), std::mt19937(order_seed));
    for (const Int3 at : order) fill_block(at, field);
  }

  const VolumeView& view() const { return storage.view(); }
  uint32_t used_blocks() const { return *view().pool.used; }

  MapStorage storage;

 private:
  static constexpr int32_t kWeightCap = 64;

  static MapParams params_of(uint32_t pool_blocks, float voxel_m, float truncation_m, FreeSpace free_space) {
    MapParams p;
    p.voxel_m = voxel_m;
    p.truncation_m = truncation_m;
    p.free_space = free_space;
    p.pool_blocks = static_cast<int32_t>(pool_blocks);
    p.mesh_min_weight = 1;
    p.mesh_min_surface = 0;
    return p;
  }
  static uint64_t bytes(const MapParams& params) {
    Arena measure;
    MapStorage plan;
    plan.carve(measure, params, kWeightCap);
    return measure.items().total_bytes;
  }

  void fill_block(Int3 at, const AnalyticField& field) {
    VoxelBlock& out = *block(at);
    for (int32_t i = 0; i < kBlockVoxels; ++i) {
      const Int3 voxel = first_voxel(at) + Int3{i & 7, i >> 3 & 7, i >> 6};
      const double step = static_cast<double>(params_.voxel_m);
      const AnalyticSample s = field({voxel.x * step, voxel.y * step, voxel.z * step});
      if (!s.observed) continue;
      const double share = std::clamp(s.sdf_m / static_cast<double>(params_.truncation_m), -1.0, 1.0);
      out.surface[i].sdf = static_cast<int16_t>(std::lround(share * kSdfMax));
      out.record[i].weight = 1;
      if (s.coloured) set_colour(s.colour, out.surface[i], out.record[i]);
    }
  }

  static void set_colour(Rgb8 c, VoxelSurface& surface, VoxelRecord& record) {
    const float y = luminance(c);
    surface.luma = static_cast<uint16_t>(y * kLumaScale + 0.5f);
    record.colour_weight = 1;
    record.cb = clamp_to_byte(128.0f + (static_cast<float>(c.b) - 255.0f * y) / 1.8556f);
    record.cr = clamp_to_byte(128.0f + (static_cast<float>(c.r) - 255.0f * y) / 1.5748f);
  }

  MapParams params_;
  std::unique_ptr<Arena> arena_;
};

/// Distances outside the shapes are above 0.
inline double sphere_sdf(Vec3d p, Vec3d centre, double radius_m) {
  return norm(p - centre) - radius_m;
}
inline double box_sdf(Vec3d p, Vec3d centre, Vec3d half_m) {
  const Vec3d q = {std::fabs(p.x - centre.x) - half_m.x, std::fabs(p.y - centre.y) - half_m.y,
                   std::fabs(p.z - centre.z) - half_m.z};
  const Vec3d out = {std::max(q.x, 0.0), std::max(q.y, 0.0), std::max(q.z, 0.0)};
  return norm(out) + std::min(std::max({q.x, q.y, q.z}), 0.0);
}
/// A half space: inside where `normal` (length 1) does not point; through `point`.
inline double plane_sdf(Vec3d p, Vec3d point, Vec3d normal) {
  return dot(p - point, normal);
}

}  // namespace stillmap
