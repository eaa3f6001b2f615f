#include "runtime/evaluate/suite.hpp"

#include <algorithm>
#include <cctype>
#include <filesystem>
#include <map>
#include <optional>
#include <span>
#include <string_view>

#include <fmt/format.h>

#include "runtime/evaluate/ate.hpp"
#include "runtime/evaluate/paper_tables.hpp"

namespace stillmap {
namespace {

namespace fs = std::filesystem;

constexpr int kSearchDepth = 2;

/// `name` stands in `folder` as whole words: "balloon" is in "rgbd_bonn_balloon", not in "..._balloon2" and
/// not in
/// "..._balloon_tracking".
bool names(const std::string& folder, std::string_view name) {
  for (std::size_t at = folder.find(name); at != std::string::npos; at = folder.find(name, at + 1)) {
    const std::size_t end = at + name.size();
    const auto in_word = [&](std::size_t i) {
      return std::isalnum(static_cast<unsigned char>(folder[i])) != 0;
    };
    const bool begins = at == 0 || !in_word(at - 1);
    const bool ends = end == folder.size() || (!in_word(end) && folder[end] != '_');
    if (begins && ends) return true;
  }
  return false;
}

bool is_sequence(const fs::path& dir) {
  std::error_code code;
  return fs::exists(dir / "depth.txt", code) || fs::exists(dir / "associated.txt", code);
}

void find_sequences(const fs::path& dir, int depth, std::map<std::string, std::string>& found) {
  if (is_sequence(dir)) {
    const std::string name = paper_sequence_of(dir.filename().string());
    if (!name.empty()) found.emplace(name, dir.string());  // the first in the order of names stays
    return;
  }
  if (depth == 0) return;
  std::error_code code;
  std::vector<fs::path> folders;
  for (fs::directory_iterator entry(dir, code), end; !code && entry != end; entry.increment(code))
    if (entry->is_directory(code)) folders.push_back(entry->path());
  std::sort(folders.begin(), folders.end());
  for (const fs::path& folder : folders) find_sequences(folder, depth - 1, found);
}

struct Cell {
  std::string text = "-";
  std::optional<double> rmse_m;
};

class Tables {
 public:
  Tables(std::map<std::string, std::string> sequences, std::vector<std::string> configs, const SuiteRun& run)
      : sequences_(std::move(sequences)), configs_(std::move(configs)), run_(run) {}

  SuiteResult make() {
    table("TUM, dynamic scenes: ATE RMSE [m]", kPaperTum, true);
    result_.text += "\n";
    table("Bonn: ATE RMSE [m]", kPaperBonn, false);
    result_.text += notes_.empty() ? "" : "\n" + notes_;
    return std::move(result_);
  }

 private:
  static std::string figure(double value_m) {
    return value_m < 0 ? std::string("-") : fmt::format("{:.3f}", value_m);
  }

  void line(const std::string& first, const std::vector<std::string>& cells) {
    result_.text += fmt::format("{:<28}", first);
    for (const std::string& cell : cells) result_.text += fmt::format(" {:>12}", cell);
    result_.text += "\n";
  }

  void table(const std::string& title, std::span<const PaperRow> rows, bool with_mask_fusion) {
    std::vector<std::string> head = {"Ours(paper)", "SF", "DS(G)", "DS(N+G)"};
    if (with_mask_fusion) head.push_back("MF");
    for (const std::string& config : configs_)
      head.push_back(config.empty() ? "default" : fs::path(config).stem().string());
    result_.text += title + "\n";
    line("", head);
    std::vector<double> worst(head.size(), kNotInPaper);
    for (const PaperRow& row : rows) row_of(row, with_mask_fusion, worst);
    std::vector<std::string> cells;
    for (const double value : worst) cells.push_back(figure(value));
    line("Max", cells);
  }

  void row_of(const PaperRow& row, bool with_mask_fusion, std::vector<double>& worst) {
    std::vector<double> values = {row.refusion_m, row.static_fusion_m, row.dynaslam_g_m, row.dynaslam_ng_m};
    if (with_mask_fusion) values.push_back(row.mask_fusion_m);
    std::vector<std::string> cells;
    for (const double value : values) cells.push_back(figure(value));
    for (const std::string& config : configs_) {
      const Cell cell = evaluate(row, config);
      cells.push_back(cell.text);
      values.push_back(cell.rmse_m.value_or(kNotInPaper));
    }
    for (std::size_t i = 0; i < values.size(); ++i) worst[i] = std::max(worst[i], values[i]);
    line(row.paper_name, cells);
  }

  Cell evaluate(const PaperRow& row, const std::string& config) {
    const auto sequence = sequences_.find(row.sequence);
    if (sequence == sequences_.end()) return {};
    const std::string& dir = sequence->second;
    const Result<AteResult> ate = run_and_compare(dir, config);
    if (!ate) {
      ++result_.failed;
      notes_ += fmt::format("{}, {}: {}\n", row.paper_name, config.empty() ? "default" : config, ate.error());
      return {"failed", std::nullopt};
    }
    ++result_.evaluated;
    if (ate->matched_share_estimate() < 0.9)
      notes_ += fmt::format("{}: truth for {:.0f} % of the poses only\n", row.paper_name,
                            100 * ate->matched_share_estimate());
    return {figure(ate->translation_m.rmse), ate->translation_m.rmse};
  }

  Result<AteResult> run_and_compare(const std::string& dir, const std::string& config) {
    const Result<Trajectory> truth = read_trajectory(dir + "/groundtruth.txt");
    if (!truth) return Error{truth.error()};
    const Result<std::string> path = run_(dir, config);
    if (!path) return Error{path.error()};
    const Result<Trajectory> estimate = read_trajectory(*path);
    if (!estimate) return Error{estimate.error()};
    return absolute_trajectory_error(*truth, *estimate);
  }

  std::map<std::string, std::string> sequences_;
  std::vector<std::string> configs_;
  const SuiteRun& run_;
  SuiteResult result_;
  std::string notes_;
};

}  // namespace

std::string paper_sequence_of(const std::string& folder_name) {
  for (const PaperRow& row : kPaperTum)
    if (names(folder_name, row.sequence)) return row.sequence;
  for (const PaperRow& row : kPaperBonn)
    if (names(folder_name, row.sequence)) return row.sequence;
  return {};
}

Result<SuiteResult> evaluate_suite(const std::string& dir, const std::vector<std::string>& configs,
                                   const SuiteRun& run) {
  std::error_code code;
  if (!fs::is_directory(dir, code))
    return Error{
        fmt::format("{}: is no folder that can be read; expected a folder of TUM or Bonn sequences", dir)};
  std::map<std::string, std::string> sequences;
  find_sequences(fs::weakly_canonical(dir, code), kSearchDepth, sequences);
  if (sequences.empty())
    return Error{
        fmt::format("{}: none of the paper's sequences is in it; expected folders such as "
                    "rgbd_dataset_freiburg3_walking_xyz or rgbd_bonn_balloon2, unpacked",
                    dir)};
  return Tables(std::move(sequences), configs.empty() ? std::vector<std::string>{""} : configs, run).make();
}

}  // namespace stillmap
