#include <CLI/CLI.hpp>
#include <cstdio>
#include <memory>
#include <string>

#include "firmware-like/commands/command.hpp"
#include "firmware-like/commands/common.hpp"

namespace stillmap {
namespace {

int check_file(const std::string& path) {
  const auto config = read_config(path, {});
  if (!config) return fail(config.error(), config.error_kind());
  if (const auto good = check(*config); !good) return fail(path + ": " + good.error(), good.error_kind());
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
