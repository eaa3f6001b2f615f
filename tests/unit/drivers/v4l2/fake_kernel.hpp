#pragma once

#include <fcntl.h>
#include <linux/videodev2.h>
#include <poll.h>

#include <cerrno>
#include <cstring>
#include <deque>
#include <functional>
#include <map>
#include <string>
#include <vector>

#include "drivers/v4l2/pixel_format.hpp"
#include "drivers/v4l2/system_calls.hpp"

namespace stillmap::test {

/// Video nodes as the kernel would show them, with everything that can go wrong. Nothing comes unless a test
/// sends it.
class FakeKernel final : public SystemCalls {
 public:
  struct Format {
    uint32_t fourcc = 0;
    int32_t cols = 640, rows = 480;  ///< the only size
    double rate_hz = 30;             ///< the highest
  };
  struct Filled {
    uint32_t index = 0, bytes = 0, flags = 0, sequence = 0;
    int64_t stamp_ns = 0;
  };
  struct Node {
    // what it is
    std::vector<Format> formats;
    uint32_t capabilities = V4L2_CAP_VIDEO_CAPTURE | V4L2_CAP_STREAMING;
    bool sets_rate = true;
    uint32_t buffers = 8;  ///< that it gives
    uint32_t stamp_flags = V4L2_BUF_FLAG_TIMESTAMP_MONOTONIC;
    uint32_t padding = 0;  ///< bytes behind each row
    std::map<uint32_t, int32_t> controls;
    // what goes wrong
    std::map<unsigned long, int> fails;                   ///< request, errno; 0 is open
    std::function<void(v4l2_pix_format&)> change_format;  ///< what S_FMT answers
    bool map_fails = false;
    uint32_t buffer_bytes = 0;  ///< instead of what an image needs
    uint32_t wrong_index = 0;   ///< added to the number of a filled buffer
    short trouble = 0;          ///< reported by poll
    // its state
    v4l2_pix_format current{};
    double rate_hz = 15;
    bool sending = false;
    uint32_t sequence = 0;
    std::vector<std::vector<uint8_t>> memory;
    std::vector<uint32_t> empty;  ///< buffers that the node has
    std::deque<Filled> filled;
  };

  std::map<std::string, Node> nodes;
  std::deque<std::function<void()>> on_poll;  ///< the first is done, and forgotten, whenever somebody waits
  int open_files = 0, mapped = 0;

  /// An image comes: `pixel` in every byte, or `data`. Nobody's buffer is free: it is lost.
  void send(const std::string& path, int64_t stamp_ns, uint8_t pixel, uint32_t flags = 0) {
    Node& node = nodes[path];
    send(path, stamp_ns, std::vector<uint8_t>(node.current.sizeimage, pixel), flags);
  }
  void send(const std::string& path, int64_t stamp_ns, const std::vector<uint8_t>& data, uint32_t flags = 0) {
    Node& node = nodes[path];
    const uint32_t sequence = node.sequence++;
    if (!node.sending || node.empty.empty()) return;
    const uint32_t index = node.empty.front();
    node.empty.erase(node.empty.begin());
    std::memcpy(node.memory[index].data(), data.data(), std::min(data.size(), node.memory[index].size()));
    node.filled.push_back(
        {index, static_cast<uint32_t>(data.size()), flags | node.stamp_flags, sequence, stamp_ns});
  }

  int open(const char* path) override {
    const auto node = nodes.find(path);
    if (node == nodes.end()) return failed(ENOENT);
    if (node->second.fails.contains(0)) return failed(node->second.fails[0]);
    ++open_files;
    paths_.push_back(path);
    return kFirst + static_cast<int>(paths_.size()) - 1;
  }
  int close(int fd) override {
    Node& node = of(fd);
    node.sending = false;
    node.memory.clear();
    node.empty.clear();
    node.filled.clear();
    --open_files;
    return 0;
  }
  void* map(int fd, size_t, int64_t offset) override {
    if (of(fd).map_fails) return errno = ENOMEM, nullptr;
    ++mapped;
    return of(fd).memory[static_cast<size_t>(offset)].data();
  }
  int unmap(void*, size_t) override {
    --mapped;
    return 0;
  }
  int poll(pollfd* fds, uint32_t count, int32_t timeout_ms) override {
    if (!on_poll.empty()) {
      const auto happens = std::move(on_poll.front());
      on_poll.pop_front();
      happens();
    }
    int ready = 0;
    pollfd others[8];
    uint32_t other_count = 0;
    for (uint32_t i = 0; i < count; ++i) {
      if (fds[i].fd < kFirst) {
        others[other_count++] = fds[i];
        continue;
      }
      const Node& node = of(fds[i].fd);
      fds[i].revents = static_cast<short>((node.filled.empty() ? 0 : POLLIN) | node.trouble);
      ready += fds[i].revents != 0;
    }
    return ready > 0 || !on_poll.empty() ? ready : ::poll(others, other_count, timeout_ms);
  }

  int control(int fd, unsigned long request, void* argument) override {
    Node& node = of(fd);
    if (node.fails.contains(request)) return failed(node.fails[request]);
    switch (request) {
      case VIDIOC_QUERYCAP:
        return query(node, *static_cast<v4l2_capability*>(argument));
      case VIDIOC_ENUM_FMT:
        return format_at(node, *static_cast<v4l2_fmtdesc*>(argument));
      case VIDIOC_ENUM_FRAMESIZES:
        return size_at(node, *static_cast<v4l2_frmsizeenum*>(argument));
      case VIDIOC_ENUM_FRAMEINTERVALS:
        return interval_at(node, *static_cast<v4l2_frmivalenum*>(argument));
      case VIDIOC_S_FMT:
        return set_format(node, static_cast<v4l2_format*>(argument)->fmt.pix);
      case VIDIOC_G_PARM:
      case VIDIOC_S_PARM:
        return rate(node, *static_cast<v4l2_streamparm*>(argument), request == VIDIOC_S_PARM);
      case VIDIOC_S_CTRL: {
        const auto* const control = static_cast<v4l2_control*>(argument);
        if (!node.controls.contains(control->id)) return failed(EINVAL);
        node.controls[control->id] = control->value;
        return 0;
      }
      case VIDIOC_REQBUFS: {
        auto& wanted = *static_cast<v4l2_requestbuffers*>(argument);
        wanted.count = std::min(wanted.count, node.buffers);
        node.memory.assign(wanted.count, std::vector<uint8_t>(bytes_of(node)));
        return 0;
      }
      case VIDIOC_QUERYBUF: {
        auto& buffer = *static_cast<v4l2_buffer*>(argument);
        buffer.length = bytes_of(node);
        buffer.m.offset = buffer.index;
        return 0;
      }
      case VIDIOC_QBUF:
        node.empty.push_back(static_cast<v4l2_buffer*>(argument)->index);
        return 0;
      case VIDIOC_DQBUF:
        return dequeue(node, *static_cast<v4l2_buffer*>(argument));
      case VIDIOC_STREAMON:
      case VIDIOC_STREAMOFF:
        node.sending = request == VIDIOC_STREAMON;
        return 0;
      default:
        return failed(ENOTTY);
    }
  }

 private:
  static constexpr int kFirst = 100000;

  Node& of(int fd) { return nodes[paths_[static_cast<size_t>(fd - kFirst)]]; }
  static int failed(int error) {
    errno = error;
    return -1;
  }
  static uint32_t bytes_of(const Node& node) {
    return node.buffer_bytes > 0 ? node.buffer_bytes : node.current.sizeimage;
  }
  static v4l2_fract interval_of(double rate_hz) { return {1000, static_cast<uint32_t>(1000 * rate_hz)}; }

  int query(const Node& node, v4l2_capability& answer) {
    std::strcpy(reinterpret_cast<char*>(answer.card), "a camera");
    answer.capabilities = V4L2_CAP_DEVICE_CAPS;
    answer.device_caps = node.capabilities;
    return 0;
  }
  int format_at(const Node& node, v4l2_fmtdesc& answer) {
    if (answer.index >= node.formats.size()) return failed(EINVAL);
    answer.pixelformat = node.formats[answer.index].fourcc;
    return 0;
  }
  static const Format* find(const Node& node, uint32_t fourcc) {
    for (const Format& format : node.formats)
      if (format.fourcc == fourcc) return &format;
    return nullptr;
  }
  int size_at(const Node& node, v4l2_frmsizeenum& answer) {
    const Format* const format = find(node, answer.pixel_format);
    if (!format || answer.index > 0) return failed(EINVAL);
    answer.type = V4L2_FRMSIZE_TYPE_DISCRETE;
    answer.discrete = {static_cast<uint32_t>(format->cols), static_cast<uint32_t>(format->rows)};
    return 0;
  }
  int interval_at(const Node& node, v4l2_frmivalenum& answer) {
    const Format* const format = find(node, answer.pixel_format);
    if (!format || answer.index > 0) return failed(EINVAL);
    answer.type = V4L2_FRMIVAL_TYPE_DISCRETE;
    answer.discrete = interval_of(format->rate_hz);
    return 0;
  }
  int set_format(Node& node, v4l2_pix_format& pix) {
    const Format* const format = find(node, pix.pixelformat);
    const Format& given = format ? *format : node.formats.at(0);
    pix.pixelformat = given.fourcc;
    pix.width = static_cast<uint32_t>(given.cols);
    pix.height = static_cast<uint32_t>(given.rows);
    pix.field = V4L2_FIELD_NONE;
    const uint32_t pixel = bytes_per_pixel(given.fourcc);
    pix.bytesperline = pixel > 0 ? pixel * pix.width + node.padding : 0;
    pix.sizeimage = pixel > 0 ? pix.bytesperline * pix.height : pix.width * pix.height;
    if (node.change_format) node.change_format(pix);
    node.current = pix;
    return 0;
  }
  int rate(Node& node, v4l2_streamparm& parameters, bool set) {
    auto& capture = parameters.parm.capture;
    capture.capability = node.sets_rate ? V4L2_CAP_TIMEPERFRAME : 0;
    const Format* const format = find(node, node.current.pixelformat);
    if (set && format)
      node.rate_hz =
          std::min(static_cast<double>(capture.timeperframe.denominator) / capture.timeperframe.numerator,
                   format->rate_hz);
    capture.timeperframe = interval_of(node.rate_hz);
    return 0;
  }
  int dequeue(Node& node, v4l2_buffer& buffer) {
    if (node.filled.empty()) return failed(EAGAIN);
    const Filled filled = node.filled.front();
    node.filled.pop_front();
    buffer.index = filled.index + node.wrong_index;
    buffer.bytesused = filled.bytes;
    buffer.flags = filled.flags;
    buffer.sequence = filled.sequence;
    buffer.timestamp = {filled.stamp_ns / 1'000'000'000, filled.stamp_ns % 1'000'000'000 / 1000};
    return 0;
  }

  std::vector<std::string> paths_;  ///< by file descriptor
};

}  // namespace stillmap::test
