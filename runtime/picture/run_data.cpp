#include "runtime/picture/run_data.hpp"

#include <algorithm>
#include <filesystem>
#include <map>
#include <optional>

#include <fmt/format.h>

#include "config/read_file.hpp"
#include "runtime/evaluate/trajectory.hpp"

namespace stillmap {
namespace {

constexpr uint64_t kMaxFileBytes = uint64_t{1} << 30;

std::vector<std::string_view> split(std::string_view text, char separator) {
  std::vector<std::string_view> parts;
  while (true) {
    const std::size_t end = text.find(separator);
    parts.push_back(text.substr(0, end));
    if (end == std::string_view::npos) return parts;
    text.remove_prefix(end + 1);
  }
}

/// A table with a header; columns are found by their names so that new ones do no harm.
template <class Row, class Parse>
Result<std::vector<Row>> read_table(const std::string& path, const std::vector<std::string_view>& names,
                                    const Parse& parse) {
  const Result<std::string> text = read_file(path, kMaxFileBytes);
  if (!text) return Error{text.error()};
  const std::string_view whole = *text;
  std::vector<std::size_t> columns;
  std::vector<Row> rows;
  std::size_t number = 0, begin = 0;
  while (begin < whole.size()) {
    const std::size_t end = std::min(whole.find('\n', begin), whole.size());
    std::string_view line = whole.substr(begin, end - begin);
    if (!line.empty() && line.back() == '\r') line.remove_suffix(1);
    begin = end + 1;
    ++number;
    if (line.empty()) continue;
    const std::vector<std::string_view> cells = split(line, ',');
    if (columns.empty()) {
      for (const std::string_view name : names) {
        const auto cell = std::find(cells.begin(), cells.end(), name);
        if (cell == cells.end()) return Error{fmt::format("{}:{}: has no column '{}'", path, number, name)};
        columns.push_back(static_cast<std::size_t>(cell - cells.begin()));
      }
      continue;
    }
    std::vector<std::string_view> values;
    for (const std::size_t column : columns) {
      if (column >= cells.size())
        return Error{fmt::format("{}:{}: has {} columns only", path, number, cells.size())};
      values.push_back(cells[column]);
    }
    const std::optional<Row> row = parse(values);
    if (!row) return Error{fmt::format("{}:{}: a value is no number or no state", path, number)};
    rows.push_back(*row);
  }
  if (columns.empty()) return Error{fmt::format("{}: is empty", path)};
  return rows;
}

std::optional<FrameState> state_from(std::string_view text) {
  if (text == "good") return FrameState::good;
  if (text == "poor") return FrameState::poor;
  if (text == "lost") return FrameState::lost;
  return std::nullopt;
}

}  // namespace

Result<std::vector<StateRow>> read_states(const std::string& path) {
  const auto parse = [](const std::vector<std::string_view>& values) -> std::optional<StateRow> {
    const auto stamp = parse_stamp(values[0]);
    const auto state = state_from(values[1]);
    const auto inliers = parse_number(values[2]), masked = parse_number(values[3]);
    if (!stamp || !state || !inliers || !masked) return std::nullopt;
    return StateRow{*stamp, *state, *inliers, *masked};
  };
  Result<std::vector<StateRow>> rows =
      read_table<StateRow>(path, {"stamp", "state", "inlier_ratio", "masked_fraction"}, parse);
  if (rows)
    std::stable_sort(rows->begin(), rows->end(),
                     [](const StateRow& a, const StateRow& b) { return a.stamp < b.stamp; });
  return rows;
}

Result<std::vector<TimingRow>> read_timing(const std::string& path) {
  const auto parse = [](const std::vector<std::string_view>& values) -> std::optional<TimingRow> {
    TimingRow row;
    for (std::size_t i = 0; i < kStages; ++i) {
      const auto value = parse_number(values[i]);
      if (!value) return std::nullopt;
      row.stage_ms[i] = *value;
    }
    const auto total = parse_number(values[kStages]);
    if (!total) return std::nullopt;
    row.total_ms = *total;
    return row;
  };
  return read_table<TimingRow>(
      path, {"prepare_ms", "track_ms", "mask_ms", "refine_ms", "integrate_ms", "total_ms"}, parse);
}

std::vector<Snapshot> find_snapshots(const std::string& dir) {
  std::map<int64_t, Snapshot> by_stamp;
  std::error_code code;
  for (std::filesystem::directory_iterator entry(dir, code), end; !code && entry != end;
       entry.increment(code)) {
    const std::string name = entry->path().filename().string();
    constexpr std::string_view kColour = "_colour.png";
    if (name.size() <= kColour.size() || name.substr(name.size() - kColour.size()) != kColour) continue;
    const std::string stamp = name.substr(0, name.size() - kColour.size());
    const auto time = parse_stamp(stamp);
    if (!time) continue;
    const auto beside = [&](const char* kind) {
      const std::string path = dir + "/" + stamp + "_" + kind + ".png";
      return have_file(path) ? path : std::string();
    };
    by_stamp[time->ns] = {stamp, entry->path().string(), beside("mask"), beside("map")};
  }
  std::vector<Snapshot> snapshots;
  for (auto& [time, snapshot] : by_stamp) snapshots.push_back(std::move(snapshot));
  return snapshots;
}

bool have_file(const std::string& path) {
  std::error_code code;
  return std::filesystem::is_regular_file(path, code);
}

}  // namespace stillmap
