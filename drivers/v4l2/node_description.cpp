#include "drivers/v4l2/node_description.hpp"

#include <fmt/format.h>
#include <linux/videodev2.h>

#include <algorithm>
#include <cerrno>
#include <cstring>

#include "drivers/v4l2/pixel_format.hpp"

namespace stillmap {
namespace {

// A driver that never says that its list is over does not hold us.
constexpr uint32_t kMostFormats = 256, kMostSizes = 64, kMostIntervals = 64;

/// An open node that is closed with the scope.
struct OpenNode {
  SystemCalls& calls;
  int fd;
  ~OpenNode() {
    if (fd >= 0) calls.close(fd);
  }
};

double rate_of(const v4l2_fract& interval) {
  return interval.numerator > 0 ? static_cast<double>(interval.denominator) / interval.numerator : 0;
}

double highest_rate(SystemCalls& calls, int fd, uint32_t format, uint32_t cols, uint32_t rows) {
  double highest = 0;
  for (uint32_t i = 0; i < kMostIntervals; ++i) {
    v4l2_frmivalenum interval{};
    interval.index = i;
    interval.pixel_format = format;
    interval.width = cols;
    interval.height = rows;
    if (calls.control(fd, VIDIOC_ENUM_FRAMEINTERVALS, &interval) < 0) break;
    if (interval.type != V4L2_FRMIVAL_TYPE_DISCRETE) return rate_of(interval.stepwise.min);
    highest = std::max(highest, rate_of(interval.discrete));
  }
  return highest;
}

int32_t side(uint32_t pixels) {
  return static_cast<int32_t>(std::min<uint32_t>(pixels, 1u << 20));
}

std::vector<SizeOffer> sizes_of(SystemCalls& calls, int fd, uint32_t format) {
  std::vector<SizeOffer> sizes;
  for (uint32_t i = 0; i < kMostSizes; ++i) {
    v4l2_frmsizeenum size{};
    size.index = i;
    size.pixel_format = format;
    if (calls.control(fd, VIDIOC_ENUM_FRAMESIZES, &size) < 0) break;
    if (size.type == V4L2_FRMSIZE_TYPE_DISCRETE) {
      const int32_t cols = side(size.discrete.width), rows = side(size.discrete.height);
      sizes.push_back({cols, rows, cols, rows,
                       highest_rate(calls, fd, format, size.discrete.width, size.discrete.height)});
      continue;
    }
    const v4l2_frmsize_stepwise& step = size.stepwise;
    sizes.push_back({side(step.min_width), side(step.min_height), side(step.max_width), side(step.max_height),
                     highest_rate(calls, fd, format, step.max_width, step.max_height)});
    break;
  }
  return sizes;
}

bool is_usable(uint32_t format) {
  for (const ImageKind kind : {ImageKind::depth, ImageKind::colour})
    for (const uint32_t known : formats_of(kind))
      if (known == format) return true;
  return false;
}

std::string size_text(const SizeOffer& size) {
  std::string text = fmt::format("{}x{}", size.cols, size.rows);
  if (size.max_cols > size.cols || size.max_rows > size.rows)
    text += fmt::format(" to {}x{}", size.max_cols, size.max_rows);
  if (size.rate_hz > 0) text += fmt::format(" at {:.3g} Hz", size.rate_hz);
  return text;
}

/// What a node's fixed-size text holds, which need not end in a zero.
template <size_t N>
std::string bounded_text(const uint8_t (&text)[N]) {
  const auto* const begin = reinterpret_cast<const char*>(text);
  return {begin, strnlen(begin, N)};
}

}  // namespace

const FormatOffer* NodeDescription::find(uint32_t format) const {
  for (const FormatOffer& offer : formats)
    if (offer.format == format) return &offer;
  return nullptr;
}

Error open_problem(const std::string& path, int error_number) {
  const char* what = "v4l2-ctl --list-devices shows what there is";
  if (error_number == EACCES || error_number == EPERM)
    what = "sudo usermod -aG video $USER, and log in again";
  if (error_number == EBUSY) what = "another program uses it; `fuser -v` names it";
  return {fmt::format("{}: {}; {}", path, std::strerror(error_number), what), ErrorKind::cannot_open};
}

Result<NodeDescription> describe_open_node(SystemCalls& calls, int fd, const std::string& path) {
  v4l2_capability capability{};
  if (calls.control(fd, VIDIOC_QUERYCAP, &capability) < 0)
    return Error{path + " is no video node; v4l2-ctl --list-devices shows what there is",
                 ErrorKind::cannot_open};
  const uint32_t can =
      capability.capabilities & V4L2_CAP_DEVICE_CAPS ? capability.device_caps : capability.capabilities;
  NodeDescription node;
  node.path = path;
  node.name = bounded_text(capability.card);
  node.streams = (can & V4L2_CAP_VIDEO_CAPTURE) && (can & V4L2_CAP_STREAMING);
  if (!node.streams) return node;
  for (uint32_t i = 0; i < kMostFormats; ++i) {
    v4l2_fmtdesc format{};
    format.index = i;
    format.type = V4L2_BUF_TYPE_VIDEO_CAPTURE;
    if (calls.control(fd, VIDIOC_ENUM_FMT, &format) < 0) break;
    FormatOffer offer{format.pixelformat, {}};
    if (is_usable(offer.format)) offer.sizes = sizes_of(calls, fd, offer.format);
    node.formats.push_back(std::move(offer));
  }
  return node;
}

Result<NodeDescription> describe_node(SystemCalls& calls, const std::string& path) {
  const OpenNode node{calls, calls.open(path.c_str())};
  if (node.fd < 0) return open_problem(path, errno);
  return describe_open_node(calls, node.fd, path);
}

std::string offers_text(const NodeDescription& node) {
  std::string text, others;
  for (const FormatOffer& offer : node.formats) {
    if (!is_usable(offer.format)) {
      others += fmt::format("{}{}", others.empty() ? "" : ", ", fourcc_text(offer.format));
      continue;
    }
    text += fmt::format("\n  {:<5}", fourcc_text(offer.format));
    for (size_t i = 0; i < offer.sizes.size(); ++i)
      text += fmt::format("{}{}", i == 0 ? "" : ", ", size_text(offer.sizes[i]));
    if (offer.sizes.empty()) text += "sizes not said";
  }
  if (!others.empty()) text += "\n  of no use: " + others;
  return text.empty() ? "\n  nothing" : text;
}

std::string summary_text(const NodeDescription& node) {
  if (!node.streams) return node.name + ": sends no images";
  std::string text = node.name;
  for (const ImageKind kind : {ImageKind::depth, ImageKind::colour}) {
    std::string names;
    for (const uint32_t format : formats_of(kind))
      if (node.find(format)) names += fmt::format(" {}", fourcc_text(format));
    if (!names.empty()) text += fmt::format("; {}{}", kind == ImageKind::depth ? "depth" : "colour", names);
  }
  return text;
}

}  // namespace stillmap
