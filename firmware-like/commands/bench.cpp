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
  return fail("bench " + o.what + ": this part is not in this build", ErrorKind::bad_usage);
}

}  // namespace

void add_bench(CLI::App& app, int& exit_code) {
  CLI::App* command = app.add_subcommand("bench", "how fast and how accurate this build is on this machine");
  auto o = std::make_shared<BenchOptions>();
  command->add_option("WHAT", o->what, "steps, accuracy, scale or soak")
      ->check(CLI::IsMember({"steps", "accuracy", "scale", "soak"}))
      ->capture_default_str();
  command->add_flag("--json", o->json, "machine-readable");
  command->add_option("--config", o->configs, "TOML file; accuracy: may be repeated, a column group each")
      ->allow_extra_args(false);
  command->add_option("--set", o->settings, "section.key=value; may be repeated")->allow_extra_args(false);
  command->add_option("--source", o->sources, "steps: what to time; accuracy: only these, may be repeated")
      ->allow_extra_args(false);
  command->add_option("--frames", o->frames, "steps: how many frames to preload")
      ->check(CLI::Range(2, 2000))
      ->capture_default_str();
  command->add_option("--out", o->out, "accuracy: where the runs are left")->capture_default_str();
  command->callback([o, &exit_code] { exit_code = bench(*o); });
}

}  // namespace stillmap
