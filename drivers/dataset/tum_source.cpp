#include "drivers/dataset/tum_source.hpp"

#include <algorithm>
#include <cctype>
#include <cmath>
#include <filesystem>

#include "config/validate.hpp"
#include "drivers/dataset/image_folder.hpp"
#include "drivers/dataset/intrinsics.hpp"
#include "drivers/dataset/pairing.hpp"
#include "drivers/dataset/text.hpp"
#include "runtime/image/image_file.hpp"

namespace stillmap {
namespace {

namespace fs = std::filesystem;

constexpr float kDepthUnitsPerM = 5000;
constexpr int64_t kMaxTruthNs = 20000000;

Error cannot_open(std::string message) {
  return {std::move(message), ErrorKind::cannot_open};
}

int64_t ns_of_ms(double ms) {
  return std::llround(ms * 1e6);
}

/// An image as a list names it.
struct StampedFile {
  Stamp stamp;
  std::string path;  ///< as written, relative to the folder
};

/// Columns of `associated.txt`, or two lists that are still to be paired.
struct Lists {
  std::vector<StampedFile> depth, colour;
  bool paired = false;               ///< depth[i] belongs to colour[i]
  std::vector<FrameEntry> unusable;  ///< lines that cannot be understood
  std::vector<size_t> position;      ///< paired: how many unusable lines stand before depth[i]
};

FrameEntry bad_line(const TextFile& file, const TextLine& line, const char* expected) {
  FrameEntry entry;
  entry.problem = file.path() + ":" + std::to_string(line.number) + ": expected " + expected;
  return entry;
}

// --- which column of associated.txt is depth
// -----------------------------------------------------------------------

bool has(const std::string& path, const char* word) {
  std::string lower = path;
  std::transform(lower.begin(), lower.end(), lower.begin(),
                 [](unsigned char c) { return static_cast<char>(std::tolower(c)); });
  return lower.find(word) != std::string::npos;
}

enum class Column { unknown, depth, colour };

/// What the first of two columns is, by the names of the files.
Column by_name(const std::string& first, const std::string& second) {
  if (has(first, "depth") != has(second, "depth"))
    return has(first, "depth") ? Column::depth : Column::colour;
  for (const char* word : {"rgb", "color", "colour"})
    if (has(first, word) != has(second, word)) return has(first, word) ? Column::colour : Column::depth;
  return Column::unknown;
}

/// What the first of two columns is, by what the files hold: depth is 16-bit grey.
Column by_content(const fs::path& dir, const std::string& first, const std::string& second) {
  const auto is_depth = [&](const std::string& path, bool& known) {
    const Result<ImageInfo> info = image_info((dir / path).string());
    known = static_cast<bool>(info);
    return known && info->bits == 16 && info->grey;
  };
  bool first_known = false, second_known = false;
  const bool first_depth = is_depth(first, first_known), second_depth = is_depth(second, second_known);
  if (!first_known && !second_known) return Column::unknown;
  if (first_known && second_known && first_depth == second_depth) return Column::unknown;
  if (first_known) return first_depth ? Column::depth : Column::colour;
  return second_depth ? Column::colour : Column::depth;
}

Column first_column(const fs::path& dir, const Lists& lists) {
  constexpr size_t kLinesToLookAt = 50;
  const size_t count = std::min(lists.depth.size(), kLinesToLookAt);
  for (size_t i = 0; i < count; ++i)
    if (const Column c = by_name(lists.depth[i].path, lists.colour[i].path); c != Column::unknown) return c;
  for (size_t i = 0; i < count; ++i)
    if (const Column c = by_content(dir, lists.depth[i].path, lists.colour[i].path); c != Column::unknown)
      return c;
  return Column::unknown;
}

// --- reading the lists
// ---------------------------------------------------------------------------------------------

Result<Lists> read_associated(const fs::path& dir) {
  const Result<TextFile> file = TextFile::read((dir / "associated.txt").string());
  if (!file) return cannot_open(file.error());
  Lists lists;
  lists.paired = true;
  for (const TextLine& line : file->lines()) {
    const auto& words = line.words;
    const auto first = words.size() >= 4 ? parse_stamp(words[0]) : std::nullopt;
    const auto second = words.size() >= 4 ? parse_stamp(words[2]) : std::nullopt;
    if (!first || !second) {
      lists.unusable.push_back(bad_line(*file, line, "stamp file stamp file"));
      continue;
    }
    lists.depth.push_back({*first, std::string(words[1])});
    lists.colour.push_back({*second, std::string(words[3])});
    lists.position.push_back(lists.unusable.size());
  }
  if (lists.depth.empty())
    return cannot_open(file->path() + ": has no line 'stamp file stamp file': the recording is empty");
  const Column first = first_column(dir, lists);
  if (first == Column::unknown)
    return cannot_open(file->path() +
                       ": neither names nor images tell which column is depth (16-bit grey PNG)");
  if (first == Column::colour) std::swap(lists.depth, lists.colour);
  return lists;
}

Result<std::vector<StampedFile>> read_list(const fs::path& path, std::vector<FrameEntry>& unusable) {
  const Result<TextFile> file = TextFile::read(path.string());
  if (!file) return cannot_open(file.error());
  std::vector<StampedFile> images;
  for (const TextLine& line : file->lines()) {
    const auto stamp = line.words.size() >= 2 ? parse_stamp(line.words[0]) : std::nullopt;
    if (stamp)
      images.push_back({*stamp, std::string(line.words[1])});
    else
      unusable.push_back(bad_line(*file, line, "stamp file"));
  }
  if (images.empty()) return cannot_open(file->path() + ": has no line 'stamp file': the recording is empty");
  return images;
}

Result<Lists> read_lists(const fs::path& dir) {
  if (is_there(dir / "associated.txt")) return read_associated(dir);
  if (!is_there(dir / "depth.txt") || !is_there(dir / "rgb.txt"))
    return cannot_open(dir.string() + ": holds neither associated.txt nor depth.txt and rgb.txt");
  Lists lists;
  Result<std::vector<StampedFile>> depth = read_list(dir / "depth.txt", lists.unusable);
  if (!depth) return cannot_open(depth.error());
  Result<std::vector<StampedFile>> colour = read_list(dir / "rgb.txt", lists.unusable);
  if (!colour) return cannot_open(colour.error());
  lists.depth = std::move(*depth);
  lists.colour = std::move(*colour);
  return lists;
}

// --- frames
// --------------------------------------------------------------------------------------------------------

FrameEntry make_entry(const fs::path& dir, const StampedFile& depth, const StampedFile& colour) {
  FrameEntry entry;
  entry.depth_stamp = depth.stamp;
  entry.colour_stamp = colour.stamp;
  entry.depth_path = (dir / depth.path).string();
  entry.colour_path = (dir / colour.path).string();
  return entry;
}

/// Frames as the lines of associated.txt pair them, lines that cannot be understood in their places.
std::vector<FrameEntry> frames_as_written(const fs::path& dir, const Lists& lists) {
  std::vector<FrameEntry> entries;
  size_t unusable = 0;
  for (size_t i = 0; i < lists.depth.size(); ++i) {
    while (unusable < lists.position[i]) entries.push_back(lists.unusable[unusable++]);
    entries.push_back(make_entry(dir, lists.depth[i], lists.colour[i]));
  }
  while (unusable < lists.unusable.size()) entries.push_back(lists.unusable[unusable++]);
  return entries;
}

std::vector<Stamp> stamps_of(const std::vector<StampedFile>& files) {
  std::vector<Stamp> stamps;
  for (const StampedFile& file : files) stamps.push_back(file.stamp);
  return stamps;
}

Result<std::vector<FrameEntry>> paired_frames(const fs::path& dir, const Lists& lists,
                                              const DatasetOptions& options) {
  const auto pairs =
      pair_by_stamp(stamps_of(lists.depth), stamps_of(lists.colour), ns_of_ms(options.max_pair_ms));
  if (pairs.empty())
    return cannot_open(dir.string() + ": none of " + std::to_string(lists.depth.size()) + " depth and " +
                       std::to_string(lists.colour.size()) + " colour images lie within " +
                       stamp_label(Stamp{ns_of_ms(options.max_pair_ms)}) +
                       " s of each other; see --time-offset-ms");
  std::vector<FrameEntry> entries = lists.unusable;
  for (const auto& [depth, colour] : pairs)
    entries.push_back(make_entry(dir, lists.depth[depth], lists.colour[colour]));
  return entries;
}

Result<std::vector<FrameEntry>> read_frames(const fs::path& dir, const DatasetOptions& options) {
  Result<Lists> lists = read_lists(dir);
  if (!lists) return cannot_open(lists.error());
  const int64_t offset_ns = ns_of_ms(options.time_offset_ms);
  for (StampedFile& image : lists->colour) image.stamp.ns += offset_ns;
  if (lists->paired && offset_ns == 0) return frames_as_written(dir, *lists);
  return paired_frames(dir, *lists, options);
}

// --- truth
// ---------------------------------------------------------------------------------------------------------

struct TruePose {
  Stamp stamp;
  Se3d T_world_cam;
};

/// `stamp tx ty tz qx qy qz qw`; a line that is none is left out.
std::optional<TruePose> parse_pose(const TextLine& line) {
  if (line.words.size() < 8) return std::nullopt;
  const auto stamp = parse_stamp(line.words[0]);
  double n[7] = {};
  for (size_t i = 0; i < 7; ++i) {
    const auto number = parse_number(line.words[i + 1]);
    if (!number) return std::nullopt;
    n[i] = *number;
  }
  const Quatd q = {n[3], n[4], n[5], n[6]};
  const double length = std::sqrt(q.x * q.x + q.y * q.y + q.z * q.z + q.w * q.w);
  if (!stamp || !(length > 1e-3) || !std::isfinite(length)) return std::nullopt;
  return TruePose{*stamp, {rotation_from(q), {n[0], n[1], n[2]}}};
}

void add_truth(const fs::path& dir, std::vector<FrameEntry>& entries) {
  const Result<TextFile> file = TextFile::read((dir / "groundtruth.txt").string());
  if (!file) return;  // most recordings have none
  std::vector<TruePose> poses;
  for (const TextLine& line : file->lines())
    if (const auto pose = parse_pose(line)) poses.push_back(*pose);
  if (poses.empty()) return;
  std::stable_sort(poses.begin(), poses.end(),
                   [](const TruePose& a, const TruePose& b) { return a.stamp < b.stamp; });
  for (FrameEntry& entry : entries) {
    auto nearest = std::lower_bound(poses.begin(), poses.end(), entry.depth_stamp,
                                    [](const TruePose& pose, Stamp stamp) { return pose.stamp < stamp; });
    const auto distance = [&](auto at) { return std::abs(at->stamp.ns - entry.depth_stamp.ns); };
    if (nearest == poses.end() || (nearest != poses.begin() && distance(nearest - 1) < distance(nearest)))
      --nearest;
    if (distance(nearest) <= kMaxTruthNs) entry.truth_T_world_cam = nearest->T_world_cam;
  }
}

}  // namespace

Result<std::unique_ptr<FrameSource>> open_tum(const std::string& dir, const DatasetOptions& options) {
  std::error_code ignored;
  if (!fs::is_directory(dir, ignored)) return cannot_open(dir + ": there is no such folder");
  const bool finite =
      std::abs(options.time_offset_ms) <= 1e9 && options.max_pair_ms >= 0 && options.max_pair_ms <= 1e6;
  if (!finite)
    return Error{"time offset and pair distance must be finite numbers of ms", ErrorKind::bad_usage};
  const Result<DatasetCamera> camera = find_camera(dir, options, {std::nullopt, kDepthUnitsPerM});
  if (!camera) return Error{camera.error(), camera.error_kind()};
  Result<std::vector<FrameEntry>> entries = read_frames(dir, options);
  if (!entries) return Error{entries.error(), entries.error_kind()};
  add_truth(dir, *entries);
  return ImageFolderSource::open("tum:" + dir, std::move(*entries), *camera);
}

}  // namespace stillmap
