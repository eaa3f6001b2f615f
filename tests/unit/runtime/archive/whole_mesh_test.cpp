#include "runtime/archive/whole_mesh.hpp"

#include <gtest/gtest.h>
#include <unistd.h>

#include <chrono>
#include <cstring>
#include <filesystem>
#include <thread>

#include "tests/support/mapped_corner.hpp"
#include "tests/support/mesh_recorder.hpp"

namespace stillmap {
namespace {

namespace fs = std::filesystem;
using test::MappedCorner;

template <class T>
bool same_bytes(const std::vector<T>& a, const std::vector<T>& b) {
  return a.size() == b.size() && std::memcmp(a.data(), b.data(), a.size() * sizeof(T)) == 0;
}

TEST(WholeMesh, IsTheMeshOfAMapThatNeverPutAnythingAway) {
  const fs::path dir = fs::temp_directory_path() / ("stillmap-whole-" + std::to_string(::getpid()));
  BlockArchive::Options options;
  options.dir = dir.string();
  options.max_bytes = 1000000000;
  options.keep_below = 0;
  const EngineParams params = test::small_archive_params();
  MappedCorner map(params);
  map.look_away();
  MeshRecorder before, after, left;
  ASSERT_EQ(map.engine->extract_mesh(before), Status::ok);
  {
    auto archive = BlockArchive::open(options);
    ASSERT_TRUE(archive) << archive.error();
    const auto end = std::chrono::steady_clock::now() + std::chrono::seconds(60);
    while ((*archive)->counters().groups < 10 && std::chrono::steady_clock::now() < end)
      (*archive)->step(*map.engine, {0, 0, -20});
    ASSERT_EQ(map.engine->extract_mesh(left), Status::ok);
    EXPECT_EQ(extract_whole_mesh(*map.engine, **archive, params, options.dir, after), "");
  }
  EXPECT_LT(left.triangle_count(), before.triangle_count());
  EXPECT_GT(before.triangle_count(), 1000u);
  EXPECT_TRUE(same_bytes(before.positions, after.positions));
  EXPECT_TRUE(same_bytes(before.colours, after.colours));
  EXPECT_TRUE(same_bytes(before.indices, after.indices));
  fs::remove_all(dir);
}

}  // namespace
}  // namespace stillmap
