// Does a frame cost more where the map is larger? The same frames, with copies of their own map out of view.

#include <fmt/format.h>

#include <array>
#include <cstdio>
#include <cstring>
#include <memory>
#include <nlohmann/json.hpp>
#include <optional>
#include <string>
#include <vector>

#include "config/engine_params.hpp"
#include "drivers/registry.hpp"
#include "firmware-like/commands/bench_options.hpp"
#include "firmware-like/commands/command.hpp"
#include "firmware-like/commands/common.hpp"
#include "firmware-like/commands/stop_signal.hpp"
#include "kernels/map/group_record.hpp"
#include "runtime/pipeline/pipeline.hpp"
#include "runtime/record/histogram.hpp"

namespace stillmap {
namespace {

constexpr std::array<int32_t, 3> kTimes = {1, 10, 50};
constexpr int kRounds = 3;                     ///< in turn, so that a noisy minute hits all of them
constexpr int32_t kGroupsBetweenCopies = 512;  ///< far out of any view
constexpr double kMostGrowth = 1.1;

/// A map in pieces.
class Pieces {
 public:
  explicit Pieces(const Engine& map) {
    std::vector<uint64_t> keys(map.list_groups({}));
    map.list_groups({keys.data(), static_cast<uint32_t>(keys.size())});
    std::vector<uint8_t> record(kMaxGroupRecordBytes);
    for (const uint64_t key : keys) {
      const uint32_t bytes = map.write_group(key, {record.data(), kMaxGroupRecordBytes});
      pieces_.emplace_back(record.begin(), record.begin() + bytes);
    }
  }

  /// Puts a copy into a map, so many groups aside. @return false when there is no room
  bool copy_into(Engine& map, int32_t groups_aside) {
    for (std::vector<uint8_t>& piece : pieces_) {
      GroupRecordHead head;
      std::memcpy(&head, piece.data(), sizeof head);
      GroupRecordHead aside = head;
      aside.group = pack(unpack(head.group) + Int3{groups_aside, 0, 0});
      std::memcpy(piece.data(), &aside, sizeof aside);
      const Status status = map.read_group({piece.data(), static_cast<uint32_t>(piece.size())});
      std::memcpy(piece.data(), &head, sizeof head);
      if (status != Status::ok) return false;
    }
    return true;
  }

 private:
  std::vector<std::vector<uint8_t>> pieces_;
};

struct Row {
  int32_t times = 0;
  uint32_t blocks = 0;  ///< in the map before the first frame
  DurationHistogram total_ms, integrate_ms;
};

void time_frames(Engine& engine, const Config& config, const PreloadedFrames& slots, Row& row) {
  Pipeline pipeline(engine, config);
  for (size_t frame = 0; frame < slots.size() && !stop_requested(); ++frame) {
    const FrameResult result =
        pipeline.process(slots[frame]->frame(), {.sonar_m = slots[frame]->frame().sonar_m});
    if (frame == 0) continue;  // it only starts the map
    row.total_ms.add(static_cast<double>(result.ms.total_ms));
    row.integrate_ms.add(static_cast<double>(result.ms.integrate_ms));
  }
}

void print(const std::array<Row, kTimes.size()>& rows, const std::string& source, size_t frames, bool json) {
  const double once = rows[0].total_ms.percentile(0.5);
  nlohmann::ordered_json out = {{"source", source}, {"frames", frames}, {"maps", nlohmann::json::array()}};
  if (!json)
    fmt::print("{}, {} frames, {} rounds, milliseconds (median, 95 %)\n{:<12} {:>10} {:>16} {:>16} {:>8}\n",
               source, frames, kRounds, "copies aside", "blocks", "total", "integrate", "ratio");
  for (const Row& row : rows) {
    const double p50 = row.total_ms.percentile(0.5), p95 = row.total_ms.percentile(0.95);
    const double integrate50 = row.integrate_ms.percentile(0.5),
                 integrate95 = row.integrate_ms.percentile(0.95);
    out["maps"].push_back({{"copies", row.times},
                           {"blocks", row.blocks},
                           {"total_ms_p50", p50},
                           {"total_ms_p95", p95},
                           {"integrate_ms_p50", integrate50},
                           {"integrate_ms_p95", integrate95},
                           {"ratio", p50 / once}});
    if (!json)
      fmt::print("{:<12} {:>10} {:>8.2f}{:>8.2f} {:>8.2f}{:>8.2f} {:>8.3f}\n", row.times, row.blocks, p50,
                 p95, integrate50, integrate95, p50 / once);
  }
  if (json) fmt::print("{}\n", out.dump(2));
}

}  // namespace

int bench_scale(const BenchOptions& o) {
  catch_stop_signals();
  if (o.configs.size() > 1 || o.sources.size() > 1)
    return fail("bench scale: takes one --config and one --source", ErrorKind::bad_usage);
  auto config = read_config(o.configs.empty() ? "" : o.configs[0], o.settings);
  if (!config) return fail(config.error(), config.error_kind());
  if (const auto good = check(*config); !good) return fail(good.error(), good.error_kind());
  const std::string name = o.sources.empty() ? "synthetic:crowd" : o.sources[0];
  auto source = open_source(name, source_options(*config));
  if (!source) return fail(source.error(), source.error_kind());
  EngineParams params = engine_params(*config, (*source)->info().camera, (*source)->info().depth_units_per_m);
  const PreloadedFrames slots = preload(**source, o.frames);
  if (slots.size() < 2) return fail(name + ": fewer than two usable frames", ErrorKind::failed);

  uint32_t blocks = 0;
  std::optional<Pieces> pieces;
  if (const std::unique_ptr<Engine> once = make_cpu_engine(params)) {
    Row untold;
    time_frames(*once, *config, slots, untold);
    blocks = once->map_health().blocks;
    pieces.emplace(*once);
  }
  if (blocks == 0) return fail(name + ": nothing was mapped, or the memory cannot be had", ErrorKind::failed);

  // One engine for all, so that only what is in the map differs. Untouched pages of its pool cost nothing.
  params.map.pool_blocks =
      static_cast<int32_t>(static_cast<float>(blocks) * (kTimes.back() + 2) / params.map.high_water);
  const std::unique_ptr<Engine> engine = make_cpu_engine(params);
  if (!engine)
    return fail("the memory for the largest map cannot be had; take a larger map.voxel_m", ErrorKind::failed);
  std::array<Row, kTimes.size()> rows;
  for (int round = 0; round < kRounds && !stop_requested(); ++round)
    for (size_t i = 0; i < kTimes.size(); ++i) {
      engine->reset_map();
      rows[i].times = kTimes[i];
      for (int32_t copy = 1; copy <= kTimes[i]; ++copy)
        if (!pieces->copy_into(*engine, copy * kGroupsBetweenCopies))
          return fail("no room for the copies of the map", ErrorKind::failed);
      rows[i].blocks = engine->map_health().blocks;
      time_frames(*engine, *config, slots, rows[i]);
    }
  print(rows, name, slots.size(), o.json);
  return rows.back().total_ms.percentile(0.5) <= kMostGrowth * rows.front().total_ms.percentile(0.5)
             ? kExitDone
             : kExitFailed;
}

}  // namespace stillmap
