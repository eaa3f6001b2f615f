#include "runtime/archive/block_archive.hpp"

#include <gtest/gtest.h>
#include <unistd.h>

#include <chrono>
#include <filesystem>
#include <fstream>
#include <thread>

#include "runtime/core/bounded_queue.hpp"
#include "tests/support/mapped_corner.hpp"
#include "tests/unit/runtime/record/file_size_limit.hpp"

namespace stillmap {
namespace {

namespace fs = std::filesystem;
using test::MappedCorner;

/// A folder of this test, gone with it.
class Folder {
 public:
  Folder() : path_(fs::temp_directory_path() / ("stillmap-archive-" + std::to_string(::getpid()))) {
    fs::remove_all(path_);
    fs::create_directories(path_);
  }
  ~Folder() { fs::remove_all(path_); }
  std::string str() const { return path_.string(); }
  std::vector<fs::path> groups() const {
    std::vector<fs::path> files;
    for (const auto& entry : fs::recursive_directory_iterator(path_))
      if (entry.path().extension() == ".group") files.push_back(entry.path());
    return files;
  }

 private:
  fs::path path_;
};

BlockArchive::Options all_goes(const Folder& folder) {
  BlockArchive::Options o;
  o.dir = folder.str();
  o.max_bytes = 1000000000;
  o.keep_below = 0;
  return o;
}

std::unique_ptr<BlockArchive> open(const BlockArchive::Options& options) {
  auto archive = BlockArchive::open(options);
  EXPECT_TRUE(archive) << archive.error();
  return archive ? std::move(*archive) : nullptr;
}

/// Steps until `done`, at most a minute. The map does not change meanwhile.
template <class Done>
bool step_until(BlockArchive& archive, Engine& engine, const Done& done) {
  const auto end = std::chrono::steady_clock::now() + std::chrono::seconds(60);
  while (!done()) {
    if (std::chrono::steady_clock::now() > end) return false;
    archive.step(engine, {0, 0, -20});
    std::this_thread::yield();
  }
  return true;
}

/// Blocks with voxels of the corner: those that the look away made are none of them.
bool corner_is_away(const MappedCorner& map) {
  for (const PointState s : map.states())
    if (s == PointState::occupied) return false;
  return true;
}

TEST(BlockArchive, WhatIsOutOfViewGoesAndComesBackTheSame) {
  const Folder folder;
  MappedCorner map;
  const std::vector<PointState> before = map.states();
  const auto archive = open(all_goes(folder));
  map.look_away();
  ASSERT_TRUE(step_until(*archive, *map.engine, [&] { return corner_is_away(map); }));
  const ArchiveCounters away = archive->counters();
  EXPECT_GT(away.groups, 10u);
  EXPECT_GT(away.bytes, 100u * sizeof(VoxelBlock));
  EXPECT_EQ(map.engine->map_health().archived_groups, away.groups);

  EXPECT_TRUE(step_until(*archive, *map.engine,
                         [&] {
                           map.look(Se3d{});
                           return map.states() == before;
                         }))
      << archive->counters().restored << " of " << away.groups << " came back";
  EXPECT_GT(archive->counters().restored, 10u);
  EXPECT_EQ(archive->counters().failed, 0u);
}

TEST(BlockArchive, WhatDoesNotFitStaysInTheMapAndIsCounted) {
  const Folder folder;
  MappedCorner map;
  BlockArchive::Options options = all_goes(folder);
  options.max_bytes = 300000;
  const auto archive = open(options);
  map.look_away();
  const uint32_t blocks = map.engine->map_health().blocks;
  ASSERT_TRUE(step_until(*archive, *map.engine, [&] { return archive->counters().refused > 10; }));
  EXPECT_LE(archive->counters().bytes, options.max_bytes);
  EXPECT_GT(map.engine->map_health().blocks, blocks / 2);
  uint64_t on_disk = 0;
  for (const fs::path& file : folder.groups()) on_disk += fs::file_size(file);
  EXPECT_LE(on_disk, options.max_bytes + 100 * sizeof(uint64_t));
}

TEST(BlockArchive, AFileThatWasChangedIsReportedAndItsPartOfTheMapForgotten) {
  const Folder folder;
  MappedCorner map;
  const auto archive = open(all_goes(folder));
  map.look_away();
  ASSERT_TRUE(step_until(*archive, *map.engine, [&] {
    return corner_is_away(map) && archive->counters().stored == archive->counters().groups;
  }));
  for (const fs::path& file : folder.groups()) {
    std::fstream f(file, std::ios::in | std::ios::out | std::ios::binary);
    f.seekp(100);
    f.put('x');
    f.put('y');
  }
  ASSERT_TRUE(step_until(*archive, *map.engine, [&] {
    map.look(Se3d{});
    return archive->counters().failed > 5;
  }));
  EXPECT_NE(archive->last_error().find(".group"), std::string::npos);
  EXPECT_NE(archive->last_error().find("is gone or not what was written"), std::string::npos);
  EXPECT_EQ(archive->counters().restored, 0u);
  map.look(Se3d{});  // and is mapped anew
  EXPECT_FALSE(corner_is_away(map));
}

TEST(BlockArchive, OnAFullDiskNothingIsLostAndItIsTriedAgainLater) {
  const Folder folder;
  MappedCorner map;
  const std::vector<PointState> corner = map.states();
  const auto archive = open(all_goes(folder));
  map.look_away();
  {
    const test::FileSizeLimit limit(100);
    ASSERT_TRUE(step_until(*archive, *map.engine, [&] { return archive->counters().failed > 0; }));
    // What was sent before the first answer comes back, and nothing more is sent for a while.
    EXPECT_EQ(archive->for_each(*map.engine, [](View<const uint8_t>) { return true; }), "");
    const uint64_t failed = archive->counters().failed;
    EXPECT_LE(failed, BlockArchive::Options{}.slots);
    for (int frame = 0; frame < 99; ++frame) archive->step(*map.engine, {0, 0, -20});
    EXPECT_EQ(archive->counters().failed, failed) << "it should wait a while";
    EXPECT_EQ(archive->counters().groups, 0u);
    EXPECT_EQ(archive->counters().stored, 0u);
    EXPECT_NE(archive->last_error().find("cannot be written"), std::string::npos) << archive->last_error();
    EXPECT_EQ(map.states(), corner);
    EXPECT_TRUE(folder.groups().empty());
  }
  EXPECT_TRUE(step_until(*archive, *map.engine, [&] { return corner_is_away(map); }));
  EXPECT_TRUE(step_until(*archive, *map.engine, [&] {
    map.look(Se3d{});
    return map.states() == corner;
  }));
}

TEST(BlockArchive, ALostCameraIsFoundInWhatLiesInTheArchive) {
  const Folder folder;
  MappedCorner map;
  for (int n = 0; n < 10; ++n) map.look(Se3d{});
  map.engine->remember_place({});
  const auto archive = open(all_goes(folder));
  map.look_away();
  ASSERT_TRUE(step_until(*archive, *map.engine, [&] { return corner_is_away(map); }));
  const Se3 far_off = cast<float>(exp(Twistd{{0, 0, -20}, {0, 0, 0}}));
  PlaceResult place;
  map.prepare(Se3d{});
  place = map.engine->find_place(far_off, 1);
  ASSERT_NE(place.status, Status::ok) << "what is not in the map cannot be found";
  EXPECT_TRUE(step_until(*archive, *map.engine, [&] {
    place = map.engine->find_place(far_off, 1);
    return place.status == Status::ok;
  }));
  EXPECT_LT(norm(place.T_map_cam.translation), 0.01f);
  EXPECT_GT(archive->counters().restored, 0u);
}

TEST(BlockArchive, WhatBelongedToAForgottenMapIsErasedAndNeverComesBack) {
  const Folder folder;
  MappedCorner map;
  const std::vector<PointState> corner = map.states();
  const auto archive = open(all_goes(folder));
  map.look_away();
  ASSERT_TRUE(step_until(*archive, *map.engine, [&] { return corner_is_away(map); }));
  ASSERT_GT(archive->counters().groups, 10u);
  map.engine->reset_map();  // some are on their way to the disk still
  archive->forget();
  const std::vector<PointState> nothing = map.states();
  ASSERT_TRUE(step_until(*archive, *map.engine, [&] { return archive->counters().groups == 0; }));
  EXPECT_EQ(archive->counters().bytes, 0u);
  EXPECT_EQ(map.states(), nothing);
  // The next map has groups with the same keys.
  for (int n = 0; n < 3; ++n) map.look(Se3d{});
  map.look_away();
  ASSERT_TRUE(step_until(*archive, *map.engine, [&] { return corner_is_away(map); }));
  ASSERT_TRUE(step_until(*archive, *map.engine, [&] {
    map.look(Se3d{});
    return map.states() == corner;
  }));
  EXPECT_EQ(archive->counters().failed, 0u);
  for (const fs::path& file : folder.groups()) EXPECT_EQ(file.filename().string()[0], '1') << file;
}

TEST(BlockArchive, WhatACrashedRunLeftIsRemovedAndWhatIsInUseIsNot) {
  const Folder folder;
  const fs::path crashed = fs::path(folder.str()) / "run-1", foreign = fs::path(folder.str()) / "run-away";
  for (const fs::path& path : {crashed, foreign}) fs::create_directories(path);
  for (const char* name : {"lock", "0-1.group"}) std::ofstream(crashed / name) << "x";
  std::ofstream(foreign / "diary.txt") << "x";  // has no lock: is none of ours
  const auto first = open(all_goes(folder));
  EXPECT_FALSE(fs::exists(crashed));
  EXPECT_TRUE(fs::exists(foreign / "diary.txt"));
  const fs::path in_use = fs::path(folder.str()) / ("run-" + std::to_string(::getpid()));
  EXPECT_TRUE(fs::exists(in_use / "lock"));
  const fs::path other = fs::path(folder.str()) / "run-2";  // another process's, as this one sees it
  fs::create_directories(other);
  fs::create_hard_link(in_use / "lock", other / "lock");
  fs::rename(in_use, fs::path(folder.str()) / "run-3");
  const auto second = open(all_goes(folder));
  EXPECT_TRUE(fs::exists(other / "lock"));
  EXPECT_TRUE(fs::exists(fs::path(folder.str()) / "run-3" / "lock"));
}

TEST(BlockArchive, ItsFilesAreGoneWithIt) {
  const Folder folder;
  {
    MappedCorner map;
    const auto archive = open(all_goes(folder));
    map.look_away();
    ASSERT_TRUE(step_until(*archive, *map.engine, [&] { return archive->counters().stored > 3; }));
    EXPECT_FALSE(folder.groups().empty());
  }
  EXPECT_TRUE(fs::is_empty(folder.str()));
}

TEST(BlockArchive, NothingGoesWhileThereIsRoom) {
  const Folder folder;
  MappedCorner map;
  BlockArchive::Options options = all_goes(folder);
  options.keep_below = 0.9f;
  const auto archive = open(options);
  map.look_away();
  for (int i = 0; i < 100; ++i) archive->step(*map.engine, {});
  EXPECT_EQ(archive->counters().groups, 0u);
}

TEST(BlockArchive, AFolderThatCannotBeMadeIsAnError) {
  const Folder folder;
  std::ofstream(folder.str() + "/file") << "no folder";
  BlockArchive::Options options = all_goes(folder);
  options.dir = folder.str() + "/file";
  const auto archive = BlockArchive::open(options);
  ASSERT_FALSE(archive);
  EXPECT_NE(archive.error().find(options.dir), std::string::npos);
}

TEST(BoundedQueue, KeepsItsOrderAcrossThreads) {
  BoundedQueue<uint32_t> queue(7);
  constexpr uint32_t kCount = 100000;
  std::thread writer([&] {
    for (uint32_t i = 0; i < kCount;)
      if (queue.push(i)) ++i;
  });
  uint32_t expected = 0, got = 0;
  while (expected < kCount && queue.pop_within(got, std::chrono::milliseconds(10000))) {
    ASSERT_EQ(got, expected);
    ++expected;
  }
  writer.join();
  EXPECT_EQ(expected, kCount);
}

TEST(BoundedQueue, RefusesWhenFullAndAnswersWhenEmpty) {
  BoundedQueue<int> queue(2);
  int got = 0;
  EXPECT_FALSE(queue.pop(got));
  EXPECT_FALSE(queue.pop_within(got, std::chrono::milliseconds(1)));
  EXPECT_TRUE(queue.push(1));
  EXPECT_TRUE(queue.push(2));
  EXPECT_FALSE(queue.push(3));
  EXPECT_TRUE(queue.pop(got));
  EXPECT_EQ(got, 1);
  EXPECT_TRUE(queue.push(3));
  EXPECT_TRUE(queue.pop(got));
  EXPECT_TRUE(queue.pop(got));
  EXPECT_EQ(got, 3);
}

}  // namespace
}  // namespace stillmap
