#include <CLI/CLI.hpp>
#include <memory>
#include <string>

#include "firmware-like/commands/bench_options.hpp"
#include "firmware-like/commands/command.hpp"

namespace stillmap {
namespace {

int bench(const BenchOptions& o) {
  if (o.what == "steps") return bench_steps(o);
  if (o.what == "accuracy") return bench_accuracy(o);
  if (o.what == "relocalise") return bench_relocalise(o);
  if (o.what == "scale") return bench_scale(o);
  if (o.what == "free_space") return bench_free_space(o);
  return bench_soak(o);
}

}  // namespace

void add_bench(CLI::App& app, int& exit_code) {
  CLI::App* command = app.add_subcommand("bench", "how fast and how accurate this build is on this machine");
  auto o = std::make_shared<BenchOptions>();
  command->add_option("WHAT", o->what, "steps, accuracy, relocalise, scale, free_space or soak")
      ->check(CLI::IsMember({"steps", "accuracy", "relocalise", "scale", "free_space", "soak"}))
      ->capture_default_str();
  command->add_flag("--json", o->json, "machine-readable");
  command->add_option("--config", o->configs, "TOML file; accuracy: may be repeated, without it both presets")
      ->allow_extra_args(false);
  command->add_option("--set", o->settings, "section.key=value; may be repeated")->allow_extra_args(false);
  command
      ->add_option(
          "--source", o->sources,
          "steps, scale: what to time; accuracy, free_space: only these, may be repeated (a recording as "
          "SOURCE@SKIP+MAX is cut)")
      ->allow_extra_args(false);
  command->add_option("--frames", o->frames, "steps, scale: how many frames to preload")
      ->check(CLI::Range(2, 2000))
      ->capture_default_str();
  command->add_option("--seeds", o->seeds, "accuracy: runs of each synthetic scene, seed 1, 2, ...")
      ->check(CLI::Range(1, 1000))
      ->capture_default_str();
  command->add_option("--size", o->size, "accuracy, free_space: WxH of the synthetic scenes");
  command->add_option("--seconds", o->seconds, "accuracy, free_space: length of the synthetic scenes");
  command->add_flag("--twins", o->twins, "accuracy: also the static twin of each --source that moves");
  command->add_option("--skip-frames", o->skip_frames, "accuracy: pass over the first frames of recordings");
  command->add_option("--max-frames", o->max_frames,
                      "accuracy: stop recordings after so many frames (0: all); soak: frames of the run "
                      "(0: 10000)");
  command->add_option("--lcm", o->lcm, "soak: LCM URL or off")->capture_default_str();
  command->add_option("--seed", o->seed, "relocalise: another draw of places")
      ->check(CLI::Range(0, 1000000))
      ->capture_default_str();
  command->add_flag("--brief", o->brief, "relocalise: one scene, few places");
  command->add_option("--out", o->out, "accuracy: where tables and runs are left; meshes only with one seed")
      ->capture_default_str();
  command->callback([o, &exit_code] { exit_code = bench(*o); });
}

}  // namespace stillmap
