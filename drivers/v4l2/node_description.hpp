#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "config/result.hpp"
#include "drivers/v4l2/system_calls.hpp"

namespace stillmap {

/// An image size that a video node offers in one of its formats.
struct SizeOffer {
  int32_t cols = 0, rows = 0;
  int32_t max_cols = 0, max_rows = 0;  ///< larger than cols, rows: any size up to it
  double rate_hz = 0;                  ///< the highest; 0: it does not say

  bool holds(int32_t want_cols, int32_t want_rows) const {
    return want_cols >= cols && want_cols <= max_cols && want_rows >= rows && want_rows <= max_rows;
  }
};

struct FormatOffer {
  uint32_t format = 0;  ///< fourcc
  std::vector<SizeOffer> sizes;
};

/// What a video node says about itself.
struct NodeDescription {
  std::string path;
  std::string name;      ///< of the camera
  bool streams = false;  ///< images by memory-mapped buffers of one plane
  std::vector<FormatOffer> formats;

  const FormatOffer* find(uint32_t format) const;
};

/// Opens a node and asks what it offers; it may be in use by another program.
/// @return kind cannot_open: it is not there, is no video node, or may not be opened
/// @thread boot
Result<NodeDescription> describe_node(SystemCalls& calls, const std::string& path);
/// The same of a node that is open.
Result<NodeDescription> describe_open_node(SystemCalls& calls, int fd, const std::string& path);

/// Why a node could not be opened, and what to do.
Error open_problem(const std::string& path, int error_number);

/// "YUYV 640x480 at 30 Hz, 320x240 at 60 Hz": a line of each format that Stillmap can use, the names of the
/// rest in one.
std::string offers_text(const NodeDescription& node);
/// In one line, for `doctor`: "Xtion: depth Z16; colour YUYV MJPG".
std::string summary_text(const NodeDescription& node);

}  // namespace stillmap
