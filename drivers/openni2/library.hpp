#pragma once

#include <string>

#include "config/result.hpp"

namespace stillmap::openni2 {

/// Starts OpenNI2, once in a process; it ends with the program, after every device was closed. The library
/// then follows by itself which cameras are plugged in. Its log goes neither to stdout nor to a file.
/// Loading its drivers changes the working directory for a moment.
/// @thread boot or one reader; a later call answers as the first did, unless that failed
Result<Done> start_library();

/// While one lives, what is written to stdout goes to stderr: drivers of the library print there.
class StdoutAside {
 public:
  StdoutAside();
  ~StdoutAside();
  StdoutAside(const StdoutAside&) = delete;
  StdoutAside& operator=(const StdoutAside&) = delete;

 private:
  int stdout_;  ///< a descriptor; -1: none could be had
};

/// What the library says about the call of this thread that failed last, on one line.
std::string library_error();

}  // namespace stillmap::openni2
