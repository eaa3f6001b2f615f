// The driver against OpenNI2 as it is and a camera that is not there (virtual_device.cpp).

#include "drivers/openni2/openni2_source.hpp"

#include <gtest/gtest.h>
#include <time.h>

#include <algorithm>
#include <chrono>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <memory>
#include <optional>
#include <string>
#include <thread>
#include <vector>

#include "runtime/core/clock.hpp"
#include "runtime/core/heap_guard.hpp"
#include "tests/drivers/openni2/virtual_studio.hpp"
#include "tests/support/contains.hpp"
#include "tests/support/temp_dir.hpp"

namespace stillmap {
namespace {

using namespace virtual_camera;
using std::chrono::milliseconds;
using test::contains;

constexpr int32_t kWaitMs = 100;    ///< as the capture thread
constexpr int64_t kPatienceS = 20;  ///< for what a busy machine may take
/// The recorder garbles the last pixels of some depth images: with this seed of none.
constexpr const char* kScene = "static,size=160x120,seconds=2,seed=4";
constexpr int kFrames = 30;

/// One process, one library: its camera, and the images of a small scene.
class Studio : public testing::Environment {
 public:
  void SetUp() override {
    std::ofstream(control_path_).write(std::string(sizeof(Control), '\0').c_str(), sizeof(Control));
    setenv(kControlVariable, control_path_.c_str(), 1);
    ASSERT_EQ(render(kScene, frames_path(), kFrames, false), "");
    control_.emplace(control_path_.c_str(), true);
    small.emplace(frames_path().c_str());
  }
  void TearDown() override { small.reset(); }
  Control& control() { return *static_cast<Control*>(control_->memory()); }
  std::string frames_path() const { return dir_.path("frames.raw"); }
  const std::string dir() const { return dir_.path(); }

  std::optional<Frames> small;

 private:
  const test::TempDir dir_;
  const std::string control_path_ = dir_.path("control");
  std::optional<Mapped> control_;
};
Studio* const g_studio = static_cast<Studio*>(testing::AddGlobalTestEnvironment(new Studio));

template <class Done>
bool wait_until(Done done) {
  const int64_t end_ns = monotonic_ns() + kPatienceS * 1'000'000'000;
  while (!done()) {
    if (monotonic_ns() > end_ns) return false;
    std::this_thread::sleep_for(milliseconds(2));
  }
  return true;
}

/// A well-behaved camera that is plugged in.
class VirtualXtion : public testing::Test {
 protected:
  VirtualXtion() {
    setenv(kFramesVariable, g_studio->frames_path().c_str(), 1);
    std::memset(static_cast<void*>(&control), 0, sizeof control);
    options.cols = 160;
    options.rows = 120;
  }
  ~VirtualXtion() override { unplug(); }

  void plug() {
    control.plugged = 1;
    ASSERT_TRUE(wait_until([] { return openni2_cameras()->size() == 1; }));
  }
  void unplug() {
    control.plugged = 0;
    EXPECT_TRUE(wait_until([] { return openni2_cameras()->empty(); }));
  }
  void open(const std::string& serial = "") {
    auto opened = open_xtion(serial, options);
    ASSERT_TRUE(opened) << opened.error();
    source = std::move(*opened);
    memory.emplace(source->info());
  }
  void plug_and_open() {
    ASSERT_NO_FATAL_FAILURE(plug());
    open();
  }
  void expect_refused(const std::vector<std::string>& words, const std::string& serial = "") {
    const auto opened = open_xtion(serial, options);
    ASSERT_FALSE(opened);
    EXPECT_EQ(opened.error_kind(), ErrorKind::cannot_open);
    for (const std::string& word : words) EXPECT_TRUE(contains(opened.error(), word)) << opened.error();
    EXPECT_TRUE(contains(opened.error(), "xtion")) << opened.error();
  }
  Status next() { return source->next(memory->frame, kWaitMs); }
  /// What comes first of what is not a time-out.
  Status next_event() {
    Status status = Status::timeout;
    EXPECT_TRUE(wait_until([&] { return (status = next()) != Status::timeout; }));
    return status;
  }
  void expect_frames(int count) {
    for (int i = 0; i < count; ++i) ASSERT_EQ(next_event(), Status::ok) << source->error();
  }
  /// The images of the frame are those of index `i` of the file.
  bool holds_image(const Frames& frames, int i) const {
    return std::memcmp(memory->depth.data(), frames.depth(i), frames.depth_bytes()) == 0 &&
           std::memcmp(memory->colour.data(), frames.colour(i), frames.colour_bytes()) == 0;
  }
  bool holds_an_image(const Frames& frames) const {
    for (int i = 0; i < frames.header().count; ++i)
      if (holds_image(frames, i)) return true;
    return false;
  }

  Control& control = g_studio->control();
  CameraOptions options;
  std::unique_ptr<FrameSource> source;
  std::optional<test::FrameMemory> memory;
};

TEST_F(VirtualXtion, IsSetUpAsAskedFor) {
  options.auto_exposure = false;
  options.auto_white_balance = true;
  ASSERT_NO_FATAL_FAILURE(plug_and_open());
  const SourceInfo& info = source->info();
  EXPECT_EQ(info.name, "xtion");
  EXPECT_TRUE(source->live());
  EXPECT_EQ(info.frames, -1);
  EXPECT_EQ(info.depth_units_per_m, 1000);
  EXPECT_EQ(info.camera.k.width, 160);
  EXPECT_EQ(info.camera.k.height, 120);
  EXPECT_NEAR(info.camera.k.fx, 525.0f * 160 / 640, 1e-3f);  // the scene's, by way of the field of view
  EXPECT_NEAR(info.camera.k.fy, 525.0f * 160 / 640, 1e-3f);
  EXPECT_EQ(info.camera.k.cx, 79.5f);
  EXPECT_EQ(control.registered, 1);
  EXPECT_EQ(control.mirrored, 0);
  EXPECT_EQ(control.auto_exposure, 0);
  EXPECT_EQ(control.auto_white_balance, 1);
}

TEST_F(VirtualXtion, TakesTheCameraModelThatItIsGiven) {
  options.camera = CameraModel{{500, 501, 80, 60, 0, 0}, {0.1f, 0, 0, 0, 0}};
  options.depth_units_per_m = 5000;
  ASSERT_NO_FATAL_FAILURE(plug_and_open());
  EXPECT_EQ(source->info().camera.k.fy, 501);
  EXPECT_EQ(source->info().camera.k.width, 160);
  EXPECT_EQ(source->info().camera.distortion.k1, 0.1f);
  EXPECT_EQ(source->info().depth_units_per_m, 5000);
}

TEST_F(VirtualXtion, SendsTheImagesOneAfterTheOther) {
  ASSERT_NO_FATAL_FAILURE(plug_and_open());
  ASSERT_EQ(next_event(), Status::ok) << source->error();
  const Stamp first = memory->frame.depth_stamp;
  Stamp last = first;
  uint32_t sequence = memory->frame.sequence;
  for (int i = 0; i < 30; ++i) {
    ASSERT_EQ(next_event(), Status::ok) << source->error();
    const RgbdFrame& frame = memory->frame;
    const uint32_t step = frame.sequence - sequence;
    EXPECT_GE(step, 1u);
    sequence = frame.sequence;
    EXPECT_TRUE(holds_an_image(*g_studio->small)) << i;
    EXPECT_EQ(frame.captured, frame.depth_stamp);
    EXPECT_EQ(frame.colour_stamp, frame.depth_stamp);
    EXPECT_GT(frame.depth_stamp, last);
    EXPECT_LE(frame.depth_stamp.ns, monotonic_ns());
    EXPECT_LT(monotonic_ns() - frame.depth_stamp.ns, 1'000'000'000);
    last = frame.depth_stamp;
  }
  EXPECT_NEAR((last.seconds() - first.seconds()) / sequence, 1.0 / 30, 0.005);
  EXPECT_EQ(source->left_out() + 30u, sequence);  // none of those that came in time
}

TEST_F(VirtualXtion, CountsWhatNobodyTook) {
  ASSERT_NO_FATAL_FAILURE(plug_and_open());
  ASSERT_NO_FATAL_FAILURE(expect_frames(2));
  const uint32_t before = source->left_out(), sequence = memory->frame.sequence;
  const int sent = control.sent;
  ASSERT_TRUE(wait_until([&] { return control.sent >= sent + 10; }));
  ASSERT_NO_FATAL_FAILURE(expect_frames(3));
  const uint32_t left_out = source->left_out() - before;
  EXPECT_GE(left_out, 7u);
  EXPECT_EQ(memory->frame.sequence, sequence + 3 + left_out);
}

TEST_F(VirtualXtion, SkipsFrames) {
  ASSERT_NO_FATAL_FAILURE(plug_and_open());
  source->skip(5);
  ASSERT_NO_FATAL_FAILURE(expect_frames(1));
  EXPECT_GE(memory->frame.sequence, 5u);
  EXPECT_GE(control.sent, 6);
}

// What is refused when it is opened.

TEST_F(VirtualXtion, NoCamera) {
  expect_refused({"no camera", "stillmap doctor"});
}

TEST_F(VirtualXtion, IsFoundByItsSerialNumber) {
  ASSERT_NO_FATAL_FAILURE(plug());
  ASSERT_NO_FATAL_FAILURE(open(kSerial));
  EXPECT_EQ(source->info().name, std::string("xtion:") + kSerial);
  source.reset();
  expect_refused({"xtion:OTHER", "virtual camera VIRTUAL0001"}, "OTHER");
}

TEST_F(VirtualXtion, SizesThatItDoesNotHave) {
  ASSERT_NO_FATAL_FAILURE(plug());
  options.cols = 320;
  expect_refused({"320x120 at 30 Hz", "it has 160x120 at 30 Hz", "source.cols"});
}

TEST_F(VirtualXtion, RegistrationThatIsRefused) {
  ASSERT_NO_FATAL_FAILURE(plug());
  control.registration = kRefuses;
  expect_refused({"refuses to bring depth into the colour image"});
  control.registration = kSaysYesDoesNothing;
  expect_refused({"says yes and does not do it"});
}

TEST_F(VirtualXtion, WhatItCannotDoIsSaidAndGoneWithout) {
  ASSERT_NO_FATAL_FAILURE(plug());
  control.registration = kUnsupported;
  control.no_sync = 1;
  testing::internal::CaptureStderr();
  ASSERT_NO_FATAL_FAILURE(open());
  const std::string said = testing::internal::GetCapturedStderr();
  EXPECT_TRUE(contains(said, "cannot bring depth into the colour image")) << said;
  EXPECT_TRUE(contains(said, "paired by their stamps")) << said;
  ASSERT_NO_FATAL_FAILURE(expect_frames(5));
}

// What goes wrong while it runs.

TEST_F(VirtualXtion, AStallIsWaitedOut) {
  ASSERT_NO_FATAL_FAILURE(plug_and_open());
  ASSERT_NO_FATAL_FAILURE(expect_frames(2));
  control.stalled = 1;
  ASSERT_TRUE(wait_until([&] { return next() == Status::timeout; }));
  const int64_t start_ns = monotonic_ns();
  EXPECT_EQ(next(), Status::timeout);
  EXPECT_GE(monotonic_ns() - start_ns, 80'000'000);
  control.stalled = 0;
  ASSERT_NO_FATAL_FAILURE(expect_frames(3));
}

TEST_F(VirtualXtion, AStallThatLastsIsACameraThatIsGone) {
  options.gone_s = 0.3;
  ASSERT_NO_FATAL_FAILURE(plug_and_open());
  ASSERT_NO_FATAL_FAILURE(expect_frames(2));
  control.stalled = 1;
  Status status = Status::ok;
  ASSERT_TRUE(wait_until([&] { return (status = next()) == Status::unavailable; })) << to_string(status);
  EXPECT_TRUE(contains(source->error(), "xtion: the camera sends no depth images any more"))
      << source->error();
  control.stalled = 0;
  const Stamp last = memory->frame.depth_stamp;
  ASSERT_EQ(source->reopen(), Status::ok) << source->error();
  EXPECT_GE(control.opened, 2);
  ASSERT_NO_FATAL_FAILURE(expect_frames(3));
  EXPECT_GT(memory->frame.depth_stamp, last);
}

TEST_F(VirtualXtion, UnpluggedAndPluggedInAgain) {
  ASSERT_NO_FATAL_FAILURE(plug_and_open());
  ASSERT_NO_FATAL_FAILURE(expect_frames(5));
  const Stamp last = memory->frame.depth_stamp;
  const uint32_t sequence = memory->frame.sequence;
  for (int round = 0; round < 2; ++round) {
    ASSERT_NO_FATAL_FAILURE(unplug());
    Status status = Status::ok;
    ASSERT_TRUE(wait_until([&] { return (status = next()) == Status::unavailable; })) << to_string(status);
    EXPECT_TRUE(contains(source->error(), "unplugged")) << source->error();
    EXPECT_EQ(next(), Status::unavailable);
    EXPECT_EQ(source->reopen(), Status::unavailable);
    EXPECT_TRUE(contains(source->error(), "no camera")) << source->error();
    EXPECT_EQ(next(), Status::unavailable);
    ASSERT_NO_FATAL_FAILURE(plug());
    ASSERT_EQ(source->reopen(), Status::ok) << source->error();
    ASSERT_NO_FATAL_FAILURE(expect_frames(3));
    EXPECT_EQ(control.registered, 1);
  }
  EXPECT_GT(memory->frame.depth_stamp, last);
  EXPECT_GT(memory->frame.sequence, sequence);
}

TEST_F(VirtualXtion, ImagesOfAnotherSize) {
  ASSERT_NO_FATAL_FAILURE(plug_and_open());
  ASSERT_NO_FATAL_FAILURE(expect_frames(2));
  control.small_images = 1;
  Status status = Status::ok;
  ASSERT_TRUE(wait_until([&] { return (status = next()) == Status::bad_data; })) << to_string(status);
  EXPECT_TRUE(contains(source->error(), "a depth image has 80x120 pixels, expected 160x120"))
      << source->error();
  ASSERT_NO_FATAL_FAILURE(expect_frames(3));
}

TEST_F(VirtualXtion, AClockThatIsSet) {
  for (const int32_t shift_ms : {60'000, -60'000}) {
    control.stamp_shift_ms = 100'000;
    ASSERT_NO_FATAL_FAILURE(plug_and_open());
    ASSERT_NO_FATAL_FAILURE(expect_frames(5));
    Stamp last = memory->frame.depth_stamp;
    control.stamp_shift_ms += shift_ms;
    int bad = 0;
    for (int good = 0; good < 5;) {
      const Status status = next_event();
      ASSERT_TRUE(status == Status::ok || status == Status::bad_data) << to_string(status);
      bad += status == Status::bad_data;
      if (status != Status::ok) continue;
      ++good;
      EXPECT_GT(memory->frame.depth_stamp, last);
      EXPECT_LT(memory->frame.depth_stamp.seconds() - last.seconds(), 5);
      last = memory->frame.depth_stamp;
    }
    EXPECT_GE(bad, 1);
    EXPECT_LE(bad, 2);
    EXPECT_TRUE(contains(source->error(), "clock jumped")) << source->error();
    source.reset();
    unplug();
  }
}

TEST_F(VirtualXtion, DepthWithoutColour) {
  options.gone_s = 0.4;
  for (const bool sync : {true, false}) {
    control.no_sync = sync ? 0 : 1;
    control.no_colour = 0;
    ASSERT_NO_FATAL_FAILURE(plug_and_open());
    ASSERT_NO_FATAL_FAILURE(expect_frames(3));
    control.no_colour = 1;
    int unpaired = 0;
    Status status = Status::ok;
    ASSERT_TRUE(wait_until([&] {
      status = next();
      if (status == Status::bad_data) {
        ++unpaired;
        EXPECT_TRUE(contains(source->error(), "no colour image within 20 ms")) << source->error();
      }
      return status == Status::unavailable;
    }));
    // In sync the library itself holds depth back.
    if (sync)
      EXPECT_EQ(unpaired, 0);
    else
      EXPECT_GE(unpaired, 2);
    control.no_colour = 0;
    ASSERT_EQ(source->reopen(), Status::ok) << source->error();
    ASSERT_NO_FATAL_FAILURE(expect_frames(3));
    source.reset();
    unplug();
  }
}

TEST_F(VirtualXtion, ColourThatIsLateIsPairedByTheOffset) {
  options.gone_s = 0.4;
  control.no_sync = 1;
  control.colour_shift_ms = 16;
  options.max_pair_ms = 10;
  ASSERT_NO_FATAL_FAILURE(plug_and_open());
  Status status = Status::ok;
  ASSERT_TRUE(wait_until([&] {
    status = next();
    EXPECT_NE(status, Status::ok);
    return status == Status::unavailable;
  }));
  EXPECT_TRUE(contains(source->error(), "do not come at the same time")) << source->error();
  source.reset();
  options.time_offset_ms = -16;
  ASSERT_NO_FATAL_FAILURE(open());
  ASSERT_NO_FATAL_FAILURE(expect_frames(3));
  EXPECT_EQ(memory->frame.colour_stamp, memory->frame.depth_stamp);
  options.time_offset_ms = 0;
  options.max_pair_ms = 20;
  source.reset();
  ASSERT_NO_FATAL_FAILURE(open());
  ASSERT_NO_FATAL_FAILURE(expect_frames(3));
  EXPECT_EQ(memory->frame.colour_stamp.ns - memory->frame.depth_stamp.ns, 16'000'000);
}

TEST_F(VirtualXtion, MemoryOfAnotherSizeIsNotWrittenTo) {
  ASSERT_NO_FATAL_FAILURE(plug_and_open());
  test::FrameMemory small(80, 60);
  EXPECT_EQ(source->next(small.frame, kWaitMs), Status::bad_data);
  EXPECT_EQ(small.depth[0], test::FrameMemory::kUntouchedDepth);
}

/// CPU time of the calling thread: what others do on this machine does not count.
int64_t thread_ns() {
  timespec now{};
  clock_gettime(CLOCK_THREAD_CPUTIME_ID, &now);
  return int64_t{now.tv_sec} * 1'000'000'000 + now.tv_nsec;
}

TEST_F(VirtualXtion, AFullFrameIsTakenInUnderAMillisecondAndWithoutTheHeap) {
  const std::string frames = g_studio->dir() + "/full.raw";
  ASSERT_EQ(render("static,size=640x480,seconds=1", frames, 4, false), "");
  setenv(kFramesVariable, frames.c_str(), 1);
  options.cols = 640;
  options.rows = 480;
  ASSERT_NO_FATAL_FAILURE(plug());
  ASSERT_NO_FATAL_FAILURE(open());
  ASSERT_NO_FATAL_FAILURE(expect_frames(5));
  std::vector<int64_t> took_ns;
  uint64_t heap_calls = 0;
  for (int tries = 0; took_ns.size() < 20; ++tries) {
    ASSERT_LT(tries, 60) << source->error();
    const int sent = control.sent;
    ASSERT_TRUE(wait_until([&] { return control.sent >= sent + 2; }));  // a pair lies ready
    const uint64_t before = heap_guard::allocations();
    const int64_t start_ns = thread_ns();
    Status status = Status::ok;
    {
      const heap_guard::Scope armed;
      status = next();
    }
    if (status != Status::ok) continue;  // the library was late with one of two images
    took_ns.push_back(thread_ns() - start_ns);
    heap_calls = std::max(heap_calls, heap_guard::allocations() - before);
  }
  EXPECT_EQ(heap_calls, 0u);
  std::nth_element(took_ns.begin(), took_ns.begin() + static_cast<long>(took_ns.size() / 2), took_ns.end());
  const double median_ms = static_cast<double>(took_ns[took_ns.size() / 2]) * 1e-6;
  std::printf("from the library to the frame: %.2f ms\n", median_ms);
  EXPECT_LT(median_ms, 3);  // 1 ms on a machine of its own
  EXPECT_TRUE(holds_an_image(Frames(frames.c_str())));
}

// Recordings.

class VirtualRecording : public VirtualXtion {
 protected:
  static void SetUpTestSuite() {
    ASSERT_EQ(render(kScene, raw_path(), kFrames, true), "");
    setenv(kFramesVariable, raw_path().c_str(), 1);
    ASSERT_EQ(record(g_studio->control(), oni_path(), kFrames), "");
  }
  static std::string raw_path() { return g_studio->dir() + "/raw.raw"; }
  static std::string oni_path() { return g_studio->dir() + "/recording.oni"; }

  void play(const std::string& path = oni_path()) {
    auto opened = open_oni(path, options);
    ASSERT_TRUE(opened) << opened.error();
    source = std::move(*opened);
    memory.emplace(source->info());
  }
  static void expect_no_recording(const std::string& path, const std::string& why) {
    const auto opened = open_oni(path, {});
    ASSERT_FALSE(opened) << path;
    EXPECT_EQ(opened.error_kind(), ErrorKind::cannot_open);
    EXPECT_TRUE(contains(opened.error(), path)) << opened.error();
    EXPECT_TRUE(contains(opened.error(), why)) << opened.error();
  }
};

TEST_F(VirtualRecording, GivesEveryFrameAsItWas) {
  const Frames raw(raw_path().c_str());
  for (int round = 0; round < 2; ++round) {
    source.reset();
    ASSERT_NO_FATAL_FAILURE(play());
    EXPECT_EQ(source->info().name, "oni:" + oni_path());
    EXPECT_EQ(source->info().frames, kFrames);
    EXPECT_EQ(source->info().depth_units_per_m, 1000);
    EXPECT_NEAR(source->info().camera.k.fx, 525.0f / 4, 1e-3f);
    EXPECT_FALSE(source->live());
    for (int i = 0; i < kFrames; ++i) {
      ASSERT_EQ(next(), Status::ok) << i << ": " << source->error();
      EXPECT_TRUE(holds_image(raw, i)) << i;
      EXPECT_EQ(memory->frame.sequence, static_cast<uint32_t>(i));
      const int64_t stamp_us = (i * 1'000'000 + 15) / 30;
      EXPECT_EQ(memory->frame.depth_stamp.ns, stamp_us * 1000);
      EXPECT_EQ(memory->frame.colour_stamp.ns, stamp_us * 1000);
    }
    EXPECT_EQ(next(), Status::end);
    EXPECT_EQ(next(), Status::end);
    EXPECT_EQ(source->left_out(), 0u);
  }
}

TEST_F(VirtualRecording, SkipsAndIsClosedInTheMiddle) {
  ASSERT_NO_FATAL_FAILURE(play());
  source->skip(7);
  ASSERT_EQ(next(), Status::ok) << source->error();
  EXPECT_EQ(memory->frame.sequence, 7u);
  EXPECT_TRUE(holds_image(Frames(raw_path().c_str()), 7));
  source.reset();
  ASSERT_NO_FATAL_FAILURE(play());
  source->skip(1000);
  EXPECT_EQ(next(), Status::end);
}

TEST_F(VirtualRecording, IsNoCamera) {
  ASSERT_NO_FATAL_FAILURE(play());  // the library lists it from now on
  EXPECT_TRUE(openni2_cameras()->empty());
  expect_refused({"no camera"});
}

TEST_F(VirtualRecording, ImagesThatFindNoPartnerAreSaid) {
  options.time_offset_ms = 25;
  options.max_pair_ms = 10;  // 8 ms from the frame after
  ASSERT_NO_FATAL_FAILURE(play());
  std::vector<Status> came;
  while (came.size() < 2 * kFrames && (came.empty() || came.back() != Status::end)) came.push_back(next());
  EXPECT_EQ(came.size(), static_cast<size_t>(kFrames) + 1);
  EXPECT_EQ(came.front(), Status::bad_data);
  EXPECT_EQ(std::count(came.begin(), came.end(), Status::ok), kFrames - 1);
}

TEST_F(VirtualRecording, WithoutColourIsRefused) {
  const std::string path = g_studio->dir() + "/depth_only.oni";
  ASSERT_EQ(record(control, path, 5, true), "");
  expect_no_recording(path, "no colour images");
}

TEST_F(VirtualRecording, FilesThatAreNone) {
  expect_no_recording("/no/such/file.oni", "no such file");
  expect_no_recording(g_studio->dir(), "is no file");
  const test::TempDir dir;
  expect_no_recording(dir.write("empty.oni", ""), "is no recording of OpenNI2");
  expect_no_recording(dir.write("text.oni", std::string(1000, 'x')), "is no recording of OpenNI2");
  expect_no_recording(dir.path(std::string(200, 'd') + "/" + "a.oni"), "no such file");
}

TEST_F(VirtualRecording, FilesThatAreCutOffOrDamaged) {
  const std::string whole = test::read_text(oni_path());
  const test::TempDir dir;
  for (const size_t share : {1, 10, 50, 99})
    expect_no_recording(dir.write("cut.oni", whole.substr(0, whole.size() / 2 * share / 100)), "is cut off");
  for (const size_t at : {size_t{24}, size_t{98}, whole.find("NIR", whole.size() / 4)}) {
    std::string damaged = whole;
    damaged[at] = '?';
    expect_no_recording(dir.write("damaged.oni", damaged), "is damaged at byte " + std::to_string(at));
  }
  const std::string deep = dir / (std::string(120, 'd') + "/" + std::string(120, 'e') + "/a.oni");
  test::write_text(deep, whole);
  expect_no_recording(deep, "255 bytes");
}

}  // namespace
}  // namespace stillmap
