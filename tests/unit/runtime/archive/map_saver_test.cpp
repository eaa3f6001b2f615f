#include "runtime/archive/map_saver.hpp"

#include <gtest/gtest.h>

#include <filesystem>
#include <string>

#include "tests/support/contains.hpp"
#include "tests/support/temp_dir.hpp"
#include "tests/unit/runtime/archive/map_fixture.hpp"
#include "tests/unit/runtime/record/file_size_limit.hpp"

namespace stillmap {
namespace {

using namespace test;  // NOLINT(google-build-using-namespace)

MapInfo info() {
  return MapInfo::of(config_of(map_params()), {}, Stamp{1});
}

TEST(MapSaver, ProgressRisesToTheEndAndASecondSaveWaitsItsTurn) {
  const TempDir dir;
  const auto engine = random_map(1, 300, 5);
  MapSaver saver(dir.path("map.smap"), *engine);
  EXPECT_FALSE(saver.progress().saving);
  EXPECT_FALSE(saver.step());
  ASSERT_TRUE(saver.begin(info()));
  EXPECT_FALSE(saver.begin(info()));
  uint64_t done = 0, steps = 0;
  while (saver.progress().saving) {
    steps += saver.step();
    const SaveProgress progress = saver.progress();
    EXPECT_GE(progress.groups_done, done);
    EXPECT_EQ(progress.groups, 600u);
    done = progress.groups_done;
  }
  EXPECT_EQ(done, 600u);
  EXPECT_GT(steps, 10u);  // a bounded piece each
  EXPECT_EQ(saver.result().error, "");
  EXPECT_EQ(saver.result().bytes, std::filesystem::file_size(dir.path("map.smap")));
  EXPECT_TRUE(saver.begin(info()));
  finish(saver);
  EXPECT_EQ(saver.result().error, "");
}

TEST(MapSaver, MemoryIsWhatThePlanSays) {
  const auto engine = make_cpu_engine(map_params());
  const MapSaver saver("/tmp/never", *engine);
  EXPECT_EQ(plan_group_capacity(map_params()), engine->group_capacity());
  EXPECT_EQ(saver.memory_bytes(), MapSaver::planned_bytes(engine->group_capacity()));
}

TEST(MapSaver, AMapThatChangesMeanwhileIsSavedWhole) {
  const TempDir dir;
  const auto engine = random_map(1, 200, 3);
  std::mt19937 random(7);
  MapSaver saver(dir.path("map.smap"), *engine);
  ASSERT_TRUE(saver.begin(info()));
  for (int i = 0; saver.progress().saving; ++i) {
    saver.step();
    if (i >= 50) continue;
    ASSERT_EQ(engine->read_group(view_of(random_group(random_place(random), random))), Status::ok);
    if (i == 5) engine->reset_map();  // all that is left to copy is gone
  }
  ASSERT_EQ(saver.result().error, "");
  auto file = MapFile::open(dir.path("map.smap"));
  ASSERT_TRUE(file) << file.error();
  EXPECT_GT(file->contents().groups, 0u);
  EXPECT_LT(file->contents().groups, 400u);
  EXPECT_TRUE(file->load(*engine));
}

TEST(MapSaver, AFullDiskIsToldAndTheOldFileStays) {
  const TempDir dir;
  const std::string path = dir.write("map.smap", "the last good one");
  const auto engine = random_map(1, 100, 3);
  MapSaver saver(path, *engine);
  {
    const FileSizeLimit limit(100000);
    ASSERT_TRUE(saver.begin(info()));
    finish(saver);
  }
  EXPECT_TRUE(contains(saver.result().error, path + ": cannot be written: File too large"))
      << saver.result().error;
  EXPECT_EQ(read_text(path), "the last good one");
  EXPECT_FALSE(exists(path + ".part"));
  ASSERT_TRUE(saver.begin(info()));  // there is room again
  finish(saver);
  EXPECT_EQ(saver.result().error, "");
  EXPECT_TRUE(MapFile::open(path));
}

TEST(MapSaver, AFolderThatIsNotThereIsTold) {
  const auto engine = random_map(1, 100, 3);
  EXPECT_TRUE(contains(save(*engine, "/proc/no/map.smap", info()), "/proc/no/map.smap: cannot be written"));
}

TEST(MapSaver, ASaveThatIsGivenUpLeavesTheOldFile) {
  const TempDir dir;
  const std::string path = dir.write("map.smap", "the last good one");
  const auto engine = random_map(1, 300, 3);
  {
    MapSaver saver(path, *engine);
    ASSERT_TRUE(saver.begin(info()));
    for (int i = 0; i < 3; ++i) saver.step();
  }
  EXPECT_EQ(read_text(path), "the last good one");
  EXPECT_FALSE(exists(path + ".part"));
}

}  // namespace
}  // namespace stillmap
