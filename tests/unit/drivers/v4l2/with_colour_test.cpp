#include "drivers/v4l2/with_colour.hpp"

#include <gtest/gtest.h>

#include "runtime/core/clock.hpp"
#include "tests/support/contains.hpp"
#include "tests/support/frame_memory.hpp"
#include "tests/unit/drivers/v4l2/fake_kernel.hpp"

namespace stillmap {
namespace {

/// A depth camera that answers as it is told.
class TellableDepth final : public FrameSource {
 public:
  TellableDepth() {
    info_.name = "xtion";
    info_.camera.k = {60, 60, 31.5f, 23.5f, 64, 48};
  }
  const SourceInfo& info() const override { return info_; }
  Status next(RgbdFrame& frame, int32_t) override {
    frame.depth_stamp = frame.captured = {captured_ns};
    frame.depth_raw.at(0, 0) = 1234;
    frame.colour.at(0, 0) = {9, 9, 9};
    return answer;
  }
  bool live() const override { return true; }
  Status reopen() override { return answer_to_reopen; }
  void skip(uint32_t) override {}
  uint32_t left_out() const override { return 3; }
  const std::string& error() const override { return error_; }

  int64_t captured_ns = 0;
  Status answer = Status::ok, answer_to_reopen = Status::ok;

 private:
  SourceInfo info_;
  const std::string error_ = "of the depth camera";
};

class WithColourTest : public ::testing::Test {
 protected:
  static constexpr const char* kNode = "/dev/video1";
  static constexpr int64_t kMs = 1'000'000;

  void SetUp() override {
    kernel_.nodes[kNode].formats = {{kGrey, 64, 48, 30}};
    auto depth = std::make_unique<TellableDepth>();
    depth_ = depth.get();
    auto source = WithColour::open(std::move(depth), kNode, options_, kernel_);
    ASSERT_TRUE(source) << source.error();
    source_ = std::move(*source);
    depth_->answer = Status::timeout;
    EXPECT_EQ(source_->next(memory_.frame, 0), Status::timeout);  // from now on images count
    depth_->answer = Status::ok;
  }
  void TearDown() override {
    source_.reset();
    EXPECT_EQ(kernel_.open_files, 0);
    EXPECT_EQ(kernel_.mapped, 0);
  }
  void send(int64_t at_ms, uint8_t pixel) { kernel_.send(kNode, start_ns_ + at_ms * kMs, pixel); }
  Status next_at(int64_t at_ms) {
    depth_->captured_ns = start_ns_ + at_ms * kMs;
    return source_->next(memory_.frame, 0);
  }
  void expect_all_buffers_back(size_t waiting) { EXPECT_EQ(kernel_.nodes[kNode].empty.size() + waiting, 8u); }

  test::FakeKernel kernel_;
  CameraOptions options_;
  TellableDepth* depth_ = nullptr;
  std::unique_ptr<WithColour> source_;
  test::FrameMemory memory_{64, 48};
  const int64_t start_ns_ = monotonic_ns() - 10'000 * kMs;
};

TEST_F(WithColourTest, TakesTheNearestColourThatIsThere) {
  EXPECT_EQ(source_->info().name, "v4l2:xtion,/dev/video1");
  EXPECT_TRUE(source_->live());
  EXPECT_EQ(source_->left_out(), 3u);
  for (int i = 0; i < 20; ++i) {
    send(100 * i - 15, 50);
    send(100 * i + 4, static_cast<uint8_t>(i));
    ASSERT_EQ(next_at(100 * i), Status::ok) << source_->error();
    EXPECT_EQ(memory_.frame.depth_raw.at(0, 0), 1234);
    EXPECT_EQ(memory_.frame.colour.at(0, 0).g, i);
    EXPECT_EQ(memory_.frame.colour.at(47, 63).g, i);
    EXPECT_NEAR(static_cast<double>(memory_.frame.colour_stamp.ns - memory_.frame.depth_stamp.ns), 4e6, 1e3);
    expect_all_buffers_back(0);
  }
}

TEST_F(WithColourTest, WaitsForColour) {
  kernel_.on_poll = {[&] { send(-40, 1); }, [&] { send(10, 77); }};
  ASSERT_EQ(next_at(0), Status::ok) << source_->error();
  EXPECT_EQ(memory_.frame.colour.at(0, 0).r, 77);
  expect_all_buffers_back(0);
}

TEST_F(WithColourTest, WithoutColourItIsNoFrame) {
  send(-200, 1);
  EXPECT_EQ(next_at(0), Status::bad_data);
  EXPECT_TRUE(test::contains(source_->error(), "no colour image within 20 ms"));
  expect_all_buffers_back(0);
  send(33, 2);
  EXPECT_EQ(next_at(30), Status::ok);
}

TEST_F(WithColourTest, TroubleOfTheDepthCameraIsItsOwn) {
  depth_->answer = Status::bad_data;
  EXPECT_EQ(next_at(0), Status::bad_data);
  EXPECT_EQ(source_->error(), "of the depth camera");
  depth_->answer = depth_->answer_to_reopen = Status::unavailable;
  EXPECT_EQ(next_at(0), Status::unavailable);
  EXPECT_EQ(source_->reopen(), Status::unavailable);
  EXPECT_EQ(source_->error(), "of the depth camera");
  depth_->answer = depth_->answer_to_reopen = Status::ok;
  EXPECT_EQ(source_->reopen(), Status::ok);
  send(0, 1);
  EXPECT_EQ(next_at(0), Status::ok);
}

TEST_F(WithColourTest, TheColourCameraMayGoAndComeBack) {
  kernel_.nodes[kNode].fails = {{VIDIOC_DQBUF, ENODEV}, {0, ENOENT}};
  EXPECT_EQ(next_at(0), Status::unavailable);
  EXPECT_TRUE(test::contains(source_->error(), "/dev/video1: the camera is gone"));
  EXPECT_EQ(kernel_.open_files, 0);
  EXPECT_EQ(source_->reopen(), Status::unavailable);
  EXPECT_TRUE(test::contains(source_->error(), "/dev/video1: No such file"));
  EXPECT_EQ(next_at(10), Status::unavailable);
  kernel_.nodes[kNode].fails.clear();
  ASSERT_EQ(source_->reopen(), Status::ok);
  depth_->answer = Status::timeout;
  EXPECT_EQ(next_at(50), Status::timeout);
  depth_->answer = Status::ok;
  send(100, 1);
  EXPECT_EQ(next_at(100), Status::ok);
}

TEST_F(WithColourTest, ANodeOfAnotherSizeIsRefused) {
  kernel_.nodes["/dev/video2"].formats = {{kYuyv, 640, 480, 30}};
  const auto source = WithColour::open(std::make_unique<TellableDepth>(), "/dev/video2", options_, kernel_);
  ASSERT_FALSE(source);
  EXPECT_EQ(source.error_kind(), ErrorKind::cannot_open);
  EXPECT_TRUE(test::contains(source.error(), "of 64x48 (as the depth images are)")) << source.error();
}

}  // namespace
}  // namespace stillmap
