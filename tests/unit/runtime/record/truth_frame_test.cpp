#include "runtime/record/truth_frame.hpp"

#include <gtest/gtest.h>

namespace stillmap {
namespace {

Se3d pose(double x, double y, double z, Vec3d rotation) {
  return exp(Twistd{{x, y, z}, rotation});
}

TEST(TruthFrame, PutsTheFirstMappedFrameAtItsMapPose) {
  const Se3d T_world_cam0 = pose(1, 2, 3, {0.3, -0.2, 0.9}), T_world_cam1 = pose(1.5, 2, 2, {0.1, 0.4, 0.2});
  const Se3d T_map_cam0 = pose(-1, 0, 0.5, {0, 0.5, 0});
  TruthFrame frame;
  EXPECT_FALSE(frame.anchored());
  frame.anchor(T_map_cam0, T_world_cam0);
  frame.anchor(T_map_cam0, T_world_cam1);  // only the first counts
  ASSERT_TRUE(frame.anchored());
  const Twistd at_start = log(inverse(T_map_cam0) * frame.to_map(T_world_cam0));
  EXPECT_LT(norm(at_start.v) + norm(at_start.w), 1e-12);
  // Motion between the frames, seen from the camera, is the same in both worlds.
  const Se3d moved = inverse(frame.to_map(T_world_cam0)) * frame.to_map(T_world_cam1);
  const Twistd difference = log(inverse(moved) * inverse(T_world_cam0) * T_world_cam1);
  EXPECT_LT(norm(difference.v) + norm(difference.w), 1e-12);
}

TEST(TruthFrame, MovesPointsAsItMovesPoses) {
  TruthFrame frame;
  frame.anchor(Se3d{}, pose(1, 2, 3, {0, 0, 0}));
  const auto points = in_map_frame(frame, {{1, 2, 3}, {1, 2, 4}});
  EXPECT_FLOAT_EQ(points[0].z, 0);
  EXPECT_FLOAT_EQ(points[1].z, 1);
}

}  // namespace
}  // namespace stillmap
