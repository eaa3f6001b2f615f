// stillmap_step_times: how long the steps of a frame take, on a synthetic scene. Needs a compiler and nothing
// else.
//   stillmap_step_times [--engine cpu|cuda] [--preset FILE]... [--scene NAME] [--size WxH] [--frames N]
//   [--warm N]
//
// One line a step: "ENGINE PRESET STEP p50 p99 max", milliseconds. The first --warm frames do not count. Exit
// 0 when the engine answered every frame, 1 when not, 2 on bad usage, 3 when the engine cannot be had here.

#include <algorithm>
#include <cstdio>
#include <cstdlib>
#include <string>
#include <vector>

#include "tests/parity/preset.hpp"
#include "tests/parity/report.hpp"
#include "tests/parity/scene.hpp"

namespace stillmap::parity {
namespace {

constexpr const char* kUsage =
    "usage: stillmap_step_times [--engine cpu|cuda] [--preset FILE]... [--scene NAME] [--size WxH] [--frames "
    "N] "
    "[--warm N]\n";

struct Options {
  std::string engine = "cpu", scene = "crowd", size = "640x480";
  std::vector<std::string> presets;
  int frames = 150, warm = 20;
};

bool read_options(int argc, char** argv, Options& o) {
  for (int i = 1; i + 1 < argc; i += 2) {
    const std::string flag = argv[i], value = argv[i + 1];
    if (flag == "--engine")
      o.engine = value;
    else if (flag == "--preset")
      o.presets.push_back(value);
    else if (flag == "--scene")
      o.scene = value;
    else if (flag == "--size")
      o.size = value;
    else if (flag == "--frames")
      o.frames = std::atoi(value.c_str());
    else if (flag == "--warm")
      o.warm = std::atoi(value.c_str());
    else
      return false;
  }
  if (o.presets.empty()) o.presets.push_back("config/presets/default.toml");
  return argc % 2 == 1 && (o.engine == "cpu" || o.engine == "cuda") && o.warm >= 1 && o.frames > o.warm &&
         o.frames <= 1000;
}

enum Step { kPrepare, kTrack, kMask, kRefine, kIntegrate, kTotal, kSteps };
constexpr const char* kNames[kSteps] = {"prepare", "track", "mask", "refine", "integrate", "total"};

/// Milliseconds of the steps of the frames that count.
struct Times {
  std::vector<double> ms[kSteps];

  template <class F>
  void time(Step step, bool counts, const F& f) {
    Timer timer;
    timer.start();
    f();
    timer.stop();
    if (counts) ms[step].push_back(timer.ms());
  }
  void print(const std::string& name) {
    for (int s = 0; s < kSteps; ++s) {
      std::sort(ms[s].begin(), ms[s].end());
      const auto at = [&](double share) {
        return ms[s][static_cast<size_t>(share * static_cast<double>(ms[s].size() - 1))];
      };
      std::printf("%s %s %.3f %.3f %.3f\n", name.c_str(), kNames[s], at(0.5), at(0.99), ms[s].back());
    }
    std::fflush(stdout);
  }
};

/// @return frames that the engine did not answer
int run(Engine& engine, const Scene& scene, int warm, Times& times) {
  int failed = 0;
  Se3 T;
  for (size_t i = 0; i < scene.frames.size(); ++i) {
    const bool counts = static_cast<int>(i) >= warm;
    const FrameView frame = scene.view(i);
    times.time(kTotal, counts, [&] {
      PrepareResult prepared;
      times.time(kPrepare, counts, [&] { prepared = engine.prepare(frame); });
      TrackResult track;
      if (i > 0) {
        times.time(kTrack, counts, [&] { track = engine.track(T, {}); });
        times.time(kMask, counts, [&] { engine.mask(track.T_world_cam); });
        times.time(kRefine, counts, [&] { track = engine.refine(track.T_world_cam, {}); });
        T = track.T_world_cam;
      }
      IntegrateResult integrated;
      times.time(kIntegrate, counts, [&] { integrated = engine.integrate(T); });
      failed += prepared.status != Status::ok || track.status != Status::ok ||
                integrated.status == Status::unavailable;
    });
  }
  return failed;
}

int run_all(const Options& o) {
  if (const char* missing = o.engine == "cuda" ? cuda_missing() : nullptr) {
    std::printf("skip cuda: %s\n", missing);
    return 3;
  }
  const Result<Scene> scene = render_scene(o.scene, 0, o.frames, o.size);
  if (!scene) {
    std::fprintf(stderr, "%s\n", scene.error().c_str());
    return 2;
  }
  int failed = 0;
  for (const std::string& preset : o.presets) {
    Result<EngineParams> params = engine_params_of(preset);
    if (!params) {
      std::fprintf(stderr, "%s\n", params.error().c_str());
      return 2;
    }
    params->camera = scene->camera;
    params->depth_units_per_m = scene->depth_units_per_m;
    const std::unique_ptr<Engine> engine =
        o.engine == "cuda" ? make_cuda_engine(*params) : make_cpu_engine(*params);
    if (!engine) {
      std::fprintf(stderr, "the %s engine cannot be made with %s; is there enough memory?\n",
                   o.engine.c_str(), preset.c_str());
      return 3;
    }
    Times times;
    const int not_answered = run(*engine, *scene, o.warm, times);
    times.print(o.engine + " " + preset);
    if (not_answered > 0)
      std::printf("%s %s: %d frames not answered\n", o.engine.c_str(), preset.c_str(), not_answered);
    failed += not_answered;
  }
  return failed == 0 ? 0 : 1;
}

}  // namespace
}  // namespace stillmap::parity

int main(int argc, char** argv) {
  stillmap::parity::Options options;
  if (!stillmap::parity::read_options(argc, argv, options)) {
    std::fprintf(stderr, "%s", stillmap::parity::kUsage);
    return 2;
  }
  return stillmap::parity::run_all(options);
}
