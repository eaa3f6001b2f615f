#include "drivers/dataset/pairing.hpp"

#include <gtest/gtest.h>

#include <cstdlib>
#include <random>
#include <set>

namespace stillmap {
namespace {

using Pairs = std::vector<std::pair<size_t, size_t>>;

std::vector<Stamp> stamps(std::initializer_list<int64_t> ns) {
  std::vector<Stamp> out;
  for (const int64_t value : ns) out.push_back({value});
  return out;
}

TEST(Pairing, NearestFirstEachOnce) {
  // 100 is nearer to 101 than 103 is: 103 must take what is left, which is too far.
  EXPECT_EQ(pair_by_stamp(stamps({100, 103}), stamps({101}), 5), (Pairs{{0, 0}}));
  EXPECT_EQ(pair_by_stamp(stamps({100, 103}), stamps({102}), 5), (Pairs{{1, 0}}));
  EXPECT_EQ(pair_by_stamp(stamps({100, 103}), stamps({102, 97}), 5), (Pairs{{0, 1}, {1, 0}}));
}

TEST(Pairing, TheLimitItselfIsAllowed) {
  EXPECT_EQ(pair_by_stamp(stamps({100}), stamps({120}), 20).size(), 1u);
  EXPECT_EQ(pair_by_stamp(stamps({100}), stamps({121}), 20).size(), 0u);
  EXPECT_EQ(pair_by_stamp(stamps({100}), stamps({80}), 20).size(), 1u);
}

TEST(Pairing, EmptyListsGiveNoPairs) {
  EXPECT_TRUE(pair_by_stamp({}, stamps({1}), 20).empty());
  EXPECT_TRUE(pair_by_stamp(stamps({1}), {}, 20).empty());
}

/// Against the plain definition: all pairs within the limit, by distance, each stamp once.
TEST(Pairing, EqualsTheDefinitionOnRandomLists) {
  constexpr uint32_t kSeed = 11;
  SCOPED_TRACE("seed " + std::to_string(kSeed));
  std::mt19937 random(kSeed);
  for (int round = 0; round < 200; ++round) {
    std::set<int64_t> a_set, b_set;
    for (int i = 0; i < 12; ++i) {
      a_set.insert(random() % 400);
      b_set.insert(random() % 400);
    }
    std::vector<Stamp> a, b;
    for (const int64_t value : a_set) a.push_back({value});
    for (const int64_t value : b_set) b.push_back({value});
    std::vector<std::tuple<int64_t, size_t, size_t>> all;
    for (size_t i = 0; i < a.size(); ++i)
      for (size_t j = 0; j < b.size(); ++j)
        if (std::abs(a[i].ns - b[j].ns) <= 20) all.emplace_back(std::abs(a[i].ns - b[j].ns), i, j);
    std::sort(all.begin(), all.end());
    std::set<size_t> a_taken, b_taken;
    Pairs expected;
    for (const auto& [distance, i, j] : all)
      if (!a_taken.contains(i) && !b_taken.contains(j)) {
        a_taken.insert(i);
        b_taken.insert(j);
        expected.emplace_back(i, j);
      }
    std::sort(expected.begin(), expected.end());
    EXPECT_EQ(pair_by_stamp(a, b, 20), expected);
  }
}

}  // namespace
}  // namespace stillmap
