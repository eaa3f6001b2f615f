#include "drivers/v4l2/capture_node.hpp"

#include <gtest/gtest.h>

#include "tests/support/contains.hpp"
#include "tests/unit/drivers/v4l2/fake_kernel.hpp"

namespace stillmap {
namespace {

using test::contains;

class CaptureNodeTest : public ::testing::Test {
 protected:
  using Node = test::FakeKernel::Node;

  void TearDown() override {
    EXPECT_EQ(kernel_.open_files, 0);
    EXPECT_EQ(kernel_.mapped, 0);
  }
  Node& node() { return kernel_.nodes["/dev/video0"]; }
  Result<std::unique_ptr<CaptureNode>> open(ImageKind kind = ImageKind::depth, bool exact_size = false) {
    NodeRequest request;
    request.path = "/dev/video0";
    request.kind = kind;
    request.exact_size = exact_size;
    return CaptureNode::open(kernel_, request);
  }
  /// @return the message
  std::string refused(ImageKind kind = ImageKind::depth, bool exact_size = false) {
    const auto opened = open(kind, exact_size);
    EXPECT_FALSE(opened);
    if (opened) return {};
    EXPECT_EQ(opened.error_kind(), ErrorKind::cannot_open);
    EXPECT_TRUE(contains(opened.error(), "/dev/video0")) << opened.error();
    return opened.error();
  }

  test::FakeKernel kernel_;
};

TEST_F(CaptureNodeTest, TakesTheFirstFormatThatIsFastEnough) {
  node().formats = {{kGrey}, {kMjpeg}, {kRgb24}, {kYuyv}, {kZ16}};
  EXPECT_EQ((*open(ImageKind::colour))->format().format, kYuyv);
  node().formats = {{kMjpeg, 640, 480, 30}, {kYuyv, 640, 480, 10}};
  EXPECT_EQ((*open(ImageKind::colour))->format().format, kMjpeg);
  node().formats = {{kYuyv, 640, 480, 10}, {kRgb24, 640, 480, 20}, {kGrey, 640, 480, 15}};
  const auto fastest = open(ImageKind::colour);
  EXPECT_EQ((*fastest)->format().format, kRgb24);
  EXPECT_DOUBLE_EQ((*fastest)->format().rate_hz, 20);
  EXPECT_DOUBLE_EQ(node().rate_hz, 20);
}

TEST_F(CaptureNodeTest, TakesTheSizeThatTheNodeAnswers) {
  node().formats = {{kY16, 320, 180, 30}};
  node().padding = 8;
  const auto opened = open();
  ASSERT_TRUE(opened) << opened.error();
  const NodeFormat& format = (*opened)->format();
  EXPECT_EQ(format.cols, 320);
  EXPECT_EQ(format.rows, 180);
  EXPECT_EQ(format.pitch_bytes, 648u);
  EXPECT_EQ(format.needed_bytes, 648u * 179 + 640);
}

TEST_F(CaptureNodeTest, ANodeThatDoesNotSayItsRateIsTaken) {
  node().formats = {{kZ16}};
  node().sets_rate = false;
  const auto opened = open();
  ASSERT_TRUE(opened) << opened.error();
  EXPECT_EQ((*opened)->format().rate_hz, 0);
}

TEST_F(CaptureNodeTest, RefusalsListWhatIsOfferedAndWhatWouldDo) {
  node().formats = {{kYuyv, 320, 240, 30}, {fourcc("NV12")}};
  std::string message = refused();
  for (const char* part :
       {"gives no depth images", "Z16, Y16 of 640x480", "\n  YUYV 320x240 at 30 Hz", "of no use: NV12"})
    EXPECT_TRUE(contains(message, part)) << message;
  message = refused(ImageKind::colour, true);
  for (const char* part :
       {"gives no colour images", "as the depth images are", "YUYV: it answers 320x240", "source.cols=320"})
    EXPECT_TRUE(contains(message, part)) << message;
  node().formats = {};
  EXPECT_TRUE(contains(refused(), "it offers:\n  nothing"));
  node().capabilities = V4L2_CAP_VIDEO_OUTPUT | V4L2_CAP_STREAMING;
  EXPECT_TRUE(contains(refused(), "sends no images"));
}

TEST_F(CaptureNodeTest, RefusesAnswersThatCannotBe) {
  node().formats = {{kZ16}};
  const auto expect_problem = [&](const char* problem, std::function<void(v4l2_pix_format&)> change) {
    node().change_format = std::move(change);
    EXPECT_TRUE(contains(refused(), problem)) << problem;
  };
  expect_problem("it answers YUYV", [](v4l2_pix_format& f) { f.pixelformat = kYuyv; });
  expect_problem("it answers 8x480", [](v4l2_pix_format& f) { f.width = 8; });
  expect_problem("it answers 640x5000", [](v4l2_pix_format& f) { f.height = 5000; });
  expect_problem("it answers 4294967295x480", [](v4l2_pix_format& f) { f.width = ~0u; });
  expect_problem("interlaced", [](v4l2_pix_format& f) { f.field = V4L2_FIELD_INTERLACED; });
  expect_problem("rows of 639 bytes", [](v4l2_pix_format& f) { f.bytesperline = 639; });
  expect_problem("are too small", [](v4l2_pix_format& f) { f.sizeimage -= 1; });
  expect_problem("images have 4294967295 bytes", [](v4l2_pix_format& f) { f.sizeimage = ~0u; });
  expect_problem("are too small", [](v4l2_pix_format& f) { f.bytesperline = ~0u; });
}

TEST_F(CaptureNodeTest, EachCallThatFailsIsSaid) {
  const std::pair<unsigned long, const char*> calls[] = {
      {VIDIOC_S_FMT, "another program uses the camera"}, {VIDIOC_REQBUFS, "no buffers"},
      {VIDIOC_QUERYBUF, "does not do what it says"},     {VIDIOC_QBUF, "does not take a buffer"},
      {VIDIOC_STREAMON, "does not begin to send"},       {0, "another program uses it"}};
  for (const auto& [request, message] : calls) {
    node() = {};
    node().formats = {{kZ16}};
    node().fails[request] = EBUSY;
    EXPECT_TRUE(contains(refused(), message)) << message;
  }
  node() = {};
  node().formats = {{kZ16}};
  node().fails[VIDIOC_STREAMON] = ENOSPC;
  EXPECT_TRUE(contains(refused(), "bandwidth"));
  node() = {};
  node().formats = {{kZ16}};
  node().map_fails = true;
  EXPECT_TRUE(contains(refused(), "no memory"));
  node() = {};
  node().formats = {{kZ16}};
  node().buffers = 5;
  EXPECT_TRUE(contains(refused(), "gives 5 buffers, 6 are needed"));
  node() = {};
  node().formats = {{kZ16}};
  node().buffer_bytes = 640 * 480;
  EXPECT_TRUE(contains(refused(), "buffer 0 has 307200 bytes, an image needs 614400"));
}

TEST_F(CaptureNodeTest, SetsTheAutomaticsThatThereAre) {
  node().formats = {{kYuyv}};
  node().controls = {{V4L2_CID_AUTO_WHITE_BALANCE, -1}, {V4L2_CID_EXPOSURE_AUTO, -1}};
  ASSERT_TRUE(open(ImageKind::colour));
  EXPECT_EQ(node().controls[V4L2_CID_AUTO_WHITE_BALANCE], 1);
  EXPECT_EQ(node().controls[V4L2_CID_EXPOSURE_AUTO], V4L2_EXPOSURE_APERTURE_PRIORITY);
  NodeRequest request;
  request.path = "/dev/video0";
  request.kind = ImageKind::colour;
  request.auto_exposure = request.auto_white_balance = false;
  ASSERT_TRUE(CaptureNode::open(kernel_, request));
  EXPECT_EQ(node().controls[V4L2_CID_AUTO_WHITE_BALANCE], 0);
  EXPECT_EQ(node().controls[V4L2_CID_EXPOSURE_AUTO], V4L2_EXPOSURE_MANUAL);
  node().controls.clear();
  EXPECT_TRUE(open(ImageKind::colour));
}

TEST_F(CaptureNodeTest, TakesBuffersAndGivesThemBack) {
  node().formats = {{kZ16, 64, 48, 30}};
  const auto opened = open();
  ASSERT_TRUE(opened) << opened.error();
  CaptureNode& capture = **opened;
  FilledBuffer buffer;
  EXPECT_EQ(capture.take(buffer), Status::timeout);
  for (int64_t i = 1; i <= 20; ++i) {
    kernel_.send("/dev/video0", 1'000'000'000 * i + 5'000, static_cast<uint8_t>(i));
    ASSERT_EQ(capture.take(buffer), Status::ok);
    EXPECT_EQ(buffer.stamp_ns, 1'000'000'000 * i + 5'000);
    EXPECT_TRUE(buffer.monotonic);
    EXPECT_FALSE(buffer.damaged);
    EXPECT_EQ(buffer.sequence, i - 1);
    EXPECT_EQ(capture.image(buffer.index).data[100], i);
    ASSERT_EQ(capture.give_back(buffer.index), Status::ok);
  }
}

TEST_F(CaptureNodeTest, DamagedImagesAreMarked) {
  node().formats = {{kZ16, 64, 48, 30}};
  node().stamp_flags = V4L2_BUF_FLAG_TIMESTAMP_UNKNOWN;
  const auto opened = open();
  ASSERT_TRUE(opened) << opened.error();
  FilledBuffer buffer;
  kernel_.send("/dev/video0", 1, 0, V4L2_BUF_FLAG_ERROR);
  ASSERT_EQ((*opened)->take(buffer), Status::ok);
  EXPECT_TRUE(buffer.damaged);
  EXPECT_FALSE(buffer.monotonic);
  kernel_.send("/dev/video0", 2, std::vector<uint8_t>(64 * 48 * 2 - 1));
  ASSERT_EQ((*opened)->take(buffer), Status::ok);
  EXPECT_TRUE(buffer.damaged);
}

TEST_F(CaptureNodeTest, AGoneNodeStaysGone) {
  node().formats = {{kZ16, 64, 48, 30}};
  FilledBuffer buffer;
  {
    const auto opened = open();
    node().fails[VIDIOC_DQBUF] = EIO;
    EXPECT_EQ((*opened)->take(buffer), Status::bad_data);
    node().fails.clear();
    EXPECT_EQ((*opened)->take(buffer), Status::timeout);
    node().fails[VIDIOC_DQBUF] = ENODEV;
    EXPECT_EQ((*opened)->take(buffer), Status::unavailable);
    node().fails.clear();
    EXPECT_EQ((*opened)->take(buffer), Status::unavailable);
  }
  {
    const auto opened = open();
    node().fails[VIDIOC_QBUF] = EINVAL;
    EXPECT_EQ((*opened)->give_back(0), Status::unavailable);
    EXPECT_EQ((*opened)->take(buffer), Status::unavailable);
    node().fails.clear();
  }
  const auto opened = open();
  node().wrong_index = 100;
  kernel_.send("/dev/video0", 1, 0);
  EXPECT_EQ((*opened)->take(buffer), Status::unavailable);
}

}  // namespace
}  // namespace stillmap
