// Saving and loading a map of which a part lies in the archive.

#include <gtest/gtest.h>

#include <cstring>
#include <map>

#include "runtime/archive/block_archive.hpp"
#include "runtime/archive/map_file.hpp"
#include "tests/support/mapped_corner.hpp"
#include "tests/support/temp_dir.hpp"
#include "tests/unit/runtime/archive/map_fixture.hpp"

namespace stillmap::test {
namespace {

MapInfo info() {
  return MapInfo::of(config_of(map_params()), {}, Stamp{1});
}

std::unique_ptr<BlockArchive> archive_in(const TempDir& dir, float keep_below) {
  BlockArchive::Options options;
  options.dir = dir.path("archive");
  options.max_bytes = 1000000000;
  options.keep_below = keep_below;
  auto archive = BlockArchive::open(options);
  EXPECT_TRUE(archive) << archive.error();
  return std::move(*archive);
}

using Groups = std::map<uint64_t, Bytes>;

void add(Groups& groups, const uint8_t* record, size_t bytes) {
  GroupRecordHead head = {};
  ASSERT_GE(bytes, sizeof head);
  std::memcpy(&head, record, sizeof head);
  EXPECT_TRUE(groups.emplace(head.group, Bytes(record, record + bytes)).second) << "there twice";
}

/// Records of the groups in the map and in the archive.
Groups groups_of(Engine& engine, BlockArchive* archive) {
  Groups groups;
  std::vector<Bytes> records = contents_of(engine);
  records.resize(records.size() - engine.place_count());
  for (const Bytes& record : records) add(groups, record.data(), record.size());
  if (!archive) return groups;
  const std::string error = archive->for_each(engine, [&](View<const uint8_t> record) {
    add(groups, record.data, record.size);
    return true;
  });
  EXPECT_EQ(error, "");
  return groups;
}

TEST(ArchivedMap, WhatIsInTheArchiveIsSavedToo) {
  const TempDir dir;
  const auto engine = random_map(1, 200, 3);
  const Groups all = groups_of(*engine, nullptr);
  const auto archive = archive_in(dir, 0.02f);
  ASSERT_EQ(archive->make_room(*engine, {}), "");
  EXPECT_LE(engine->map_health().fill, 0.02f);
  ASSERT_GT(archive->counters().groups, 100u);

  MapSaver saver(dir.path("map.smap"), *engine, archive.get());
  ASSERT_TRUE(saver.begin(info()));
  EXPECT_EQ(saver.progress().groups, all.size());
  finish(saver);
  ASSERT_EQ(saver.result().error, "");
  EXPECT_EQ(saver.progress().groups_done, all.size());
  auto file = MapFile::open(dir.path("map.smap"));
  ASSERT_TRUE(file) << file.error();
  const auto to = make_cpu_engine(map_params());
  ASSERT_TRUE(file->load(*to));
  EXPECT_EQ(groups_of(*to, nullptr), all);
  EXPECT_EQ(to->place_count(), 3u);
}

TEST(ArchivedMap, WhatGoesIntoTheArchiveDuringASaveIsSaved) {
  const TempDir dir;
  const auto engine = random_map(2, 400, 0);
  const Groups all = groups_of(*engine, nullptr);
  const auto archive = archive_in(dir, 0.02f);
  MapSaver saver(dir.path("map.smap"), *engine, archive.get());
  ASSERT_TRUE(saver.begin(info()));
  ASSERT_EQ(archive->make_room(*engine, {}), "");
  ASSERT_GT(archive->counters().groups, 200u);
  finish(saver);
  ASSERT_EQ(saver.result().error, "");
  auto file = MapFile::open(dir.path("map.smap"));
  ASSERT_TRUE(file) << file.error();
  const auto to = make_cpu_engine(map_params());
  ASSERT_TRUE(file->load(*to));
  EXPECT_EQ(groups_of(*to, nullptr), all);
}

TEST(ArchivedMap, WhatComesBackFromTheArchiveDuringASaveIsSaved) {
  const TempDir dir;
  MappedCorner map;
  const std::vector<PointState> before = map.states();
  const auto archive = archive_in(dir, 0);
  map.look_away();
  ASSERT_EQ(archive->make_room(*map.engine, {0, 0, -20}), "");
  ASSERT_NE(map.states(), before);

  MapSaver saver(dir.path("map.smap"), *map.engine, archive.get());
  ASSERT_TRUE(saver.begin(info()));
  // The thread of the saver is slower than the loop or faster, as it comes: both have to be right.
  for (int frame = 0; frame < 500 && map.states() != before; ++frame) {
    map.look(Se3d{});
    archive->step(*map.engine, {0, 0, -20});
    saver.step();
  }
  ASSERT_EQ(map.states(), before);
  finish(saver);
  ASSERT_EQ(saver.result().error, "");
  auto file = MapFile::open(dir.path("map.smap"));
  ASSERT_TRUE(file) << file.error();
  map.engine->reset_map();
  ASSERT_TRUE(file->load(*map.engine));
  EXPECT_EQ(map.states(), before);
}

TEST(ArchivedMap, AMapLargerThanThePoolIsLoadedIntoTheArchive) {
  const TempDir dir;
  const auto from = random_map(3, 300, 2);
  ASSERT_EQ(save(*from, dir.path("map.smap"), info()), "");
  const auto blocks = static_cast<int32_t>(from->map_health().blocks);
  auto file = MapFile::open(dir.path("map.smap"));
  ASSERT_TRUE(file) << file.error();
  EngineParams fifth = map_params(blocks / 5);
  Config config = config_of(fifth);
  EXPECT_FALSE(file->check_against(config));
  config.archive.dir = dir.path("archive");
  EXPECT_TRUE(file->check_against(config));

  const auto to = make_cpu_engine(fifth);
  const auto archive = archive_in(dir, 0.8f);
  const auto loaded = file->load(*to, archive.get());
  ASSERT_TRUE(loaded) << loaded.error();
  EXPECT_GT(to->map_health().fill, 0.5f);
  EXPECT_EQ(to->map_health().dropped_blocks, 0u);
  EXPECT_EQ(groups_of(*to, archive.get()), groups_of(*from, nullptr));
}

TEST(ArchivedMap, AnArchiveThatIsFullTooIsAnError) {
  const TempDir dir;
  const auto from = random_map(4, 300, 2);
  ASSERT_EQ(save(*from, dir.path("map.smap"), info()), "");
  auto file = MapFile::open(dir.path("map.smap"));
  ASSERT_TRUE(file) << file.error();
  const auto to = make_cpu_engine(map_params(static_cast<int32_t>(from->map_health().blocks) / 5));
  BlockArchive::Options options;
  options.dir = dir.path("archive");
  options.max_bytes = 1000000;
  const auto archive = BlockArchive::open(options);
  ASSERT_TRUE(archive);
  const auto loaded = file->load(*to, archive->get());
  ASSERT_FALSE(loaded);
  EXPECT_NE(loaded.error().find("archive.max_bytes"), std::string::npos);
  EXPECT_TRUE(contents_of(*to).empty());
}

}  // namespace
}  // namespace stillmap::test
