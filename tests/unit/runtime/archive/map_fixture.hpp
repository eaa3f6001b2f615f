#pragma once

// Engines with maps of every kind of block, and what is in them.

#include <gtest/gtest.h>

#include <chrono>
#include <cstring>
#include <memory>
#include <random>
#include <string>
#include <thread>
#include <vector>

#include "kernels/engine.hpp"
#include "kernels/map/group_record.hpp"
#include "kernels/relocalise/place_record.hpp"
#include "runtime/archive/map_saver.hpp"

namespace stillmap::test {

inline EngineParams map_params(int32_t pool_blocks = 16000) {
  EngineParams p;
  p.camera.k = {70, 70, 40, 30, 80, 60};
  p.map.pool_blocks = pool_blocks;
  p.map.free_space = FreeSpace::hierarchical;
  p.relocalise.max_keyframes = 16;
  p.relocalise.ferns = 64;
  p.threads = 1;
  return p;
}

inline Config config_of(const EngineParams& p) {
  Config config;
  config.map = p.map;
  config.relocalise = p.relocalise;
  return config;
}

using Bytes = std::vector<uint8_t>;
inline View<const uint8_t> view_of(const Bytes& bytes) {
  return {bytes.data(), static_cast<uint32_t>(bytes.size())};
}

/// @param voxel_share of the blocks  @param noise voxels are random, else all the same
inline Bytes random_group(Int3 at, std::mt19937& random, double voxel_share = 0.1, bool noise = true) {
  GroupRecordHead head = {pack(at), sizeof head, 0, {}, {}, {}};
  const auto draw = [&](uint32_t low, uint32_t high) {
    return std::uniform_int_distribution<uint32_t>(low, high)(random);
  };
  Bytes record(sizeof head);
  for (int32_t i = 0; i < kGroupBlocks; ++i) {
    const bool voxels = std::uniform_real_distribution<>()(random) < voxel_share;
    const uint32_t other = draw(0, 2);
    const BlockKind kind = voxels ? BlockKind::voxels
                                  : (other == 0   ? BlockKind::unknown
                                     : other == 1 ? BlockKind::free
                                                  : BlockKind::partly);
    head.kind[i] = static_cast<uint8_t>(kind);
    if (kind == BlockKind::free || kind == BlockKind::partly)
      head.looks[i] = static_cast<uint8_t>(draw(1, 64));
    if (kind == BlockKind::voxels) head.settled[i] = static_cast<uint8_t>(draw(0, 2));
    for (uint32_t b = 0; b < payload_bytes(kind); ++b)
      record.push_back(noise ? static_cast<uint8_t>(draw(0, 255)) : uint8_t{17});
  }
  head.bytes = static_cast<uint32_t>(record.size());
  std::memcpy(record.data(), &head, sizeof head);
  return record;
}

/// A group that is free throughout.
inline Bytes free_group(Int3 at, uint32_t looks) {
  const GroupRecordHead head = {pack(at), sizeof head, looks, {}, {}, {}};
  Bytes record(sizeof head);
  std::memcpy(record.data(), &head, sizeof head);
  return record;
}

inline Int3 random_place(std::mt19937& random) {
  std::uniform_int_distribution<int32_t> along(-200000, 200000);
  return {along(random), along(random), along(random)};
}

/// Takes keyframes of random pictures on a walk of half a metre a step.
inline void walk(Engine& engine, int32_t steps, std::mt19937& random) {
  std::vector<uint16_t> depth(80 * 60);
  std::vector<Rgb8> colour(80 * 60);
  for (int32_t step = 0; step < steps; ++step) {
    for (uint16_t& d : depth) d = static_cast<uint16_t>(3000 + random() % 12000);
    for (Rgb8& c : colour) c = {static_cast<uint8_t>(random()), static_cast<uint8_t>(random()), 9};
    engine.prepare({{depth.data(), 60, 80, 80}, {colour.data(), 60, 80, 80}});
    Se3 T = cast<float>(exp(Twistd{{0.5 * step, 0, 0}, {0, 0.1 * step, 0}}));
    engine.remember_place(T);
  }
}

inline std::unique_ptr<Engine> random_map(uint32_t seed, int32_t groups, int32_t keyframes) {
  std::mt19937 random(seed);
  auto engine = make_cpu_engine(map_params());
  for (int32_t i = 0; i < groups; ++i)
    EXPECT_EQ(engine->read_group(view_of(random_group(random_place(random), random))), Status::ok);
  for (int32_t i = 0; i < groups; ++i)
    EXPECT_EQ(engine->read_group(view_of(free_group(random_place(random), 1 + random() % 64))), Status::ok);
  walk(*engine, keyframes, random);
  EXPECT_EQ(engine->place_count(), static_cast<uint32_t>(keyframes));
  return engine;
}

/// Every record of a map, in order.
inline std::vector<Bytes> contents_of(const Engine& engine) {
  std::vector<Bytes> records;
  std::vector<uint64_t> keys(engine.group_capacity());
  keys.resize(engine.list_groups({keys.data(), engine.group_capacity()}));
  Bytes record(kMaxGroupRecordBytes);
  const View<uint8_t> space{record.data(), kMaxGroupRecordBytes};
  for (const uint64_t key : keys)
    records.emplace_back(record.data(), record.data() + engine.write_group(key, space));
  for (uint32_t i = 0; i < engine.place_count(); ++i)
    records.emplace_back(record.data(), record.data() + engine.write_place(i, space));
  return records;
}

inline void finish(MapSaver& saver) {
  while (saver.progress().saving)
    if (!saver.step()) std::this_thread::sleep_for(std::chrono::milliseconds(1));
}

/// Saves in one go. @return the error, or empty
inline std::string save(const Engine& engine, const std::string& path, const MapInfo& info) {
  MapSaver saver(path, engine);
  EXPECT_TRUE(saver.begin(info));
  finish(saver);
  return saver.result().error;
}

}  // namespace stillmap::test
