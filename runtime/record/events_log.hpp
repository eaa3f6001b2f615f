#pragma once

#include <cstdint>
#include <functional>
#include <map>
#include <optional>
#include <string>
#include <string_view>
#include <utility>

#include "runtime/ports/frame_source.hpp"
#include "runtime/record/output_file.hpp"

namespace stillmap {

/// Streams events.log, one line each: `stamp kind name: text`, kind being info, warning or fault.
/// Faults are counted by name for the report. After kMaxLinesPerName lines of a name it is only counted, so
/// that a fault in every frame for weeks does not fill the disk. @thread one
class EventsLog {
 public:
  static constexpr uint32_t kMaxLinesPerName = 1000;

  /// Counts only, writes nothing.
  EventsLog() = default;
  static Result<EventsLog> create(const std::string& path);

  void info(Stamp stamp, std::string_view name, std::string_view text);
  void warning(Stamp stamp, std::string_view name, std::string_view text);
  void fault(Stamp stamp, std::string_view name, std::string_view text);

  /// Hears every line that is written down.
  using Listener = std::function<void(bool fault, std::string_view name, std::string_view text)>;
  void set_listener(Listener listener) { listener_ = std::move(listener); }

  const std::map<std::string, uint64_t, std::less<>>& faults() const { return faults_; }
  /// @return false when something could not be written, see error()
  bool close() { return !file_ || file_->close(); }
  bool failed() const { return file_ && file_->failed(); }
  std::string error() const { return file_ ? file_->error() : std::string(); }

 private:
  explicit EventsLog(OutputFile file);
  void line(Stamp stamp, std::string_view kind, std::string_view name, std::string_view text);

  std::optional<OutputFile> file_;
  Listener listener_;
  std::map<std::string, uint64_t, std::less<>> faults_, lines_;
};

}  // namespace stillmap
