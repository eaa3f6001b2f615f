#include "config/memory_plan.hpp"

#include <CLI/CLI.hpp>
#include <cstdio>
#include <memory>

#include "config/engine_params.hpp"
#include "drivers/camera/calibrated_source.hpp"
#include "firmware-like/commands/command.hpp"
#include "firmware-like/commands/common.hpp"

namespace stillmap {
namespace {

struct MemoryPlanOptions {
  std::string config;
  std::vector<std::string> settings;
};

/// Size of the images of the cameras that Stillmap is made for; a run plans with the size of its source.
constexpr int32_t kWidth = 640, kHeight = 480;

int show(const MemoryPlanOptions& o) {
  const auto config = read_config(o.config, o.settings);
  if (!config) return fail(config.error(), config.error_kind());
  if (const auto good = check(*config); !good) return fail(good.error(), good.error_kind());
  CameraModel camera;
  camera.k = {525, 525, 319.5f, 239.5f, kWidth, kHeight};
  const EngineParams params = engine_params(*config, camera, 5000);
  MemoryPlan plan = plan_memory(*config, params);
  const auto calibration = configured_calibration(*config);
  if (!calibration) return fail(calibration.error(), calibration.error_kind());
  if (calibration->depth) plan.add(kRegistrationEntry, CalibratedSource::registration_bytes(kHeight, kWidth));
  std::printf("for images of %dx%d pixels\n%s", kWidth, kHeight, table(plan).c_str());
  if (plan.fits()) return kExitDone;
  return fail("the plan is over memory.budget_mb; raise it or lower map.pool_blocks", ErrorKind::bad_usage);
}

}  // namespace

void add_memory_plan(CLI::App& app, int& exit_code) {
  CLI::App* command =
      app.add_subcommand("memory-plan", "every pool, its bytes, the total; nothing is started");
  auto options = std::make_shared<MemoryPlanOptions>();
  command->add_option("--config", options->config, "TOML file (default: the built-in default preset)");
  command->add_option("--set", options->settings, "section.key=value; may be repeated")
      ->allow_extra_args(false);
  command->callback([options, &exit_code] { exit_code = show(*options); });
}

}  // namespace stillmap
