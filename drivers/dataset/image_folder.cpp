#include "drivers/dataset/image_folder.hpp"

#include <algorithm>
#include <limits>

#include "config/validate.hpp"
#include "drivers/dataset/text.hpp"
#include "runtime/image/image_file.hpp"

namespace stillmap {
namespace {

/// A single stamp that lies ahead of both frames behind it is wrong itself; taken as it is, it would turn the
/// whole rest of the recording into jumps back.
bool is_stray(Stamp last, Stamp stamp, Stamp following, Stamp after_that) {
  return last < following && following < stamp && last < after_that && after_that < stamp;
}

void mark_stamps_that_do_not_rise(std::vector<FrameEntry>& entries) {
  std::vector<FrameEntry*> usable;
  for (FrameEntry& entry : entries)
    if (entry.problem.empty()) usable.push_back(&entry);
  const FrameEntry* last = nullptr;
  for (size_t i = 0; i < usable.size(); ++i) {
    FrameEntry& entry = *usable[i];
    const std::string what = entry.depth_path + ": stamp " + stamp_label(entry.depth_stamp);
    if (last && entry.depth_stamp <= last->depth_stamp) {
      entry.problem = what + " jumps back: expected more than " + stamp_label(last->depth_stamp);
      continue;
    }
    const Stamp before = last ? last->depth_stamp : Stamp{std::numeric_limits<int64_t>::min()};
    if (i + 2 < usable.size() &&
        is_stray(before, entry.depth_stamp, usable[i + 1]->depth_stamp, usable[i + 2]->depth_stamp)) {
      entry.problem = what + " lies ahead of the frames that follow it";
      continue;
    }
    last = &entry;
  }
}

/// Size of the first depth image that can be read.
Result<ImageInfo> find_size(const std::string& name, const std::vector<FrameEntry>& entries) {
  std::string first_problem;
  for (const FrameEntry& entry : entries) {
    std::string problem = entry.problem;
    if (problem.empty()) {
      const Result<ImageInfo> info = image_info(entry.depth_path);
      if (info && info->bits == 16 && info->grey) return info;
      problem = info ? entry.depth_path + ": expected a depth image of 16-bit grey (PNG)" : info.error();
    }
    if (first_problem.empty()) first_problem = problem;
  }
  return Error{
      name + ": no depth image can be read" + (first_problem.empty() ? "" : "; the first: " + first_problem),
      ErrorKind::cannot_open};
}

}  // namespace

Result<std::unique_ptr<FrameSource>> ImageFolderSource::open(std::string name,
                                                             std::vector<FrameEntry> entries,
                                                             const DatasetCamera& camera) {
  mark_stamps_that_do_not_rise(entries);
  const Result<ImageInfo> size = find_size(name, entries);
  if (!size) return Error{size.error(), size.error_kind()};

  auto source = std::make_unique<ImageFolderSource>();
  source->info_.name = std::move(name);
  source->info_.camera = camera.model;
  source->info_.camera.k.width = size->cols;
  source->info_.camera.k.height = size->rows;
  source->info_.depth_units_per_m = camera.depth_units_per_m;
  source->info_.depth_bias = camera.depth_bias;
  source->info_.depth_camera = camera.depth_camera;
  source->info_.frames = static_cast<int64_t>(entries.size());
  source->entries_ = std::move(entries);
  if (const std::string problem = camera_problem(source->info_.camera); !problem.empty())
    return Error{camera.origin + ": " + problem, ErrorKind::bad_usage};
  return std::unique_ptr<FrameSource>(std::move(source));
}

Status ImageFolderSource::next(RgbdFrame& frame, int32_t /*timeout_ms*/) {
  if (next_ >= entries_.size()) return Status::end;
  frame.sequence = static_cast<uint32_t>(next_);
  const FrameEntry& entry = entries_[next_++];
  frame.depth_stamp = entry.depth_stamp;
  frame.colour_stamp = entry.colour_stamp;
  frame.truth_T_world_cam = entry.truth_T_world_cam;
  if (!entry.problem.empty()) return passed_over(entry.problem);
  if (const Result<Done> depth = read_png16(entry.depth_path, frame.depth_raw); !depth)
    return passed_over(depth.error());
  if (const Result<Done> colour = read_colour(entry.colour_path, frame.colour); !colour)
    return passed_over(colour.error());
  error_.clear();
  return Status::ok;
}

void ImageFolderSource::skip(uint32_t count) {
  next_ = std::min(next_ + count, entries_.size());
}

Status ImageFolderSource::passed_over(std::string why) {
  error_ = std::move(why);
  return Status::bad_data;
}

}  // namespace stillmap
