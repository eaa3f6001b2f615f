#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <cstdio>
#include <memory>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "drivers/registry.hpp"
#include "firmware-like/commands/command.hpp"
#include "firmware-like/commands/common.hpp"
#include "firmware-like/commands/stop_signal.hpp"
#include "runtime/image/image_file.hpp"
#include "runtime/record/output_file.hpp"
#include "runtime/record/ply_writer.hpp"
#include "runtime/record/run_folder.hpp"
#include "runtime/record/trajectory_writer.hpp"

namespace stillmap {
namespace {

struct RenderOptions {
  std::string source, out;
};

/// camera.toml as `tum:` reads it.
std::string camera_toml(const SourceInfo& info) {
  const Intrinsics& k = info.camera.k;
  const Distortion& d = info.camera.distortion;
  return fmt::format(
      "# {}\nfx = {:#}\nfy = {:#}\ncx = {:#}\ncy = {:#}\ndistortion = [{:#}, {:#}, {:#}, {:#}, {:#}]   # k1 "
      "k2 p1 p2 k3\n"
      "depth_scale = {:#}   # units per metre\n",
      info.name, k.fx, k.fy, k.cx, k.cy, d.k1, d.k2, d.p1, d.p2, d.k3, info.depth_units_per_m);
}

/// A TUM folder that is being written.
class TumFolder {
 public:
  /// @return empty, or the error
  std::string open(const RunFolder& folder, const SourceInfo& info) {
    folder_ = &folder;
    masks_ = info.has_truth_mask;
    for (const char* name : {"rgb", "depth", "masks_truth"})
      if (std::string error = folder.make(name); !error.empty()) return error;
    if (std::string error = write_whole_file(folder.path("camera.toml"), camera_toml(info)); !error.empty())
      return error;
    for (const char* name : {"rgb.txt", "depth.txt", "associated.txt", "groundtruth.txt"}) {
      auto file = OutputFile::create(folder.path(name), OutputFile::Kind::stream);
      if (!file) return file.error();
      files_.push_back(std::move(*file));
    }
    return {};
  }

  std::string add(const RgbdFrame& f) {
    const std::string depth_stamp = file_stamp(f.depth_stamp), colour_stamp = file_stamp(f.colour_stamp);
    const std::string depth = "depth/" + depth_stamp + ".png", colour = "rgb/" + colour_stamp + ".png";
    if (const auto done = write_png(folder_->path(colour), f.colour); !done) return done.error();
    if (const auto done = write_png16(folder_->path(depth), f.depth_raw); !done) return done.error();
    if (masks_)
      if (const auto done =
              write_png_grey(folder_->path("masks_truth/" + depth_stamp + ".png"), f.truth_mask);
          !done)
        return done.error();
    files_[0].write(colour_stamp + " " + colour + "\n");
    files_[1].write(depth_stamp + " " + depth + "\n");
    files_[2].write(fmt::format("{} {} {} {}\n", colour_stamp, colour, depth_stamp, depth));
    if (f.truth_T_world_cam) files_[3].write(tum_line(f.depth_stamp, *f.truth_T_world_cam));
    return error();
  }

  std::string close() {
    for (OutputFile& file : files_) file.close();
    return error();
  }

 private:
  std::string error() const {
    for (const OutputFile& file : files_)
      if (file.failed()) return file.error();
    return {};
  }

  const RunFolder* folder_ = nullptr;
  bool masks_ = false;
  std::vector<OutputFile> files_;
};

int render(const RenderOptions& o) {
  catch_stop_signals();
  if (o.source.rfind("synthetic:", 0) != 0)
    return fail("--source " + o.source + ": only synthetic:SCENE can be rendered", ErrorKind::bad_usage);
  auto source = open_source(o.source, {});
  if (!source) return fail(source.error(), source.error_kind());
  const SourceInfo& info = (*source)->info();
  constexpr int32_t kKeepPrevious = 0;
  const auto folder = RunFolder::open(o.out, kKeepPrevious);
  if (!folder) return fail(folder.error(), ErrorKind::failed);
  TumFolder tum;
  if (const std::string error = tum.open(*folder, info); !error.empty())
    return fail(error, ErrorKind::failed);

  FrameSlot slot(info);
  int64_t frames = 0;
  while (!stop_requested() && (*source)->next(slot.frame(), 0) == Status::ok) {
    if (const std::string error = tum.add(slot.frame()); !error.empty())
      return fail(error, ErrorKind::failed);
    ++frames;
  }
  if (const std::string error = tum.close(); !error.empty()) return fail(error, ErrorKind::failed);
  if (const std::string error = write_point_cloud(folder->path("truth_cloud.ply"), (*source)->truth_cloud());
      !error.empty())
    return fail(error, ErrorKind::failed);
  fmt::print("{} frames in {}; `stillmap run --source tum:{}` maps them\n", frames, o.out, o.out);
  return kExitDone;
}

}  // namespace

void add_render(CLI::App& app, int& exit_code) {
  CLI::App* command = app.add_subcommand("render", "a synthetic scene as a TUM folder, with truth");
  auto options = std::make_shared<RenderOptions>();
  command->add_option("--source", options->source, "synthetic:SCENE[,seed=N][,size=WxH][,seconds=S]")
      ->required();
  command->add_option("--out", options->out, "folder, made if missing")->required();
  command->callback([options, &exit_code] { exit_code = render(*options); });
}

}  // namespace stillmap
