#include "runtime/picture/rasterise.hpp"

#include <gtest/gtest.h>

namespace stillmap {
namespace {

constexpr Rgb8 kBlack = {0, 0, 0};

/// A square of side 2 at depth z, counter-clockwise as the eye at the origin sees it (x right, y down).
void add_square(PlyMesh& mesh, float z, Rgb8 colour, bool turned = false) {
  const uint32_t n = static_cast<uint32_t>(mesh.vertices_m.size());
  for (const Vec3 p : {Vec3{-1, -1, z}, Vec3{-1, 1, z}, Vec3{1, 1, z}, Vec3{1, -1, z}}) {
    mesh.vertices_m.push_back(p);
    mesh.colours.push_back(colour);
  }
  if (turned) {
    mesh.triangles.push_back({n, n + 2, n + 1});
    mesh.triangles.push_back({n, n + 3, n + 2});
  } else {
    mesh.triangles.push_back({n, n + 1, n + 2});
    mesh.triangles.push_back({n, n + 2, n + 3});
  }
}

ViewPoint ahead(float scale_px, bool perspective = false) {
  ViewPoint view;
  view.scale_px = scale_px;
  view.perspective = perspective;
  return view;
}

bool is_background(Rgb8 p) {
  return p.r == 0 && p.g == 0 && p.b == 0;
}

TEST(Rasterise, FillsTheSquareAndNothingElse) {
  PlyMesh mesh;
  add_square(mesh, 5, {200, 100, 50});
  const Picture picture = rasterise(mesh, ahead(10), 40, 40, kBlack);
  int filled = 0;
  for (const Rgb8 p : picture.pixels) filled += is_background(p) ? 0 : 1;
  EXPECT_EQ(filled, 20 * 20);  // no hole along the diagonal either
  EXPECT_FALSE(is_background(picture.at(10, 10)));
  EXPECT_TRUE(is_background(picture.at(9, 9)));
  const Rgb8 middle = picture.at(20, 20);
  EXPECT_NEAR(middle.r, 2 * middle.g, 3);
  EXPECT_GT(middle.r, 110);
}

TEST(Rasterise, PerspectiveShrinksWithDistance) {
  PlyMesh mesh;
  add_square(mesh, 4, {200, 100, 50});
  const Picture picture = rasterise(mesh, ahead(40, true), 60, 60, kBlack);
  int filled = 0;
  for (const Rgb8 p : picture.pixels) filled += is_background(p) ? 0 : 1;
  EXPECT_EQ(filled, 20 * 20);
}

TEST(Rasterise, FacesSeenFromBehindAreLeftOut) {
  PlyMesh mesh;
  add_square(mesh, 5, {200, 100, 50}, true);
  for (const Rgb8 p : rasterise(mesh, ahead(10), 40, 40, kBlack).pixels) ASSERT_TRUE(is_background(p));
}

TEST(Rasterise, TheNearerSurfaceWinsInAnyOrder) {
  for (const bool near_first : {true, false}) {
    PlyMesh mesh;
    add_square(mesh, near_first ? 3.0f : 6.0f, near_first ? Rgb8{250, 0, 0} : Rgb8{0, 0, 250});
    add_square(mesh, near_first ? 6.0f : 3.0f, near_first ? Rgb8{0, 0, 250} : Rgb8{250, 0, 0});
    const Rgb8 middle = rasterise(mesh, ahead(10), 40, 40, kBlack).at(20, 20);
    EXPECT_GT(middle.r, 100);
    EXPECT_EQ(middle.b, 0);
  }
}

TEST(Rasterise, KeepsOnlyWhatIsAskedFor) {
  PlyMesh mesh;
  add_square(mesh, 3, {250, 0, 0});
  add_square(mesh, 6, {0, 0, 250});
  const Picture picture = rasterise(mesh, ahead(10), 40, 40, kBlack, [](Vec3 p) { return p.z > 4; });
  EXPECT_EQ(picture.at(20, 20).r, 0);
  EXPECT_GT(picture.at(20, 20).b, 100);
}

TEST(Rasterise, BehindTheEyeAndFarOutsideIsLeftOut) {
  PlyMesh mesh;
  add_square(mesh, -2, {250, 0, 0});
  mesh.vertices_m.push_back({1e30f, -1e30f, 1});
  mesh.colours.push_back({250, 0, 0});
  mesh.triangles.push_back({0, 1, 4});
  for (const Rgb8 p : rasterise(mesh, ahead(40, true), 40, 40, kBlack).pixels) ASSERT_TRUE(is_background(p));
}

TEST(Rasterise, CloudsAreDrawnAsPoints) {
  PlyMesh cloud;
  cloud.vertices_m = {{0, 0, 2}};
  const Picture picture = rasterise(cloud, ahead(10), 20, 20, kBlack);
  EXPECT_FALSE(is_background(picture.at(10, 10)));
  EXPECT_TRUE(is_background(picture.at(2, 2)));
}

TEST(Halved, IsTheMeanOfFour) {
  Picture picture(2, 2, {});
  picture.at(0, 0) = {100, 0, 0};
  picture.at(1, 1) = {0, 0, 200};
  const Picture half = halved(picture);
  ASSERT_EQ(half.pixels.size(), 1u);
  EXPECT_EQ(half.at(0, 0).r, 25);
  EXPECT_EQ(half.at(0, 0).b, 50);
}

}  // namespace
}  // namespace stillmap
