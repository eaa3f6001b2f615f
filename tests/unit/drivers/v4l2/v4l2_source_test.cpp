#include "drivers/v4l2/v4l2_source.hpp"

#include <gtest/gtest.h>

#include "runtime/core/clock.hpp"
#include "runtime/core/heap_guard.hpp"
#include "tests/support/contains.hpp"
#include "tests/support/frame_memory.hpp"
#include "tests/unit/drivers/v4l2/fake_kernel.hpp"
#include "tests/unit/drivers/v4l2/jpeg_image.hpp"

namespace stillmap {
namespace {

using test::contains;

constexpr const char* kDepthNode = "/dev/depth";
constexpr const char* kColourNode = "/dev/colour";
constexpr int64_t kMs = 1'000'000;

class V4l2SourceTest : public ::testing::Test {
 protected:
  V4l2SourceTest() {
    kernel_.nodes[kDepthNode].formats = {{kZ16, 64, 48, 30}};
    kernel_.nodes[kColourNode].formats = {{kGrey, 64, 48, 30}};
    options_.camera = CameraModel{{60, 60, 31.5f, 23.5f, 0, 0}, {}};
    options_.gone_s = 60;
    // Longer than any wait of a test; nothing is asserted on it.
    stamp_ns_ = monotonic_ns() - 10'000 * kMs;
  }
  void TearDown() override {
    source_.reset();
    EXPECT_EQ(kernel_.open_files, 0);
    EXPECT_EQ(kernel_.mapped, 0);
  }

  test::FakeKernel::Node& node(const char* path) { return kernel_.nodes[path]; }
  void open(const std::string& colour = kColourNode) {
    source_.reset();
    auto source = V4l2Source::open({kDepthNode, colour}, options_, kernel_);
    ASSERT_TRUE(source) << source.error();
    source_ = std::move(*source);
    EXPECT_EQ(next(0), Status::timeout);  // from now on images count
  }
  Status next(int32_t timeout_ms = 100) { return source_->next(memory_.frame, timeout_ms); }
  void send(const char* path, int64_t at_ms, uint8_t pixel, uint32_t flags = 0) {
    kernel_.send(path, stamp_ns_ + at_ms * kMs, pixel, flags);
  }
  int64_t depth_ms() const { return (memory_.frame.depth_stamp.ns - stamp_ns_ + kMs / 2) / kMs; }
  int64_t colour_ms() const { return (memory_.frame.colour_stamp.ns - stamp_ns_ + kMs / 2) / kMs; }
  /// No buffer is lost on its way.
  void expect_all_buffers_back() {
    for (const char* path : {kDepthNode, kColourNode})
      if (node(path).sending) {
        EXPECT_EQ(node(path).empty.size() + node(path).filled.size(), node(path).buffers) << path;
      }
  }

  test::FakeKernel kernel_;
  CameraOptions options_;
  std::unique_ptr<V4l2Source> source_;
  test::FrameMemory memory_{64, 48, 5};
  int64_t stamp_ns_ = 0;
};

TEST_F(V4l2SourceTest, EveryPairArrives) {
  open();
  EXPECT_TRUE(source_->live());
  EXPECT_EQ(source_->info().name, "v4l2:/dev/depth,/dev/colour");
  EXPECT_EQ(source_->info().camera.k.width, 64);
  EXPECT_EQ(source_->info().camera.k.height, 48);
  EXPECT_FLOAT_EQ(source_->info().camera.k.fx, 60);
  EXPECT_FLOAT_EQ(source_->info().depth_units_per_m, 1000);
  EXPECT_EQ(source_->formats_text(), "Z16 64x48 at 30 Hz, GREY 64x48 at 30 Hz");
  for (int i = 0; i < 50; ++i) {
    send(kDepthNode, 33 * i, static_cast<uint8_t>(i));
    send(kColourNode, 33 * i + 7, static_cast<uint8_t>(2 * i));
    ASSERT_EQ(next(), Status::ok) << i;
    EXPECT_EQ(depth_ms(), 33 * i);
    EXPECT_EQ(colour_ms(), 33 * i + 7);
    EXPECT_EQ(memory_.frame.captured, memory_.frame.depth_stamp);
    EXPECT_EQ(memory_.frame.sequence, static_cast<uint32_t>(i));
    EXPECT_EQ(memory_.frame.depth_raw.at(47, 63), i * 0x0101);
    EXPECT_EQ(memory_.frame.colour.at(47, 63).g, 2 * i);
    expect_all_buffers_back();
  }
  EXPECT_EQ(source_->left_out(), 0u);
  EXPECT_EQ(next(0), Status::timeout);
}

TEST_F(V4l2SourceTest, WaitsForTheSecondImage) {
  open();
  kernel_.on_poll = {[&] { send(kColourNode, 5, 1); }, [] {}, [&] { send(kDepthNode, 0, 2); }};
  EXPECT_EQ(next(10'000), Status::ok);
  EXPECT_TRUE(kernel_.on_poll.empty());
}

TEST_F(V4l2SourceTest, DepthAloneComesWithGrey) {
  open("");
  EXPECT_EQ(source_->info().name, "v4l2:/dev/depth");
  send(kDepthNode, 0, 3);
  ASSERT_EQ(next(), Status::ok);
  EXPECT_EQ(memory_.frame.depth_raw.at(0, 0), 0x0303);
  EXPECT_EQ(memory_.frame.colour.at(20, 20).r, 128);
  EXPECT_EQ(memory_.frame.colour.at(47, 63).b, 128);
  EXPECT_EQ(memory_.frame.colour_stamp, memory_.frame.depth_stamp);
  expect_all_buffers_back();
}

TEST_F(V4l2SourceTest, ColourWithoutDepthIsNoFrameAndDepthWithoutColourIsLeftOut) {
  open();
  for (int i = 0; i < 20; ++i) {
    send(kColourNode, 33 * i, 1);
    EXPECT_EQ(next(0), Status::timeout);
  }
  EXPECT_EQ(source_->left_out(), 0u);
  EXPECT_GE(source_->unpaired_colour(), 16u);
  for (int i = 0; i < 20; ++i) {
    send(kDepthNode, 10'000 + 33 * i, 1);
    EXPECT_EQ(next(0), Status::timeout);
  }
  EXPECT_GE(source_->left_out(), 16u);
  send(kColourNode, 10'000 + 33 * 19, 1);
  EXPECT_EQ(next(), Status::ok);
  EXPECT_EQ(source_->left_out(), 19u);
  expect_all_buffers_back();
}

TEST_F(V4l2SourceTest, TheTimeOffsetMovesColour) {
  options_.time_offset_ms = -33;
  open();
  send(kDepthNode, 0, 1);
  send(kColourNode, 33, 2);
  ASSERT_EQ(next(), Status::ok);
  EXPECT_EQ(colour_ms(), 0);
}

TEST_F(V4l2SourceTest, StampsOfTheCamerasOwnClockAreMapped) {
  node(kDepthNode).stamp_flags = V4L2_BUF_FLAG_TIMESTAMP_UNKNOWN;
  open("");
  int64_t last_ns = 0;
  for (int i = 0; i < 5; ++i) {
    kernel_.send(kDepthNode, 77'000 * kMs + 33 * i * kMs, 1);
    const int64_t before_ns = monotonic_ns();
    ASSERT_EQ(next(), Status::ok);
    if (i == 0) {
      EXPECT_GE(memory_.frame.captured.ns, before_ns);
    }
    EXPECT_LE(memory_.frame.captured.ns, monotonic_ns());
    EXPECT_GT(memory_.frame.captured.ns, last_ns);
    last_ns = memory_.frame.captured.ns;
  }
}

TEST_F(V4l2SourceTest, DamagedImagesAreBadDataAndTheNextIsGood) {
  open("");
  send(kDepthNode, 0, 1, V4L2_BUF_FLAG_ERROR);
  EXPECT_EQ(next(), Status::bad_data);
  EXPECT_TRUE(contains(source_->error(), "/dev/depth: an image came damaged"));
  kernel_.send(kDepthNode, stamp_ns_ + 33 * kMs, std::vector<uint8_t>(100));
  EXPECT_EQ(next(), Status::bad_data);
  send(kDepthNode, 66, 1);
  EXPECT_EQ(next(), Status::ok);
  EXPECT_EQ(memory_.frame.sequence, 2u);
  expect_all_buffers_back();
}

TEST_F(V4l2SourceTest, FramesThatTheDriverLostAreLeftOut) {
  open("");
  for (int i = 0; i < 12; ++i) send(kDepthNode, i, 1);  // eight buffers
  for (int i = 0; i < 8; ++i) EXPECT_EQ(next(), Status::ok);
  send(kDepthNode, 20, 1);
  EXPECT_EQ(next(), Status::ok);
  EXPECT_EQ(source_->left_out(), 4u);
  node(kDepthNode).sequence = 0;  // counts anew
  send(kDepthNode, 21, 1);
  EXPECT_EQ(next(), Status::ok);
  EXPECT_EQ(source_->left_out(), 4u);
}

TEST_F(V4l2SourceTest, WhatCameBeforeAnybodyAskedIsPassedOver) {
  auto source = V4l2Source::open({kDepthNode, ""}, options_, kernel_);
  ASSERT_TRUE(source);
  source_ = std::move(*source);
  for (int i = 0; i < 30; ++i) send(kDepthNode, i, 1);
  EXPECT_EQ(next(0), Status::timeout);
  send(kDepthNode, 100, 9);
  ASSERT_EQ(next(), Status::ok);
  EXPECT_EQ(depth_ms(), 100);
  EXPECT_EQ(source_->left_out(), 0u);
  source_->skip(2);
  for (int i = 0; i < 3; ++i) send(kDepthNode, 200 + i, 1);
  ASSERT_EQ(next(), Status::ok);
  EXPECT_EQ(depth_ms(), 202);
}

TEST_F(V4l2SourceTest, ErrorsOfTheDriverAreCountedUntilTheyNeverEnd) {
  open("");
  node(kDepthNode).fails[VIDIOC_DQBUF] = EIO;
  EXPECT_EQ(next(), Status::bad_data);
  EXPECT_EQ(next(), Status::bad_data);
  node(kDepthNode).fails.clear();
  send(kDepthNode, 0, 1);
  EXPECT_EQ(next(), Status::ok);
  node(kDepthNode).fails[VIDIOC_DQBUF] = EIO;
  int errors = 0;
  while (errors < 100 && next() == Status::bad_data) ++errors;
  EXPECT_EQ(errors, 9);
  EXPECT_TRUE(contains(source_->error(), "/dev/depth: the camera is gone"));
}

TEST_F(V4l2SourceTest, TroubleSaidByPollIsTheEnd) {
  for (const int error : {0, EIO}) {  // EIO: of a queue that the driver has given up
    open();
    kernel_.on_poll = {[&] {
      node(kColourNode).trouble = POLLERR;
      if (error != 0) node(kColourNode).fails[VIDIOC_DQBUF] = error;
      send(kDepthNode, 0, 1);
    }};
    EXPECT_EQ(next(), Status::unavailable);
    EXPECT_TRUE(contains(source_->error(), "/dev/colour: the camera is gone"));
    node(kColourNode).trouble = 0;
    node(kColourNode).fails.clear();
  }
}

TEST_F(V4l2SourceTest, UnpluggedAndPluggedInAgain) {
  for (const char* gone : {kDepthNode, kColourNode}) {
    open();
    send(kDepthNode, 0, 1);
    send(kColourNode, 0, 1);
    ASSERT_EQ(next(), Status::ok);
    const Stamp before = memory_.frame.depth_stamp;
    send(kDepthNode, 50, 1);  // waits for its partner when the camera goes
    EXPECT_EQ(next(0), Status::timeout);
    node(gone).fails[VIDIOC_DQBUF] = ENODEV;
    node(gone).fails[0] = ENOENT;
    node(gone).trouble = POLLERR | POLLHUP;
    EXPECT_EQ(next(), Status::unavailable);
    EXPECT_TRUE(contains(source_->error(), std::string(gone) + ": the camera is gone"));
    EXPECT_EQ(next(), Status::unavailable);
    EXPECT_EQ(source_->reopen(), Status::unavailable);
    EXPECT_TRUE(contains(source_->error(), std::string(gone) + ": No such file")) << source_->error();
    EXPECT_EQ(next(), Status::unavailable);
    EXPECT_TRUE(contains(source_->error(), std::string(gone) + ": No such file")) << source_->error();
    EXPECT_EQ(kernel_.open_files, 0);
    node(gone).fails.clear();
    node(gone).trouble = 0;
    ASSERT_EQ(source_->reopen(), Status::ok) << source_->error();
    EXPECT_EQ(next(0), Status::timeout);
    send(kDepthNode, 100, 1);
    send(kColourNode, 100, 1);
    ASSERT_EQ(next(), Status::ok);
    EXPECT_GT(memory_.frame.depth_stamp, before);
    EXPECT_EQ(source_->left_out(), 1u);
    expect_all_buffers_back();
  }
}

TEST_F(V4l2SourceTest, AnotherCameraInItsPlaceIsRefused) {
  open();
  node(kDepthNode).formats = {{kZ16, 32, 24, 30}};
  EXPECT_EQ(source_->reopen(), Status::unavailable);
  EXPECT_TRUE(contains(source_->error(), "it answers 32x24")) << source_->error();
}

TEST_F(V4l2SourceTest, ACameraThatSaysNothingIsGone) {
  options_.gone_s = 0.5;
  open();
  Status status = Status::timeout;
  for (int i = 0; i < 1000 && status == Status::timeout; ++i) status = next(50);
  EXPECT_EQ(status, Status::unavailable);
  EXPECT_TRUE(contains(source_->error(), "no frame for 0.5 s")) << source_->error();
  EXPECT_TRUE(contains(source_->error(), "source.max_pair_ms"));
}

TEST_F(V4l2SourceTest, MemoryOfAnotherSizeIsRefused) {
  open();
  test::FrameMemory other(32, 24);
  EXPECT_EQ(source_->next(other.frame, 0), Status::bad_data);
  EXPECT_TRUE(contains(source_->error(), "64x48"));
}

TEST_F(V4l2SourceTest, CompressedColourIsDecoded) {
  node(kColourNode).formats = {{kMjpeg, 64, 48, 30}};
  open();
  const auto good = test::jpeg_image(64, 48, {10, 200, 30});
  for (int i = 0; i < 10; ++i) {
    send(kDepthNode, 33 * i, static_cast<uint8_t>(i));
    kernel_.send(kColourNode, stamp_ns_ + (33 * i + 2) * kMs, good);
    ASSERT_EQ(next(20'000), Status::ok);
    EXPECT_EQ(depth_ms(), 33 * i);
    EXPECT_EQ(colour_ms(), 33 * i + 2);
    EXPECT_NEAR(memory_.frame.colour.at(47, 63).g, 200, 4);
    expect_all_buffers_back();
  }
  kernel_.send(kColourNode, stamp_ns_ + 1000 * kMs, std::vector<uint8_t>(200, 0x11));
  EXPECT_EQ(next(20'000), Status::bad_data);
  EXPECT_TRUE(contains(source_->error(), "/dev/colour: an image came damaged"));
  send(kDepthNode, 2000, 1);
  kernel_.send(kColourNode, stamp_ns_ + 2000 * kMs, good);
  EXPECT_EQ(next(20'000), Status::ok);
  expect_all_buffers_back();
}

TEST_F(V4l2SourceTest, CompressedColourThatComesTooFastIsPassedOver) {
  node(kColourNode).formats = {{kMjpeg, 64, 48, 30}};
  open();
  const auto image = test::jpeg_image(64, 48, {10, 200, 30});
  constexpr int kTooMany = 4;
  for (int i = 0; i < kTooMany; ++i) {
    send(kDepthNode, 33 * i, 1);
    kernel_.send(kColourNode, stamp_ns_ + 33 * i * kMs, image);
  }
  // All are seen at once: as many as may be on their way are decoded.
  for (uint32_t i = 0; i < MjpegDecoder::kAtOnce; ++i) EXPECT_EQ(next(20'000), Status::ok) << i;
  EXPECT_EQ(next(0), Status::timeout);
  send(kDepthNode, 1000, 1);
  kernel_.send(kColourNode, stamp_ns_ + 1000 * kMs, image);
  EXPECT_EQ(next(20'000), Status::ok);
  EXPECT_EQ(depth_ms(), 1000);
  EXPECT_EQ(source_->left_out(), kTooMany - MjpegDecoder::kAtOnce);
  expect_all_buffers_back();
}

TEST_F(V4l2SourceTest, NextLeavesTheHeapAlone) {
  if (!heap_guard::counts()) GTEST_SKIP() << "a sanitizer has its own allocator";
  node(kColourNode).formats = {{kYuyv, 64, 48, 30}};
  open();
  for (int i = 0; i < 4; ++i) {
    send(kDepthNode, 33 * i, 1);
    send(kColourNode, 33 * i, 1);
  }
  send(kDepthNode, 200, 1, V4L2_BUF_FLAG_ERROR);
  const uint64_t before = heap_guard::allocations();
  uint32_t good = 0, bad = 0;
  Status last = Status::ok;
  {
    const heap_guard::Scope armed;
    for (int i = 0; i < 6; ++i) {
      last = next(1);
      good += last == Status::ok;
      bad += last == Status::bad_data && !source_->error().empty();
    }
  }
  EXPECT_EQ(heap_guard::allocations() - before, 0u);
  EXPECT_EQ(good, 4u);
  EXPECT_EQ(bad, 1u);
  EXPECT_EQ(last, Status::timeout);
}

TEST_F(V4l2SourceTest, BadDescriptionsAreBadUsage) {
  for (const char* rest :
       {"", ",", "/dev/depth,", ",/dev/colour", "/dev/depth,/dev/depth", "/dev/depth,/dev/colour,/dev/x"}) {
    const auto source = open_v4l2(rest, options_, kernel_);
    ASSERT_FALSE(source) << rest;
    EXPECT_EQ(source.error_kind(), ErrorKind::bad_usage);
    EXPECT_TRUE(contains(source.error(), "v4l2:DEPTH_DEV,COLOUR_DEV"));
  }
  const auto good = open_v4l2("/dev/depth,/dev/colour", options_, kernel_);
  EXPECT_TRUE(good);
  options_.camera.reset();
  const auto unknown = open_v4l2("/dev/depth", options_, kernel_);
  ASSERT_FALSE(unknown);
  EXPECT_EQ(unknown.error_kind(), ErrorKind::bad_usage);
  EXPECT_TRUE(contains(unknown.error(), "--camera"));
  options_.camera = CameraModel{{60, 60, 320, 240, 0, 0}, {}};  // of a larger image
  const auto outside = open_v4l2("/dev/depth", options_, kernel_);
  ASSERT_FALSE(outside);
  EXPECT_EQ(outside.error_kind(), ErrorKind::bad_usage);
  EXPECT_TRUE(contains(outside.error(), "64x48")) << outside.error();
}

TEST_F(V4l2SourceTest, NodesThatCannotBeOpenedAreSaid) {
  const auto missing = open_v4l2("/dev/none", options_, kernel_);
  ASSERT_FALSE(missing);
  EXPECT_EQ(missing.error_kind(), ErrorKind::cannot_open);
  node(kColourNode).formats = {{kYuyv, 640, 480, 30}};
  const auto other_size = open_v4l2("/dev/depth,/dev/colour", options_, kernel_);
  ASSERT_FALSE(other_size);
  EXPECT_TRUE(contains(other_size.error(), "YUYV 640x480 at 30 Hz")) << other_size.error();
}

}  // namespace
}  // namespace stillmap
