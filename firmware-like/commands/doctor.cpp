#include <CLI/CLI.hpp>
#include <cstdio>
#include <memory>
#include <string>
#include <utility>
#include <vector>

#include "config/engine_params.hpp"
#include "drivers/gpio/gpio_sonar.hpp"
#include "drivers/registry.hpp"
#include "firmware-like/commands/command.hpp"
#include "firmware-like/commands/common.hpp"
#include "firmware-like/doctor/checks.hpp"

namespace stillmap {
namespace {

struct DoctorOptions {
  std::string config, source, out;
  std::vector<std::string> settings;
};

/// What is wrong with a configuration, in place of everything that would depend on it.
Finding bad_configuration(const std::string& path, const std::string& problems) {
  return {Verdict::wrong, "configuration", problems,
          "stillmap check-config " + (path.empty() ? std::string("FILE") : path)};
}

/// Opens the source as `run` would and closes it again; its images then say how much memory is needed.
Finding check_source(const RunIntent& intent, SourceInfo& info) {
  const auto source = open_source(intent.source, source_options(intent.config));
  if (!source)
    return {Verdict::wrong, "source", source.error(),
            source.error_kind() == ErrorKind::bad_usage ? "stillmap run --help" : "see the lines above"};
  info = (*source)->info();
  return {Verdict::ok,
          "source",
          intent.source + " opens, " + std::to_string(info.camera.k.width) + "x" +
              std::to_string(info.camera.k.height),
          {}};
}

uint64_t planned_bytes(const Config& config, const SourceInfo& info) {
  return plan_memory(config, engine_params(config, info.camera, info.depth_units_per_m)).total_bytes;
}

/// The cameras that Stillmap is made for: taken where no source can say what it sends.
SourceInfo usual_camera() {
  SourceInfo info;
  info.camera.k = {525, 525, 319.5f, 239.5f, 640, 480};
  return info;
}

Findings examine(const DoctorOptions& o) {
  RunIntent intent;
  intent.source = o.source;
  intent.out = o.out;
  const auto config = read_config(o.config, o.settings);
  if (!config) return {bad_configuration(o.config, config.error())};
  if (const auto good = check(*config); !good) return {bad_configuration(o.config, good.error())};
  intent.config = *config;

  Findings found = {{Verdict::ok, "configuration", o.config.empty() ? "the defaults" : o.config, {}}};
  SourceInfo info = usual_camera();
  Machine machine = this_machine();
  if (!gpio_library().empty()) machine.gpio_problem = sonar_line_problem;
  // First the camera, then whether it opens: the reason stands above the failure.
  for (Finding& finding : check_cameras(machine, intent)) found.push_back(std::move(finding));
  if (o.source.empty() || is_camera(o.source))
    for (Finding& finding : check_openni2(machine, intent, xtion_cameras()))
      found.push_back(std::move(finding));
  if (!o.source.empty()) found.push_back(check_source(intent, info));
  intent.planned_bytes = planned_bytes(intent.config, info);
  for (Finding& finding : check_system(machine, intent)) found.push_back(std::move(finding));
  return found;
}

int diagnose(const DoctorOptions& o) {
  const Findings found = examine(o);
  std::fputs(to_text(found).c_str(), stdout);
  if (would_run(found)) return kExitDone;
  std::fputs("`stillmap run` would not work: see the lines WRONG\n", stdout);
  return kExitFailed;
}

}  // namespace

void add_doctor(CLI::App& app, int& exit_code) {
  CLI::App* command =
      app.add_subcommand("doctor", "what this machine lacks for a run, and the command that mends it");
  auto options = std::make_shared<DoctorOptions>();
  command->add_option("--config", options->config, "TOML file (default: the built-in default preset)");
  command->add_option("--source", options->source, "what would be run; a camera is looked at and opened");
  command->add_option("--out", options->out, "where a run would leave its files");
  command->add_option("--set", options->settings, "section.key=value; may be repeated")
      ->allow_extra_args(false);
  command->callback([options, &exit_code] { exit_code = diagnose(*options); });
}

}  // namespace stillmap
