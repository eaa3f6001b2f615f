#include <fmt/format.h>

#include <cstdio>
#include <memory>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "config/engine_params.hpp"
#include "drivers/registry.hpp"
#include "firmware-like/commands/bench_options.hpp"
#include "firmware-like/commands/command.hpp"
#include "firmware-like/commands/common.hpp"
#include "firmware-like/commands/stop_signal.hpp"
#include "runtime/pipeline/pipeline.hpp"
#include "runtime/record/histogram.hpp"

namespace stillmap {
namespace {

struct Step {
  const char* name;
  float StageTimes::*ms;
};
constexpr Step kSteps[] = {
    {"prepare", &StageTimes::prepare_ms},     {"track", &StageTimes::track_ms},
    {"mask", &StageTimes::mask_ms},           {"refine", &StageTimes::refine_ms},
    {"integrate", &StageTimes::integrate_ms}, {"total", &StageTimes::total_ms},
};
constexpr size_t kStepCount = std::size(kSteps);

using Histograms = std::array<DurationHistogram, kStepCount>;

void print_json(const Histograms& times, const std::string& source, size_t frames, int32_t threads) {
  nlohmann::ordered_json json = {
      {"source", source}, {"frames", frames}, {"threads", threads}, {"ms", nullptr}};
  for (size_t i = 0; i < kStepCount; ++i)
    json["ms"][kSteps[i].name] = {{"mean", times[i].mean()},
                                  {"p50", times[i].percentile(0.5)},
                                  {"p95", times[i].percentile(0.95)},
                                  {"p99", times[i].percentile(0.99)},
                                  {"max", times[i].max()}};
  fmt::print("{}\n", json.dump(2));
}

void print_table(const Histograms& times, const std::string& source, size_t frames, int32_t threads) {
  fmt::print("{}, {} frames, {} threads, milliseconds\n{:<10} {:>8} {:>8} {:>8} {:>8}\n", source, frames,
             threads, "", "p50", "p95", "p99", "max");
  for (size_t i = 0; i < kStepCount; ++i)
    fmt::print("{:<10} {:>8.2f} {:>8.2f} {:>8.2f} {:>8.2f}\n", kSteps[i].name, times[i].percentile(0.5),
               times[i].percentile(0.95), times[i].percentile(0.99), times[i].max());
}

}  // namespace

int bench_steps(const BenchOptions& o) {
  catch_stop_signals();
  if (o.configs.size() > 1 || o.sources.size() > 1)
    return fail("bench steps: takes one --config and one --source", ErrorKind::bad_usage);
  const auto config = read_config(o.configs.empty() ? "" : o.configs[0], o.settings);
  if (!config) return fail(config.error(), config.error_kind());
  if (const auto good = check(*config); !good) return fail(good.error(), good.error_kind());
  const std::string name = o.sources.empty() ? "synthetic:crowd" : o.sources[0];
  auto source = open_source(name, source_options(*config));
  if (!source) return fail(source.error(), source.error_kind());
  const EngineParams params =
      engine_params(*config, (*source)->info().camera, (*source)->info().depth_units_per_m);
  const std::unique_ptr<Engine> engine = make_cpu_engine(params);
  if (!engine)
    return fail("the memory of the engine cannot be had; lower map.pool_blocks", ErrorKind::failed);

  const PreloadedFrames slots = preload(**source, o.frames);
  if (slots.size() < 2) return fail(name + ": fewer than two usable frames", ErrorKind::failed);
  Pipeline pipeline(*engine, *config);
  Histograms times;
  for (size_t frame = 0; frame < slots.size() && !stop_requested(); ++frame) {
    const FrameResult result =
        pipeline.process(slots[frame]->frame(), {.sonar_m = slots[frame]->frame().sonar_m});
    if (frame == 0) continue;  // it only starts the map
    for (size_t i = 0; i < kStepCount; ++i) times[i].add(static_cast<double>(result.ms.*kSteps[i].ms));
  }
  (o.json ? print_json : print_table)(times, name, slots.size(), params.threads);
  return kExitDone;
}

}  // namespace stillmap
