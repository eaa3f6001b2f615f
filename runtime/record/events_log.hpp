#pragma once

#include <cstdint>
#include <map>
#include <string>
#include <string_view>

#include "runtime/ports/frame_source.hpp"
#include "runtime/record/output_file.hpp"

namespace stillmap {

/// Streams events.log, one line each: `stamp kind name: text`, kind being info, warning or fault.
/// Faults are counted by name for the report. After kMaxLinesPerName lines of a name it is only counted, so
/// that a fault in every frame for weeks does not fill the disk. @thread one
class EventsLog {
 public:
  static constexpr uint32_t kMaxLinesPerName = 1000;

  static Result<EventsLog> create(const std::string& path);

  void info(Stamp stamp, std::string_view name, std::string_view text);
  void warning(Stamp stamp, std::string_view name, std::string_view text);
  void fault(Stamp stamp, std::string_view name, std::string_view text);

  const std::map<std::string, uint64_t, std::less<>>& faults() const { return faults_; }
  OutputFile& file() { return file_; }

 private:
  explicit EventsLog(OutputFile file);
  void line(Stamp stamp, std::string_view kind, std::string_view name, std::string_view text);

  OutputFile file_;
  std::map<std::string, uint64_t, std::less<>> faults_, lines_;
};

}  // namespace stillmap
