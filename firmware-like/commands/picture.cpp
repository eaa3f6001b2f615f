// stillmap picture: PNGs of what a run left.

#include <CLI/CLI.hpp>
#include <cstdio>
#include <memory>
#include <string>

#include "firmware-like/commands/command.hpp"
#include "runtime/picture/pictures.hpp"

namespace stillmap {
namespace {

struct PictureCommandOptions {
  std::string dir, truth;
};

int picture(const PictureCommandOptions& options) {
  const auto outcomes = make_pictures(options.dir, {options.truth});
  if (!outcomes) return fail(outcomes.error(), outcomes.error_kind());
  bool any_written = false, any_failed = false;
  for (const PictureOutcome& outcome : *outcomes) {
    any_written = any_written || outcome.state == PictureState::written;
    any_failed = any_failed || outcome.state == PictureState::failed;
    if (outcome.state == PictureState::written)
      std::printf("%s/pictures/%s\n", options.dir.c_str(), outcome.name.c_str());
    else if (outcome.state == PictureState::skipped)
      std::printf("%s skipped: %s\n", outcome.name.c_str(), outcome.why.c_str());
    else
      fail(outcome.name + ": " + outcome.why, ErrorKind::failed);
  }
  if (!any_written && !any_failed)
    return fail(options.dir + ": holds nothing to make a picture of; expected what `stillmap run --out` left",
                ErrorKind::failed);
  return any_failed ? kExitFailed : kExitDone;
}

}  // namespace

void add_picture(CLI::App& app, int& exit_code) {
  CLI::App* command = app.add_subcommand("picture", "make PNGs of a run into DIR/pictures");
  const auto options = std::make_shared<PictureCommandOptions>();
  command->add_option("dir", options->dir, "folder that `run --out` left")->required();
  command->add_option("--truth", options->truth,
                      "true trajectory (default: DIR/truth.txt or DIR/groundtruth.txt)");
  command->callback([options, &exit_code] { exit_code = picture(*options); });
}

}  // namespace stillmap
