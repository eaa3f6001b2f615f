#include "firmware-like/journal.hpp"

#include <fmt/format.h>
#include <sys/stat.h>
#include <unistd.h>

#include <cstdio>
#include <cstdlib>

namespace stillmap {
namespace {

/// The variable holds "device:inode" of the journal's stream; a redirected standard error is another file.
bool stderr_is_the_journals() {
  const char* stream = std::getenv("JOURNAL_STREAM");
  struct stat file = {};
  if (stream == nullptr || fstat(STDERR_FILENO, &file) != 0) return false;
  return fmt::format("{}:{}", file.st_dev, file.st_ino) == stream;
}

}  // namespace

bool journal_reads() {
  static const bool reads = stderr_is_the_journals();
  return reads;
}

void say(Priority priority, const std::string& text) {
  if (journal_reads())
    std::fprintf(stderr, "<%d>%s\n", static_cast<int>(priority), text.c_str());
  else
    std::fprintf(stderr, "stillmap: %s\n", text.c_str());
}

}  // namespace stillmap
