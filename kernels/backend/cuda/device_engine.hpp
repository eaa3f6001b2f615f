#pragma once

// The engine over a device: memory that kernels reach, memory that both sides reach, launches in order. The
// device is the GPU (cuda_device.cuh) or, in the tests, its emulation on the CPU (tests/support); so all of
// this also runs where there is no GPU.
//
// A device has
//   bool failed() const                       it cannot be used; stays so
//   uint8_t* device_memory(), shared_memory() as much as was asked for; shared: reached by both sides
//   void launch(blocks, kernel)               see grid.hpp
//   void copy(to, from, bytes), fill(at, byte, bytes)   between any of its memory, in order with the launches
//   void record(step, f), play(step)          what f() launches, as often as it is played; recorded at boot
//   Status wait()                             until all of it is done
//
// Each step of a frame has a state: the host fills its copy, the first thing that a step does is to take it
// to the device, the last to bring it back. So what a step launches is the same for every frame and can be
// recorded.

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <cstring>

#include "kernels/backend/cpu/arena.hpp"
#include "kernels/backend/cuda/complete_kernels.hpp"
#include "kernels/backend/cuda/map_access.hpp"
#include "kernels/backend/cuda/map_update.hpp"
#include "kernels/backend/cuda/mask_kernels.hpp"
#include "kernels/backend/cuda/pixel_kernels.hpp"
#include "kernels/backend/cuda/place_kernels.hpp"
#include "kernels/backend/cuda/track_kernel.hpp"
#include "kernels/backend/cuda/view_kernels.hpp"
#include "kernels/complete/kept_frames.hpp"
#include "kernels/engine.hpp"
#include "kernels/extract/cube_cases.hpp"
#include "kernels/frame_rules.hpp"
#include "kernels/map/map_sizes.hpp"
#include "kernels/mask/parts.hpp"
#include "kernels/mask/slide.hpp"
#include "kernels/mask/static_pixels.hpp"
#include "kernels/raycast/raycast_pass.hpp"
#include "kernels/relocalise/place_store.hpp"
#include "kernels/track/track.hpp"

namespace stillmap {

/// What is launched as one.
enum class DeviceStep : uint32_t {
  prepare,
  track,
  evidence,  ///< cells against the map
  mask,      ///< from cells, or from pixels, to the mask
  refine,
  track_coarse,  ///< as track and refine, but not at the finest level
  refine_coarse,
  integrate,
  look,      ///< at groups only, for the archive
  places,    ///< small views of the frame
  complete,  ///< a kept frame; only with depth.invalid = complete
  count_
};

/// The states of the steps; one copy on each side.
struct DeviceStates {
  struct Prepare {
    PreparePass pass;
    CellDepthPass cell_depth;
    CellNormalPass cell_normal;
    uint32_t valid;
  } prepare;
  struct Register {
    CarryMaskPass carry;
    TrustPass trust;
    TrackState track;
  } track, refine;
  struct Evidence {
    CellEvidencePass evidence;
    StillPass still;
  } evidence;
  struct Mask {
    ResidualMaskPass suspect;
    DynamicPixelPass pixels;
    TrustPass trust;
    CountMaskedKernel::Counts counts;
    uint32_t components[2];  ///< see ComponentMemory
  } mask;
  struct Integrate {
    StaticDepthPass depth;
    UpdateState update;
  } integrate;
  struct Places {
    ShrinkPass shrink;
    HalvePass halve;
  } places;
  struct Complete {
    StartDepthPass start;
    SilentCellPass silent;
    CompletePass pass;
  } complete;
  MapCounters counters;
  MapMail mail;
};

/// The images of the cells, one after the other, so that one copy takes them all.
struct CellImages {
  CellGrid grid;

  void carve(Arena& arena, const Intrinsics& k) {
    grid.px = cell_px_for(k.width);
    grid.k = shrunk(k, grid.px);
    const int32_t rows = grid.k.height, cols = grid.k.width;
    const char* name = "parts";
    grid.depth_m = arena.take_image<float>(name, rows, cols);
    grid.luma = arena.take_image<float>(name, rows, cols);
    grid.residual = arena.take_image<CellResidual>(name, rows, cols);
    grid.normal = arena.take_image<Vec3>(name, rows, cols);
    grid.evidence = arena.take_image<Contradiction>(name, rows, cols);
    grid.expected = arena.take_image<uint8_t>(name, rows, cols);
    grid.fused = arena.take_image<uint8_t>(name, rows, cols);
    grid.dynamic = arena.take_image<uint8_t>(name, rows, cols);
    grid.still = arena.take_image<uint16_t>(name, rows, cols);
    grid.crept_m = arena.take_image<float>(name, rows, cols);
    grid.part = arena.take_image<int32_t>(name, rows, cols);
  }
  static uint64_t bytes(const Intrinsics& k) {
    Arena arena;
    CellImages images;
    images.carve(arena, k);
    return arena.items().total_bytes;
  }
};

/// Memory that kernels reach.
struct DeviceMemory {
  DeviceStates* states = nullptr;
  ImageView<float> depth_m, static_depth_m;
  ImageView<LumaChroma> luma_chroma;
  ImageView<Rgb8> colour;
  ImageView<Pixel> source_pixel;
  ImageView<uint8_t> mask, mask_scratch, trust;
  ComponentMemory components;  ///< of pixels; only with the residual method
  View<uint8_t> cell_bytes;
  CellImages cells;
  CellsBefore before;
  DepthRangePyramid ranges;
  View<NormalEqT<float>> partial;
  DeviceMap map;
  View<VoxelBlock> free_block;
  UpdateMemory update;
  View<RayRange> ray_ranges;
  View<uint8_t> classes;
  View<BlockId> order;
  View<uint32_t> first_vertex, first_triangle;
  View<CubeCases> cube_cases;
  SmallView small[2];
  TryScratch scratch_of_tries[PlaceStore::kMaxTries];
  KeptFrames kept;
  View<ModelFrame> model_frames;

  void carve(Arena& arena, const EngineParams& p) {
    const Intrinsics& k = p.camera.k;
    const int32_t rows = k.height, cols = k.width;
    states = arena.take<DeviceStates>("device: images", 1).data;
    depth_m = arena.take_image<float>("device: images", rows, cols);
    static_depth_m = arena.take_image<float>("device: images", rows, cols);
    luma_chroma = arena.take_image<LumaChroma>("device: images", rows, cols);
    colour = arena.take_image<Rgb8>("device: images", rows, cols);
    if (!p.camera.distortion.none()) source_pixel = arena.take_image<Pixel>("device: images", rows, cols);
    mask = arena.take_image<uint8_t>("device: mask", rows, cols);
    mask_scratch = arena.take_image<uint8_t>("device: mask", rows, cols);
    trust = arena.take_image<uint8_t>("device: mask", rows, cols);
    if (p.mask.method == MaskMethod::residual) components.carve(arena, rows, cols);
    carve_cells(arena, k);
    carve_ranges(arena, rows, cols);
    partial = arena.take<NormalEqT<float>>("device: images", TrackKernel::kMostBlocks);
    carve_map(arena, p);
    carve_views(arena, static_cast<uint64_t>(p.map.pool_blocks));
    if (p.relocalise.enabled) carve_places(arena, p);
    kept.carve(arena, "device: completed depth", p);
    if (p.depth.invalid == InvalidDepth::complete)
      model_frames = arena.take<ModelFrame>("device: completed depth", kMostModelFrames);
  }

 private:
  void carve_cells(Arena& arena, const Intrinsics& k) {
    cell_bytes = arena.take<uint8_t>("device: parts", CellImages::bytes(k));
    Arena inner(cell_bytes.data, cell_bytes.size);
    if (cell_bytes.data) cells.carve(inner, k);
    const Intrinsics grid = shrunk(k, cell_px_for(k.width));
    before.depth_m = arena.take_image<float>("device: parts", grid.height, grid.width);
    before.luma = arena.take_image<float>("device: parts", grid.height, grid.width);
    before.crept_m = arena.take_image<float>("device: parts", grid.height, grid.width);
    before.dynamic = arena.take_image<uint8_t>("device: parts", grid.height, grid.width);
    before.still = arena.take_image<uint16_t>("device: parts", grid.height, grid.width);
  }
  void carve_ranges(Arena& arena, int32_t image_rows, int32_t image_cols) {
    ranges.image_rows = image_rows;
    ranges.image_cols = image_cols;
    int32_t rows = (image_rows + kTilePx - 1) / kTilePx, cols = (image_cols + kTilePx - 1) / kTilePx;
    while (ranges.levels < kMaxLevels) {
      ranges.level[ranges.levels++] = arena.take_image<DepthRange>("device: images", rows, cols);
      if (rows == 1 && cols == 1) break;
      rows = (rows + 1) / 2;
      cols = (cols + 1) / 2;
    }
  }
  void carve_map(Arena& arena, const EngineParams& p) {
    const MapSizes sizes = map_sizes(p.map);
    VolumeView& view = map.view;
    view.voxel_m = p.map.voxel_m;
    view.truncation_m = p.map.truncation_m;
    view.mesh_min_weight = p.map.mesh_min_weight;
    view.mesh_min_surface = p.map.mesh_min_surface;
    view.table.keys = arena.take<BlockKey>("device: map table", sizes.slots);
    view.table.blocks = arena.take<BlockRef>("device: map table", sizes.slots);
    view.groups = arena.take<BlockGroup>("device: map groups", sizes.groups);
    view.group_pool.free_ids = arena.take<BlockId>("device: map groups", sizes.groups);
    view.blocks = arena.take<VoxelBlock>("device: map voxel blocks", sizes.blocks);
    free_block = arena.take<VoxelBlock>("device: map voxel blocks", 1);
    view.block_keys = arena.take<BlockKey>("device: map block lists", sizes.blocks);
    view.settled_free = arena.take<uint8_t>("device: map block lists", sizes.blocks);
    view.pool.free_ids = arena.take<BlockId>("device: map block lists", sizes.blocks);
    view.partly = arena.take<SeenVoxels>("device: map partly seen blocks", sizes.partly);
    view.partly_pool.free_ids = arena.take<BlockId>("device: map partly seen blocks", sizes.partly);
    view.free_block = free_block.data;
    map.counters = states ? &states->counters : nullptr;
    uint32_t* const used = states ? states->counters.used : nullptr;
    view.pool.used = used;
    view.group_pool.used = used ? used + 1 : nullptr;
    view.partly_pool.used = used ? used + 2 : nullptr;
    map.enough = static_cast<uint32_t>(p.integrate.weight_cap);
    carve_update(arena, p, sizes);
  }
  void carve_update(Arena& arena, const EngineParams& p, const MapSizes& sizes) {
    update.state = states ? &states->integrate.update : nullptr;
    update.groups = arena.take<GroupWork>("device: visible blocks", max_groups(p));
    update.candidates = arena.take<uint32_t>("device: visible blocks", max_groups(p));
    update.visible = arena.take<VisibleBlock>("device: visible blocks", max_visible(p));
    update.outcome = arena.take<uint32_t>("device: visible blocks", max_visible(p));
    update.record = arena.take<uint32_t>("device: visible blocks", max_visible(p));
    update.fresh = arena.take<BlockId>("device: visible blocks", sizes.blocks);
    update.fresh_was = arena.take<BlockRef>("device: visible blocks", sizes.blocks);
    update.released = arena.take<uint32_t>("device: visible blocks", sizes.partly);
    update.ranges = ranges;
  }
  void carve_views(Arena& arena, uint64_t blocks) {
    ray_ranges = arena.take<RayRange>("device: mesh and views", RayRanges::kMaxEdge * RayRanges::kMaxEdge);
    classes = arena.take<uint8_t>("device: mesh and views", blocks);
    order = arena.take<BlockId>("device: mesh and views", blocks);
    first_vertex = arena.take<uint32_t>("device: mesh and views", blocks);
    first_triangle = arena.take<uint32_t>("device: mesh and views", blocks + 1);
    cube_cases = arena.take<CubeCases>("device: mesh and views", 1);
  }
  void carve_places(Arena& arena, const EngineParams& p) {
    const char* name = "device: relocalisation";
    const Intrinsics fine = shrunk(p.camera.k, cell_px(p.camera.k.width)), coarse = shrunk(fine, 2);
    for (int32_t i = 0; i < 2; ++i) {
      const Intrinsics& k = i == 0 ? fine : coarse;
      small[i] = {arena.take_image<float>(name, k.height, k.width),
                  arena.take_image<float>(name, k.height, k.width)};
    }
    const Intrinsics wide = widened(coarse);
    for (TryScratch& s : scratch_of_tries) {
      s.model.k = wide;
      s.model.depth_m = arena.take_image<float>(name, wide.height, wide.width);
      s.model.normal = arena.take_image<Vec3>(name, wide.height, wide.width);
      s.colour = arena.take<Rgb8>(
          name, static_cast<uint64_t>(std::max(wide.width * wide.height, fine.width * fine.height)));
      s.expected_m = arena.take_image<float>(name, fine.height, fine.width);
      s.map_luma = arena.take_image<float>(name, fine.height, fine.width);
    }
  }
};

/// Memory that both sides reach.
struct SharedMemory {
  DeviceStates* states = nullptr;
  ImageView<uint16_t> depth_raw;
  ImageView<Rgb8> colour_raw;
  ImageView<uint8_t> mask;
  ImageView<float> depth_m;  ///< as the host asked for it last
  ImageView<Rgb8> colour;
  View<uint8_t> cell_bytes;
  CellImages cells;
  EarlierCells earlier[kEarlier];  ///< host only, as what follows
  PartMemory part_memory;
  View<uint8_t> post;  ///< for whatever is asked outside of frames
  View<uint32_t> first_vertex, first_triangle;
  PlaceStore places;
  View<ModelFrame> model_frames;

  void carve(Arena& arena, const EngineParams& p) {
    const Intrinsics& k = p.camera.k;
    const int32_t rows = k.height, cols = k.width;
    states = arena.take<DeviceStates>("shared: images", 1).data;
    depth_raw = arena.take_image<uint16_t>("shared: images", rows, cols);
    colour_raw = arena.take_image<Rgb8>("shared: images", rows, cols);
    mask = arena.take_image<uint8_t>("shared: images", rows, cols);
    depth_m = arena.take_image<float>("shared: images", rows, cols);
    colour = arena.take_image<Rgb8>("shared: images", rows, cols);
    carve_cells(arena, k);
    post = arena.take<uint8_t>("shared: mesh, views, records", post_bytes(p));
    const uint64_t blocks = static_cast<uint64_t>(p.map.pool_blocks);
    first_vertex = arena.take<uint32_t>("shared: mesh, views, records", blocks);
    first_triangle = arena.take<uint32_t>("shared: mesh, views, records", blocks + 1);
    places.carve(arena, p);
    if (p.depth.invalid == InvalidDepth::complete)
      model_frames = arena.take<ModelFrame>("shared: completed depth", kMostModelFrames);
  }

 private:
  void carve_cells(Arena& arena, const Intrinsics& k) {
    cell_bytes = arena.take<uint8_t>("shared: parts", CellImages::bytes(k));
    Arena inner(cell_bytes.data, cell_bytes.size);
    if (cell_bytes.data) cells.carve(inner, k);
    const Intrinsics grid = shrunk(k, cell_px_for(k.width));
    const int32_t rows = grid.height, cols = grid.width;
    for (EarlierCells& e : earlier) {
      e.depth_m = arena.take_image<float>("shared: parts", rows, cols);
      e.luma = arena.take_image<float>("shared: parts", rows, cols);
    }
    const uint64_t count = static_cast<uint64_t>(rows) * static_cast<uint64_t>(cols);
    part_memory.parts = arena.take<Part>("shared: parts", count);
    part_memory.queue = arena.take<int32_t>("shared: parts", count);
    part_memory.border = arena.take_image<uint8_t>("shared: parts", rows, cols);
    part_memory.scratch = arena.take_image<uint8_t>("shared: parts", rows, cols);
  }
  static uint64_t post_bytes(const EngineParams& p) {
    const uint64_t pixels =
        static_cast<uint64_t>(p.camera.k.width) * static_cast<uint64_t>(p.camera.k.height);
    const uint64_t view = pixels * (sizeof(float) + sizeof(Rgb8)) + 64;
    const uint64_t list = map_sizes(p.map).slots * uint64_t{sizeof(GroupEntry)};
    const uint64_t keys =
        static_cast<uint64_t>(p.map.pool_blocks) * (sizeof(BlockKey) + sizeof(BlockId)) + 64;
    return std::max({view, list, keys, uint64_t{kMaxGroupRecordBytes}, uint64_t{1} << 20});
  }
};

template <class Device>
class DeviceEngine : public Engine {
 public:
  /// What it takes, item by item.
  static MemoryItems plan(const EngineParams& params, MemoryItems& shared) {
    Arena device_arena, shared_arena;
    DeviceMemory device_memory;
    SharedMemory shared_memory;
    device_memory.carve(device_arena, params);
    shared_memory.carve(shared_arena, params);
    shared = shared_arena.items();
    return device_arena.items();
  }

  DeviceEngine(const EngineParams& params, Device& device) : params_(params), device_(device) {
    MemoryItems shared;
    const MemoryItems own = plan(params, shared);
    Arena device_arena(device_.device_memory(), own.total_bytes),
        shared_arena(device_.shared_memory(), shared.total_bytes);
    d_.carve(device_arena, params_);
    h_.carve(shared_arena, params_);
    *h_.states = DeviceStates{};
    device_.copy(d_.states, h_.states, sizeof(DeviceStates));
    std::memcpy(h_.post.data, &kCubeCases, sizeof(CubeCases));
    device_.copy(d_.cube_cases.data, h_.post.data, sizeof(CubeCases));
    ready_ = device_.wait() == Status::ok && fill_source_pixels();
    clear_map();
    forget_cells();
    record_steps();
  }
  bool failed() const { return !ready_ || device_.failed(); }

  PrepareResult prepare(const FrameView& frame) override;
  TrackResult track(const Se3& T_world_cam_start, const PosePrior& prior) override {
    if (by_parts()) set_first_trust(T_world_cam_start);
    return register_to_map(finest_level_ > 0 ? DeviceStep::track_coarse : DeviceStep::track, h_.states->track,
                           by_parts(), T_world_cam_start, first_levels(finest_level_), prior);
  }
  MaskResult mask(const Se3& T_world_cam) override;
  TrackResult refine(const Se3& T_world_cam_start, const PosePrior& prior) override {
    return register_to_map(finest_level_ > 0 ? DeviceStep::refine_coarse : DeviceStep::refine,
                           h_.states->refine, true, T_world_cam_start, second_levels(finest_level_), prior);
  }
  /// One level can be left out: what is recorded cannot change.
  void limit_finest_level(int32_t level) override { finest_level_ = std::clamp(level, 0, 1); }
  IntegrateResult integrate(const Se3& T_world_cam) override { return fuse(prepared_images(), T_world_cam); }
  uint32_t keep_frame(const Se3& T_world_cam, const NearEcho& echo) override;
  IntegrateResult integrate_kept(uint32_t index) override;
  void forget_kept(uint32_t oldest) override { d_.kept.forget(oldest); }
  uint32_t kept_frames() const override { return d_.kept.count(); }

  void remember_place(const Se3& T_map_cam) override;
  PlaceResult find_place(const Se3& T_map_cam_guess, int32_t attempt) override;
  PlaceResult confirm_place(const Se3& T_map_cam_start) override;

  Status raycast(const Se3& T_world_cam, const Intrinsics& k, ImageView<float> depth_m,
                 ImageView<Rgb8> colour) override;
  Status extract_mesh(MeshSink& sink) override;

  void look_up(View<const Vec3> points_map_m, View<PointState> states) const override;
  uint32_t list_groups(View<uint64_t> keys) const override;
  uint32_t write_group(uint64_t key, View<uint8_t> record) const override;
  Status read_group(View<const uint8_t> record) override;
  uint32_t group_capacity() const override { return d_.map.view.table.keys.size; }
  uint32_t place_count() const override { return h_.places.keyframes(); }
  uint32_t write_place(uint32_t index, View<uint8_t> record) const override {
    return h_.places.write(index, record);
  }
  Status read_place(View<const uint8_t> record) override { return h_.places.read(record); }

  uint32_t farthest_groups(Vec3 centre_map, View<uint64_t> keys, bool near_view_too) override;
  void put_away(uint64_t key, uint32_t entry) override { change_group({d_.map, key, entry, false}); }
  void forget_group(uint64_t key) override { change_group({d_.map, key, 0, true}); }
  uint32_t wanted_groups(View<ArchivedGroup> groups) const override;

  ImageView<const uint8_t> mask_image() const override { return h_.mask; }
  ImageView<const float> depth_image_m() const override {
    fetch_images();
    return h_.depth_m;
  }
  ImageView<const Rgb8> colour_image() const override {
    fetch_images();
    return h_.colour;
  }
  MapHealth map_health() const override;
  void reset_map() override {
    clear_map();
    forget_cells();
    h_.places.clear();
    d_.kept.forget(d_.kept.count());
    h_.states->integrate.update.groups = 0;
  }

 private:
  static constexpr uint32_t kMostBlocks = 4096;  ///< of a launch whose kernel goes on to further elements

  const Intrinsics& k() const { return params_.camera.k; }
  const Intrinsics& grid_k() const { return d_.cells.grid.k; }
  bool by_parts() const { return params_.mask.enabled && params_.mask.method == MaskMethod::parts; }
  bool dense() const { return params_.map.free_space == FreeSpace::dense; }
  LevelRange second_levels(int32_t finest) const {
    return {params_.track.levels - 1, std::min(finest, params_.track.levels - 1)};
  }
  LevelRange first_levels(int32_t finest) const {
    return second_levels(std::max(params_.track.first_finest_level, finest));
  }
  int32_t frames_in(float seconds) const {
    return static_cast<int32_t>(std::lround(std::min(seconds / period_s_, 65535.0f)));
  }
  int32_t reabsorb_frames() const {
    return std::max(1, frames_in(params_.mask.reabsorb_s > 0 ? params_.mask.reabsorb_s : 1.0f));
  }
  uint32_t masks_between_earlier() const {
    return static_cast<uint32_t>(std::max(1, reabsorb_frames() / (kEarlier - 1)));
  }
  template <class Kernel>
  void launch_all(uint64_t elements, const Kernel& kernel) const {
    const uint32_t blocks = blocks_for(elements, Kernel::kLanes);
    device_.launch(std::max(1u, std::min(blocks, kMostBlocks)), kernel);
  }
  template <class Kernel>
  void launch_pixels(const Kernel& kernel) const {
    const int64_t step = 1;
    launch_all(static_cast<uint64_t>(int64_t{kernel.rows} * kernel.cols / step), kernel);
  }
  template <class State>
  void send(State& device_state, const State& host_state) const {
    device_.copy(&device_state, &host_state, sizeof(State));
  }
  template <class State>
  void bring_back(State& host_state, const State& device_state) const {
    device_.copy(&host_state, &device_state, sizeof(State));
  }
  void bring_counters_back() const { bring_back(h_.states->counters, d_.states->counters); }
  /// @return false: the device has failed
  bool play(DeviceStep step) {
    device_.play(static_cast<uint32_t>(step));
    return device_.wait() == Status::ok;
  }

  bool fill_source_pixels();
  void clear_map();
  void forget_cells();

  void record_steps();
  void launch_prepare();
  void launch_registration(DeviceStates::Register& d, DeviceStates::Register& h, LevelRange levels,
                           bool first);
  void launch_evidence();
  void launch_mask_by_parts();
  void launch_mask_by_residual();
  void launch_count();
  void launch_look();
  void launch_integrate();
  void launch_complete();

  TrustPass trust_pass(ImageView<const uint8_t> mask) const;
  void set_first_trust(const Se3& T_start);
  TrackResult register_to_map(DeviceStep step, DeviceStates::Register& state, bool trust, const Se3& T_start,
                              LevelRange levels, const PosePrior& prior);
  bool find_parts(const Se3& T_map_cam);
  void remember_cells(const Se3& T_map_cam);
  /// Images that go into the map.
  struct FrameImages {
    ImageView<const float> depth_m;
    ImageView<const LumaChroma> luma_chroma;
    ImageView<const uint8_t> mask;
  };
  FrameImages prepared_images() const { return {d_.depth_m, d_.luma_chroma, d_.mask}; }
  void set_view(const FrameImages& images, const Se3& T_map_cam);
  IntegrateResult fuse(const FrameImages& images, const Se3& T_map_cam);
  bool shrink_frame();
  void follow(View<PoseTry> tries);
  bool drop_farthest(Vec3 centre_map);
  float fill() const;
  bool above_high_water() const;
  void change_group(const PutAwayKernel& kernel);
  View<GroupEntry> groups_of_table(bool any_view, float margin_m) const;
  void fetch_images() const;

  EngineParams params_;
  Device& device_;
  DeviceMemory d_;
  mutable SharedMemory h_;
  bool ready_ = false;
  mutable bool images_fetched_ = false;
  int32_t frames_ = 0;  ///< integrated, modulo 2^16
  int32_t finest_level_ = 0;
  float usual_ = 1.0f;
  float period_s_ = 1.0f / 30.0f;  ///< FrameView::period_s
  Se3 T_before_;                   ///< pose of the last mask
  uint32_t masks_ = 0;             ///< masks made since the map was empty
  bool continued_ = false;         ///< the map, or part of it, is older than this engine
  MapExtent extent_;
};

}  // namespace stillmap

#include "kernels/backend/cuda/device_engine_frame.hpp"
#include "kernels/backend/cuda/device_engine_map.hpp"
