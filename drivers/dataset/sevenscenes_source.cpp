#include "drivers/dataset/sevenscenes_source.hpp"

#include <charconv>
#include <cmath>
#include <filesystem>
#include <map>

#include "drivers/dataset/image_folder.hpp"
#include "drivers/dataset/intrinsics.hpp"
#include "drivers/dataset/text.hpp"

namespace stillmap {
namespace {

namespace fs = std::filesystem;

constexpr float kDepthUnitsPerM = 1000;
constexpr CameraModel kCamera = {{585, 585, 320, 240, 0, 0}, {}};

/// The files of one number; empty where missing.
struct FrameFiles {
  std::string stem;  ///< "frame-000123"
  std::string depth, colour_png, colour_jpg;
};

struct FileName {
  int64_t number;
  std::string stem, kind;  ///< "frame-000123", ".depth.png"
};

std::optional<FileName> parse_name(const std::string& name) {
  constexpr std::string_view kPrefix = "frame-";
  constexpr ptrdiff_t kMaxDigits = 9;
  if (!name.starts_with(kPrefix)) return std::nullopt;
  int64_t number = 0;
  const char* const begin = name.data() + kPrefix.size();
  const auto [end, error] = std::from_chars(begin, name.data() + name.size(), number);
  if (error != std::errc() || number < 0 || end - begin > kMaxDigits) return std::nullopt;
  return FileName{number, std::string(name.data(), end), std::string(end, name.data() + name.size())};
}

Result<std::map<int64_t, FrameFiles>> list_frames(const std::string& dir) {
  std::map<int64_t, FrameFiles> frames;
  std::error_code failed;
  for (fs::directory_iterator at(dir, failed), end; !failed && at != end; at.increment(failed)) {
    const auto name = parse_name(at->path().filename().string());
    if (!name) continue;
    const auto put = [&](std::string FrameFiles::*which) {
      FrameFiles& frame = frames[name->number];
      frame.stem = name->stem;
      frame.*which = at->path().string();
    };
    if (name->kind == ".depth.png") put(&FrameFiles::depth);
    if (name->kind == ".color.png") put(&FrameFiles::colour_png);
    if (name->kind == ".color.jpg") put(&FrameFiles::colour_jpg);
  }
  if (failed) return Error{dir + ": cannot be read: " + failed.message(), ErrorKind::cannot_open};
  if (frames.empty())
    return Error{dir + ": holds no frame-NNNNNN.depth.png: expected the layout of 7-Scenes",
                 ErrorKind::cannot_open};
  return frames;
}

bool is_rotation(const Mat3T<double>& r) {
  constexpr double kTolerance = 1e-2;  // of recordings that were written with few digits
  const Mat3T<double> should_be_one = r * transposed(r);
  for (int row = 0; row < 3; ++row)
    for (int col = 0; col < 3; ++col)
      if (!(std::abs(should_be_one(row, col) - (row == col ? 1 : 0)) < kTolerance)) return false;
  const Vec3d x = {r(0, 0), r(1, 0), r(2, 0)}, y = {r(0, 1), r(1, 1), r(2, 1)},
              z = {r(0, 2), r(1, 2), r(2, 2)};
  return dot(cross(x, y), z) > 0;
}

/// 4x4, row by row, camera to world. Lost frames of a recording hold NaN: no truth.
std::optional<Se3d> read_pose(const std::string& path) {
  const Result<TextFile> file = TextFile::read(path);
  if (!file) return std::nullopt;
  std::vector<double> m;
  for (const TextLine& line : file->lines())
    for (const std::string_view word : line.words) {
      const auto number = parse_number(word);
      if (!number || m.size() == 16) return std::nullopt;
      m.push_back(*number);
    }
  if (m.size() != 16) return std::nullopt;
  const Mat3T<double> rotation = {{m[0], m[1], m[2], m[4], m[5], m[6], m[8], m[9], m[10]}};
  if (!is_rotation(rotation)) return std::nullopt;
  return Se3d{orthonormalized(rotation), {m[3], m[7], m[11]}};
}

FrameEntry make_entry(const std::string& dir, int64_t number, const FrameFiles& files, int64_t offset_ns) {
  FrameEntry entry;
  entry.depth_stamp = sevenscenes_stamp(number);
  entry.colour_stamp = {entry.depth_stamp.ns + offset_ns};
  entry.depth_path = files.depth;
  entry.colour_path = files.colour_png.empty() ? files.colour_jpg : files.colour_png;
  const std::string stem = (fs::path(dir) / files.stem).string();
  if (entry.depth_path.empty()) entry.problem = stem + ".depth.png: is missing";
  if (entry.colour_path.empty()) entry.problem = stem + ".color.png or .color.jpg: is missing";
  entry.truth_T_world_cam = read_pose(stem + ".pose.txt");
  return entry;
}

}  // namespace

Stamp sevenscenes_stamp(int64_t number) {
  constexpr int64_t kThirdOfTenthNs = 100000000;  // 1e9 ns / 30 = 1e8 ns / 3
  return {(number * kThirdOfTenthNs + 1) / 3};    // + 1: to nearest
}

Result<std::unique_ptr<FrameSource>> open_sevenscenes(const std::string& dir, const DatasetOptions& options) {
  std::error_code ignored;
  if (!fs::is_directory(dir, ignored))
    return Error{dir + ": there is no such folder", ErrorKind::cannot_open};
  if (!(std::abs(options.time_offset_ms) <= 1e9))
    return Error{"the time offset must be a finite number of ms", ErrorKind::bad_usage};
  const Result<DatasetCamera> camera = find_camera(dir, options, {kCamera, kDepthUnitsPerM});
  if (!camera) return Error{camera.error(), camera.error_kind()};
  const Result<std::map<int64_t, FrameFiles>> frames = list_frames(dir);
  if (!frames) return Error{frames.error(), frames.error_kind()};
  const int64_t offset_ns = std::llround(options.time_offset_ms * 1e6);
  std::vector<FrameEntry> entries;
  for (const auto& [number, files] : *frames) entries.push_back(make_entry(dir, number, files, offset_ns));
  return ImageFolderSource::open("sevenscenes:" + dir, std::move(entries), *camera);
}

}  // namespace stillmap
