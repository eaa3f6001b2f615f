#include "runtime/record/events_log.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <utility>

#include "runtime/record/trajectory_writer.hpp"

namespace stillmap {

Result<EventsLog> EventsLog::create(const std::string& path) {
  auto file = OutputFile::create(path, OutputFile::Kind::stream);
  if (!file) return Error{file.error()};
  return EventsLog(std::move(*file));
}

EventsLog::EventsLog(OutputFile file) : file_(std::move(file)) {}

void EventsLog::info(Stamp stamp, std::string_view name, std::string_view text) {
  line(stamp, "info", name, text);
}

void EventsLog::warning(Stamp stamp, std::string_view name, std::string_view text) {
  line(stamp, "warning", name, text);
}

void EventsLog::fault(Stamp stamp, std::string_view name, std::string_view text) {
  ++faults_[std::string(name)];
  line(stamp, "fault", name, text);
}

void EventsLog::line(Stamp stamp, std::string_view kind, std::string_view name, std::string_view text) {
  const uint64_t count = ++lines_[std::string(name)];
  if (count > kMaxLinesPerName) return;
  std::string one_line(text);
  std::replace(one_line.begin(), one_line.end(), '\n', ' ');
  if (count == kMaxLinesPerName) one_line += " (further ones are counted only)";
  if (file_) file_->write(fmt::format("{} {} {}: {}\n", file_stamp(stamp), kind, name, one_line));
  if (listener_) listener_(kind == "fault", name, one_line);
}

}  // namespace stillmap
