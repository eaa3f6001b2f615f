#include <algorithm>
#include <cmath>

#include <fmt/format.h>

#include "runtime/evaluate/trajectory.hpp"
#include "runtime/picture/painters.hpp"
#include "runtime/picture/run_data.hpp"

namespace stillmap {
namespace {

constexpr std::size_t kMaxFrames = 8;
constexpr double kGap_px = 10, kHead_px = 76, kCaption_px = 26;
constexpr Rgb8 kMaskColour = {235, 30, 40};

bool masked(const Picture& mask, int32_t row, int32_t col) {
  return row >= 0 && col >= 0 && row < mask.height && col < mask.width && mask.at(row, col).r >= 128;
}

/// Translucent red where the mask is set, solid along its rim.
void draw_mask(Picture& picture, const Picture& mask) {
  const int32_t rim = std::max(1, picture.width / 213);
  for (int32_t row = 0; row < picture.height; ++row)
    for (int32_t col = 0; col < picture.width; ++col) {
      if (!masked(mask, row, col)) continue;
      const bool inside = masked(mask, row - rim, col) && masked(mask, row + rim, col) &&
                          masked(mask, row, col - rim) && masked(mask, row, col + rim);
      Rgb8& p = picture.at(row, col);
      if (!inside)
        p = kMaskColour;
      else
        p = {static_cast<uint8_t>((p.r * 55 + kMaskColour.r * 45) / 100),
             static_cast<uint8_t>((p.g * 55 + kMaskColour.g * 45) / 100),
             static_cast<uint8_t>((p.b * 55 + kMaskColour.b * 45) / 100)};
    }
}

/// At most kMaxFrames, evenly over the run.
std::vector<Snapshot> chosen(std::vector<Snapshot> snapshots) {
  if (snapshots.size() <= kMaxFrames) return snapshots;
  std::vector<Snapshot> some;
  for (std::size_t i = 0; i < kMaxFrames; ++i)
    some.push_back(snapshots[i * (snapshots.size() - 1) / (kMaxFrames - 1)]);
  return some;
}

/// Colour with mask, and the map's view, side by side in `cell`.
std::optional<Error> draw_snapshot(Canvas& canvas, const Snapshot& snapshot, const Rect& cell, double width,
                                   double height) {
  Result<Picture> colour = read_picture(snapshot.colour);
  if (!colour) return Error{colour.error()};
  if (!snapshot.mask.empty()) {
    const Result<Picture> mask = read_picture(snapshot.mask);
    if (!mask) return Error{mask.error()};
    if (mask->width != colour->width || mask->height != colour->height)
      return Error{fmt::format("{}: {} x {} pixels; expected {} x {} as the colour image", snapshot.mask,
                               mask->width, mask->height, colour->width, colour->height)};
    draw_mask(*colour, *mask);
  }
  canvas.image(*colour, {cell.x, cell.y, width, height});
  const Rect map_at = {cell.x + width + 4, cell.y, width, height};
  if (snapshot.map.empty()) {
    canvas.fill(map_at, kGrid);
    canvas.text({map_at.x + width / 2, map_at.y + height / 2}, "no view of the map", {14, Align::centre});
    return std::nullopt;
  }
  const Result<Picture> map = read_picture(snapshot.map);
  if (!map) return Error{map.error()};
  canvas.image(*map, map_at);
  return std::nullopt;
}

}  // namespace

Painted paint_frames(const RunInputs& inputs) {
  const std::vector<Snapshot> snapshots = chosen(find_snapshots(inputs.path("snapshots")));
  if (snapshots.empty()) return Missing{inputs.path("snapshots") + " holds no STAMP_colour.png"};
  const Result<Picture> first = read_picture(snapshots.front().colour);
  if (!first) return Error{first.error()};
  const std::size_t columns = snapshots.size() == 1 ? 1 : 2;
  const std::size_t rows = (snapshots.size() + columns - 1) / columns;
  const double cell_width =
      (kPageWidth_px - kGap_px * static_cast<double>(columns + 1)) / static_cast<double>(columns);
  const double width = (cell_width - 4) / 2;
  const double ratio = std::clamp(static_cast<double>(first->height) / first->width, 0.2, 3.0);
  const double height = std::round(width * ratio);
  const double cell_height = height + kCaption_px + kGap_px;
  Canvas canvas(kPageWidth_px, static_cast<int>(kHead_px + cell_height * static_cast<double>(rows)));
  canvas.text({kGap_px, 32}, "What moves, and what stands still", {20, Align::left, true});
  canvas.text({kGap_px, 58},
              "left: camera image, dynamic pixels in red; right: the still map reprojected to the same view",
              {15});
  const std::optional<Stamp> start = parse_stamp(snapshots.front().stamp);
  for (std::size_t i = 0; i < snapshots.size(); ++i) {
    const Rect cell = {kGap_px + (cell_width + kGap_px) * static_cast<double>(i % columns),
                       kHead_px + cell_height * static_cast<double>(i / columns), cell_width, cell_height};
    if (const auto error = draw_snapshot(canvas, snapshots[i], cell, width, height)) return *error;
    const std::optional<Stamp> stamp = parse_stamp(snapshots[i].stamp);
    const double after_s = start && stamp ? static_cast<double>(stamp->ns - start->ns) * 1e-9 : 0;
    canvas.text({cell.x, cell.y + height + 18}, fmt::format("{} s (+{:.2f} s)", snapshots[i].stamp, after_s),
                {13});
  }
  return canvas;
}

}  // namespace stillmap
