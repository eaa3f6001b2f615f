#include "runtime/pipeline/pipeline.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <string>
#include <vector>

namespace stillmap {
namespace {

/// An engine that answers as told and writes down what it was asked.
class ScriptedEngine : public Engine {
 public:
  PrepareResult prepare(const FrameView& frame) override {
    calls += 'p';
    period_s = frame.period_s;
    return {prepare_status, 1000};
  }
  TrackResult track(const Se3& T_start, const PosePrior&) override {
    calls += 't';
    track_start = T_start;
    return calls == "ptt" ? tracked_again : tracked;
  }
  MaskResult mask(const Se3& T) override {
    calls += 'm';
    mask_pose = T;
    return {Status::ok, masked_pixels, masked_pixels};
  }
  TrackResult refine(const Se3& T_start, const PosePrior&) override {
    calls += 'r';
    refine_start = T_start;
    return refined;
  }
  void limit_finest_level(int32_t level) override { finest_level = level; }
  IntegrateResult integrate(const Se3& T) override {
    calls += 'i';
    integrate_pose = T;
    return {};
  }
  uint32_t keep_frame(const Se3& T, const NearEcho& echo) override {
    calls += 'k';
    kept.push_back(T);
    echoes.push_back(echo);
    return kept_frames();
  }
  IntegrateResult integrate_kept(uint32_t index) override {
    calls += 'o';
    integrate_pose = kept.at(index);
    mapped_x.push_back(integrate_pose.translation.x);
    return {};
  }
  void forget_kept(uint32_t oldest) override {
    kept.erase(kept.begin(), kept.begin() + oldest);
    echoes.erase(echoes.begin(), echoes.begin() + oldest);
  }
  uint32_t kept_frames() const override { return static_cast<uint32_t>(kept.size()); }
  void remember_place(const Se3&) override { ++keyframes; }
  PlaceResult find_place(const Se3& T_guess, int32_t) override {
    calls += 'f';
    find_guess = T_guess;
    return place;
  }
  PlaceResult confirm_place(const Se3&) override {
    calls += 'c';
    return place;
  }
  Status raycast(const Se3&, const Intrinsics&, ImageView<float>, ImageView<Rgb8>) override {
    return Status::ok;
  }
  Status extract_mesh(MeshSink&) override { return Status::ok; }
  void look_up(View<const Vec3>, View<PointState>) const override {}
  uint32_t list_groups(View<uint64_t>) const override { return 0; }
  uint32_t write_group(uint64_t, View<uint8_t>) const override { return 0; }
  Status read_group(View<const uint8_t>) override { return Status::unavailable; }
  uint32_t farthest_groups(Vec3, View<uint64_t>, bool) override { return 0; }
  void put_away(uint64_t, uint32_t) override {}
  void forget_group(uint64_t) override {}
  uint32_t wanted_groups(View<ArchivedGroup>) const override { return 0; }
  uint32_t group_capacity() const override { return 0; }
  uint32_t place_count() const override { return 0; }
  uint32_t write_place(uint32_t, View<uint8_t>) const override { return 0; }
  Status read_place(View<const uint8_t>) override { return Status::unavailable; }
  ImageView<const uint8_t> mask_image() const override { return {nullptr, 10, 20, 20}; }
  ImageView<const float> depth_image_m() const override { return {}; }
  ImageView<const Rgb8> colour_image() const override { return {}; }
  MapHealth map_health() const override {
    MapHealth health;
    health.blocks = 77;
    return health;
  }
  void reset_map() override {
    ++resets;
    kept.clear();
    echoes.clear();
  }

  std::string calls;  ///< first letters, in order
  Status prepare_status = Status::ok;
  TrackResult tracked, refined;
  TrackResult tracked_again;  ///< by a second call for the same frame
  int32_t masked_pixels = 0, keyframes = 0, resets = 0, finest_level = 0;
  PlaceResult place;
  Se3 find_guess;
  float period_s = -1;  ///< told with the last frame
  Se3 track_start, mask_pose, refine_start, integrate_pose;
  std::vector<Se3> kept;  ///< what waits to be completed
  std::vector<NearEcho> echoes;
  std::vector<float> mapped_x;  ///< of the poses of what was completed
};

Se3 at(float x, float y = 0) {
  Se3 T;
  T.translation = {x, y, 0};
  return T;
}

class PipelineTest : public testing::Test {
 protected:
  PipelineTest() {
    config_.track.prior = MotionPrior::last_pose;
    config_.track.first_finest_level = 0;
  }
  /// Both registrations answer this pose and share of inliers.
  void answer(const Se3& T, float inlier_ratio = 0.9f, Status status = Status::ok) {
    engine_.tracked.status = engine_.refined.status = status;
    engine_.tracked.T_world_cam = engine_.refined.T_world_cam = T;
    engine_.tracked.inlier_ratio = engine_.refined.inlier_ratio = inlier_ratio;
    engine_.tracked.converged = true;
  }
  FrameResult process(Pipeline& pipeline, int64_t stamp_ms) {
    engine_.calls.clear();
    RgbdFrame frame;
    frame.depth_stamp = {stamp_ms * 1000000};
    frame.sequence = static_cast<uint32_t>(stamp_ms);
    return pipeline.process(frame);
  }
  ScriptedEngine engine_;
  Config config_;
};

TEST_F(PipelineTest, TheFirstFrameIsTheMap) {
  Pipeline pipeline(engine_, config_);
  const FrameResult result = process(pipeline, 33);
  EXPECT_EQ(engine_.calls, "pi");
  EXPECT_EQ(result.status, Status::ok);
  EXPECT_EQ(result.state, TrackingState::good);
  EXPECT_EQ(norm(result.T_map_cam.translation), 0.0);
  EXPECT_EQ(result.T_map_cam.rotation(0, 0), 1.0);
  EXPECT_EQ(result.p_good, 1.0f);
  EXPECT_EQ(result.stamp.ns, 33000000);
  EXPECT_EQ(result.sequence, 33u);
  EXPECT_EQ(result.map.blocks, 77u);
  EXPECT_EQ(pipeline.counters().frames, 1u);
}

TEST_F(PipelineTest, ANewMapBeginsWhereTheCameraWasSeenLast) {
  Pipeline pipeline(engine_, config_);
  answer(at(0.05f));
  process(pipeline, 0);
  process(pipeline, 100);
  EXPECT_EQ(pipeline.lost_s(), 0.0);
  answer(at(5), 0.0f);
  process(pipeline, 200);
  EXPECT_EQ(pipeline.lost_s(), 0.0);  // just now
  process(pipeline, 1700);
  EXPECT_NEAR(pipeline.lost_s(), 1.5, 1e-9);
  pipeline.start_new_map();
  EXPECT_EQ(engine_.resets, 1);
  EXPECT_EQ(pipeline.lost_s(), 0.0);
  const FrameResult result = process(pipeline, 1800);
  EXPECT_EQ(engine_.calls, "pi");
  EXPECT_EQ(result.state, TrackingState::good);
  EXPECT_EQ(result.T_map_cam.translation.x, static_cast<double>(0.05f));
  EXPECT_EQ(pipeline.counters().new_maps, 1u);
  EXPECT_EQ(pipeline.counters().relocalised, 0u);
  answer(at(0.06f));
  EXPECT_EQ(process(pipeline, 1900).state, TrackingState::good);
}

TEST_F(PipelineTest, TheEngineIsToldHowFarApartFramesAre) {
  Pipeline pipeline(engine_, config_);
  answer(at(0));
  process(pipeline, 0);
  EXPECT_EQ(engine_.period_s, 0.0f);  // nobody knows
  for (const int64_t ms : {40, 80, 120}) process(pipeline, ms);
  EXPECT_NEAR(engine_.period_s, 0.040f, 1e-6f);
  process(pipeline, 5120);  // a gap is hardly a longer period
  process(pipeline, 5160);
  EXPECT_NEAR(engine_.period_s, 0.046f, 1e-6f);
  for (int64_t ms = 5260; ms < 20000; ms += 100) process(pipeline, ms);
  EXPECT_NEAR(engine_.period_s, 0.1f, 1e-3f);
}

TEST_F(PipelineTest, InAMapThatIsThereTheCameraIsFoundBeforeAnythingIsMapped) {
  Pipeline pipeline(engine_, config_);
  pipeline.start_lost(cast<double>(at(3)));
  answer(at(4));
  FrameResult result = process(pipeline, 33);
  EXPECT_EQ(engine_.calls, "pf");  // no integration
  EXPECT_EQ(engine_.find_guess.translation.x, 3.0f);
  EXPECT_EQ(result.state, TrackingState::lost);
  EXPECT_EQ(result.T_map_cam.translation.x, 3.0);
  engine_.place.status = Status::ok;
  engine_.place.T_map_cam = at(4);
  for (int frame = 2; result.state == TrackingState::lost && frame < 10; ++frame)
    result = process(pipeline, 33 * frame);
  EXPECT_EQ(result.state, TrackingState::good);
  EXPECT_EQ(engine_.calls.back(), 'i');
  EXPECT_EQ(result.T_map_cam.translation.x, 4.0);
  EXPECT_EQ(pipeline.counters().relocalised, 1u);
}

TEST_F(PipelineTest, WithoutASearchTheMapIsGoneOnWithFromTheGuess) {
  config_.relocalise.enabled = false;
  Pipeline pipeline(engine_, config_);
  pipeline.start_lost(cast<double>(at(3)));
  answer(at(3));
  EXPECT_EQ(process(pipeline, 33).state, TrackingState::good);
  EXPECT_EQ(engine_.calls.substr(0, 2), "pt");
  EXPECT_EQ(engine_.track_start.translation.x, 3.0f);
}

TEST_F(PipelineTest, TheInitialPoseIsThatOfTheFirstFrame) {
  Pipeline pipeline(engine_, config_, exp(Twistd{{1, 2, 3}, {0, 0, 0.5}}));
  EXPECT_NEAR(process(pipeline, 0).T_map_cam.translation.x, exp(Twistd{{1, 2, 3}, {0, 0, 0.5}}).translation.x,
              1e-12);
  EXPECT_NEAR(engine_.integrate_pose.rotation(1, 0), std::sin(0.5f), 1e-6f);
  answer(at(1));
  process(pipeline, 33);
  EXPECT_NEAR(engine_.track_start.translation.z, 3.0f, 1e-5f);
}

TEST_F(PipelineTest, AFrameGoesThroughTheStepsOfThePaper) {
  Pipeline pipeline(engine_, config_);
  process(pipeline, 0);
  answer(at(0.1f));
  engine_.refined.T_world_cam = at(0.2f);
  engine_.refined.covariance[0] = 3e-6f;
  engine_.masked_pixels = 50;  // of 10 x 20
  const FrameResult result = process(pipeline, 33);
  EXPECT_EQ(engine_.calls, "ptmri");
  EXPECT_EQ(engine_.mask_pose.translation.x, 0.1f);
  EXPECT_EQ(engine_.refine_start.translation.x, 0.1f);
  EXPECT_EQ(engine_.integrate_pose.translation.x, 0.2f);
  EXPECT_NEAR(result.T_map_cam.translation.x, 0.2, 1e-6);
  EXPECT_EQ(result.masked_fraction, 0.25f);
  EXPECT_EQ(result.covariance[0], 3e-6f);
  EXPECT_EQ(result.inlier_ratio, 0.9f);
  EXPECT_GT(result.p_good, 0.5f);
  EXPECT_GE(result.ms.total_ms, 0.0f);
}

TEST_F(PipelineTest, WithoutAMaskAConvergedRegistrationIsNotRepeated) {
  Pipeline pipeline(engine_, config_);
  process(pipeline, 0);
  answer(at(0.1f));
  EXPECT_NEAR(process(pipeline, 33).T_map_cam.translation.x, 0.1, 1e-6);
  EXPECT_EQ(engine_.calls, "ptmi");
  engine_.tracked.converged = false;
  process(pipeline, 66);
  EXPECT_EQ(engine_.calls, "ptmri");
}

TEST_F(PipelineTest, ABadFrameIsCountedAndTouchesNothing) {
  config_.track.prior = MotionPrior::last_pose;
  Pipeline pipeline(engine_, config_);
  engine_.prepare_status = Status::bad_data;
  const FrameResult first = process(pipeline, 0);  // the next is the map
  EXPECT_EQ(first.status, Status::bad_data);
  EXPECT_EQ(first.state, TrackingState::lost);
  EXPECT_EQ(engine_.calls, "p");
  engine_.prepare_status = Status::ok;
  process(pipeline, 33);
  EXPECT_EQ(engine_.calls, "pi");
  answer(at(0.01f));
  process(pipeline, 66);
  engine_.prepare_status = Status::bad_data;
  const FrameResult bad = process(pipeline, 100);
  EXPECT_EQ(engine_.calls, "p");
  EXPECT_EQ(bad.status, Status::bad_data);
  EXPECT_NEAR(bad.T_map_cam.translation.x, 0.01, 1e-6);
  EXPECT_EQ(bad.state, TrackingState::poor);
  engine_.prepare_status = Status::ok;
  process(pipeline, 133);
  EXPECT_EQ(engine_.track_start.translation.x, 0.01f);
  EXPECT_EQ(pipeline.counters().frames, 5u);
  EXPECT_EQ(pipeline.counters().bad_frames, 2u);
  EXPECT_EQ(pipeline.counters().lost_frames, 1u);
}

TEST_F(PipelineTest, WithoutAFrameTheMotionGoesOnUntilItIsUnsure) {
  config_.track.prior = MotionPrior::constant_velocity;
  Pipeline pipeline(engine_, config_);
  for (int i = 0; i <= 30; ++i) {
    answer(at(0.01f * static_cast<float>(i)));
    process(pipeline, 33 * i);
  }
  engine_.prepare_status = Status::bad_data;
  const FrameResult soon = process(pipeline, 31 * 33);
  EXPECT_EQ(soon.state, TrackingState::poor);
  EXPECT_NEAR(soon.T_map_cam.translation.x, 0.31, 0.003);
  EXPECT_GT(soon.p_good, 0.99f);
  const FrameResult late = process(pipeline, 38 * 33);  // 0.27 s without a frame: 3 cm too far, or 5
  EXPECT_EQ(late.state, TrackingState::lost);
  EXPECT_LT(late.p_good, soon.p_good);
  engine_.prepare_status = Status::ok;
  answer(at(0.32f));
  EXPECT_EQ(process(pipeline, 39 * 33).state, TrackingState::lost);  // it is looked for
}

TEST_F(PipelineTest, APoorPoseFreezesTheMap) {
  Pipeline pipeline(engine_, config_);
  process(pipeline, 0);
  answer(at(0.1f), 0.3f);  // between lost at 0.2 and poor at 0.4
  const FrameResult result = process(pipeline, 33);
  EXPECT_EQ(result.state, TrackingState::poor);
  EXPECT_EQ(engine_.calls, "ptm");
  EXPECT_NEAR(result.T_map_cam.translation.x, 0.1, 1e-6);  // the pose goes out all the same
  EXPECT_GT(result.p_good, 0.0f);
  EXPECT_LT(result.p_good, 0.5f);
  EXPECT_EQ(pipeline.counters().lost_frames, 0u);
}

TEST_F(PipelineTest, WithoutMappingTheFirstFrameStaysTheMap) {
  config_.pipeline.mapping = false;
  Pipeline pipeline(engine_, config_);
  answer(at(0.01f));
  EXPECT_TRUE(process(pipeline, 33).integrated);
  const auto keyframes = engine_.keyframes;
  EXPECT_GT(keyframes, 0);
  const FrameResult result = process(pipeline, 66);
  EXPECT_EQ(result.state, TrackingState::good);
  EXPECT_FALSE(result.integrated);
  EXPECT_EQ(engine_.calls, "ptm");
  EXPECT_EQ(engine_.keyframes, keyframes);
}

TEST_F(PipelineTest, LostIsSaidCountedAndComesBack) {
  Pipeline pipeline(engine_, config_);
  process(pipeline, 0);
  answer(at(0.1f));
  process(pipeline, 33);
  answer(at(0.1f), 0.9f, Status::degenerate);
  EXPECT_EQ(process(pipeline, 66).state, TrackingState::lost);
  EXPECT_EQ(engine_.calls.find('i'), std::string::npos);
  const FrameResult lost = process(pipeline, 100);
  EXPECT_EQ(engine_.calls, "pf");
  EXPECT_EQ(lost.state, TrackingState::lost);
  EXPECT_NEAR(lost.T_map_cam.translation.x, 0.1, 1e-6);
  EXPECT_EQ(lost.p_good, 0.0f);
  EXPECT_EQ(pipeline.counters().lost_frames, 2u);
  EXPECT_EQ(pipeline.counters().relocalised, 0u);
  engine_.prepare_status = Status::bad_data;
  EXPECT_EQ(process(pipeline, 133).state, TrackingState::lost);  // a bad frame finds nothing again
  EXPECT_EQ(pipeline.counters().lost_frames, 3u);
  engine_.prepare_status = Status::ok;
  engine_.place.status = Status::ok;
  engine_.place.T_map_cam = at(0.7f);
  answer(at(0.8f), 0.8f);
  EXPECT_EQ(process(pipeline, 166).state, TrackingState::lost);  // found, not yet believed
  EXPECT_EQ(process(pipeline, 200).state, TrackingState::lost);
  EXPECT_EQ(engine_.calls, "pc");
  const FrameResult found = process(pipeline, 233);
  EXPECT_EQ(engine_.calls, "pctmi");
  EXPECT_EQ(engine_.track_start.translation.x, 0.7f);
  EXPECT_EQ(found.state, TrackingState::good);
  EXPECT_NEAR(found.T_map_cam.translation.x, 0.8, 1e-6);
  EXPECT_EQ(pipeline.counters().relocalised, 1u);
  EXPECT_EQ(pipeline.counters().lost_frames, 5u);
  process(pipeline, 266);
  EXPECT_EQ(engine_.calls, "ptmi");
  EXPECT_EQ(pipeline.counters().relocalised, 1u);
}

TEST_F(PipelineTest, WithoutRelocalisationALostCameraIsTrackedOn) {
  config_.relocalise.enabled = false;
  Pipeline pipeline(engine_, config_);
  process(pipeline, 0);
  answer(at(0.5f), 0.1f);
  EXPECT_EQ(process(pipeline, 33).state, TrackingState::lost);
  answer(at(0.2f), 0.8f);
  EXPECT_EQ(process(pipeline, 66).state, TrackingState::good);
  EXPECT_EQ(engine_.calls, "ptmi");
  EXPECT_EQ(pipeline.counters().relocalised, 1u);
  EXPECT_EQ(engine_.keyframes, 0);
}

TEST_F(PipelineTest, ALongStretchWithoutAUsableFrameIsALoss) {
  Pipeline pipeline(engine_, config_);
  process(pipeline, 0);
  answer(at(0.001f));
  process(pipeline, 33);
  process(pipeline, 66);
  engine_.prepare_status = Status::bad_data;
  EXPECT_EQ(process(pipeline, 200).state, TrackingState::poor);  // relocalise.blind_s is 0.2
  EXPECT_EQ(process(pipeline, 300).state, TrackingState::lost);
  engine_.prepare_status = Status::ok;
  EXPECT_EQ(process(pipeline, 333).state, TrackingState::lost);
  EXPECT_EQ(engine_.calls, "pf");
  EXPECT_EQ(engine_.find_guess.translation.x, 0.001f);  // the last pose is tried
  EXPECT_EQ(pipeline.counters().lost_frames, 2u);
  EXPECT_EQ(pipeline.counters().bad_frames, 2u);
}

TEST_F(PipelineTest, MissingFramesAreALossButASlowSourceIsNot) {
  Pipeline pipeline(engine_, config_);
  answer(at(0.1f));
  for (const int64_t stamp_ms : {0, 500, 1000, 1500})
    EXPECT_EQ(process(pipeline, stamp_ms).state, TrackingState::good) << stamp_ms;
  EXPECT_EQ(process(pipeline, 3100).state, TrackingState::lost);
}

TEST_F(PipelineTest, WellTrackedFramesAreOfferedAsKeyframes) {
  Pipeline pipeline(engine_, config_);
  process(pipeline, 0);
  EXPECT_EQ(engine_.keyframes, 1);
  answer(at(0.1f), 0.3f);  // poor
  for (int i = 1; i < 10; ++i) process(pipeline, 33 * i);
  EXPECT_EQ(engine_.keyframes, 1);
  answer(at(0.1f));
  for (int i = 10; i < 16; ++i) process(pipeline, 33 * i);
  EXPECT_EQ(engine_.keyframes, 3);  // every third
}

TEST_F(PipelineTest, ADegenerateFrameKeepsThePose) {
  Pipeline pipeline(engine_, config_);
  process(pipeline, 0);
  answer(at(0.1f));
  process(pipeline, 33);
  answer(at(9), 0.9f, Status::degenerate);
  EXPECT_NEAR(process(pipeline, 66).T_map_cam.translation.x, 0.1, 1e-6);
}

TEST_F(PipelineTest, StartsFromTheLastPoseUnlessAskedOtherwise) {
  config_.track.prior = MotionPrior::last_pose;
  Pipeline pipeline(engine_, config_);
  process(pipeline, 0);
  answer(at(0.1f));
  process(pipeline, 33);
  EXPECT_EQ(engine_.track_start.translation.x, 0.0f);
  answer(at(0.2f));
  process(pipeline, 66);
  EXPECT_EQ(engine_.track_start.translation.x, 0.1f);
}

TEST_F(PipelineTest, ConstantVelocityContinuesTheLastMotionByTime) {
  config_.relocalise.blind_s = 10;
  config_.track.prior = MotionPrior::constant_velocity;
  config_.track.prior_fade_s = 10;
  Pipeline pipeline(engine_, config_);
  process(pipeline, 0);
  answer(at(0.1f));
  process(pipeline, 40);
  EXPECT_EQ(engine_.track_start.translation.x, 0.0f);  // one pose is no motion
  answer(at(0.2f));
  process(pipeline, 80);
  EXPECT_NEAR(engine_.track_start.translation.x, 0.2f, 1e-3f);
  answer(at(0.25f));
  process(pipeline, 100);
  EXPECT_NEAR(engine_.track_start.translation.x, 0.25f, 1e-3f);  // half the time
}

TEST_F(PipelineTest, ConstantVelocityTurnsWithTheCamera) {
  config_.track.prior = MotionPrior::constant_velocity;
  config_.track.prior_fade_s = 10;
  config_.track.prior_reach_rad = 1;
  Pipeline pipeline(engine_, config_);
  const Se3d step = exp(Twistd{{0.1, 0, 0}, {0, 0, 0.3}});
  process(pipeline, 0);
  answer(cast<float>(step));
  process(pipeline, 40);
  answer(cast<float>(step * step));
  process(pipeline, 80);
  process(pipeline, 120);
  const Se3 expected = cast<float>(step * step * step);
  EXPECT_LT(norm(engine_.track_start.translation - expected.translation), 1e-3f);
  EXPECT_NEAR(engine_.track_start.rotation(1, 0), expected.rotation(1, 0), 2e-3f);
}

TEST_F(PipelineTest, NoMotionIsContinuedOverALossOrAStampThatJumpsBack) {
  config_.relocalise.enabled = false;
  config_.track.prior = MotionPrior::constant_velocity;
  Pipeline pipeline(engine_, config_);
  process(pipeline, 1000);
  answer(at(0.1f));
  process(pipeline, 1040);
  answer(at(0.2f));
  process(pipeline, 1080);
  process(pipeline, 500);
  EXPECT_EQ(engine_.track_start.translation.x, 0.2f);
  answer(at(0.3f), 0.0f);  // lost
  process(pipeline, 540);
  const float last_x = engine_.track_start.translation.x;
  EXPECT_TRUE(std::isfinite(last_x));
  answer(at(0.4f));
  process(pipeline, 580);
  const float from_lost_x = engine_.track_start.translation.x;
  process(pipeline, 620);
  EXPECT_EQ(engine_.track_start.translation.x, 0.4f);  // the way out of the loss is no motion
  EXPECT_TRUE(std::isfinite(from_lost_x));
}

TEST_F(PipelineTest, WhenLessOfThePictureFitsTheLastPoseIsTriedAsWell) {
  config_.track.second_start_drop = 0.05f;
  Pipeline pipeline(engine_, config_);
  process(pipeline, 0);
  engine_.tracked.mapped_ratio = 0.95f;
  answer(at(0.1f));
  process(pipeline, 40);
  engine_.tracked.mapped_ratio = 0.91f;  // a little less is nothing
  process(pipeline, 80);
  EXPECT_EQ(engine_.calls, "ptmi");
  engine_.tracked.mapped_ratio = 0.8f;
  engine_.tracked.T_world_cam = at(0.3f);
  engine_.tracked_again = engine_.tracked;
  engine_.tracked_again.T_world_cam = at(0.11f);
  engine_.tracked_again.mapped_ratio = 0.94f;
  process(pipeline, 120);
  EXPECT_EQ(engine_.calls, "pttmi");
  EXPECT_EQ(engine_.track_start.translation.x, 0.1f);
  EXPECT_EQ(engine_.mask_pose.translation.x, 0.11f);
  engine_.tracked_again.mapped_ratio = 0.7f;  // no better: the first answer stands
  process(pipeline, 160);
  EXPECT_EQ(engine_.calls, "pttmi");
  EXPECT_EQ(engine_.mask_pose.translation.x, 0.3f);
}

/// The first three frames are mapped at once, later ones wait for three more.
class CompletionTest : public PipelineTest {
 protected:
  CompletionTest() {
    config_.depth.invalid = InvalidDepth::complete;
    config_.depth.complete_frames = 3;
  }
  /// At 33 ms each, frame i at x = i cm.
  FrameResult process_frame(Pipeline& pipeline, int i, const FrameWork& work = {}) {
    answer(at(0.01f * static_cast<float>(i)));
    engine_.calls.clear();
    RgbdFrame frame;
    frame.depth_stamp = {i * int64_t{33000000}};
    return pipeline.process(frame, work);
  }
};

TEST_F(CompletionTest, TheFirstFramesAreMappedAtOnceTheOthersLate) {
  Pipeline pipeline(engine_, config_);
  EXPECT_TRUE(process_frame(pipeline, 0).integrated);
  EXPECT_EQ(engine_.calls, "pi");
  for (int i = 1; i < 3; ++i) {
    EXPECT_TRUE(process_frame(pipeline, i).integrated);
    EXPECT_EQ(engine_.calls, "ptmi") << i;
  }
  for (int i = 3; i < 6; ++i) {
    const FrameResult result = process_frame(pipeline, i);
    EXPECT_EQ(engine_.calls, "ptmk") << i;
    EXPECT_FALSE(result.integrated);
    EXPECT_FLOAT_EQ(static_cast<float>(result.T_map_cam.translation.x), 0.01f * static_cast<float>(i));
  }
  EXPECT_TRUE(process_frame(pipeline, 6).integrated);
  EXPECT_EQ(engine_.calls, "ptmko") << "tracked, kept; the oldest is completed";
  EXPECT_EQ(engine_.kept_frames(), 3u);
  process_frame(pipeline, 7);
  ASSERT_EQ(engine_.mapped_x.size(), 2u);
  EXPECT_NEAR(engine_.mapped_x[0], 0.03f, 1e-6f);
  EXPECT_NEAR(engine_.mapped_x[1], 0.04f, 1e-6f);
}

TEST_F(CompletionTest, AtTheEndAllThatWaitAreMapped) {
  Pipeline pipeline(engine_, config_);
  for (int i = 0; i < 8; ++i) process_frame(pipeline, i);
  pipeline.finish();
  ASSERT_EQ(engine_.mapped_x.size(), 5u);
  for (size_t i = 0; i < 5; ++i) EXPECT_NEAR(engine_.mapped_x[i], 0.01 * static_cast<double>(i + 3), 1e-6);
  EXPECT_EQ(engine_.kept_frames(), 0u);
  pipeline.finish();
  EXPECT_EQ(engine_.mapped_x.size(), 5u);
  EXPECT_EQ(pipeline.counters().not_mapped, 0u);
}

TEST_F(CompletionTest, InAMapThatWasThereAllWait) {
  config_.relocalise.enabled = false;
  Pipeline pipeline(engine_, config_);
  pipeline.start_lost(cast<double>(at(0)));
  process_frame(pipeline, 0);
  EXPECT_EQ(engine_.calls.back(), 'k');
}

TEST_F(CompletionTest, WhatIsNotMappedDoesNotWaitEither) {
  Pipeline pipeline(engine_, config_);
  for (int i = 0; i < 5; ++i) process_frame(pipeline, i);
  EXPECT_EQ(engine_.kept_frames(), 2u);
  process_frame(pipeline, 5, {.integrate = false});
  EXPECT_EQ(engine_.kept_frames(), 2u) << "shed";
  answer(at(0.05f), 0.35f);
  EXPECT_EQ(process(pipeline, 198).state, TrackingState::poor);
  EXPECT_EQ(engine_.kept_frames(), 2u) << "poor";
  engine_.prepare_status = Status::bad_data;
  process(pipeline, 231);
  EXPECT_EQ(engine_.kept_frames(), 2u) << "bad";
}

TEST_F(CompletionTest, ALossAndANewMapGiveThemUp) {
  Pipeline pipeline(engine_, config_);
  for (int i = 0; i < 5; ++i) process_frame(pipeline, i);
  answer(at(5), 0.0f);
  EXPECT_EQ(process(pipeline, 165).state, TrackingState::lost);
  EXPECT_EQ(engine_.kept_frames(), 0u);
  EXPECT_EQ(pipeline.counters().not_mapped, 2u);
  pipeline.start_new_map();
  EXPECT_EQ(pipeline.counters().not_mapped, 2u);
  for (int i = 6; i < 11; ++i) process_frame(pipeline, i);
  EXPECT_EQ(engine_.kept_frames(), 2u);
  pipeline.start_new_map();
  EXPECT_EQ(pipeline.counters().not_mapped, 4u);
  EXPECT_TRUE(engine_.mapped_x.empty());
}

TEST_F(CompletionTest, AReadingNearerThanTheCameraSeesStaysWithItsFrame) {
  config_.sonar.veto_m = 0.5f;
  config_.sonar.beam_deg = 60;
  config_.sonar.T_cam_sonar = {0.01f, -0.02f, 0.03f, 0, 0.70710678f, 0, 0.70710678f};  // looks along x
  Pipeline pipeline(engine_, config_);
  for (int i = 0; i < 3; ++i) process_frame(pipeline, i);
  process_frame(pipeline, 3, {.sonar_m = 0.3f});
  process_frame(pipeline, 4, {.sonar_m = 0.6f});
  process_frame(pipeline, 5);
  ASSERT_EQ(engine_.echoes.size(), 3u);
  const NearEcho& echo = engine_.echoes[0];
  EXPECT_EQ(echo.range_m, 0.3f);
  EXPECT_EQ(echo.until_m, 0.5f);
  EXPECT_NEAR(echo.cos_half_beam, std::cos(3.14159265f / 6), 1e-6f);
  EXPECT_EQ(echo.place_cam.y, -0.02f);
  EXPECT_NEAR(echo.axis_cam.x, 1.0f, 1e-6f);
  EXPECT_NEAR(echo.axis_cam.z, 0.0f, 1e-6f);
  EXPECT_EQ(engine_.echoes[1].range_m, 0.0f) << "as far as the camera sees";
  EXPECT_EQ(engine_.echoes[2].range_m, 0.0f);
}

}  // namespace
}  // namespace stillmap
