#include <CLI/CLI.hpp>
#include <cstdio>
#include <memory>
#include <string>
#include <vector>

#include "config/calibration.hpp"
#include "firmware-like/commands/command.hpp"
#include "firmware-like/commands/common.hpp"

namespace stillmap {
namespace {

/// What could be used, but is most likely wrong. @return as `check`
Result<Done> check_plausible(const Config& config) {
  std::string text;
  const auto add = [&](const std::vector<std::string>& lines) {
    for (const std::string& line : lines) text += "\n  " + line;
  };
  const CameraConfig& c = config.camera;
  if (c.fx > 0)
    add(implausible(
        {{c.fx, c.fy, c.cx, c.cy, config.source.cols, config.source.rows}, {c.k1, c.k2, c.p1, c.p2, c.k3}},
        "camera."));
  const auto calibration = configured_calibration(config);
  if (!calibration) return Error{calibration.error(), calibration.error_kind()};
  add(implausible(*calibration, c.calibration, config.source.cols, config.source.rows, config.depth));
  if (text.empty()) return Done{};
  return Error{"most likely wrong, though `stillmap run` would use it:" + text, ErrorKind::bad_usage};
}

int check_file(const std::string& path) {
  const auto config = read_config(path, {});
  if (!config) return fail(config.error(), config.error_kind());
  if (const auto good = check(*config); !good) return fail(path + ": " + good.error(), good.error_kind());
  if (const auto good = check_plausible(*config); !good)
    return fail(path + ": " + good.error(), good.error_kind());
  std::printf("%s: good\n", path.c_str());
  return kExitDone;
}

}  // namespace

void add_check_config(CLI::App& app, int& exit_code) {
  CLI::App* command = app.add_subcommand("check-config", "every violation of a configuration file");
  auto path = std::make_shared<std::string>();
  command->add_option("FILE", *path, "TOML file")->required();
  command->callback([path, &exit_code] { exit_code = check_file(*path); });
}

}  // namespace stillmap
