#pragma once

namespace stillmap {

/// From now on SIGINT and SIGTERM ask for a stop instead of ending the program; the second one ends it at
/// once. SIGHUP asks for another file of the event log. A pipe that nobody reads and a file size limit become
/// errors of the write. @thread boot
void catch_stop_signals();

/// @thread any
bool stop_requested();

/// Once for each SIGHUP (or several of them that came together). @thread record
bool rotation_requested();

}  // namespace stillmap
