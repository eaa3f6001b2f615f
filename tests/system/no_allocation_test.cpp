// The real-time loop and the workers of the engine leave the heap alone.

#include <gtest/gtest.h>

#include <algorithm>
#include <chrono>
#include <cstdlib>
#include <cstring>
#include <filesystem>
#include <memory>
#include <optional>
#include <string>
#include <thread>

#include "config/engine_params.hpp"
#include "drivers/lcm/lcm.hpp"
#include "drivers/registry.hpp"
#include "runtime/archive/block_archive.hpp"
#include "runtime/archive/map_saver.hpp"
#include "runtime/core/heap_guard.hpp"
#include "runtime/pipeline/pipeline.hpp"
#include "tests/support/frame_memory.hpp"
#include "tests/support/private_network.hpp"
#include "tests/support/sample_messages.hpp"
#include "tests/support/temp_dir.hpp"

namespace stillmap {
namespace {

/// Heap calls that `work` makes in this thread, and in those that are armed by themselves.
template <class Work>
uint64_t allocations_of(Work work) {
  const uint64_t before = heap_guard::allocations();
  const heap_guard::Scope armed;
  work();
  return heap_guard::allocations() - before;
}

TEST(HeapGuard, SeesEveryWayToUseTheHeap) {
  void* volatile kept = nullptr;  // keeps the compiler from leaving the allocation out
  EXPECT_EQ(allocations_of([&] { kept = ::operator new(10); }), 1u);
  EXPECT_EQ(allocations_of([&] { ::operator delete(kept); }), 1u);
  EXPECT_EQ(allocations_of([&] { kept = std::malloc(10); }), 1u);
  EXPECT_EQ(allocations_of([&] { kept = std::realloc(kept, 1000); }), 1u);
  EXPECT_EQ(allocations_of([&] { std::free(kept); }), 1u);
  EXPECT_EQ(allocations_of([&] { kept = std::calloc(1, 10); }), 1u);
  std::free(kept);
  EXPECT_EQ(allocations_of([&] { kept = std::aligned_alloc(64, 64); }), 1u);
  std::free(kept);
  EXPECT_EQ(allocations_of([] {}), 0u);
}

TEST(HeapGuard, SeesWhatALibraryAllocates) {
  char* volatile kept = nullptr;
  EXPECT_GE(allocations_of([&] { kept = ::strdup("a text"); }), 1u);
  std::free(kept);
}

TEST(HeapGuard, CountsArmedThreadsOnly) {
  void* volatile kept = nullptr;
  uint64_t armed = 0, others = 0;
  std::thread worker([&] { armed = allocations_of([&] { kept = std::malloc(10); }); });
  worker.join();
  std::free(kept);
  EXPECT_EQ(armed, 1u);
  const uint64_t before = heap_guard::allocations();
  std::thread other([&] { kept = std::malloc(10); });
  other.join();
  others = heap_guard::allocations() - before;
  std::free(kept);
  EXPECT_EQ(others, 0u);
}

TEST(HeapGuard, WhereItIsFatalItSaysWhereTheCallCameFrom) {
  EXPECT_DEATH(
      {
        heap_guard::make_fatal();
        const heap_guard::Scope armed;
        void* volatile kept = std::malloc(10);
        std::free(kept);
      },
      "a real-time thread used the heap, from");
}

/// A pipeline and the frames of a source for it.
class RealTimeLoop : public testing::Test {
 protected:
  void start(const Config& config, const std::string& scene) {
    auto opened = open_source(scene, SourceOptions{});
    ASSERT_TRUE(opened) << opened.error();
    source_ = std::move(*opened);
    const SourceInfo& info = source_->info();
    EngineParams params = engine_params(config, info.camera, info.depth_units_per_m);
    params.on_worker = heap_guard::arm_worker;
    engine_ = make_cpu_engine(params);
    ASSERT_NE(engine_, nullptr);
    memory_.emplace(info);
    pipeline_.emplace(*engine_, config);
  }
  void next() { ASSERT_EQ(source_->next(memory_->frame, 1000), Status::ok) << source_->error(); }
  /// As the loop does: one save after the other.
  void save(const Config& config, const std::string& path) {
    if (!saver_) saver_.emplace(path, *engine_);
    const MapInfo info = MapInfo::of(config, {}, Stamp{1});
    allocations_ += allocations_of([&] {
      saves_ += saver_->begin(info);
      saver_->step();
    });
  }
  void process() {
    allocations_ += allocations_of([&] { pipeline_->process(memory_->frame); });
  }

  std::unique_ptr<FrameSource> source_;
  std::unique_ptr<Engine> engine_;
  std::optional<test::FrameMemory> memory_;
  std::optional<Pipeline> pipeline_;
  std::optional<MapSaver> saver_;  // the engine outlives it
  uint64_t allocations_ = 0, saves_ = 0;
};

TEST_F(RealTimeLoop, DoesNotAllocateIn300FramesWorkersIncluded) {
  Config config;
  config.map.pool_blocks = 20000;
  config.map.voxel_m = 0.04f;  // a coarse map: what is looked for does not depend on it
  config.map.truncation_m = 0.16f;
  ASSERT_NO_FATAL_FAILURE(start(config, "synthetic:crowd,size=160x120,seconds=11"));
  for (int i = 0; i < 300; ++i) {
    ASSERT_NO_FATAL_FAILURE(next());
    process();
  }
  EXPECT_EQ(allocations_, 0u);
  EXPECT_EQ(pipeline_->counters().frames, 300u);
  EXPECT_GT(engine_->map_health().blocks, 100u);  // it did map
}

TEST_F(RealTimeLoop, DoesNotAllocateWhileTheArchiveRuns) {
  Config config;
  config.map.pool_blocks = 20000;
  config.map.voxel_m = 0.04f;
  config.map.truncation_m = 0.16f;
  config.map.free_space = FreeSpace::hierarchical;
  config.archive.dir = "no_allocation_test.archive";  // the folder that is opened below
  ASSERT_NO_FATAL_FAILURE(start(config, "synthetic:loop,size=160x120"));
  BlockArchive::Options options;
  options.dir = config.archive.dir;
  options.max_bytes = 1000000000;
  options.keep_below = 0;  // all that is out of view goes, and comes back
  auto archive = BlockArchive::open(options);
  ASSERT_TRUE(archive) << archive.error();
  for (int i = 0; i < 300; ++i) {
    ASSERT_NO_FATAL_FAILURE(next());
    process();
    allocations_ += allocations_of([&] { (*archive)->step(*engine_, {}); });
  }
  EXPECT_EQ(allocations_, 0u);
  EXPECT_GT((*archive)->counters().stored, 10u);
  EXPECT_EQ((*archive)->counters().failed, 0u);
  archive->reset();
  std::filesystem::remove_all(options.dir);
}

TEST_F(RealTimeLoop, DoesNotAllocateWhileTheMapIsSaved) {
  const test::TempDir dir;
  Config config;
  config.map.pool_blocks = 20000;
  config.map.voxel_m = 0.04f;
  config.map.truncation_m = 0.16f;
  ASSERT_NO_FATAL_FAILURE(start(config, "synthetic:crowd,size=160x120,seconds=3"));
  for (int i = 0; i < 80; ++i) {
    ASSERT_NO_FATAL_FAILURE(next());
    process();
    save(config, dir.path("map.smap"));
  }
  EXPECT_EQ(allocations_, 0u);
  EXPECT_GE(saves_, 1u);
  while (saver_->progress().saving)
    if (!saver_->step()) std::this_thread::sleep_for(std::chrono::milliseconds(1));
  EXPECT_EQ(saver_->result().error, "");
  saver_.reset();
  const auto file = MapFile::open(dir.path("map.smap"));
  ASSERT_TRUE(file) << file.error();
  EXPECT_GT(file->contents().voxel_blocks, 100u);
}

TEST_F(RealTimeLoop, DoesNotAllocateWhileLostAndFindingItselfAgain) {
  Config config;
  config.map.pool_blocks = 20000;
  config.map.voxel_m = 0.02f;
  ASSERT_NO_FATAL_FAILURE(start(config, "synthetic:static,size=160x120,seconds=3"));
  for (int i = 0; i < 80; ++i) {
    ASSERT_NO_FATAL_FAILURE(next());
    if (i >= 50 && i < 60) std::fill(memory_->depth.begin(), memory_->depth.end(), uint16_t{0});
    process();
  }
  EXPECT_EQ(allocations_, 0u);
  EXPECT_GE(pipeline_->counters().lost_frames, 3u);
  EXPECT_EQ(pipeline_->counters().relocalised, 1u);
}

// Of all threads: whoever publishes, the listeners' own, and whoever asks for odometry and commands.
TEST(LcmFace, DoesNotAllocateOnceItIsOpen) {
  if (PrivateNetwork::enter()) PrivateNetwork::add_multicast_route();
  const auto codec = make_lcm_codec();
  auto bus = open_lcm_bus(kLcmDefaultUrl);
  auto commands = open_lcm_commands(kLcmDefaultUrl);
  auto odometry = open_lcm_odometry(kLcmDefaultUrl, [](Utime utime) { return Stamp{utime.us * 1000}; });
  ASSERT_TRUE(bus && commands && odometry);
  uint8_t bytes[kDatagramBytes];
  uint32_t heard = 0;
  const auto send = [&](const char* channel, const auto& message) {
    return (*bus)->publish(channel, {bytes, codec->encode(message, {bytes, kDatagramBytes})});
  };
  PoseMessage pose = samples::pose();
  Status sent = Status::ok;
  EXPECT_EQ(allocations_of([&] {
              for (int i = 0; i < 1000; ++i) {
                pose.utime.us += 1000;
                sent = send(kPoseChannel, pose);
                send(kStatusChannel, samples::status());
                send(kCommandChannel, samples::command());
                send(kOdometryChannel, pose);
                CommandMessage command;
                OdometrySample sample;
                heard += (*commands)->next(command) == Status::ok;
                heard += (*odometry)->at({pose.utime.us * 1000}, sample) == Status::ok;
              }
            }),
            0u);
  EXPECT_TRUE(sent == Status::unavailable || heard > 100u) << heard;  // hosts without multicast hear nothing
}

}  // namespace
}  // namespace stillmap
