// The V4L2 driver on the kernel's virtual cameras (vivid). Runs in the virtual machine: vm_v4l2.sh loads two
// cameras, /dev/video0, which stands for depth (its 16-bit grey images), and /dev/video1 for colour.

#include <fcntl.h>
#include <gtest/gtest.h>
#include <linux/videodev2.h>
#include <sys/ioctl.h>
#include <unistd.h>

#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <map>
#include <string>

#include "drivers/v4l2/node_description.hpp"
#include "drivers/v4l2/v4l2_source.hpp"
#include "tests/support/contains.hpp"
#include "tests/support/frame_memory.hpp"

namespace stillmap {
namespace {

constexpr const char* kDepthNode = "/dev/video0";
constexpr const char* kColourNode = "/dev/video1";
constexpr int32_t kFrames = 60;
constexpr int32_t kLongMs = 10'000;  ///< of the guest's time; never needed

/// The kernel's, with a count of the images that it handed out by node.
class CountingCalls final : public SystemCalls {
 public:
  int open(const char* path) override {
    const int fd = kernel_calls().open(path);
    if (fd >= 0) paths_[fd] = path;
    return fd;
  }
  int close(int fd) override { return kernel_calls().close(fd); }
  int control(int fd, unsigned long request, void* argument) override {
    const int answer = kernel_calls().control(fd, request, argument);
    if (request == VIDIOC_DQBUF && answer >= 0) {
      const uint32_t sequence = static_cast<v4l2_buffer*>(argument)->sequence;
      Count& count = counts[paths_[fd]];
      if (count.images++ > 0 && sequence > count.last_sequence)
        count.gaps += sequence - count.last_sequence - 1;
      count.last_sequence = sequence;
    }
    return answer;
  }
  void* map(int fd, size_t bytes, int64_t offset) override { return kernel_calls().map(fd, bytes, offset); }
  int unmap(void* memory, size_t bytes) override { return kernel_calls().unmap(memory, bytes); }
  int poll(pollfd* fds, uint32_t count, int32_t timeout_ms) override {
    return kernel_calls().poll(fds, count, timeout_ms);
  }

  struct Count {
    int32_t images = 0;
    uint32_t last_sequence = 0, gaps = 0;  ///< what the driver says that it did not fill
  };
  std::map<std::string, Count> counts;

 private:
  std::map<int, std::string> paths_;
};

/// The settings of a virtual camera, by name. Keeps its node open.
class Settings {
 public:
  explicit Settings(const char* node) : fd_(::open(node, O_RDWR)) { EXPECT_GE(fd_, 0) << node; }
  ~Settings() { ::close(fd_); }
  Settings(const Settings&) = delete;
  Settings& operator=(const Settings&) = delete;

  void set(const std::string& name, int32_t value) {
    v4l2_control control{id_of(name), value};
    EXPECT_EQ(::ioctl(fd_, VIDIOC_S_CTRL, &control), 0) << name << ": " << std::strerror(errno);
  }
  void press(const std::string& name) { set(name, 1); }

 private:
  uint32_t id_of(const std::string& name) {
    v4l2_query_ext_ctrl query{};
    query.id = V4L2_CTRL_FLAG_NEXT_CTRL;
    while (::ioctl(fd_, VIDIOC_QUERY_EXT_CTRL, &query) == 0) {
      if (name == query.name) return query.id;
      query.id |= V4L2_CTRL_FLAG_NEXT_CTRL;
    }
    ADD_FAILURE() << "the virtual camera has no setting '" << name << "'";
    return 0;
  }

  const int fd_;
};

constexpr int32_t kNoText = 2, kSquares = 4, kWhite = 6, kRed = 7;
void show(const char* node, int32_t pattern) {
  Settings settings(node);
  settings.set("OSD Text Mode", kNoText);
  settings.set("Test Pattern", pattern);
}

class V4l2Kernel : public ::testing::Test {
 protected:
  V4l2Kernel() {
    options_.camera = CameraModel{{525, 525, 319.5f, 239.5f, 0, 0}, {}};
    options_.max_pair_ms = 20;
  }
  /// What comes after these tests sees edges in every direction.
  static void TearDownTestSuite() {
    for (const char* node : {kDepthNode, kColourNode}) show(node, kSquares);
  }
  void open(bool with_colour = true) {
    source_.reset();
    auto source = V4l2Source::open({kDepthNode, with_colour ? kColourNode : ""}, options_, calls_);
    ASSERT_TRUE(source) << source.error();
    source_ = std::move(*source);
    EXPECT_EQ(source_->info().camera.k.width, 640);
    EXPECT_EQ(source_->next(memory_.frame, 0), Status::timeout);
    calls_.counts.clear();
  }
  Status next() { return source_->next(memory_.frame, kLongMs); }
  /// @return the first answer that is no frame; ok: `frames` frames came
  Status next_trouble(int frames) {
    for (int i = 0; i < frames; ++i)
      if (const Status status = next(); status != Status::ok) return status;
    return Status::ok;
  }

  CountingCalls calls_;
  CameraOptions options_;
  std::unique_ptr<V4l2Source> source_;
  test::FrameMemory memory_{640, 480};
};

TEST_F(V4l2Kernel, SaysWhatTheNodeOffers) {
  const auto node = describe_node(kernel_calls(), kDepthNode);
  ASSERT_TRUE(node) << node.error();
  EXPECT_TRUE(node->streams);
  EXPECT_EQ(summary_text(*node), "vivid; depth Y16; colour YUYV RGB3 GREY");
  ASSERT_NE(node->find(kYuyv), nullptr);
  bool vga = false;
  for (const SizeOffer& size : node->find(kYuyv)->sizes)
    vga = vga || (size.cols == 640 && size.rows == 480 && size.rate_hz >= 30);
  EXPECT_TRUE(vga) << offers_text(*node);
}

TEST_F(V4l2Kernel, EveryImageThatTheDriverDeliversArrives) {
  open(false);
  for (int32_t i = 0; i < kFrames; ++i) {
    ASSERT_EQ(next(), Status::ok) << i << ": " << source_->error();
    EXPECT_EQ(calls_.counts[kDepthNode].images, i + 1);
  }
  EXPECT_EQ(source_->left_out(), calls_.counts[kDepthNode].gaps);
}

TEST_F(V4l2Kernel, EveryPairArrives) {
  open();
  EXPECT_EQ(source_->formats_text(), "Y16 640x480 at 30 Hz, YUYV 640x480 at 30 Hz");
  ASSERT_EQ(next_trouble(3), Status::ok);  // the nodes do not begin together
  const uint32_t left_out_before = source_->left_out();
  const auto before = calls_.counts;
  Stamp first, last;
  for (int32_t i = 0; i < kFrames; ++i) {
    ASSERT_EQ(next(), Status::ok) << i << ": " << source_->error();
    const Stamp stamp = memory_.frame.depth_stamp;
    if (i == 0) first = stamp;
    EXPECT_GT(stamp, last);
    EXPECT_LE(std::abs(stamp.ns - memory_.frame.colour_stamp.ns), 20'000'000);
    last = stamp;
  }
  const auto came = [&](const char* node) { return calls_.counts[node].images - before.at(node).images; };
  const auto skipped = [&](const char* node) { return calls_.counts[node].gaps - before.at(node).gaps; };
  const uint32_t left_out = source_->left_out() - left_out_before;
  std::printf("%d frames of %d depth and %d colour images; the driver skipped %u and %u, %u were left out\n",
              kFrames, came(kDepthNode), came(kColourNode), skipped(kDepthNode), skipped(kColourNode),
              left_out);
  // An image may have waited for its partner before the first frame, and one may wait behind the last. Depth
  // whose colour the driver skipped is left out. And the nodes run by themselves: half a period apart, an
  // image that is a little late has another partner, and the one in between has none.
  constexpr uint32_t kSlips = 3;
  EXPECT_LE(left_out, skipped(kDepthNode) + skipped(kColourNode) + kSlips);
  EXPECT_NEAR(came(kDepthNode), kFrames + static_cast<int32_t>(left_out - skipped(kDepthNode)), 1);
  EXPECT_NEAR((kFrames - 1) / (last.seconds() - first.seconds()), 30, 3);
}

TEST_F(V4l2Kernel, ColoursAndDepthAreThoseOfTheCamera) {
  show(kDepthNode, kWhite);
  show(kColourNode, kRed);
  open();
  ASSERT_EQ(next_trouble(3), Status::ok);
  const Rgb8 rgb = memory_.frame.colour.at(240, 320);
  EXPECT_GE(rgb.r, 252);
  EXPECT_LE(rgb.g, 3);
  EXPECT_LE(rgb.b, 3);
  const uint16_t white = memory_.frame.depth_raw.at(240, 320);
  EXPECT_GE(white, 0xea00);
  EXPECT_EQ(memory_.frame.depth_raw.at(479, 639), white);
}

TEST_F(V4l2Kernel, DepthAloneComesWithGrey) {
  open(false);
  ASSERT_EQ(next_trouble(3), Status::ok);
  EXPECT_EQ(memory_.frame.colour.at(479, 639).g, 128);
}

TEST_F(V4l2Kernel, TheSizeIsWhatTheDriverAnswers) {
  options_.cols = 320;
  options_.rows = 240;
  options_.camera = CameraModel{{260, 260, 159.5f, 89.5f, 0, 0}, {}};
  auto source = V4l2Source::open({kDepthNode, kColourNode}, options_, calls_);
  ASSERT_TRUE(source) << source.error();
  EXPECT_EQ((*source)->formats_text(), "Y16 320x180 at 30 Hz, YUYV 320x180 at 30 Hz");
  test::FrameMemory memory((*source)->info());
  EXPECT_EQ((*source)->next(memory.frame, kLongMs), Status::ok);
}

TEST_F(V4l2Kernel, DamagedBuffersAreCounted) {
  open();
  ASSERT_EQ(next_trouble(2), Status::ok);
  Settings(kDepthNode).press("Inject V4L2_BUF_FLAG_ERROR");
  EXPECT_EQ(next_trouble(5), Status::bad_data);
  EXPECT_TRUE(test::contains(source_->error(), "/dev/video0: an image came damaged"));
  EXPECT_EQ(next_trouble(5), Status::ok);
}

TEST_F(V4l2Kernel, UnpluggedAndPluggedInAgain) {
  for (const char* node : {kDepthNode, kColourNode}) {
    open();
    ASSERT_EQ(next_trouble(2), Status::ok);
    const Stamp before = memory_.frame.depth_stamp;
    {
      Settings settings(node);  // the camera comes back when nobody has its node open
      settings.press("Disconnect");
      EXPECT_EQ(next_trouble(5), Status::unavailable);
      EXPECT_TRUE(test::contains(source_->error(), std::string(node) + ": the camera is gone"));
      EXPECT_EQ(source_->reopen(), Status::unavailable);
      EXPECT_TRUE(test::contains(source_->error(), std::string(node) + ": No such device"))
          << source_->error();
      EXPECT_EQ(next(), Status::unavailable);
    }
    ASSERT_EQ(source_->reopen(), Status::ok) << source_->error();
    EXPECT_EQ(next_trouble(5), Status::ok);
    EXPECT_GT(memory_.frame.depth_stamp, before);
  }
}

TEST_F(V4l2Kernel, ADriverThatGivesUpIsOpenedAgain) {
  for (const char* error : {"Inject Fatal Streaming Error", "Inject VIDIOC_QBUF Error"}) {
    open();
    ASSERT_EQ(next_trouble(2), Status::ok);
    Settings(kDepthNode).press(error);
    Status status = next_trouble(5);
    for (int i = 0; i < 20 && status == Status::bad_data; ++i) status = next();
    EXPECT_EQ(status, Status::unavailable) << error;
    ASSERT_EQ(source_->reopen(), Status::ok) << source_->error();
    EXPECT_EQ(next_trouble(5), Status::ok) << error;
  }
}

TEST_F(V4l2Kernel, ErrorsWhileItOpensAreSaid) {
  const std::pair<const char*, const char*> errors[] = {
      {"Inject VIDIOC_REQBUFS Error", "no buffers"},
      {"Inject VIDIOC_STREAMON Error", "does not begin to send"}};
  for (const auto& [error, message] : errors) {
    Settings(kColourNode).press(error);
    const auto source = V4l2Source::open({kDepthNode, kColourNode}, options_, calls_);
    ASSERT_FALSE(source) << error;
    EXPECT_TRUE(test::contains(source.error(), message)) << source.error();
  }
  open();
  const auto second = V4l2Source::open({kDepthNode, kColourNode}, options_, calls_);
  ASSERT_FALSE(second);
  EXPECT_TRUE(test::contains(second.error(), "another program uses the camera")) << second.error();
  EXPECT_EQ(next_trouble(3), Status::ok);
}

TEST_F(V4l2Kernel, ACameraThatStopsIsGone) {
  options_.gone_s = 1;
  open();
  ASSERT_EQ(next_trouble(2), Status::ok);
  Settings(kColourNode).set("Percentage of Dropped Buffers", 100);
  Status status = Status::ok;
  for (int i = 0; i < 100 && (status == Status::ok || status == Status::timeout); ++i)
    status = source_->next(memory_.frame, 100);
  Settings(kColourNode).set("Percentage of Dropped Buffers", 0);
  EXPECT_EQ(status, Status::unavailable);
  EXPECT_TRUE(test::contains(source_->error(), "no frame for 1 s")) << source_->error();
  EXPECT_GT(source_->left_out(), 10u);
  ASSERT_EQ(source_->reopen(), Status::ok) << source_->error();
  EXPECT_EQ(next_trouble(3), Status::ok);
}

}  // namespace
}  // namespace stillmap
