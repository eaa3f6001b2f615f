#include "runtime/archive/map_file.hpp"

#include <gtest/gtest.h>

#include <string>

#include "runtime/core/crc32c.hpp"
#include "tests/support/contains.hpp"
#include "tests/support/temp_dir.hpp"
#include "tests/unit/runtime/archive/map_fixture.hpp"

namespace stillmap {
namespace {

using namespace test;  // NOLINT(google-build-using-namespace)

const Se3d kPose = exp(Twistd{{1, -2, 0.5}, {0.3, -1, 0.2}});

class MapFileTest : public testing::Test {
 protected:
  MapInfo info() const { return MapInfo::of(config_of(map_params()), kPose, Stamp{123456789012345}); }
  std::string error_of(const std::string& content) const {
    const auto file = MapFile::open(dir.write("tried.smap", content));
    return file ? "" : file.error();
  }
  /// A small map of every kind of block; its voxels are all the same.
  std::string small_file() const {
    std::mt19937 random(5);
    auto engine = make_cpu_engine(map_params(200));
    EXPECT_EQ(engine->read_group(view_of(random_group({1, 2, 3}, random, 0.05, false))), Status::ok);
    EXPECT_EQ(engine->read_group(view_of(free_group({-1, 2, 3}, 7))), Status::ok);
    walk(*engine, 1, random);
    EXPECT_EQ(save(*engine, dir.path("small.smap"), info()), "");
    return read_text(dir.path("small.smap"));
  }
  TempDir dir;
};

TEST_F(MapFileTest, EveryLayerAndThePoseComeBack) {
  for (uint32_t seed = 1; seed <= 3; ++seed) {
    const auto from = random_map(seed, 60, 9);
    ASSERT_EQ(save(*from, dir.path("map.smap"), info()), "");
    EXPECT_FALSE(exists(dir.path("map.smap.part")));
    auto file = MapFile::open(dir.path("map.smap"));
    ASSERT_TRUE(file) << file.error();
    EXPECT_EQ(file->info().stamp.ns, 123456789012345);
    EXPECT_EQ(norm(file->info().T_map_cam.translation - kPose.translation), 0.0);
    for (int i = 0; i < 9; ++i) EXPECT_EQ(file->info().T_map_cam.rotation.m[i], kPose.rotation.m[i]);
    EXPECT_EQ(file->info().voxel_m, map_params().map.voxel_m);
    EXPECT_STRNE(file->info().program_version, "");
    EXPECT_EQ(file->contents().groups, 120u);
    EXPECT_EQ(file->contents().voxel_blocks, from->map_health().blocks);
    EXPECT_EQ(file->contents().places, 9u);
    EXPECT_TRUE(file->check_against(config_of(map_params())));

    const auto to = random_map(99, 5, 2);  // what was there before is gone
    const auto loaded = file->load(*to);
    ASSERT_TRUE(loaded) << loaded.error();
    EXPECT_EQ(loaded->places, 9u);
    EXPECT_EQ(loaded->foreign_places, 0u);
    EXPECT_EQ(contents_of(*to), contents_of(*from));
    EXPECT_TRUE(file->load(*to));  // and again
    EXPECT_EQ(contents_of(*to), contents_of(*from));
  }
}

TEST_F(MapFileTest, AnEmptyMap) {
  ASSERT_EQ(save(*make_cpu_engine(map_params()), dir.path("map.smap"), info()), "");
  auto file = MapFile::open(dir.path("map.smap"));
  ASSERT_TRUE(file) << file.error();
  const auto to = random_map(1, 5, 2);
  EXPECT_TRUE(file->load(*to));
  EXPECT_TRUE(contents_of(*to).empty());
}

TEST_F(MapFileTest, KeyframesOfAnotherCameraAreCountedAndLeftOut) {
  ASSERT_EQ(save(*random_map(1, 5, 3), dir.path("map.smap"), info()), "");
  auto file = MapFile::open(dir.path("map.smap"));
  ASSERT_TRUE(file);
  EngineParams other = map_params();
  other.relocalise.ferns = 65;
  const auto to = make_cpu_engine(other);
  const auto loaded = file->load(*to);
  ASSERT_TRUE(loaded) << loaded.error();
  EXPECT_EQ(loaded->foreign_places, 3u);
  EXPECT_EQ(to->place_count(), 0u);
}

TEST_F(MapFileTest, CutAtEveryByte) {
  const std::string whole = small_file();
  EXPECT_EQ(error_of(whole), "");
  for (size_t bytes = 0; bytes < whole.size(); ++bytes) {
    const std::string error = error_of(whole.substr(0, bytes));
    ASSERT_TRUE(contains(error, "tried.smap")) << bytes << ": " << error;
    ASSERT_TRUE(contains(error, "cut off") || contains(error, "not a map")) << bytes << ": " << error;
  }
  EXPECT_TRUE(contains(error_of(whole + '\0'), "follows the end"));
}

TEST_F(MapFileTest, EveryBitFlipped) {
  std::string content = small_file();
  for (size_t bit = 0; bit < 8 * content.size(); ++bit) {
    content[bit / 8] = static_cast<char>(content[bit / 8] ^ 1 << bit % 8);
    const std::string error = error_of(content);
    ASSERT_TRUE(contains(error, "damaged")) << bit << ": " << error;
    content[bit / 8] = static_cast<char>(content[bit / 8] ^ 1 << bit % 8);
  }
}

TEST_F(MapFileTest, ANewerFormatIsNotTakenForDamage) {
  std::string content = small_file();
  content[offsetof(FileHead, format_version)] = 2;
  const uint32_t checksum = crc32c(content.data(), offsetof(FileHead, checksum));
  std::memcpy(content.data() + offsetof(FileHead, checksum), &checksum, sizeof checksum);
  const auto file = MapFile::open(dir.write("newer.smap", content));
  ASSERT_FALSE(file);
  EXPECT_EQ(file.error_kind(), ErrorKind::bad_usage);
  EXPECT_TRUE(contains(file.error(), "format version 2")) << file.error();
  EXPECT_TRUE(contains(file.error(), "version 1")) << file.error();
}

TEST_F(MapFileTest, OtherFilesAndFolders) {
  EXPECT_TRUE(contains(error_of("ply\nformat binary_little_endian 1.0\n"), "not a map"));
  for (const std::string& path : {dir.path("none.smap"), dir.path()}) {
    const auto file = MapFile::open(path);
    ASSERT_FALSE(file);
    EXPECT_EQ(file.error_kind(), ErrorKind::bad_usage);
    EXPECT_TRUE(contains(file.error(), path));
  }
}

TEST_F(MapFileTest, OtherParametersAreNamedWithBothValues) {
  ASSERT_EQ(save(*random_map(1, 20, 0), dir.path("map.smap"), info()), "");
  auto file = MapFile::open(dir.path("map.smap"));
  ASSERT_TRUE(file);
  Config config = config_of(map_params());
  config.map.voxel_m = 0.02f;
  config.map.truncation_m = 0.2f;
  config.map.free_space = FreeSpace::dense;
  config.map.pool_blocks = 3;
  const auto fits = file->check_against(config);
  ASSERT_FALSE(fits);
  EXPECT_EQ(fits.error_kind(), ErrorKind::bad_usage);
  for (const char* words :
       {"map.voxel_m is 0.01 in the map and 0.02 in the configuration: use --set map.voxel_m=0.01",
        "map.truncation_m is 0.1 in the map and 0.2", "map.free_space is hierarchical in the map and dense",
        "map.pool_blocks is 3"})
    EXPECT_TRUE(contains(fits.error(), words)) << fits.error();
}

TEST_F(MapFileTest, AMapThatDoesNotFitLeavesNothing) {
  ASSERT_EQ(save(*random_map(1, 40, 4), dir.path("map.smap"), info()), "");
  auto file = MapFile::open(dir.path("map.smap"));
  ASSERT_TRUE(file);
  const auto to = make_cpu_engine(map_params(30));
  const auto loaded = file->load(*to);
  ASSERT_FALSE(loaded);
  EXPECT_TRUE(contains(loaded.error(), "map.pool_blocks")) << loaded.error();
  EXPECT_TRUE(contents_of(*to).empty());
  EXPECT_EQ(to->map_health().blocks, 0u);
}

/// Writes a file whose checksums are right and whose records are these.
std::string write_records(const TempDir& dir, ChunkKind kind, const std::vector<Bytes>& records,
                          uint64_t count, const MapInfo& info) {
  const std::string path = dir.path("made.smap");
  auto writer = MapFileWriter::create(path, info);
  EXPECT_TRUE(writer);
  Bytes chunk;
  for (const Bytes& record : records) {
    const auto length = static_cast<uint32_t>(record.size());
    const auto* const bytes = reinterpret_cast<const uint8_t*>(&length);
    chunk.insert(chunk.end(), bytes, bytes + sizeof length);
    chunk.insert(chunk.end(), record.begin(), record.end());
  }
  EXPECT_TRUE(writer->write(kind, view_of(chunk), count));
  EXPECT_TRUE(writer->close()) << writer->error();
  return path;
}

TEST_F(MapFileTest, RecordsThatMakeNoSenseAreRefusedThoughTheChecksumsAreRight) {
  std::mt19937 random(1);
  const Bytes good = random_group({1, 1, 1}, random);
  const Bytes cut(good.begin(), good.end() - 1);
  const Bytes no_head(good.begin(), good.begin() + 100);
  for (const auto& records : {std::vector<Bytes>{good, cut}, {good, no_head}})
    EXPECT_FALSE(MapFile::open(write_records(dir, ChunkKind::groups, records, 2, info())));
  EXPECT_FALSE(MapFile::open(write_records(dir, ChunkKind::groups, {good}, 2, info())));
  EXPECT_FALSE(MapFile::open(write_records(dir, ChunkKind{7}, {good}, 1, info())));
  MapInfo nowhere = info();
  nowhere.T_map_cam.rotation.m[3] = 3;
  EXPECT_FALSE(MapFile::open(write_records(dir, ChunkKind::groups, {good}, 1, nowhere)));
}

TEST_F(MapFileTest, WhatOnlyTheEngineCanRefuseLeavesNothing) {
  std::mt19937 random(1);
  const Bytes good = random_group({1, 1, 1}, random);
  Bytes of_no_kind = free_group({2, 2, 2}, 1);
  of_no_kind[offsetof(GroupRecordHead, kind)] = 77;
  Bytes place(sizeof(PlaceRecordHead) + 64);  // a rotation of zeros
  const PlaceRecordHead head = {{{{}}, {}}, 64, 1, 1};
  std::memcpy(place.data(), &head, sizeof head);
  for (const std::string& path : {write_records(dir, ChunkKind::groups, {good, of_no_kind}, 2, info())}) {
    auto file = MapFile::open(path);
    ASSERT_TRUE(file) << file.error();
    const auto to = random_map(3, 5, 2);
    const auto loaded = file->load(*to);
    ASSERT_FALSE(loaded);
    EXPECT_TRUE(contains(loaded.error(), "damaged"));
    EXPECT_TRUE(contents_of(*to).empty());
  }
  auto file = MapFile::open(write_records(dir, ChunkKind::places, {place}, 1, info()));
  ASSERT_TRUE(file) << file.error();
  EXPECT_FALSE(file->load(*make_cpu_engine(map_params())));
}

/// Whatever the bytes are: an answer, no crash. (Run it under a sanitizer.)
TEST_F(MapFileTest, RandomDamageWithAndWithoutAnEnd) {
  const std::string whole = small_file();
  std::mt19937 random(11);
  for (int i = 0; i < 2000; ++i) {
    std::string content = whole;
    for (uint32_t n = 1 + random() % 8; n > 0; --n) {
      const size_t at = random() % content.size();
      if (random() % 3 == 0)
        content.erase(at, 1 + random() % 9);
      else if (random() % 2 == 0)
        content.insert(at, 1 + random() % 9, static_cast<char>(random()));
      else
        content[at] = static_cast<char>(random());
      if (content.empty()) break;
    }
    EXPECT_NE(error_of(content == whole ? "" : content), "");
  }
}

}  // namespace
}  // namespace stillmap
