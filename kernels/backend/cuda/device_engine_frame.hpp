#pragma once

// The steps of a frame: what each launches, and what the host puts into its state. Part of device_engine.hpp.

namespace stillmap {

template <class Device>
bool DeviceEngine<Device>::fill_source_pixels() {
  if (!d_.source_pixel.data) return true;
  // A row at a time through the post: it is read once, at boot.
  auto* const row = reinterpret_cast<Pixel*>(h_.post.data);
  for (int32_t r = 0; r < k().height; ++r) {
    for (int32_t c = 0; c < k().width; ++c)
      row[c] = distort(params_.camera, {static_cast<float>(c), static_cast<float>(r)});
    device_.copy(d_.source_pixel.row(r), row, static_cast<uint64_t>(k().width) * sizeof(Pixel));
    if (device_.wait() != Status::ok) return false;
  }
  return true;
}

template <class Device>
void DeviceEngine<Device>::record_steps() {
  const auto record = [&](DeviceStep step, const auto& f) { device_.record(static_cast<uint32_t>(step), f); };
  record(DeviceStep::prepare, [this] { launch_prepare(); });
  const auto record_registration = [&](DeviceStep track, DeviceStep refine, int32_t finest) {
    record(track, [this, finest] {
      launch_registration(d_.states->track, h_.states->track, first_levels(finest), true);
    });
    record(refine, [this, finest] {
      launch_registration(d_.states->refine, h_.states->refine, second_levels(finest), false);
    });
  };
  record_registration(DeviceStep::track, DeviceStep::refine, 0);
  record_registration(DeviceStep::track_coarse, DeviceStep::refine_coarse, 1);
  record(DeviceStep::evidence, [this] { launch_evidence(); });
  record(DeviceStep::mask, [this] {
    if (by_parts())
      launch_mask_by_parts();
    else
      launch_mask_by_residual();
  });
  record(DeviceStep::integrate, [this] { launch_integrate(); });
  if (params_.depth.invalid == InvalidDepth::complete)
    record(DeviceStep::complete, [this] { launch_complete(); });
  record(DeviceStep::places, [this] {
    if (!h_.places.enabled()) return;
    send(d_.states->places, h_.states->places);
    for (int32_t i = 0; i < 2; ++i) {
      const ImageView<float>&depth_m = d_.small[i].depth_m, &luma = d_.small[i].luma;
      if (i == 0)
        launch_pixels(PixelKernel<ShrinkPass>{&d_.states->places.shrink, depth_m.rows, depth_m.cols});
      else
        launch_pixels(PixelKernel<HalvePass>{&d_.states->places.halve, depth_m.rows, depth_m.cols});
      const uint64_t bytes = static_cast<uint64_t>(depth_m.pixels()) * sizeof(float);
      device_.copy(h_.places.view(i).depth_m.data, depth_m.data, bytes);
      device_.copy(h_.places.view(i).luma.data, luma.data, bytes);
    }
  });
  record(DeviceStep::look, [this] {
    send(d_.states->integrate, h_.states->integrate);
    launch_look();
    bring_back(h_.states->integrate, d_.states->integrate);
  });
}

// prepare

template <class Device>
void DeviceEngine<Device>::launch_prepare() {
  DeviceStates::Prepare& state = d_.states->prepare;
  send(state, h_.states->prepare);
  launch_all(static_cast<uint64_t>(d_.mask.pixels()),
             PrepareKernel{&state.pass, d_.mask, d_.trust, &state.valid});
  if (by_parts()) {
    const CellGrid& cells = d_.cells.grid;
    device_.fill(cells.expected.data, 0, static_cast<uint64_t>(cells.expected.pixels()));
    launch_pixels(PixelKernel<CellDepthPass>{&state.cell_depth, grid_k().height, grid_k().width});
    launch_pixels(PixelKernel<CellNormalPass>{&state.cell_normal, grid_k().height, grid_k().width});
  }
  bring_back(h_.states->prepare, state);
}

template <class Device>
PrepareResult DeviceEngine<Device>::prepare(const FrameView& frame) {
  const auto right_size = [&](int32_t rows, int32_t cols) { return rows == k().height && cols == k().width; };
  if (!right_size(frame.depth_raw.rows, frame.depth_raw.cols) ||
      !right_size(frame.colour.rows, frame.colour.cols))
    return {Status::bad_data, 0};
  if (frame.period_s > 0.0f) period_s_ = frame.period_s;
  for (int32_t r = 0; r < k().height; ++r) {
    std::copy_n(frame.depth_raw.row(r), k().width, h_.depth_raw.row(r));
    std::copy_n(frame.colour.row(r), k().width, h_.colour_raw.row(r));
  }
  DeviceStates::Prepare& state = h_.states->prepare;
  state.pass = {h_.depth_raw,
                h_.colour_raw,
                d_.depth_m,
                d_.luma_chroma,
                d_.colour,
                d_.source_pixel,
                1.0f / params_.depth_units_per_m,
                params_.depth.min_m,
                params_.depth.max_m,
                params_.depth_bias,
                !params_.depth_bias.none()};
  state.cell_depth = {d_.depth_m, d_.luma_chroma, d_.cells.grid, params_.depth.max_m};
  state.cell_normal = {d_.cells.grid};
  state.valid = 0;
  std::fill_n(h_.mask.data, h_.mask.pixels(), uint8_t{0});
  images_fetched_ = false;
  if (!play(DeviceStep::prepare)) return {Status::unavailable, 0};
  const auto valid = static_cast<int32_t>(state.valid);
  const bool enough = valid >= scaled_pixels(params_.depth.min_valid_pixels, k());
  return {enough ? Status::ok : Status::bad_data, valid};
}

template <class Device>
void DeviceEngine<Device>::fetch_images() const {
  if (images_fetched_) return;
  const auto pixels = static_cast<uint64_t>(d_.depth_m.pixels());
  device_.copy(h_.depth_m.data, d_.depth_m.data, pixels * sizeof(float));
  device_.copy(h_.colour.data, d_.colour.data, pixels * sizeof(Rgb8));
  images_fetched_ = device_.wait() == Status::ok;
}

// track and refine

/// @param first registration: by parts it starts with the expected mask, which decides on the trust
template <class Device>
void DeviceEngine<Device>::launch_registration(DeviceStates::Register& d, DeviceStates::Register& h,
                                               LevelRange levels, bool first) {
  send(d, h);
  if (first && by_parts()) {
    if (params_.mask.warp) {
      const CellGrid& cells = d_.cells.grid;
      device_.fill(cells.expected.data, 0, static_cast<uint64_t>(cells.expected.pixels()));
      launch_pixels(CarryMaskKernel{&d.carry, grid_k().height, grid_k().width});
    }
    launch_pixels(
        PixelKernel<TrustPass>{&d.trust, k().height, k().width, finest_step(params_) << levels.finest});
  }
  for (int32_t level = levels.coarsest; level >= levels.finest; --level) {
    const int32_t sample = finest_step(params_), most_steps = iterations_at(params_.track, level);
    const uint32_t blocks = TrackKernel::blocks(k().height, k().width, sample << level);
    for (int32_t pass = 0; pass <= most_steps; ++pass)
      device_.launch(blocks, TrackKernel{&d.track, d_.partial, k().height, k().width, sample, level,
                                         most_steps, pass == 0});
  }
  bring_back(h.track.search, d.track.search);
}

/// Trust of every pixel that is tracked: from the expected mask before the decision, from the mask after it.
/// In a young map nothing is better known than what is near: without it the pose slides along the rest.
template <class Device>
TrustPass DeviceEngine<Device>::trust_pass(ImageView<const uint8_t> mask) const {
  const bool young = !continued_ && masks_ < static_cast<uint32_t>(reabsorb_frames());
  return {d_.cells.grid,
          d_.depth_m,
          mask,
          d_.trust,
          depth_noise(params_.depth, k()),
          params_.track.trust_noise_m,
          young ? 0.0f : params_.track.trust_area_m,
          params_.track.probation_trust,
          params_.map.mesh_min_surface};
}

template <class Device>
void DeviceEngine<Device>::set_first_trust(const Se3& T_start) {
  DeviceStates::Register& state = h_.states->track;
  state.carry = {d_.before.depth_m, d_.before.dynamic, inverse(T_start) * T_before_, d_.cells.grid};
  state.trust = trust_pass({});
}

template <class Device>
TrackResult DeviceEngine<Device>::register_to_map(DeviceStep step, DeviceStates::Register& state, bool trust,
                                                  const Se3& T_start, LevelRange levels,
                                                  const PosePrior& prior) {
  TrackState& track = state.track;
  track.pass = track_pass_at(params_, d_.map.view, T_start);
  track.pass.depth_m = d_.depth_m;
  track.pass.colour = d_.luma_chroma;
  if (trust) track.pass.trust = d_.trust;
  for (int32_t level = 0; level < 3; ++level) {
    set_kernel(params_, 1 << level, track.pass.weights);
    track.kernel_m[level] = track.pass.weights.kernel_m;
  }
  track.params = params_.track;
  track.prior = prior;
  track.search.start(T_start, params_.track);
  track.arrived = 0;
  const int32_t sample = finest_step(params_);
  const int32_t min_points = scaled_pixels(params_.depth.min_valid_pixels, k()) / (sample * sample);
  if (!play(step)) {
    TrackResult failed;
    failed.status = Status::unavailable;
    failed.T_world_cam = T_start;
    return failed;
  }
  TrackResult result = result_of(track.search, T_start, levels.finest, min_points);
  for (float& c : result.covariance) c *= correlated_points(params_);
  return result;
}

// mask

template <class Device>
void DeviceEngine<Device>::launch_count() {
  DeviceStates::Mask& state = d_.states->mask;
  launch_all(static_cast<uint64_t>(d_.mask.pixels()), CountMaskedKernel{d_.mask, d_.depth_m, &state.counts});
  device_.copy(h_.mask.data, d_.mask.data, static_cast<uint64_t>(d_.mask.pixels()));
  bring_back(h_.states->mask.counts, state.counts);
}

template <class Device>
void DeviceEngine<Device>::launch_mask_by_residual() {
  DeviceStates::Mask& state = d_.states->mask;
  send(state, h_.states->mask);
  const auto pixels = static_cast<uint64_t>(d_.mask.pixels());
  const int32_t erode = scaled_px(params_.mask.erode_px, k().width),
                dilate = scaled_px(params_.mask.dilate_px, k().width);
  launch_pixels(MapPixelKernel<ResidualMaskPass>{&state.suspect, k().height, k().width});
  launch_all(pixels, SlideKernel<true>{d_.mask, d_.mask_scratch, erode, true});
  launch_all(pixels, SlideKernel<true>{d_.mask_scratch, d_.mask, erode, false});
  uint32_t* const steps = &state.components[0];
  launch_all(pixels, StartComponentsKernel{d_.components, steps});
  launch_all(pixels, UniteKernel{d_.components, d_.depth_m, params_.mask.flood_depth_ratio, steps});
  launch_all(pixels, SeedKernel{d_.components, d_.mask, d_.depth_m});
  device_.launch(1, FollowStepsKernel{d_.components, steps});
  launch_all(pixels, GrowMaskKernel{d_.components, d_.mask, d_.depth_m});
  launch_all(pixels, SlideKernel<false>{d_.mask, d_.mask_scratch, dilate, true});
  launch_all(pixels, SlideKernel<false>{d_.mask_scratch, d_.mask, dilate, false});
  launch_all(pixels, TrustUnmaskedKernel{d_.mask, d_.trust});
  launch_count();
}

template <class Device>
void DeviceEngine<Device>::launch_evidence() {
  DeviceStates::Evidence& state = d_.states->evidence;
  send(state, h_.states->evidence);
  launch_pixels(MapPixelKernel<CellEvidencePass>{&state.evidence, grid_k().height, grid_k().width});
  launch_pixels(PixelKernel<StillPass>{&state.still, grid_k().height, grid_k().width});
  device_.copy(h_.cell_bytes.data, d_.cell_bytes.data, d_.cell_bytes.size);
}

template <class Device>
void DeviceEngine<Device>::launch_mask_by_parts() {
  DeviceStates::Mask& state = d_.states->mask;
  send(state, h_.states->mask);
  const CellGrid &own = d_.cells.grid, &hosts = h_.cells.grid;
  const auto cells = static_cast<uint64_t>(own.depth_m.pixels());
  device_.copy(own.dynamic.data, hosts.dynamic.data, cells);
  device_.copy(own.still.data, hosts.still.data, cells * sizeof(uint16_t));
  launch_pixels(PixelKernel<DynamicPixelPass>{&state.pixels, k().height, k().width});
  launch_pixels(PixelKernel<TrustPass>{&state.trust, k().height, k().width, finest_step(params_)});
  launch_all(cells, RememberCellsKernel{own, d_.before});
  launch_count();
}

template <class Device>
MaskResult DeviceEngine<Device>::mask(const Se3& T_world_cam) {
  MaskResult result;
  if (!params_.mask.enabled) return result;
  if (by_parts() && !find_parts(T_world_cam)) {
    result.status = Status::unavailable;
    return result;
  }
  const float tau_m = params_.map.truncation_m;
  DeviceStates::Mask& state = h_.states->mask;
  state.suspect = {d_.map.view,
                   d_.depth_m,
                   d_.mask,
                   k(),
                   T_world_cam,
                   params_.depth.max_m,
                   params_.mask.gamma * tau_m * tau_m};
  state.pixels = {d_.cells.grid, d_.depth_m, d_.mask};
  state.trust = trust_pass(d_.mask);
  state.counts = {0, 0};
  if (!play(DeviceStep::mask)) {
    result.status = Status::unavailable;
    return result;
  }
  if (by_parts()) remember_cells(T_world_cam);
  result.masked_pixels = static_cast<int32_t>(state.counts.masked);
  result.masked_valid_pixels = static_cast<int32_t>(state.counts.with_depth);
  return result;
}

/// Which cells are dynamic: their evidence on the device, the parts of the picture on the host.
/// @return false: the device has failed
template <class Device>
bool DeviceEngine<Device>::find_parts(const Se3& T_map_cam) {
  const DepthNoise noise = depth_noise(params_.depth, k());
  extent_.see(T_map_cam, masks_ == 0);
  CellGrid cells = d_.cells.grid;
  cells.drift_m = extent_.drift_m(params_.mask);
  const MaskParams p = allowing(params_.mask, cells.drift_m);
  cells.settled_frames = p.reabsorb_s > 0 ? reabsorb_frames() : 0;
  DeviceStates::Evidence& state = h_.states->evidence;
  state.evidence = evidence_pass(params_, d_.map.view, cells, T_map_cam, noise, frames_in(p.empty_s));
  state.still = {cells, d_.before, inverse(T_before_) * T_map_cam, noise, reabsorb_frames() / 2};
  if (!play(DeviceStep::evidence)) return false;
  CellGrid& found = h_.cells.grid;
  found.settled_frames = cells.settled_frames;
  found.drift_m = cells.drift_m;
  find_bends(found, h_.part_memory, p, 0, found.depth_m.rows);
  const int32_t parts = segment(found, h_.part_memory, noise);
  gather_parts(found, parts, h_.part_memory, noise);
  const Twistd motion = agree_on_motion(parts, h_.part_memory, p, usual_);
  const Se3 T_agreed = moved_about_centre(T_map_cam, motion);
  const EarlierFrames earlier{&h_.earlier[0], masks_, masks_between_earlier()};
  restart_sliding(found, parts, h_.part_memory, p, noise, earlier, T_agreed);
  measure_slides(found, parts, h_.part_memory, p, noise, earlier, T_agreed, usual_);
  decide_parts(found, parts, h_.part_memory, p, usual_);
  return true;
}

/// RememberCellsKernel keeps the rest.
template <class Device>
void DeviceEngine<Device>::remember_cells(const Se3& T_map_cam) {
  T_before_ = T_map_cam;
  const uint32_t mask = masks_++;
  if (mask % masks_between_earlier() != 0) return;
  const CellGrid& now = h_.cells.grid;
  EarlierCells& earlier = h_.earlier[mask / masks_between_earlier() % kEarlier];
  std::copy_n(now.depth_m.data, now.depth_m.pixels(), earlier.depth_m.data);
  std::copy_n(now.luma.data, now.luma.pixels(), earlier.luma.data);
  earlier.T_map_cam = T_map_cam;
}

template <class Device>
void DeviceEngine<Device>::forget_cells() {
  const auto cells = static_cast<uint64_t>(d_.before.depth_m.pixels());
  device_.fill(d_.before.depth_m.data, 0, cells * sizeof(float));
  device_.fill(d_.before.dynamic.data, 0, cells);
  device_.fill(d_.before.still.data, 0, cells * sizeof(uint16_t));
  for (const EarlierCells& earlier : h_.earlier)
    std::fill_n(earlier.depth_m.data, earlier.depth_m.pixels(), 0.0f);
  masks_ = 0;
  continued_ = false;
  usual_ = 1.0f;
  T_before_ = {};
}

// integrate

/// What the frame sees of the groups around its view.
template <class Device>
void DeviceEngine<Device>::launch_look() {
  const ImageView<DepthRange>& tiles = d_.ranges.level[0];
  launch_all(static_cast<uint64_t>(tiles.pixels()),
             StaticDepthKernel{&d_.states->integrate.depth, tiles.rows, tiles.cols});
  device_.launch(1, ViewBoxKernel{d_.update});
  launch_all(d_.update.groups.size, LookAtGroupsKernel{d_.update});
}

template <class Device>
void DeviceEngine<Device>::launch_integrate() {
  constexpr uint32_t kBlocks = 2048;  // a block of lanes a group or voxel block, and on to the next
  send(d_.states->integrate, h_.states->integrate);
  launch_look();
  device_.launch(kBlocks, LookAtBlocksKernel{d_.map, d_.update});
  device_.launch(1, PlanUpdateKernel{d_.map, d_.update});
  device_.launch(kBlocks, UpdateGroupsKernel{d_.map, d_.update});
  device_.launch(kBlocks, FillFreshKernel{d_.map, d_.update});
  if (!dense()) device_.launch(64, ForgetReleasedKernel{d_.map, d_.update});
  device_.launch(kBlocks, FuseKernel{d_.map, d_.update});
  if (!dense()) {
    device_.launch(1, PlanMergeKernel{d_.map, d_.update});
    device_.launch(kBlocks, MergeBlocksKernel{d_.map, d_.update});
    device_.launch(kBlocks, MergeGroupsKernel{d_.map, d_.update});
  }
  bring_back(h_.states->integrate, d_.states->integrate);
  bring_counters_back();
}

/// States of `integrate` and `look` for a pose.
template <class Device>
void DeviceEngine<Device>::set_view(const FrameImages& images, const Se3& T_map_cam) {
  DeviceStates::Integrate& state = h_.states->integrate;
  state.depth = {images.depth_m, images.mask, params_.integrate.through_movers, d_.static_depth_m,
                 d_.ranges.level[0]};
  const FrameGeometry geometry = {
      d_.static_depth_m,       k(), params_.depth.min_m, params_.depth.max_m, params_.integrate.free_max_m,
      params_.map.truncation_m};
  UpdateState& update = state.update;
  update.visible = {d_.map.view,
                    geometry,
                    d_.ranges,
                    inverse(T_map_cam),
                    {},
                    {1, 1, 1},
                    params_.integrate.free_space,
                    dense(),
                    static_cast<uint32_t>(params_.integrate.weight_cap),
                    params_.fetch_m,
                    first_looks(params_, frames_in(params_.mask.empty_s)),
                    frames_};
  update.fuse = {d_.map.view,
                 geometry,
                 images.luma_chroma.data,
                 update.visible.T_cam_map,
                 {static_cast<float>(kSdfMax) / params_.map.truncation_m,
                  static_cast<float>(params_.integrate.weight_cap), params_.integrate.relearn},
                 params_.integrate.free_space,
                 frames_,
                 dense()};
  update.T_map_cam = T_map_cam;
  update.far_plane_m = far_plane_m(params_);
  update.group_m = group_m(params_.map);
}

template <class Device>
IntegrateResult DeviceEngine<Device>::fuse(const FrameImages& images, const Se3& T_world_cam) {
  IntegrateResult result;
  if (above_high_water() && drop_farthest(T_world_cam.translation))
    result.status = Status::capacity_exhausted;
  set_view(images, T_world_cam);
  frames_ = (frames_ + 1) & 0xffff;
  if (!play(DeviceStep::integrate)) {
    result.status = Status::unavailable;
    return result;
  }
  const UpdateState& update = h_.states->integrate.update;
  if (update.groups < update.groups_wanted || update.failures > 0) result.status = Status::capacity_exhausted;
  result.visible_blocks = update.visible_blocks;
  result.visible_voxel_blocks = update.visible_voxel_blocks;
  result.map = map_health();
  return result;
}

// complete

template <class Device>
uint32_t DeviceEngine<Device>::keep_frame(const Se3& T_world_cam, const NearEcho& echo) {
  if (params_.depth.invalid != InvalidDepth::complete) return 0;
  KeptFrame& frame = d_.kept.add();
  const auto pixels = static_cast<uint64_t>(d_.depth_m.pixels());
  device_.copy(frame.depth_m.data, d_.depth_m.data, pixels * sizeof(float));
  device_.copy(frame.luma_chroma.data, d_.luma_chroma.data, pixels * sizeof(LumaChroma));
  device_.copy(frame.mask.data, d_.mask.data, pixels);
  frame.T_map_cam = T_world_cam;
  frame.echo = echo;
  return kept_frames();
}

template <class Device>
void DeviceEngine<Device>::launch_complete() {
  constexpr uint64_t kBytes = kMostModelFrames * sizeof(ModelFrame);
  DeviceStates::Complete& state = d_.states->complete;
  const TemporaryModel model = d_.kept.empty_model();
  send(state, h_.states->complete);
  device_.copy(d_.model_frames.data, h_.model_frames.data, kBytes);
  static_assert(TemporaryModel::kNoStart == 0xffffffffu);
  device_.fill(model.start.data, 0xff, uint64_t{model.start.size} * sizeof(uint32_t));
  launch_all(model.start.size, StartDepthKernel{&state.start});
  launch_pixels(PixelKernel<SilentCellPass>{&state.silent, model.cell_rows, model.cell_cols});
  launch_pixels(PixelKernel<CompletePass>{&state.pass, k().height, k().width});
}

template <class Device>
IntegrateResult DeviceEngine<Device>::integrate_kept(uint32_t index) {
  IntegrateResult failed;
  failed.status = Status::unavailable;
  if (index >= kept_frames()) return failed;
  DeviceStates::Complete& state = h_.states->complete;
  state.pass = d_.kept.completion_of(index, h_.model_frames.data, d_.model_frames.data);
  state.start = {state.pass.model};
  state.silent = d_.kept.silent_cells_of(state.pass);
  if (!play(DeviceStep::complete)) return failed;
  const KeptFrame& kept = d_.kept.at(index);
  return fuse({state.pass.completed_m, kept.luma_chroma, kept.mask}, kept.T_map_cam);
}

}  // namespace stillmap
