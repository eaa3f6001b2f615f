// stillmap_parity: every step of every engine that this machine has, beside the plain CPU loops, on two
// synthetic scenes. Needs a compiler and nothing else.
//
// One line a check: "ok NAME value limit ms" or "FAIL NAME value limit ms", NAME as ENGINE/SCENE/STEP/WHAT
// and ms the time spent in that engine over all frames. Exit 0 when all are ok, 1 when one is not, 2 on bad
// usage.

#include <cstdio>
#include <cstdlib>
#include <cstring>

#include "tests/parity/checks.hpp"

namespace stillmap::parity {
namespace {

constexpr int kFrames = 30;

struct SceneToRun {
  const char* name;
  int first_frame;
  bool movers;           ///< the engines have to mask something
  double truth_limit_m;  ///< farthest that a pose may be from the truth, any frame
};
constexpr SceneToRun kScenes[] = {{"static", 0, false, 0.03}, {"crowd", 150, true, 0.1}};

int run(int frames) {
  Report report;
  const std::vector<NamedEngine> engines = available_engines();
  if (const std::string skipped = engines_left_out(); !skipped.empty()) std::printf("%s\n", skipped.c_str());
  Timer total;
  total.start();
  for (const SceneToRun& wanted : kScenes) {
    Result<Scene> scene = render_scene(wanted.name, wanted.first_frame, frames);
    if (!scene) {
      report.failed(wanted.name, scene.error());
      continue;
    }
    scene->movers = wanted.movers;
    const Trajectory reference_run = run_whole(engines[0], *scene);
    check_whole(engines[0], nullptr, *scene, reference_run, wanted.truth_limit_m, report);
    for (size_t i = 1; i < engines.size(); ++i) {
      check_steps(engines[0], engines[i], *scene, report);
      check_whole(engines[0], &engines[i], *scene, reference_run, wanted.truth_limit_m, report);
    }
  }
  total.stop();
  std::printf("%d checks, %d failed, %.1f s\n", report.checks(), report.failures(), total.ms() / 1000);
  return report.failures() == 0 ? 0 : 1;
}

}  // namespace
}  // namespace stillmap::parity

int main(int argc, char** argv) {
  int frames = stillmap::parity::kFrames;
  if (argc == 3 && std::strcmp(argv[1], "--frames") == 0) frames = std::atoi(argv[2]);
  if ((argc != 1 && argc != 3) || frames < 12 || frames > 300) {
    std::fprintf(stderr, "usage: stillmap_parity [--frames 12..300]\n");
    return 2;
  }
  return stillmap::parity::run(frames);
}
