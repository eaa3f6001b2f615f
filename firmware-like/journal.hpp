#pragma once

#include <string>

namespace stillmap {

/// As syslog numbers them.
enum class Priority : int { error = 3, warning = 4, info = 6 };

/// Standard error goes to systemd's journal ($JOURNAL_STREAM names it).  @thread any
bool journal_reads();

/// A line for people on standard error. The journal gets its priority with it.  @thread any
void say(Priority priority, const std::string& text);

}  // namespace stillmap
