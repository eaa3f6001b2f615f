#include "drivers/v4l2/node_description.hpp"

#include <gtest/gtest.h>

#include "tests/support/contains.hpp"
#include "tests/unit/drivers/v4l2/fake_kernel.hpp"

namespace stillmap {
namespace {

using test::contains;

TEST(NodeDescription, SaysWhatANodeOffers) {
  test::FakeKernel kernel;
  kernel.nodes["/dev/video0"].formats = {
      {kZ16, 640, 480, 30}, {kMjpeg, 1280, 720, 60}, {fourcc("NV12"), 64, 48, 5}};
  const auto node = describe_node(kernel, "/dev/video0");
  ASSERT_TRUE(node) << node.error();
  EXPECT_TRUE(node->streams);
  ASSERT_EQ(node->formats.size(), 3u);
  EXPECT_DOUBLE_EQ(node->find(kMjpeg)->sizes.at(0).rate_hz, 60);
  EXPECT_EQ(node->find(kYuyv), nullptr);
  EXPECT_EQ(summary_text(*node), "a camera; depth Z16; colour MJPG");
  EXPECT_EQ(offers_text(*node), "\n  Z16  640x480 at 30 Hz\n  MJPG 1280x720 at 60 Hz\n  of no use: NV12");
  EXPECT_EQ(kernel.open_files, 0);
}

TEST(NodeDescription, NodesThatCannotBeOpenedSayWhatToDo) {
  test::FakeKernel kernel;
  EXPECT_TRUE(contains(describe_node(kernel, "/dev/video9").error(), "/dev/video9: No such file"));
  kernel.nodes["/dev/video0"].fails[0] = EACCES;
  EXPECT_TRUE(contains(describe_node(kernel, "/dev/video0").error(), "usermod -aG video"));
  kernel.nodes["/dev/video1"].fails[VIDIOC_QUERYCAP] = ENOTTY;
  const auto node = describe_node(kernel, "/dev/video1");
  EXPECT_TRUE(contains(node.error(), "is no video node"));
  EXPECT_EQ(node.error_kind(), ErrorKind::cannot_open);
  EXPECT_EQ(kernel.open_files, 0);
}

TEST(NodeDescription, NodesOfOtherKindsSendNothing) {
  test::FakeKernel kernel;
  kernel.nodes["/dev/video0"].capabilities = V4L2_CAP_META_CAPTURE | V4L2_CAP_STREAMING;
  const auto node = describe_node(kernel, "/dev/video0");
  ASSERT_TRUE(node);
  EXPECT_FALSE(node->streams);
  EXPECT_EQ(summary_text(*node), "a camera: sends no images");
}

TEST(NodeDescription, ThisMachinesKernelRefusesWhatIsNoVideoNode) {
  EXPECT_TRUE(contains(describe_node(kernel_calls(), "/dev/null").error(), "/dev/null is no video node"));
  EXPECT_TRUE(contains(describe_node(kernel_calls(), "/nowhere/video0").error(), "No such file"));
}

}  // namespace
}  // namespace stillmap
