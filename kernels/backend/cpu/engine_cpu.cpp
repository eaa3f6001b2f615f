// The CPU engine: owns the memory, hands views to the loops.

#include <algorithm>
#include <cmath>
#include <new>

#include "kernels/backend/cpu/arena.hpp"
#include "kernels/backend/cpu/extract.hpp"
#include "kernels/backend/cpu/loops.hpp"
#include "kernels/backend/cpu/map_storage.hpp"
#include "kernels/backend/cpu/raycast.hpp"
#include "kernels/backend/cpu/relocalise.hpp"
#include "kernels/backend/cpu/thread_pool.hpp"
#include "kernels/complete/kept_frames.hpp"
#include "kernels/engine.hpp"
#include "kernels/frame_rules.hpp"
#include "kernels/mask/grow_mask.hpp"
#include "kernels/mask/parts.hpp"
#include "kernels/mask/slide.hpp"
#include "kernels/track/track.hpp"

namespace stillmap {
namespace {

constexpr int32_t kRowsPerTile = 16;  ///< of the finest level; a multiple of the coarsest step
constexpr uint32_t kGroupsPerTile = 16;
constexpr uint32_t kBlocksPerTile = 32;

uint32_t tiles_of(int32_t length, int32_t tile) {
  return static_cast<uint32_t>((length + tile - 1) / tile);
}

/// Everything that lives as long as the engine.
struct CpuMemory {
  ImageView<float> depth_m, static_depth_m;
  ImageView<LumaChroma> luma_chroma;
  ImageView<Rgb8> colour;
  ImageView<Pixel> source_pixel;  ///< only with distortion
  ImageView<uint8_t> mask, mask_scratch;
  View<int32_t> flood_queue;
  ImageView<uint8_t> trust;
  CellGrid cells;
  CellsBefore before;
  EarlierCells earlier[kEarlier];
  PartMemory part_memory;
  DepthRangePyramid ranges;
  View<NormalEqT<float>> track_tiles;
  KeptCorners kept_corners;
  View<int32_t> valid_tiles, masked_tiles;
  View<GroupView> groups;
  View<VisibleBlock> visible;
  View<uint8_t> extract_scratch, raycast_scratch;
  MapStorage map;
  CpuRelocaliser relocaliser;
  KeptFrames kept;
  View<ModelFrame> model_frames;

  void carve(Arena& arena, const EngineParams& p) {
    const int32_t rows = p.camera.k.height, cols = p.camera.k.width;
    depth_m = arena.take_image<float>("images", rows, cols);
    luma_chroma = arena.take_image<LumaChroma>("images", rows, cols);
    static_depth_m = arena.take_image<float>("images", rows, cols);
    colour = arena.take_image<Rgb8>("images", rows, cols);
    mask = arena.take_image<uint8_t>("mask", rows, cols);
    mask_scratch = arena.take_image<uint8_t>("mask", rows, cols);
    trust = arena.take_image<uint8_t>("mask", rows, cols);
    carve_cells(arena, p.camera.k);
    flood_queue = arena.take<int32_t>("mask", static_cast<uint64_t>(rows) * static_cast<uint64_t>(cols));
    if (!p.camera.distortion.none()) source_pixel = arena.take_image<Pixel>("undistortion", rows, cols);
    carve_ranges(arena, rows, cols);
    const uint32_t tiles = tiles_of(rows, kRowsPerTile);
    track_tiles = arena.take<NormalEqT<float>>("sums of tiles", tiles);
    kept_corners.step = finest_step(p);
    const int32_t kept_rows = (rows + kept_corners.step - 1) / kept_corners.step,
                  kept_cols = (cols + kept_corners.step - 1) / kept_corners.step;
    kept_corners.cell = arena.take_image<uint64_t>("points of a registration", kept_rows, kept_cols);
    kept_corners.corners =
        arena.take_image<KeptCorners::Corners>("points of a registration", kept_rows, kept_cols);
    valid_tiles = arena.take<int32_t>("sums of tiles", tiles);
    masked_tiles = arena.take<int32_t>("sums of tiles", tiles);
    groups = arena.take<GroupView>("visible blocks", max_groups(p));
    visible = arena.take<VisibleBlock>("visible blocks", max_visible(p));
    extract_scratch = arena.take<uint8_t>("mesh and views",
                                          extract_scratch_bytes(static_cast<uint32_t>(p.map.pool_blocks)));
    raycast_scratch = arena.take<uint8_t>("mesh and views", raycast_scratch_bytes());
    map.carve(arena, p.map, p.integrate.weight_cap);
    relocaliser.carve(arena, p);
    kept.carve(arena, "completed depth", p);
    if (p.depth.invalid == InvalidDepth::complete)
      model_frames = arena.take<ModelFrame>("completed depth", kMostModelFrames);
  }

 private:
  void carve_cells(Arena& arena, const Intrinsics& k) {
    cells.px = cell_px_for(k.width);
    cells.k = shrunk(k, cells.px);
    const int32_t rows = cells.k.height, cols = cells.k.width;
    cells.depth_m = arena.take_image<float>("parts", rows, cols);
    cells.luma = arena.take_image<float>("parts", rows, cols);
    cells.residual = arena.take_image<CellResidual>("parts", rows, cols);
    cells.normal = arena.take_image<Vec3>("parts", rows, cols);
    cells.evidence = arena.take_image<Contradiction>("parts", rows, cols);
    cells.expected = arena.take_image<uint8_t>("parts", rows, cols);
    cells.fused = arena.take_image<uint8_t>("parts", rows, cols);
    cells.dynamic = arena.take_image<uint8_t>("parts", rows, cols);
    cells.part = arena.take_image<int32_t>("parts", rows, cols);
    cells.still = arena.take_image<uint16_t>("parts", rows, cols);
    cells.crept_m = arena.take_image<float>("parts", rows, cols);
    before.depth_m = arena.take_image<float>("parts", rows, cols);
    before.luma = arena.take_image<float>("parts", rows, cols);
    before.crept_m = arena.take_image<float>("parts", rows, cols);
    before.dynamic = arena.take_image<uint8_t>("parts", rows, cols);
    before.still = arena.take_image<uint16_t>("parts", rows, cols);
    for (EarlierCells& e : earlier) {
      e.depth_m = arena.take_image<float>("parts", rows, cols);
      e.luma = arena.take_image<float>("parts", rows, cols);
    }
    const uint64_t count = static_cast<uint64_t>(rows) * static_cast<uint64_t>(cols);
    part_memory.parts = arena.take<Part>("parts", count);
    part_memory.queue = arena.take<int32_t>("parts", count);
    part_memory.border = arena.take_image<uint8_t>("parts", rows, cols);
    part_memory.scratch = arena.take_image<uint8_t>("parts", rows, cols);
  }
  void carve_ranges(Arena& arena, int32_t rows, int32_t cols) {
    ranges.image_rows = rows;
    ranges.image_cols = cols;
    int32_t r = static_cast<int32_t>(tiles_of(rows, kTilePx)),
            c = static_cast<int32_t>(tiles_of(cols, kTilePx));
    while (ranges.levels < kMaxLevels) {
      ranges.level[ranges.levels++] = arena.take_image<DepthRange>("depth ranges", r, c);
      if (r == 1 && c == 1) break;
      r = (r + 1) / 2;
      c = (c + 1) / 2;
    }
  }
};

class CpuEngine final : public Engine {
 public:
  CpuEngine(const EngineParams& params, const CpuLoops& loops, uint64_t bytes)
      : params_(params), arena_(bytes), loops_(loops), pool_(params.threads, params.on_worker) {
    if (arena_.failed()) return;
    memory_.carve(arena_, params_);
    memory_.map.clear();
    fill_source_pixels();
    touch_memory();
  }
  bool failed() const { return arena_.failed(); }

  PrepareResult prepare(const FrameView& frame) override;
  TrackResult track(const Se3& T_world_cam_start, const PosePrior& prior) override;
  MaskResult mask(const Se3& T_world_cam) override;
  TrackResult refine(const Se3& T_world_cam_start, const PosePrior& prior) override {
    return register_to_map(T_world_cam_start, memory_.trust, {params_.track.levels - 1, finest_level_},
                           prior);
  }
  void limit_finest_level(int32_t level) override {
    finest_level_ = std::clamp(level, 0, params_.track.levels - 1);
  }
  IntegrateResult integrate(const Se3& T_world_cam) override { return fuse(prepared_view(), T_world_cam); }
  uint32_t keep_frame(const Se3& T_world_cam, const NearEcho& echo) override;
  IntegrateResult integrate_kept(uint32_t index) override;
  void forget_kept(uint32_t oldest) override { memory_.kept.forget(oldest); }
  uint32_t kept_frames() const override { return memory_.kept.count(); }
  void remember_place(const Se3& T_map_cam) override {
    memory_.relocaliser.remember(prepared_view(), T_map_cam);
  }
  PlaceResult find_place(const Se3& T_map_cam_guess, int32_t attempt) override;
  PlaceResult confirm_place(const Se3& T_map_cam_start) override {
    return memory_.relocaliser.confirm(prepared_view(), memory_.map.view(), T_map_cam_start, pool_);
  }
  Status raycast(const Se3& T_world_cam, const Intrinsics& k, ImageView<float> depth_m,
                 ImageView<Rgb8> colour) override {
    return stillmap::raycast({memory_.map.view(), k, T_world_cam, depth_m, colour}, memory_.raycast_scratch,
                             pool_);
  }
  Status extract_mesh(MeshSink& sink) override {
    return stillmap::extract_mesh(memory_.map.view(), sink, memory_.extract_scratch, pool_);
  }

  void look_up(View<const Vec3> points_map_m, View<PointState> states) const override;
  uint32_t list_groups(View<uint64_t> keys) const override { return memory_.map.list_groups(keys); }
  uint32_t write_group(uint64_t key, View<uint8_t> record) const override {
    return memory_.map.write_group(key, record);
  }
  uint32_t farthest_groups(Vec3 centre_map, View<uint64_t> keys, bool near_view_too) override {
    return memory_.map.farthest_groups(centre_map, keys,
                                       InView(*this, near_view_too ? 0.0f : params_.fetch_m));
  }
  void put_away(uint64_t key, uint32_t entry) override { memory_.map.put_away(key, entry); }
  void forget_group(uint64_t key) override { memory_.map.forget_group(key); }
  uint32_t wanted_groups(View<ArchivedGroup> groups) const override;
  Status read_group(View<const uint8_t> record) override {
    const Status status = memory_.map.read_group(record);
    continued_ = continued_ || (status == Status::ok && masks_ == 0);
    return status;
  }
  uint32_t group_capacity() const override { return memory_.map.view().table.keys.size; }
  uint32_t place_count() const override { return static_cast<uint32_t>(memory_.relocaliser.keyframes()); }
  uint32_t write_place(uint32_t index, View<uint8_t> record) const override {
    return memory_.relocaliser.write(index, record);
  }
  Status read_place(View<const uint8_t> record) override { return memory_.relocaliser.read(record); }

  ImageView<const uint8_t> mask_image() const override { return memory_.mask; }
  ImageView<const float> depth_image_m() const override { return memory_.depth_m; }
  ImageView<const Rgb8> colour_image() const override { return memory_.colour; }
  MapHealth map_health() const override { return memory_.map.health(); }
  void reset_map() override {
    memory_.map.clear();
    memory_.relocaliser.clear();
    memory_.kept.forget(memory_.kept.count());
    forget_cells();
    groups_looked_at_ = 0;
  }

 private:
  const Intrinsics& k() const { return params_.camera.k; }
  PreparedView prepared_view() const { return {memory_.depth_m, memory_.luma_chroma, memory_.mask}; }
  void fill_source_pixels();
  TrackPass track_pass(const Se3& T_map_cam) const;
  TrackResult register_to_map(const Se3& T_start, ImageView<const uint8_t> trust, LevelRange levels,
                              const PosePrior& prior);
  int32_t frames_in(float seconds) const {
    return static_cast<int32_t>(std::lround(std::min(seconds / period_s_, 65535.0f)));
  }
  /// What never settles is compared with what was a second ago.
  int32_t reabsorb_frames() const {
    return std::max(1, frames_in(params_.mask.reabsorb_s > 0 ? params_.mask.reabsorb_s : 1.0f));
  }
  uint32_t masks_between_earlier() const {
    return static_cast<uint32_t>(std::max(1, reabsorb_frames() / (kEarlier - 1)));
  }
  bool by_parts() const { return params_.mask.enabled && params_.mask.method == MaskMethod::parts; }
  void make_cells();
  void remember_cells(const Se3& T_map_cam);
  void touch_memory();
  void forget_cells();
  void mask_by_residual(const Se3& T_map_cam);
  void mask_by_parts(const Se3& T_map_cam);
  void count_masked(MaskResult& result);
  void write_trust(ImageView<const uint8_t> mask, int32_t step);
  template <class F>
  void in_row_tiles(int32_t rows, const F& f) {
    pool_.for_each(tiles_of(rows, kRowsPerTile), [&](uint32_t tile) {
      const int32_t first = static_cast<int32_t>(tile) * kRowsPerTile;
      f(first, std::min(first + kRowsPerTile, rows));
    });
  }
  void set_nothing_masked();
  void update_static_depth(const PreparedView& frame);
  FrameGeometry frame_geometry() const {
    return {memory_.static_depth_m,       k(),
            params_.depth.min_m,          params_.depth.max_m,
            params_.integrate.free_max_m, params_.map.truncation_m};
  }
  VisibleGroupPass visible_pass(const Se3& T_map_cam, const FrameGeometry& geometry) const;
  /// Of a group: whether the last frame saw it, or came so near it.
  struct InView {
    VisibleGroupPass view;
    bool any;
    InView(const CpuEngine& engine, float margin_m)
        : view(engine.last_view_), any(engine.groups_looked_at_ > 0) {
      view.margin_m = margin_m;
    }
    bool operator()(BlockKey key) const { return any && view.comes_into_view(unpack(key)); }
  };
  bool look_at_groups(const VisibleGroupPass& pass);
  Status list_visible(const VisibleGroupPass& pass, uint32_t& visible_count);
  void merge_free(const VisibleGroupPass& pass, View<const VisibleBlock> visible);
  IntegrateResult fuse(const PreparedView& frame, const Se3& T_world_cam);
  bool dense() const { return params_.map.free_space == FreeSpace::dense; }

  EngineParams params_;
  Arena arena_;
  CpuMemory memory_;
  const CpuLoops& loops_;
  ThreadPool pool_;
  int32_t frames_ = 0;          ///< integrated, modulo 2^16
  int32_t finest_level_ = 0;    ///< at the finest, of both registrations
  VisibleGroupPass last_view_;  ///< of the last integrated frame, or where a lost camera was looked for
  uint32_t groups_looked_at_ = 0;
  float usual_ = 1.0f;
  float period_s_ = 1.0f / 30.0f;  ///< FrameView::period_s
  Se3 T_before_;                   ///< pose of the last mask
  uint32_t masks_ = 0;             ///< masks made since the map was empty
  bool continued_ = false;         ///< the map, or part of it, is older than this engine
  MapExtent extent_;
};

/// The first frame makes thousands of blocks: it need not wait for the system to find memory for each. What
/// only a large map takes is left until it does.
void CpuEngine::touch_memory() {
  constexpr uint32_t kFirstViewBlocks = 16384;
  const View<VoxelBlock> blocks = memory_.map.view().blocks;
  arena_.touch_all_but(blocks.data + std::min(kFirstViewBlocks, blocks.size), blocks.end());
}

void CpuEngine::fill_source_pixels() {
  const ImageView<Pixel>& map = memory_.source_pixel;
  for (int32_t r = 0; r < map.rows; ++r)
    for (int32_t c = 0; c < map.cols; ++c)
      map.at(r, c) = distort(params_.camera, {static_cast<float>(c), static_cast<float>(r)});
}

PrepareResult CpuEngine::prepare(const FrameView& frame) {
  const auto right_size = [&](int32_t rows, int32_t cols) { return rows == k().height && cols == k().width; };
  if (!right_size(frame.depth_raw.rows, frame.depth_raw.cols) ||
      !right_size(frame.colour.rows, frame.colour.cols))
    return {Status::bad_data, 0};
  if (frame.period_s > 0.0f) period_s_ = frame.period_s;
  const PreparePass pass{frame.depth_raw,
                         frame.colour,
                         memory_.depth_m,
                         memory_.luma_chroma,
                         memory_.colour,
                         memory_.source_pixel,
                         1.0f / params_.depth_units_per_m,
                         params_.depth.min_m,
                         params_.depth.max_m,
                         params_.depth_bias,
                         !params_.depth_bias.none()};
  const uint32_t tiles = tiles_of(k().height, kRowsPerTile);
  pool_.for_each(tiles, [&](uint32_t tile) {
    const int32_t first = static_cast<int32_t>(tile) * kRowsPerTile;
    memory_.valid_tiles[tile] = loops_.prepare(pass, first, std::min(first + kRowsPerTile, k().height));
  });
  PrepareResult result;
  for (uint32_t t = 0; t < tiles; ++t) result.valid_pixels += memory_.valid_tiles[t];
  set_nothing_masked();
  if (by_parts()) make_cells();
  if (result.valid_pixels < scaled_pixels(params_.depth.min_valid_pixels, k()))
    result.status = Status::bad_data;
  return result;
}

void CpuEngine::set_nothing_masked() {
  std::fill_n(memory_.mask.data, memory_.mask.pixels(), uint8_t{0});
  std::fill_n(memory_.trust.data, memory_.trust.pixels(), uint8_t{255});
}

TrackPass CpuEngine::track_pass(const Se3& T_map_cam) const {
  TrackPass pass = track_pass_at(params_, memory_.map.view(), T_map_cam);
  pass.depth_m = memory_.depth_m;
  pass.colour = memory_.luma_chroma;
  return pass;
}

TrackResult CpuEngine::track(const Se3& T_start, const PosePrior& prior) {
  const LevelRange levels = {
      params_.track.levels - 1,
      std::min(std::max(params_.track.first_finest_level, finest_level_), params_.track.levels - 1)};
  if (!by_parts()) return register_to_map(T_start, {}, levels, prior);
  if (params_.mask.warp)
    carry_mask(memory_.before.depth_m, memory_.before.dynamic, inverse(T_start) * T_before_, memory_.cells);
  write_trust({}, finest_step(params_) << levels.finest);
  return register_to_map(T_start, memory_.trust, levels, prior);
}

void CpuEngine::make_cells() {
  std::fill_n(memory_.cells.expected.data, memory_.cells.expected.pixels(), uint8_t{0});
  const CellDepthPass depth{memory_.depth_m, memory_.luma_chroma, memory_.cells, params_.depth.max_m};
  const CellNormalPass normals{memory_.cells};
  in_row_tiles(memory_.cells.depth_m.rows,
               [&](int32_t first, int32_t last) { loops_.cell_depth(depth, first, last); });
  in_row_tiles(memory_.cells.depth_m.rows,
               [&](int32_t first, int32_t last) { loops_.cell_normals(normals, first, last); });
}

/// Trust of every pixel that is tracked: from the expected mask before the decision, from the mask after it.
/// In a young map nothing is better known than what is near: without it the pose slides along the rest.
void CpuEngine::write_trust(ImageView<const uint8_t> mask, int32_t step) {
  const bool young = !continued_ && masks_ < static_cast<uint32_t>(reabsorb_frames());
  const TrustPass pass{memory_.cells,
                       memory_.depth_m,
                       mask,
                       memory_.trust,
                       depth_noise(params_.depth, k()),
                       params_.track.trust_noise_m,
                       young ? 0.0f : params_.track.trust_area_m,
                       params_.track.probation_trust,
                       params_.map.mesh_min_surface};
  in_row_tiles(k().height, [&](int32_t first, int32_t last) { loops_.trust(pass, first, last, step); });
}

void CpuEngine::mask_by_parts(const Se3& T_map_cam) {
  CellGrid& cells = memory_.cells;
  cells.settled_frames = params_.mask.reabsorb_s > 0 ? reabsorb_frames() : 0;
  const DepthNoise noise = depth_noise(params_.depth, k());
  extent_.see(T_map_cam, masks_ == 0);
  cells.drift_m = extent_.drift_m(params_.mask);
  const MaskParams params = allowing(params_.mask, cells.drift_m);
  const CellEvidencePass evidence =
      evidence_pass(params_, memory_.map.view(), cells, T_map_cam, noise, frames_in(params.empty_s));
  in_row_tiles(cells.depth_m.rows,
               [&](int32_t first, int32_t last) { loops_.cell_evidence(evidence, first, last); });
  const StillPass still{cells, memory_.before, inverse(T_before_) * T_map_cam, noise, reabsorb_frames() / 2};
  in_row_tiles(cells.depth_m.rows,
               [&](int32_t first, int32_t last) { loops_.still_cells(still, first, last); });
  in_row_tiles(cells.depth_m.rows, [&](int32_t first, int32_t last) {
    find_bends(cells, memory_.part_memory, params, first, last);
  });
  const int32_t parts = segment(cells, memory_.part_memory, noise);
  gather_parts(cells, parts, memory_.part_memory, noise);
  const Twistd motion = agree_on_motion(parts, memory_.part_memory, params, usual_);
  const Se3 T_agreed = moved_about_centre(T_map_cam, motion);
  const EarlierFrames earlier{&memory_.earlier[0], masks_, masks_between_earlier()};
  restart_sliding(cells, parts, memory_.part_memory, params, noise, earlier, T_agreed);
  measure_slides(cells, parts, memory_.part_memory, params, noise, earlier, T_agreed, usual_);
  decide_parts(cells, parts, memory_.part_memory, params, usual_);
  const DynamicPixelPass pixels{cells, memory_.depth_m, memory_.mask};
  in_row_tiles(k().height, [&](int32_t first, int32_t last) { loops_.dynamic_pixels(pixels, first, last); });
  write_trust(memory_.mask, finest_step(params_));
  remember_cells(T_map_cam);
}

void CpuEngine::remember_cells(const Se3& T_map_cam) {
  const CellGrid& now = memory_.cells;
  const CellsBefore& before = memory_.before;
  std::copy_n(now.depth_m.data, now.depth_m.pixels(), before.depth_m.data);
  std::copy_n(now.luma.data, now.luma.pixels(), before.luma.data);
  std::copy_n(now.crept_m.data, now.crept_m.pixels(), before.crept_m.data);
  for (int32_t i = 0; i < now.dynamic.pixels(); ++i)
    before.dynamic.data[i] = now.dynamic.data[i]                    ? now.dynamic.data[i]
                             : now.evidence.data[i] >= kContradicts ? kDoubted
                                                                    : uint8_t{0};
  std::copy_n(now.still.data, now.still.pixels(), before.still.data);
  T_before_ = T_map_cam;
  const uint32_t mask = masks_++;
  if (mask % masks_between_earlier() != 0) return;
  EarlierCells& earlier = memory_.earlier[mask / masks_between_earlier() % kEarlier];
  std::copy_n(now.depth_m.data, now.depth_m.pixels(), earlier.depth_m.data);
  std::copy_n(now.luma.data, now.luma.pixels(), earlier.luma.data);
  earlier.T_map_cam = T_map_cam;
}

void CpuEngine::forget_cells() {
  const CellsBefore& before = memory_.before;
  std::fill_n(before.depth_m.data, before.depth_m.pixels(), 0.0f);
  std::fill_n(before.dynamic.data, before.dynamic.pixels(), uint8_t{0});
  std::fill_n(before.still.data, before.still.pixels(), uint16_t{0});
  for (const EarlierCells& earlier : memory_.earlier)
    std::fill_n(earlier.depth_m.data, earlier.depth_m.pixels(), 0.0f);
  masks_ = 0;
  continued_ = false;
  usual_ = 1.0f;
  T_before_ = {};
}

TrackResult CpuEngine::register_to_map(const Se3& T_start, ImageView<const uint8_t> trust, LevelRange levels,
                                       const PosePrior& prior) {
  struct Context {
    CpuEngine* engine;
    TrackPass pass;
    int32_t sample;
  } context{this, track_pass(T_start), finest_step(params_)};
  context.pass.trust = trust;
  const KeptCorners& kept = memory_.kept_corners;
  in_row_tiles(kept.cell.rows, [&](int32_t first, int32_t last) { kept.forget_rows(first, last); });
  const PassRunner runner{[](void* opaque, const Se3& T_map_cam, int32_t step) {
                            Context& c = *static_cast<Context*>(opaque);
                            CpuEngine* const engine = c.engine;
                            TrackPass& pass = c.pass;
                            pass.T_map_cam = T_map_cam;
                            set_kernel(engine->params_, step, pass.weights);
                            const int32_t rows = engine->k().height;
                            const uint32_t tiles = tiles_of(rows, kRowsPerTile);
                            engine->pool_.for_each(tiles, [&](uint32_t tile) {
                              const int32_t first = static_cast<int32_t>(tile) * kRowsPerTile;
                              engine->memory_.track_tiles[tile] =
                                  engine->loops_.track(pass, engine->memory_.kept_corners, first,
                                                       std::min(first + kRowsPerTile, rows), c.sample * step);
                            });
                            NormalEq sums;
                            for (uint32_t t = 0; t < tiles; ++t) sums.add(engine->memory_.track_tiles[t]);
                            return sums;
                          },
                          &context};
  const int32_t min_points =
      scaled_pixels(params_.depth.min_valid_pixels, k()) / (context.sample * context.sample);
  TrackResult result = register_frame(runner, T_start, params_.track, levels, min_points, prior);
  for (float& c : result.covariance) c *= correlated_points(params_);
  return result;
}

MaskResult CpuEngine::mask(const Se3& T_world_cam) {
  MaskResult result;
  if (!params_.mask.enabled) {
    std::fill_n(memory_.trust.data, memory_.trust.pixels(), uint8_t{255});
    return result;
  }
  if (by_parts())
    mask_by_parts(T_world_cam);
  else
    mask_by_residual(T_world_cam);
  count_masked(result);
  return result;
}

void CpuEngine::count_masked(MaskResult& result) {
  in_row_tiles(k().height, [&](int32_t first, int32_t last) {
    int32_t masked = 0, valid = 0;
    for (int32_t r = first; r < last; ++r)
      for (int32_t c = 0; c < k().width; ++c) {
        const auto here = static_cast<int32_t>(memory_.mask.at(r, c) != 0);
        masked += here;
        valid += here & static_cast<int32_t>(memory_.depth_m.at(r, c) > 0.0f);
      }
    const auto tile = static_cast<uint32_t>(first / kRowsPerTile);
    memory_.masked_tiles[tile] = masked;
    memory_.valid_tiles[tile] = valid;
  });
  for (uint32_t t = 0; t < tiles_of(k().height, kRowsPerTile); ++t) {
    result.masked_pixels += memory_.masked_tiles[t];
    result.masked_valid_pixels += memory_.valid_tiles[t];
  }
}

void CpuEngine::mask_by_residual(const Se3& T_world_cam) {
  const float tau_m = params_.map.truncation_m;
  const ResidualMaskPass pass{memory_.map.view(),
                              memory_.depth_m,
                              memory_.mask,
                              k(),
                              T_world_cam,
                              params_.depth.max_m,
                              params_.mask.gamma * tau_m * tau_m};
  const int32_t rows = k().height, cols = k().width;
  constexpr int32_t kColsPerTile = 64;
  const auto in_column_tiles = [&](const auto& f) {
    pool_.for_each(tiles_of(cols, kColsPerTile), [&](uint32_t tile) {
      const int32_t first = static_cast<int32_t>(tile) * kColsPerTile;
      f(first, std::min(first + kColsPerTile, cols));
    });
  };
  const ImageView<uint8_t> image = memory_.mask, scratch = memory_.mask_scratch;
  const int32_t erode = scaled_px(params_.mask.erode_px, cols),
                dilate = scaled_px(params_.mask.dilate_px, cols);
  in_row_tiles(rows, [&](int32_t first, int32_t last) {
    loops_.residual_mask(pass, first, last);
    erode_rows(image, scratch, erode, first, last);
  });
  in_column_tiles([&](int32_t first, int32_t last) { erode_columns(scratch, image, erode, first, last); });
  flood_fill(image, memory_.depth_m, params_.mask.flood_depth_ratio, memory_.flood_queue);
  in_row_tiles(rows, [&](int32_t first, int32_t last) { dilate_rows(image, scratch, dilate, first, last); });
  in_column_tiles([&](int32_t first, int32_t last) { dilate_columns(scratch, image, dilate, first, last); });
  for (int32_t i = 0; i < image.pixels(); ++i) memory_.trust.data[i] = image.data[i] ? 0 : 255;
}

void CpuEngine::update_static_depth(const PreparedView& frame) {
  DepthRangePyramid& ranges = memory_.ranges;
  const StaticDepthPass pass{frame.depth_m, frame.mask, params_.integrate.through_movers,
                             memory_.static_depth_m, ranges.level[0]};
  pool_.for_each(static_cast<uint32_t>(pass.tiles.rows),
                 [&](uint32_t row) { loops_.static_depth(pass, static_cast<int32_t>(row)); });
  for (int32_t l = 1; l < ranges.levels; ++l) {
    const MergeRangesPass merge{ranges.level[l - 1], ranges.level[l]};
    for (int32_t r = 0; r < merge.coarse.rows; ++r)
      for (int32_t c = 0; c < merge.coarse.cols; ++c) merge(r, c);
  }
}

/// The box of groups around the camera's view.
VisibleGroupPass CpuEngine::visible_pass(const Se3& T_map_cam, const FrameGeometry& geometry) const {
  const DepthRangePyramid& ranges = memory_.ranges;
  const float farthest_m = std::min(
      far_plane_m(params_), ranges.level[ranges.levels - 1].at(0, 0).max_m + params_.map.truncation_m);
  const GroupBox box = box_around_view(T_map_cam, k(), farthest_m, params_.fetch_m, group_m(params_.map));
  return {memory_.map.view(),
          geometry,
          ranges,
          inverse(T_map_cam),
          box.first,
          box.groups,
          params_.integrate.free_space,
          dense(),
          static_cast<uint32_t>(params_.integrate.weight_cap),
          params_.fetch_m,
          first_looks(params_, frames_in(params_.mask.empty_s)),
          frames_};
}

/// What is known of the groups around the view, and which blocks of them the frame says something of.
/// @return false: there are more groups than the memory of a frame holds
bool CpuEngine::look_at_groups(const VisibleGroupPass& pass) {
  const uint64_t wanted = static_cast<uint64_t>(pass.groups.x) * static_cast<uint64_t>(pass.groups.y) *
                          static_cast<uint64_t>(pass.groups.z);
  const uint32_t count = static_cast<uint32_t>(std::min<uint64_t>(wanted, memory_.groups.size));
  groups_looked_at_ = count;
  pool_.for_each((count + kGroupsPerTile - 1) / kGroupsPerTile, [&](uint32_t tile) {
    const uint32_t end = std::min((tile + 1) * kGroupsPerTile, count);
    for (uint32_t g = tile * kGroupsPerTile; g < end; ++g) memory_.groups[g] = loops_.visible_group(pass, g);
  });
  return count == wanted;
}

/// Lists the visible blocks, in an order that does not depend on threads; makes those that are new.
Status CpuEngine::list_visible(const VisibleGroupPass& pass, uint32_t& visible_count) {
  Status status = look_at_groups(pass) ? Status::ok : Status::capacity_exhausted;
  const uint32_t count = groups_looked_at_;
  visible_count = 0;
  const auto add = [&](const InsertResult& block, uint32_t kind) {
    if (block.answer != Insert::inserted && block.answer != Insert::existed)
      status = Status::capacity_exhausted;
    else if (block.block != kNoBlock)
      memory_.visible[visible_count++] = {block.block | kind};
  };
  // Surfaces before free space: when the pool runs out, tracking needs the surfaces.
  for (uint32_t g = 0; g < count; ++g)
    for (uint64_t bits = memory_.groups[g].mixed; bits; bits &= bits - 1)
      add(memory_.map.insert(pack(pass.block_at(g, __builtin_ctzll(bits)))), 0);
  for (uint32_t g = 0; g < count; ++g) {
    const GroupView view = memory_.groups[g];
    if (!pass.dense && view.free == ~0ull && memory_.map.see_group_free(pass.group_at(g))) continue;
    for (uint64_t bits = view.free; bits; bits &= bits - 1) {
      const Int3 block = pass.block_at(g, __builtin_ctzll(bits));
      const InsertResult found = pass.dense ? memory_.map.insert(pack(block)) : memory_.map.see_free(block);
      const bool settled = found.block != kNoBlock && pass.map.settled_free[found.block];
      if (!settled) add(found, VisibleBlock::kFree);
    }
    for (uint64_t bits = view.partly; bits; bits &= bits - 1)
      add(memory_.map.see_partly(pass.block_at(g, __builtin_ctzll(bits))), VisibleBlock::kPartly);
  }
  return status;
}

/// Gives back what a free block or group of blocks can do without.
void CpuEngine::merge_free(const VisibleGroupPass& pass, View<const VisibleBlock> visible) {
  for (const VisibleBlock block : visible) {
    if (block.partly())
      memory_.map.release_partly(block.id());
    else if (pass.map.settled_free[block.id()] == kNoSurfaceLeft)
      memory_.map.release_voxels(block.id());
  }
  for (uint32_t g = 0; g < groups_looked_at_; ++g)
    if (memory_.groups[g].free) memory_.map.merge_group(pass.group_at(g));
}

IntegrateResult CpuEngine::fuse(const PreparedView& frame, const Se3& T_world_cam) {
  IntegrateResult result;
  if (memory_.map.above_high_water()) {
    memory_.map.drop_farthest(T_world_cam.translation, InView(*this, 0.0f));
    result.status = Status::capacity_exhausted;
  }
  update_static_depth(frame);
  const FrameGeometry geometry = frame_geometry();
  const VisibleGroupPass visible = visible_pass(T_world_cam, geometry);
  last_view_ = visible;
  const Status listed = list_visible(visible, result.visible_blocks);
  if (listed != Status::ok) result.status = listed;
  const IntegratePass pass{memory_.map.view(),
                           geometry,
                           frame.colour.data,
                           visible.T_cam_map,
                           {static_cast<float>(kSdfMax) / params_.map.truncation_m,
                            static_cast<float>(params_.integrate.weight_cap), params_.integrate.relearn},
                           params_.integrate.free_space,
                           frames_,
                           dense()};
  frames_ = (frames_ + 1) & 0xffff;
  const View<const VisibleBlock> blocks{memory_.visible.data, result.visible_blocks};
  for (const VisibleBlock block : blocks) result.visible_voxel_blocks += !block.partly();
  pool_.for_each((blocks.size + kBlocksPerTile - 1) / kBlocksPerTile, [&](uint32_t tile) {
    const uint32_t first = tile * kBlocksPerTile;
    loops_.integrate(pass, {blocks.data + first, std::min(kBlocksPerTile, blocks.size - first)});
  });
  if (!dense()) merge_free(visible, blocks);
  result.map = memory_.map.health();
  return result;
}

uint32_t CpuEngine::keep_frame(const Se3& T_world_cam, const NearEcho& echo) {
  if (params_.depth.invalid != InvalidDepth::complete) return 0;
  KeptFrame& frame = memory_.kept.add();
  std::copy_n(memory_.depth_m.data, memory_.depth_m.pixels(), frame.depth_m.data);
  std::copy_n(memory_.luma_chroma.data, memory_.luma_chroma.pixels(), frame.luma_chroma.data);
  std::copy_n(memory_.mask.data, memory_.mask.pixels(), frame.mask.data);
  frame.T_map_cam = T_world_cam;
  frame.echo = echo;
  return kept_frames();
}

IntegrateResult CpuEngine::integrate_kept(uint32_t index) {
  if (index >= kept_frames()) {
    IntegrateResult none;
    none.status = Status::unavailable;
    return none;
  }
  ModelFrame* const frames = memory_.model_frames.data;
  const CompletePass pass = memory_.kept.completion_of(index, frames, frames);
  std::fill_n(pass.model.start.data, pass.model.start.size, TemporaryModel::kNoStart);
  const StartDepthPass start{pass.model};
  const SilentCellPass silent = memory_.kept.silent_cells_of(pass);
  const auto frames_of_model = static_cast<uint32_t>(pass.model.frames);
  pool_.for_each(frames_of_model + 1, [&](uint32_t i) {
    if (i < frames_of_model)
      loops_.start_depth(start, static_cast<int32_t>(i));
    else
      loops_.silent_cells(silent);
  });
  in_row_tiles(k().height, [&](int32_t first, int32_t last) { loops_.complete(pass, first, last); });
  const KeptFrame& kept = memory_.kept.at(index);
  return fuse({pass.completed_m, kept.luma_chroma, kept.mask}, kept.T_map_cam);
}

uint32_t CpuEngine::wanted_groups(View<ArchivedGroup> groups) const {
  const InView in_view(*this, 0.0f);
  uint32_t count = 0;
  for (const bool seen : {true, false})
    for (uint32_t g = 0; g < groups_looked_at_ && count < groups.size; ++g) {
      const BlockRef archived = memory_.groups[g].archived;
      const BlockKey key = pack(last_view_.group_at(g));
      if (archived != kNoBlock && in_view(key) == seen) groups[count++] = {key, payload(archived), seen};
    }
  return count;
}

PlaceResult CpuEngine::find_place(const Se3& T_map_cam_guess, int32_t attempt) {
  const PlaceResult result =
      memory_.relocaliser.find(prepared_view(), memory_.map.view(), T_map_cam_guess, attempt, pool_);
  if (result.status == Status::ok || memory_.map.health().archived_groups == 0) return result;
  update_static_depth(prepared_view());
  last_view_ = visible_pass(result.T_map_wanted, frame_geometry());
  look_at_groups(last_view_);
  return result;
}

void CpuEngine::look_up(View<const Vec3> points_map_m, View<PointState> states) const {
  const VolumeView& map = memory_.map.view();
  BlockCache cache;
  for (uint32_t i = 0; i < std::min(points_map_m.size, states.size); ++i)
    states[i] = point_state(map, points_map_m[i], cache);
}

}  // namespace

MemoryItems plan_cpu_engine(const EngineParams& params) {
  Arena arena;
  CpuMemory memory;
  memory.carve(arena, params);
  return arena.items();
}

uint32_t plan_group_capacity(const EngineParams& params) {
  Arena arena;
  CpuMemory memory;
  memory.carve(arena, params);
  return memory.map.view().table.keys.size;
}

std::unique_ptr<Engine> make_cpu_engine(const EngineParams& params) {
  return make_cpu_engine(params, best_loops());
}

std::unique_ptr<Engine> make_cpu_engine(const EngineParams& params, const CpuLoops& loops) {
  const uint64_t bytes = plan_cpu_engine(params).total_bytes;
  std::unique_ptr<CpuEngine> engine(new (std::nothrow) CpuEngine(params, loops, bytes));
  if (!engine || engine->failed()) return nullptr;
  return engine;
}

}  // namespace stillmap
