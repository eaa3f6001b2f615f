#pragma once

// A subcommand is a file of this folder with one `add_NAME(app, exit_code)`: it declares its flags and, when
// it was called for, runs and leaves its exit code. main.cpp lists them.

#include <string>

#include "config/result.hpp"

namespace CLI {
class App;
}

namespace stillmap {

/// Exit codes of the program; others rely on them.
inline constexpr int kExitDone = 0;
inline constexpr int kExitFailed = 1;    ///< went wrong while running
inline constexpr int kExitUsage = 2;     ///< bad usage or configuration, or a part that this build lacks
inline constexpr int kExitNoSource = 3;  ///< the source cannot be opened
inline constexpr int kExitLost = 4;      ///< tracking was lost and not found again before the end

/// Prints `stillmap: MESSAGE` to stderr. @return the exit code of that kind of error
int fail(const std::string& message, ErrorKind kind);

/// Mesh of a saved map, on one thread. @return the error, or empty
std::string mesh_of_map(const std::string& map_path, const std::string& mesh_path);

void add_run(CLI::App& app, int& exit_code);
void add_evaluate(CLI::App& app, int& exit_code);
void add_bench(CLI::App& app, int& exit_code);
void add_render(CLI::App& app, int& exit_code);
void add_picture(CLI::App& app, int& exit_code);
void add_mesh(CLI::App& app, int& exit_code);
void add_memory_plan(CLI::App& app, int& exit_code);
void add_top(CLI::App& app, int& exit_code);
void add_check_config(CLI::App& app, int& exit_code);
void add_replay(CLI::App& app, int& exit_code);
void add_doctor(CLI::App& app, int& exit_code);

}  // namespace stillmap
