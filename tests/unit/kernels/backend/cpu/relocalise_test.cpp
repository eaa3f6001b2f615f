// Keyframes and the search among them, through the engine.

#include <gtest/gtest.h>

#include <cstring>
#include <memory>
#include <string>
#include <vector>

#include "kernels/engine.hpp"
#include "tests/support/corner_scene.hpp"

namespace stillmap {
namespace {

using test::corner_camera;
using test::CornerScene;
using test::CornerView;

EngineParams params() {
  EngineParams p;
  p.camera.k = corner_camera(160);
  p.map.voxel_m = 0.02f;
  p.map.pool_blocks = 20000;
  p.relocalise.max_keyframes = 16;
  p.threads = 2;
  return p;
}

const Se3d kHome, kAside = exp(Twistd{{-0.35, -0.1, 0.1}, {0.0, 0.25, 0.0}}),
                  kBetween = exp(Twistd{{-0.27, -0.02, 0.05}, {0.05, 0.15, 0.03}}),
                  kFar = exp(Twistd{{5, 5, 5}, {1, 2, 0}});

/// An engine with the corner mapped from two places.
class Relocalise : public testing::Test {
 protected:
  explicit Relocalise(const EngineParams& p = params()) : engine(make_cpu_engine(p)) {
    for (const Se3d& T : {kHome, kAside}) {
      look(CornerScene{}, T);
      engine->integrate(cast<float>(T));
      engine->remember_place(cast<float>(T));
    }
  }
  void look(const CornerScene& scene, const Se3d& T_map_cam) {
    const CornerView view(scene, corner_camera(160), T_map_cam);
    EXPECT_EQ(engine->prepare({view.image(view.depth_raw), view.image(view.colour)}).status, Status::ok);
  }
  static double off_m(const PlaceResult& r, const Se3d& truth) {
    return norm(cast<double>(r.T_map_cam).translation - truth.translation);
  }
  std::unique_ptr<Engine> engine;
};

TEST_F(Relocalise, FindsAPlaceBetweenTwoThatWereSeen) {
  look(CornerScene{}, kBetween);
  const PlaceResult r = engine->find_place(cast<float>(kFar), 0);
  EXPECT_EQ(r.status, Status::ok);
  EXPECT_EQ(r.keyframes, 2);
  EXPECT_LT(off_m(r, kBetween), 0.01);
  EXPECT_GT(r.check.on, 0.8f);
  EXPECT_GT(r.check.texture_correlation, 0.8f);
}

TEST_F(Relocalise, KeyframesThatWereReadBackFindTheSamePlace) {
  std::vector<std::vector<uint8_t>> places, groups;
  std::vector<uint8_t> record(1 << 19);
  const View<uint8_t> space{record.data(), 1 << 19};
  std::vector<uint64_t> keys(engine->group_capacity());
  keys.resize(engine->list_groups({keys.data(), engine->group_capacity()}));
  for (const uint64_t key : keys)
    groups.emplace_back(record.data(), record.data() + engine->write_group(key, space));
  ASSERT_EQ(engine->place_count(), 2u);
  for (uint32_t i = 0; i < 2; ++i)
    places.emplace_back(record.data(), record.data() + engine->write_place(i, space));
  EXPECT_EQ(engine->write_place(2, space), 0u);
  EXPECT_EQ(engine->write_place(0, {record.data(), 100}), 0u);

  engine->reset_map();
  EXPECT_EQ(engine->place_count(), 0u);
  const auto view = [](const std::vector<uint8_t>& bytes) {
    return View<const uint8_t>{bytes.data(), static_cast<uint32_t>(bytes.size())};
  };
  for (const auto& group : groups) ASSERT_EQ(engine->read_group(view(group)), Status::ok);
  for (const auto& place : places) ASSERT_EQ(engine->read_place(view(place)), Status::ok);
  look(CornerScene{}, kBetween);
  const PlaceResult r = engine->find_place(cast<float>(kFar), 0);
  EXPECT_EQ(r.status, Status::ok);
  EXPECT_EQ(r.keyframes, 2);
  EXPECT_LT(off_m(r, kBetween), 0.01);
}

TEST_F(Relocalise, KeyframesThatCannotBeReadChangeNothing) {
  std::vector<uint8_t> record(1000);
  record.resize(engine->write_place(0, {record.data(), 1000}));
  const auto answer = [&](const std::vector<uint8_t>& bytes) {
    return engine->read_place({bytes.data(), static_cast<uint32_t>(bytes.size())});
  };
  for (const size_t bytes : {size_t{0}, size_t{59}, size_t{60}, record.size() - 1})
    EXPECT_EQ(answer({record.begin(), record.begin() + static_cast<std::ptrdiff_t>(bytes)}),
              Status::bad_data);
  auto turned = record;
  turned[3] ^= 0x40;  // no rotation any more
  EXPECT_EQ(answer(turned), Status::bad_data);
  auto other_camera = record;
  other_camera[52] ^= 1;  // rows of the view
  EXPECT_EQ(answer(other_camera), Status::unavailable);
  EXPECT_EQ(engine->place_count(), 2u);
}

TEST_F(Relocalise, AFullStoreGivesUpItsMostRedundantKeyframe) {
  std::vector<uint8_t> record(1000);
  record.resize(engine->write_place(0, {record.data(), 1000}));
  for (int i = 0; i < 40; ++i)
    ASSERT_EQ(engine->read_place({record.data(), static_cast<uint32_t>(record.size())}), Status::ok);
  EXPECT_EQ(engine->place_count(), 16u);
  look(CornerScene{}, kBetween);
  EXPECT_EQ(engine->find_place(cast<float>(kFar), 0).status, Status::ok);
}

TEST_F(Relocalise, SomeoneInTheWayDoesNotHinder) {
  CornerScene scene;
  scene.box = {{-0.3, -0.3, 1.0}, {0.1, 0.4, 1.06}};
  look(scene, kBetween);
  const PlaceResult r = engine->find_place(cast<float>(kFar), 0);
  EXPECT_EQ(r.status, Status::ok);
  EXPECT_LT(off_m(r, kBetween), 0.02);
  EXPECT_GT(r.check.front, 0.1f);
}

TEST_F(Relocalise, AnotherCornerIsNotTakenForThisOne) {
  CornerScene other;
  other.wall_x += 0.150;  // by half a wave of its texture: planes alone cannot tell
  other.floor_y += 0.137;
  other.back_z -= 0.165;
  look(other, kHome);
  for (int32_t attempt = 0; attempt < 4; ++attempt)
    EXPECT_EQ(engine->find_place(cast<float>(kHome), attempt).status, Status::unavailable);
}

TEST_F(Relocalise, TheSameShapeWithAnotherTextureIsAnotherPlace) {
  CornerScene plain;
  plain.textured = false;
  look(plain, kHome);
  EXPECT_EQ(engine->find_place(cast<float>(kHome), 0).status, Status::unavailable);
}

TEST_F(Relocalise, ConfirmsFromNearByWithoutKeyframes) {
  look(CornerScene{}, kBetween);
  EXPECT_EQ(engine->confirm_place(cast<float>(kAside)).status, Status::ok);
  EXPECT_EQ(engine->confirm_place(cast<float>(kFar)).status, Status::unavailable);
}

TEST_F(Relocalise, TheGuessIsTriedFirst) {
  engine->reset_map();
  look(CornerScene{}, kHome);
  engine->integrate(cast<float>(kHome));
  EXPECT_EQ(engine->find_place(cast<float>(kHome), 0).status, Status::ok);
  EXPECT_EQ(engine->find_place(cast<float>(kHome), 1).status, Status::unavailable);  // there is no keyframe
}

TEST_F(Relocalise, ThePlacesAreForgottenWithTheMap) {
  engine->reset_map();
  look(CornerScene{}, kHome);
  EXPECT_EQ(engine->find_place(cast<float>(kHome), 0).keyframes, 0);
}

TEST_F(Relocalise, WhatIsKnownIsNotKeptTwice) {
  for (int i = 0; i < 5; ++i) {
    look(CornerScene{}, kHome);
    engine->remember_place(cast<float>(kHome));
  }
  EXPECT_EQ(engine->find_place(cast<float>(kHome), 0).keyframes, 2);
}

TEST_F(Relocalise, AFullStoreKeepsTheMostDifferentOnes) {
  CornerScene scene;
  for (int i = 0; i < 60; ++i) {
    scene.back_z = 1.2 + 0.02 * i;
    const Se3d T = exp(Twistd{{0.3 * (i % 8), 0.3 * (i / 8), 0}, {}});
    look(scene, {});
    engine->remember_place(cast<float>(T));
  }
  EXPECT_EQ(engine->find_place(cast<float>(kFar), 0).keyframes, 16);
  look(CornerScene{}, kBetween);
  EXPECT_EQ(engine->find_place(cast<float>(kFar), 0).keyframes, 16);
}

TEST_F(Relocalise, TheAnswerDoesNotDependOnThreads) {
  EngineParams one = params();
  one.threads = 1;
  const std::unique_ptr<Engine> single = make_cpu_engine(one);
  for (const Se3d& T : {kHome, kAside}) {
    const CornerView view(CornerScene{}, corner_camera(160), T);
    single->prepare({view.image(view.depth_raw), view.image(view.colour)});
    single->integrate(cast<float>(T));
    single->remember_place(cast<float>(T));
  }
  const CornerView view(CornerScene{}, corner_camera(160), kBetween);
  single->prepare({view.image(view.depth_raw), view.image(view.colour)});
  look(CornerScene{}, kBetween);
  const PlaceResult a = engine->find_place(cast<float>(kFar), 0),
                    b = single->find_place(cast<float>(kFar), 0);
  EXPECT_EQ(std::memcmp(&a.T_map_cam, &b.T_map_cam, sizeof a.T_map_cam), 0);
  EXPECT_EQ(a.check.on, b.check.on);
}

TEST(RelocaliseOff, TakesNoMemoryAndFindsNothing) {
  EngineParams p = params();
  const uint64_t with = plan_cpu_engine(p).total_bytes;
  p.relocalise.enabled = false;
  const MemoryItems items = plan_cpu_engine(p);
  EXPECT_LT(items.total_bytes, with);
  for (uint32_t i = 0; i < items.count; ++i)
    EXPECT_EQ(std::string(items.item[i].name).find("relocalisation"), std::string::npos);
  const std::unique_ptr<Engine> engine = make_cpu_engine(p);
  engine->remember_place({});
  EXPECT_EQ(engine->find_place({}, 0).status, Status::unavailable);
  EXPECT_EQ(engine->confirm_place({}).status, Status::unavailable);
}

}  // namespace
}  // namespace stillmap
