#include "drivers/camera/calibrated_source.hpp"

#include <gtest/gtest.h>

#include "runtime/core/heap_guard.hpp"
#include "tests/support/contains.hpp"
#include "tests/support/frame_memory.hpp"

namespace stillmap {
namespace {

/// A wall at 2 m, 64x48 pixels; the third frame is bad.
class WallSource final : public FrameSource {
 public:
  WallSource() {
    info_.name = "wall";
    info_.camera = {{60, 60, 31.5f, 23.5f, 64, 48}, {}};
    info_.depth_units_per_m = 1000;
  }
  const SourceInfo& info() const override { return info_; }
  Status next(RgbdFrame& frame, int32_t) override {
    frame.sequence = frames_++;
    if (frame.sequence == 2) return Status::bad_data;
    for (int32_t r = 0; r < frame.depth_raw.rows; ++r)
      for (int32_t c = 0; c < frame.depth_raw.cols; ++c) frame.depth_raw.at(r, c) = 2000;
    return Status::ok;
  }
  bool live() const override { return true; }
  Status reopen() override { return Status::ok; }
  uint32_t left_out() const override { return 7; }
  void skip(uint32_t count) override { frames_ += count; }
  const std::string& error() const override { return error_; }

 private:
  SourceInfo info_;
  uint32_t frames_ = 0;
  const std::string error_ = "the third frame is bad";
};

DepthCamera to_the_left() {
  DepthCamera depth{{{60, 60, 31.5f, 23.5f, 0, 0}, {}}, {}};
  depth.T_colour_depth.translation = {-0.1, 0, 0};
  return depth;
}

TEST(CalibratedSource, RegistersWhatIsNotRegistered) {
  auto source = CalibratedSource::make(std::make_unique<WallSource>(), {}, to_the_left());
  ASSERT_TRUE(source) << source.error();
  EXPECT_FALSE((*source)->info().depth_camera) << "what comes out is registered";
  EXPECT_EQ((*source)->info().registration_bytes, 64u * 48 * (3 * sizeof(float) + sizeof(uint16_t)));
  test::FrameMemory memory((*source)->info());
  const uint16_t* const pixels = memory.frame.depth_raw.data;
  ASSERT_EQ((*source)->next(memory.frame, 0), Status::ok);
  EXPECT_EQ(memory.frame.depth_raw.data, pixels) << "the frame's own memory";
  EXPECT_EQ(memory.frame.depth_raw.at(10, 60), 2000);
  EXPECT_EQ(memory.frame.depth_raw.at(10, 61), 0) << "three pixels of disparity";
}

TEST(CalibratedSource, RegistersWhenAFrameIsFinished) {
  auto source = CalibratedSource::make(std::make_unique<WallSource>(), {}, to_the_left());
  ASSERT_TRUE(source) << source.error();
  test::FrameMemory memory((*source)->info()), at_once((*source)->info());
  const uint16_t* const pixels = memory.frame.depth_raw.data;
  ASSERT_EQ((*source)->next_unfinished(memory.frame, 0), Status::ok);
  EXPECT_EQ(memory.frame.depth_raw.at(10, 61), 2000) << "as the camera gave it";
  const uint64_t before = heap_guard::allocations();
  {
    const heap_guard::Scope armed;
    (*source)->finish(memory.frame);
  }
  EXPECT_EQ(heap_guard::allocations(), before);
  EXPECT_EQ(memory.frame.depth_raw.data, pixels) << "the frame's own memory";
  ASSERT_EQ((*source)->next(at_once.frame, 0), Status::ok);
  for (int32_t r = 0; r < 48; ++r)
    for (int32_t c = 0; c < 64; ++c)
      ASSERT_EQ(memory.frame.depth_raw.at(r, c), at_once.frame.depth_raw.at(r, c)) << r << " " << c;
}

TEST(CalibratedSource, PassesOnEverythingElse) {
  auto source = CalibratedSource::make(std::make_unique<WallSource>(), {{0, 1.01f, 0, 0}}, to_the_left());
  ASSERT_TRUE(source) << source.error();
  FrameSource& s = **source;
  EXPECT_EQ(s.info().depth_bias.c[1], 1.01f);
  EXPECT_EQ(s.info().name, "wall");
  EXPECT_TRUE(s.live());
  EXPECT_EQ(s.reopen(), Status::ok);
  EXPECT_EQ(s.left_out(), 7u);
  test::FrameMemory memory(s.info());
  s.skip(1);
  ASSERT_EQ(s.next(memory.frame, 0), Status::ok);
  EXPECT_EQ(memory.frame.sequence, 1u);
  const uint16_t* const pixels = memory.frame.depth_raw.data;
  ASSERT_EQ(s.next(memory.frame, 0), Status::bad_data);
  EXPECT_EQ(memory.frame.depth_raw.data, pixels);
  EXPECT_EQ(s.error(), "the third frame is bad");
}

TEST(CalibratedSource, WithoutADepthCameraDepthIsAsItComes) {
  auto source = CalibratedSource::make(std::make_unique<WallSource>(), {{0.01f, 1, 0, 0}}, {});
  ASSERT_TRUE(source);
  test::FrameMemory memory((*source)->info());
  ASSERT_EQ((*source)->next(memory.frame, 0), Status::ok);
  EXPECT_EQ(memory.frame.depth_raw.at(10, 63), 2000);
}

TEST(CalibratedSource, ACalibrationForOtherImagesIsRefused) {
  DepthCamera depth = to_the_left();
  depth.model.k.width = 640, depth.model.k.height = 480;
  auto source = CalibratedSource::make(std::make_unique<WallSource>(), {}, depth);
  ASSERT_FALSE(source);
  EXPECT_EQ(source.error_kind(), ErrorKind::bad_usage);
  EXPECT_TRUE(test::contains(source.error(), "640x480")) << source.error();
  EXPECT_TRUE(test::contains(source.error(), "64x48")) << source.error();
}

}  // namespace
}  // namespace stillmap
