#include <CLI/CLI.hpp>
#include <memory>
#include <string>
#include <vector>

#include "firmware-like/commands/command.hpp"

namespace stillmap {
namespace {

struct Flag {
  const char* name;
  const char* help;
  bool required = false;
};

void add(CLI::App& app, int& exit_code, const char* name, const char* help, const std::vector<Flag>& flags) {
  CLI::App* command = app.add_subcommand(name, std::string(help) + " (not part of this build)");
  auto values = std::make_shared<std::vector<std::string>>(flags.size());
  for (size_t i = 0; i < flags.size(); ++i)
    command->add_option(flags[i].name, (*values)[i], flags[i].help)->required(flags[i].required);
  const std::string text = std::string(name) + ": this part is not in this build";
  command->callback([values, text, &exit_code] { exit_code = fail(text, ErrorKind::bad_usage); });
}

}  // namespace

void add_parts_not_built(CLI::App& app, int& exit_code) {
  add(app, exit_code, "replay", "a recorded event log once more",
      {{"LOG", "*.lcm of a run", true}, {"--out", "folder"}});
}

}  // namespace stillmap
