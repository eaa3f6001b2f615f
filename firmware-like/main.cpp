#include <CLI/CLI.hpp>
#include <cstdio>
#include <exception>
#include <string>

#include "firmware-like/commands/command.hpp"
#include "firmware-like/journal.hpp"
#include "runtime/core/version.hpp"

namespace stillmap {
namespace {

int run_program(int argc, char** argv) {
  CLI::App app("Tracks an RGB-D camera, throws out whatever moves and maps what stands still.", "stillmap");
  app.set_version_flag("--version", std::string("stillmap ") + version());
  app.require_subcommand(0, 1);
  app.footer("`stillmap SUBCOMMAND --help` explains the flags of each.");

  int exit_code = kExitDone;
  add_run(app, exit_code);
  add_evaluate(app, exit_code);
  add_picture(app, exit_code);
  add_render(app, exit_code);
  add_bench(app, exit_code);
  add_mesh(app, exit_code);
  add_top(app, exit_code);
  add_memory_plan(app, exit_code);
  add_check_config(app, exit_code);
  add_replay(app, exit_code);
  add_doctor(app, exit_code);
  try {
    app.parse(argc, argv);
  } catch (const CLI::ParseError& error) {
    return app.exit(error) == 0 ? kExitDone : kExitUsage;
  }
  if (!app.get_subcommands().empty()) return exit_code;
  return fail("a subcommand is needed\n" + app.help(), ErrorKind::bad_usage);
}

}  // namespace
}  // namespace stillmap

int main(int argc, char** argv) {
  try {
    return stillmap::run_program(argc, argv);
  } catch (const std::exception& error) {  // what no border caught: memory, or a defect
    stillmap::say(stillmap::Priority::error, error.what());
    return stillmap::kExitFailed;
  }
}
