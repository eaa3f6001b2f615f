#pragma once

// What is asked of the map outside of frames: each call waits for the device. Part of device_engine.hpp.

namespace stillmap {

template <class Device>
void DeviceEngine<Device>::clear_map() {
  const VolumeView& view = d_.map.view;
  constexpr uint8_t kOnes = 0xff;  // kEmptyKey, kNoBlock
  const auto fill = [&](const auto& list) {
    device_.fill(list.data, kOnes, uint64_t{list.size} * sizeof(*list.data));
  };
  fill(view.table.keys);
  fill(view.table.blocks);
  fill(view.block_keys);
  fill(view.partly);
  for (const View<BlockId>& ids : {view.pool.free_ids, view.group_pool.free_ids, view.partly_pool.free_ids})
    launch_all(ids.size, FillPoolKernel{ids});
  device_.launch(1, ClearMapKernel{d_.map, d_.free_block.data});
  bring_counters_back();
  ready_ = ready_ && device_.wait() == Status::ok;
}

template <class Device>
float DeviceEngine<Device>::fill() const {
  const MapCounters& c = h_.states->counters;
  const auto share = [](uint32_t used, uint32_t capacity) {
    return static_cast<float>(used) / static_cast<float>(std::max(capacity, 1u));
  };
  const VolumeView& view = d_.map.view;
  return std::max({share(c.used[0], view.pool.free_ids.size), share(c.used[1], view.group_pool.free_ids.size),
                   share(c.used[2], view.partly_pool.free_ids.size)});
}

template <class Device>
bool DeviceEngine<Device>::above_high_water() const {
  const auto entries = static_cast<float>(most_entries(d_.map.view.table.keys.size));
  return fill() > params_.map.high_water ||
         static_cast<float>(h_.states->counters.table_entries) > params_.map.high_water * entries;
}

template <class Device>
MapHealth DeviceEngine<Device>::map_health() const {
  const MapCounters& c = h_.states->counters;
  MapHealth health;
  health.blocks = c.used[0];
  health.capacity = d_.map.view.pool.free_ids.size;
  health.peak_blocks = c.peak_blocks;
  health.dropped_blocks = c.dropped_blocks;
  health.table_full = c.table_full;
  health.pool_empty = c.pool_empty;
  health.bytes = c.peak_bytes;
  health.archived_groups = c.archived_groups;
  health.fill = fill();
  return health;
}

/// The table as it stands, in no order; lies in the post.
/// @param any_view whether any group can be in view
template <class Device>
View<GroupEntry> DeviceEngine<Device>::groups_of_table(bool any_view, float margin_m) const {
  const uint32_t slots = d_.map.view.table.keys.size;
  const View<GroupEntry> entries{reinterpret_cast<GroupEntry*>(h_.post.data), slots};
  device_.fill(&d_.states->mail, 0, sizeof(MapMail));
  launch_all(slots, ListGroupsKernel{d_.map, any_view ? &d_.states->integrate.update.visible : nullptr,
                                     margin_m, entries, &d_.states->mail});
  bring_back(h_.states->mail, d_.states->mail);
  if (device_.wait() != Status::ok) return {};
  return {entries.data, h_.states->mail.count};
}

/// @return false: nothing was dropped, the device has failed
template <class Device>
bool DeviceEngine<Device>::drop_farthest(Vec3 centre_map) {
  const VolumeView& view = d_.map.view;
  const View<GroupEntry> entries = groups_of_table(h_.states->integrate.update.groups > 0, 0.0f);
  if (!entries.data) return false;
  const bool any_kind = !has_room(entries.size, most_entries(view.table.keys.size));
  std::sort(entries.begin(), entries.end(), KeptLonger{{centre_map, view.voxel_m}, any_kind});
  MapMail* const mail = &d_.states->mail;
  device_.launch(1, GiveUpKernel{d_.map, {entries.data, entries.size}, mail});
  device_.fill(view.table.keys.data, 0xff, uint64_t{view.table.keys.size} * sizeof(BlockKey));
  device_.fill(view.table.blocks.data, 0xff, uint64_t{view.table.blocks.size} * sizeof(BlockRef));
  launch_all(entries.size, RebuildTableKernel{d_.map, {entries.data, entries.size}, mail});
  bring_counters_back();
  return device_.wait() == Status::ok;
}

template <class Device>
uint32_t DeviceEngine<Device>::list_groups(View<uint64_t> keys) const {
  const View<GroupEntry> entries = groups_of_table(false, 0.0f);
  uint32_t count = 0;
  for (const GroupEntry& entry : entries) {
    if (is_archived(entry.ref)) continue;
    if (count < keys.size) keys[count] = entry.key;
    ++count;
  }
  std::sort(keys.begin(), keys.begin() + std::min(count, keys.size));
  return count;
}

template <class Device>
uint32_t DeviceEngine<Device>::farthest_groups(Vec3 centre_map, View<uint64_t> keys, bool near_view_too) {
  const View<GroupEntry> entries =
      groups_of_table(h_.states->integrate.update.groups > 0, near_view_too ? 0.0f : params_.fetch_m);
  uint32_t count = 0;
  for (const GroupEntry& entry : entries)
    if (has_id(entry.ref) && !entry.in_view) entries[count++] = entry;
  const uint32_t wanted = std::min(count, keys.size);
  std::partial_sort(entries.begin(), entries.begin() + wanted, entries.begin() + count,
                    FartherGroup{centre_map, d_.map.view.voxel_m});
  for (uint32_t i = 0; i < wanted; ++i) keys[i] = entries[i].key;
  return wanted;
}

template <class Device>
uint32_t DeviceEngine<Device>::wanted_groups(View<ArchivedGroup> groups) const {
  if (h_.states->integrate.update.groups == 0 || h_.states->counters.archived_groups == 0) return 0;
  const View<WantedEntry> entries{reinterpret_cast<WantedEntry*>(h_.post.data),
                                  static_cast<uint32_t>(h_.post.size / sizeof(WantedEntry))};
  device_.fill(&d_.states->mail, 0, sizeof(MapMail));
  launch_all(d_.update.groups.size, ListWantedKernel{d_.update, entries, &d_.states->mail});
  bring_back(h_.states->mail, d_.states->mail);
  if (device_.wait() != Status::ok) return 0;
  const uint32_t found = std::min(h_.states->mail.count, entries.size);
  std::sort(entries.begin(), entries.begin() + found, [](const WantedEntry& a, const WantedEntry& b) {
    return a.in_view != b.in_view ? a.in_view > b.in_view : a.index < b.index;
  });
  const uint32_t count = std::min(found, groups.size);
  for (uint32_t i = 0; i < count; ++i)
    groups[i] = {entries[i].key, entries[i].entry, entries[i].in_view != 0};
  return count;
}

template <class Device>
uint32_t DeviceEngine<Device>::write_group(uint64_t key, View<uint8_t> record) const {
  device_.launch(1, WriteGroupKernel{d_.map, key, {h_.post.data, kMaxGroupRecordBytes}, &d_.states->mail});
  bring_back(h_.states->mail, d_.states->mail);
  if (device_.wait() != Status::ok) return 0;
  const uint32_t bytes = h_.states->mail.count;
  if (bytes > record.size) return 0;
  std::copy_n(h_.post.data, bytes, record.data);
  return bytes;
}

template <class Device>
Status DeviceEngine<Device>::read_group(View<const uint8_t> record) {
  GroupRecordHead head;
  if (!read_head(record, head)) return Status::bad_data;
  std::copy_n(record.data, record.size, h_.post.data);
  device_.launch(1, ReadGroupKernel{d_.map, {h_.post.data, record.size}, &d_.states->mail});
  bring_back(h_.states->mail, d_.states->mail);
  bring_counters_back();
  if (device_.wait() != Status::ok) return Status::unavailable;
  if (h_.states->mail.failed) return Status::capacity_exhausted;
  continued_ = continued_ || masks_ == 0;
  return Status::ok;
}

template <class Device>
void DeviceEngine<Device>::change_group(const PutAwayKernel& kernel) {
  device_.launch(1, kernel);
  bring_counters_back();
  (void)device_.wait();  // a failure stays: the next frame tells
}

template <class Device>
void DeviceEngine<Device>::look_up(View<const Vec3> points_map_m, View<PointState> states) const {
  constexpr uint32_t kAtOnce = 1u << 14;
  auto* const points = reinterpret_cast<Vec3*>(h_.post.data);
  auto* const answers = reinterpret_cast<PointState*>(points + kAtOnce);
  static_assert(kAtOnce * (sizeof(Vec3) + sizeof(PointState)) <= 1u << 20, "fits the post");
  const uint32_t all = std::min(points_map_m.size, states.size);
  for (uint32_t first = 0; first < all; first += kAtOnce) {
    const uint32_t count = std::min(kAtOnce, all - first);
    std::copy_n(points_map_m.data + first, count, points);
    launch_all(count, LookUpKernel{d_.map.view, {points, count}, {answers, count}});
    const bool good = device_.wait() == Status::ok;
    for (uint32_t i = 0; i < count; ++i) states[first + i] = good ? answers[i] : PointState::unknown;
  }
}

/// As many rows at a time as the post has room for: each such strip is a view of its own.
template <class Device>
Status DeviceEngine<Device>::raycast(const Se3& T_world_cam, const Intrinsics& k, ImageView<float> depth_m,
                                     ImageView<Rgb8> colour) {
  const auto has_size = [&](int32_t rows, int32_t cols) { return rows == k.height && cols == k.width; };
  if (!is_view(T_world_cam, k) || !has_size(depth_m.rows, depth_m.cols) ||
      !has_size(colour.rows, colour.cols))
    return Status::out_of_range;
  const uint64_t row_bytes = static_cast<uint64_t>(k.width) * (sizeof(float) + sizeof(Rgb8));
  const auto rows_at_once = static_cast<int32_t>(
      std::min<uint64_t>(static_cast<uint64_t>(k.height), (h_.post.size - 64) / row_bytes));
  for (int32_t top = 0; top < k.height; top += rows_at_once) {
    Intrinsics strip = k;
    strip.height = std::min(rows_at_once, k.height - top);
    strip.cy -= static_cast<float>(top);
    auto* const depths = reinterpret_cast<float*>(h_.post.data);
    const int32_t pixels = strip.height * strip.width;
    auto* const colours = reinterpret_cast<Rgb8*>(depths + pixels);
    RaycastPass pass{d_.map.view,
                     strip,
                     T_world_cam,
                     {depths, strip.height, strip.width, strip.width},
                     {colours, strip.height, strip.width, strip.width}};
    const int32_t px = RayRanges::tile_px_for(strip.height, strip.width);
    const int32_t rows = (strip.height + px - 1) / px, cols = (strip.width + px - 1) / px;
    pass.ranges = {{d_.ray_ranges.data, rows, cols, cols}, px};
    const RayRangesPass ranges{pass.map,    strip,      inverse(pass.T_map_cam),
                               pass.near_m, pass.far_m, pass.ranges};
    const uint32_t blocks = pass.map.block_keys.size;
    launch_all(static_cast<uint64_t>(rows * cols), EmptyRangesKernel{pass.ranges});
    launch_all(blocks, PoolKernel<RayRangesPass>{ranges, blocks});
    launch_all(static_cast<uint64_t>(pixels), CastKernel{pass});
    if (device_.wait() != Status::ok) return Status::unavailable;
    for (int32_t r = 0; r < strip.height; ++r) {
      std::copy_n(depths + r * strip.width, strip.width, depth_m.row(top + r));
      std::copy_n(colours + r * strip.width, strip.width, colour.row(top + r));
    }
  }
  return Status::ok;
}

/// The host puts the blocks in order and adds up their counts, the device does the rest, in batches.
template <class Device>
Status DeviceEngine<Device>::extract_mesh(MeshSink& sink) {
  constexpr uint32_t kBatch = 1u << 15;  // vertices, or triangles: at least one block's
  static_assert(kBatch >= 3 * kBlockVoxels && kBatch >= kMaxCellTriangles * kBlockVoxels);
  static_assert(kBatch * (sizeof(Vec3) + sizeof(Rgb8)) <= 1u << 20 &&
                3 * kBatch * sizeof(uint32_t) <= 1u << 20);
  const ExtractPass pass{d_.map.view, d_.cube_cases.data};
  const uint32_t capacity = d_.map.view.block_keys.size;
  const View<BlockKey> keys{reinterpret_cast<BlockKey*>(h_.post.data), capacity};
  launch_all(capacity, PoolKernel<ClassifyPass>{{pass, d_.classes}, capacity});
  launch_all(capacity,
             PoolKernel<CandidateKeysPass>{{pass, {d_.classes.data, d_.classes.size}, keys}, capacity});
  if (device_.wait() != Status::ok) return Status::unavailable;

  const View<BlockId> order{reinterpret_cast<BlockId*>(keys.end()), capacity};
  uint32_t blocks = 0;
  for (BlockId id = 0; id < capacity; ++id)
    if (keys[id] != kEmptyKey) order[blocks++] = id;
  std::sort(order.begin(), order.begin() + blocks, [&](BlockId a, BlockId b) { return keys[a] < keys[b]; });
  device_.copy(d_.order.data, order.data, uint64_t{blocks} * sizeof(BlockId));
  const View<const BlockId> device_order{d_.order.data, blocks};
  // The counts come into the memory of the keys, which were used to sort.
  const View<BlockCounts> counts{reinterpret_cast<BlockCounts*>(h_.post.data), blocks};
  static_assert(sizeof(BlockCounts) <= sizeof(BlockKey));
  launch_all(blocks, CountSurfaceKernel{pass, device_order, counts});
  if (device_.wait() != Status::ok) return Status::unavailable;

  uint64_t vertices = 0, triangles = 0;
  for (uint32_t rank = 0; rank < blocks; ++rank) {
    h_.first_vertex[order[rank]] = static_cast<uint32_t>(vertices);
    h_.first_triangle[rank] = static_cast<uint32_t>(triangles);
    vertices += counts[rank].vertices;
    triangles += counts[rank].triangles;
    if (vertices > UINT32_MAX || triangles > UINT32_MAX) return Status::capacity_exhausted;
  }
  h_.first_triangle[blocks] = static_cast<uint32_t>(triangles);
  // By rank from here on; by id on the device.
  device_.copy(d_.first_vertex.data, h_.first_vertex.data, uint64_t{capacity} * sizeof(uint32_t));
  device_.copy(d_.first_triangle.data, h_.first_triangle.data, uint64_t{blocks + 1} * sizeof(uint32_t));
  if (device_.wait() != Status::ok) return Status::unavailable;
  for (uint32_t rank = 0, sum = 0; rank < blocks; ++rank) {
    h_.first_vertex[rank] = sum;
    sum += counts[rank].vertices;
  }
  const auto first_vertex = [&](uint32_t rank) {
    return rank < blocks ? h_.first_vertex[rank] : static_cast<uint32_t>(vertices);
  };
  const auto first_triangle = [&](uint32_t rank) { return h_.first_triangle[rank]; };
  const auto in_batches = [&](const auto& first, const auto& send) {
    for (uint32_t begin = 0, end = 0; begin < blocks; begin = end) {
      while (end < blocks && first(end + 1) - first(begin) <= kBatch) ++end;
      if (first(end) != first(begin) && !send(begin, end)) return false;
    }
    return true;
  };
  auto* const positions = reinterpret_cast<Vec3*>(h_.post.data);
  auto* const colours = reinterpret_cast<Rgb8*>(positions + kBatch);
  auto* const indices = reinterpret_cast<uint32_t*>(h_.post.data);
  const View<const uint32_t> by_id{d_.first_vertex.data, capacity},
      by_rank{d_.first_triangle.data, blocks + 1};
  const auto send_vertices = [&](uint32_t begin, uint32_t end) {
    const uint32_t count = first_vertex(end) - first_vertex(begin);
    launch_all(end - begin, WriteVerticesKernel{pass,
                                                device_order,
                                                by_id,
                                                begin,
                                                end,
                                                first_vertex(begin),
                                                {positions, count},
                                                {colours, count}});
    return device_.wait() == Status::ok && sink.vertices({positions, count}, {colours, count});
  };
  const auto send_triangles = [&](uint32_t begin, uint32_t end) {
    const uint32_t count = 3 * (first_triangle(end) - first_triangle(begin));
    launch_all(end - begin,
               WriteTrianglesKernel{pass, device_order, by_id, by_rank, begin, end, {indices, count}});
    return device_.wait() == Status::ok && sink.triangles({indices, count});
  };
  const bool done = sink.begin(vertices, triangles) && in_batches(first_vertex, send_vertices) &&
                    in_batches(first_triangle, send_triangles);
  return done ? Status::ok : Status::unavailable;
}

/// The small views of the last prepared frame, on both sides. @return false: the device has failed
template <class Device>
bool DeviceEngine<Device>::shrink_frame() {
  DeviceStates::Places& state = h_.states->places;
  state.shrink = {d_.depth_m, d_.luma_chroma, d_.mask, h_.places.cell_px(), params_.depth.max_m, d_.small[0]};
  state.halve = {d_.small[0], d_.small[1]};
  return play(DeviceStep::places);
}

template <class Device>
void DeviceEngine<Device>::remember_place(const Se3& T_map_cam) {
  if (h_.places.enabled() && shrink_frame()) h_.places.remember(T_map_cam);
}

template <class Device>
void DeviceEngine<Device>::follow(View<PoseTry> tries) {
  auto* const posted = reinterpret_cast<PoseTry*>(h_.post.data);
  std::copy_n(tries.data, tries.size, posted);
  FollowTriesKernel kernel{d_.map.view,
                           {posted, tries.size},
                           {},
                           {d_.small[0], d_.small[1]},
                           {h_.places.view_k(0), h_.places.view_k(1)},
                           h_.places.params()};
  std::copy_n(d_.scratch_of_tries, PlaceStore::kMaxTries, kernel.scratch);
  device_.launch(tries.size, kernel);
  if (device_.wait() != Status::ok) {
    for (PoseTry& t : tries) t.check = {};
    return;
  }
  std::copy_n(posted, tries.size, tries.data);
}

template <class Device>
PlaceResult DeviceEngine<Device>::find_place(const Se3& T_map_cam_guess, int32_t attempt) {
  if (!h_.places.enabled() || !shrink_frame()) return {};
  auto all = [this](View<PoseTry> tries) { follow(tries); };
  const PlaceResult result = h_.places.find(T_map_cam_guess, attempt, follower(all));
  if (result.status == Status::ok || h_.states->counters.archived_groups == 0) return result;
  set_view(prepared_images(), result.T_map_wanted);
  play(DeviceStep::look);
  return result;
}

template <class Device>
PlaceResult DeviceEngine<Device>::confirm_place(const Se3& T_map_cam_start) {
  if (!h_.places.enabled() || !shrink_frame()) return {};
  auto all = [this](View<PoseTry> tries) { follow(tries); };
  return h_.places.confirm(T_map_cam_start, follower(all));
}

}  // namespace stillmap
