#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "config/config.hpp"
#include "config/result.hpp"
#include "drivers/openni2/openni2_source.hpp"
#include "firmware-like/doctor/machine.hpp"

namespace stillmap {

enum class Verdict : uint8_t {
  ok,
  worse,  ///< `run` works, but less well than it could
  wrong,  ///< `run` would not work
};

/// One line of `doctor`.
struct Finding {
  Verdict verdict = Verdict::ok;
  std::string part;  ///< what was looked at: "camera"
  std::string text;  ///< what was found
  std::string mend;  ///< the command that mends it; empty when all is well
};

using Findings = std::vector<Finding>;

/// What is to run.
struct RunIntent {
  Config config;
  std::string source;          ///< as --source; empty: not said
  std::string out;             ///< as --out; empty: nothing is written
  uint64_t planned_bytes = 0;  ///< total of the memory plan
};

/// Cameras of the source: there, fast enough, and permitted. Nothing for recordings; without a source, and
/// beside those of `v4l2:`, the video nodes that there are.
Findings check_cameras(const Machine& machine, const RunIntent& intent);
/// The lines of the sonar: there, free, and permitted. Nothing where there is none.
Findings check_sonar(const Machine& machine, const RunIntent& intent);
/// What OpenNI2 makes of them. Where no source was named, those that it finds and nothing else.
Findings check_openni2(const Machine& machine, const RunIntent& intent,
                       const Result<std::vector<OpenNi2Camera>>& cameras);
/// Enough memory for the plan.
Findings check_memory(const Machine& machine, const RunIntent& intent);
/// Priorities and locked memory that the configuration asks for.
Findings check_real_time(const Machine& machine, const RunIntent& intent);
/// Processors: enough of them, and not slowed down.
Findings check_processors(const Machine& machine, const RunIntent& intent);
/// Driver of the graphics processor. Without one the CPU engine is used.
Findings check_cuda(const Machine& machine);
/// The way of LCM's multicast, and the sizes of socket buffers.
Findings check_lcm(const Machine& machine);
/// That stamps in UTC mean something on other computers.
Findings check_clock(const Machine& machine);
/// Folders of the run and of the archive: can be written, with room.
Findings check_disks(const Machine& machine, const RunIntent& intent);

/// All but the cameras, in this order.  @thread boot; test: checks_test
Findings check_system(const Machine& machine, const RunIntent& intent);

/// "OK     camera     ..." and, where something is wrong, what mends it on a line of its own.
std::string to_text(const Findings& findings);

/// Whether `run` would work.
bool would_run(const Findings& findings);

}  // namespace stillmap
