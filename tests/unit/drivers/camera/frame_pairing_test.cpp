#include "drivers/camera/frame_pairing.hpp"

#include <gtest/gtest.h>

#include <cstdlib>
#include <memory>
#include <random>
#include <string>
#include <vector>

#include "runtime/core/heap_guard.hpp"

namespace stillmap {
namespace {

constexpr int64_t kMs = 1'000'000;
using Pairing = FramePairing<int>;

/// Feeds images "d0" (depth, stamp 0 ms) or "c33"; says what came of it: "d0+c3", "-c9" for one given up.
class Fed {
 public:
  explicit Fed(int64_t max_ms) : pairing(max_ms * kMs) {}

  auto give_up() {
    return [this](Pairing::Kind kind, int image) {
      said.push_back((kind == Pairing::kDepth ? "-d" : "-c") + std::to_string(image));
    };
  }

  void add(const std::string& image) {
    Pairing::Pair pair;
    const int ms = std::stoi(image.substr(1));
    const auto kind = image[0] == 'd' ? Pairing::kDepth : Pairing::kColour;
    if (pairing.add(kind, ms * kMs, ms, pair, give_up()))
      said.push_back("d" + std::to_string(pair.depth.image) + "+c" + std::to_string(pair.colour.image));
  }
  void add_all(const std::vector<std::string>& images) {
    for (const std::string& image : images) add(image);
  }

  Pairing pairing;
  std::vector<std::string> said;
};

using Said = std::vector<std::string>;

TEST(FramePairing, PairsWhatIsNearInEitherOrder) {
  Fed fed(20);
  fed.add_all({"d0", "c3", "c36", "d33"});
  EXPECT_EQ(fed.said, (Said{"d0+c3", "d33+c36"}));
  EXPECT_EQ(fed.pairing.unpaired(Pairing::kDepth), 0u);
  EXPECT_EQ(fed.pairing.unpaired(Pairing::kColour), 0u);
}

TEST(FramePairing, TheBoundItselfIsAllowedMoreIsNot) {
  Fed fed(20);
  fed.add_all({"d0", "c20", "d100", "c121", "c200"});
  EXPECT_EQ(fed.said, (Said{"d0+c20", "-d100"}));
  Fed exact(0);
  exact.add_all({"d5", "c5", "d6", "c7"});
  EXPECT_EQ(exact.said, (Said{"d5+c5", "-d6"}));
}

TEST(FramePairing, TakesTheNearestOfThoseThatWait) {
  Fed fed(20);
  fed.add_all({"c0", "c10", "c18", "d12"});
  EXPECT_EQ(fed.said, (Said{"-c0", "d12+c10"}));
  fed.add("d20");
  EXPECT_EQ(fed.said.back(), "d20+c18");
}

TEST(FramePairing, AMissingImageCostsOneFrameOnly) {
  Fed fed(10);
  fed.add_all({"d0", "c1", "d33", "d66", "c67", "d100", "c101"});
  EXPECT_EQ(fed.said, (Said{"d0+c1", "-d33", "d66+c67", "d100+c101"}));
  EXPECT_EQ(fed.pairing.unpaired(Pairing::kDepth), 1u);
  EXPECT_EQ(fed.pairing.unpaired(Pairing::kColour), 0u);
}

TEST(FramePairing, HoldsAFixedNumberWhenAStreamDies) {
  Fed fed(1000);
  for (int i = 0; i < 100; ++i) fed.add("d" + std::to_string(33 * i));
  EXPECT_EQ(fed.pairing.unpaired(Pairing::kDepth), 100 - Pairing::kPending);
  fed.add("c3267");
  EXPECT_EQ(fed.said.back(), "d3267+c3267");
  EXPECT_EQ(fed.pairing.unpaired(Pairing::kDepth), 99u);
}

TEST(FramePairing, StampsThatRunBackBeginAnew) {
  Fed fed(10);
  fed.add_all({"d1000", "c1100", "d5", "c6"});
  EXPECT_EQ(fed.said, (Said{"-d1000", "-c1100", "d5+c6"}));
}

TEST(FramePairing, ClearGivesUpWhatWaits) {
  Fed fed(10);
  fed.add_all({"d0", "d33", "c200"});
  fed.pairing.clear(fed.give_up());
  EXPECT_EQ(fed.pairing.unpaired(Pairing::kDepth), 2u);
  EXPECT_EQ(fed.pairing.unpaired(Pairing::kColour), 1u);
  fed.add_all({"d1", "c1"});  // earlier stamps are welcome again
  EXPECT_EQ(fed.said.back(), "d1+c1");
}

/// Whatever the order and the gaps: each image once, pairs within the bound, nothing kept beyond the limit.
TEST(FramePairing, EveryImageIsPairedGivenUpOrWaits) {
  std::mt19937 random(7);
  for (int round = 0; round < 200; ++round) {
    FramePairing<int64_t> pairing(15 * kMs);
    uint64_t added[2] = {0, 0}, paired = 0, given_up = 0;
    int64_t stamp_ns[2] = {0, 0};
    for (int i = 0; i < 200; ++i) {
      const auto kind = random() % 2 == 0 ? FramePairing<int64_t>::kDepth : FramePairing<int64_t>::kColour;
      stamp_ns[kind] += static_cast<int64_t>(random() % 50) * kMs + 1;
      ++added[kind];
      FramePairing<int64_t>::Pair pair;
      if (pairing.add(kind, stamp_ns[kind], stamp_ns[kind], pair, [&](auto, int64_t) { ++given_up; })) {
        ++paired;
        EXPECT_EQ(pair.depth.image, pair.depth.stamp_ns);
        EXPECT_LE(std::abs(pair.depth.stamp_ns - pair.colour.stamp_ns), 15 * kMs);
      }
    }
    const uint64_t waiting = added[0] + added[1] - 2 * paired - given_up;
    EXPECT_LE(waiting, 2 * FramePairing<int64_t>::kPending);
    pairing.clear([&](auto, int64_t) { ++given_up; });
    EXPECT_EQ(added[0] + added[1], 2 * paired + given_up);
    EXPECT_EQ(given_up, pairing.unpaired(FramePairing<int64_t>::kDepth) +
                            pairing.unpaired(FramePairing<int64_t>::kColour));
  }
}

/// A buffer that is kept would never be filled again.
TEST(FramePairing, LetsGoOfEveryImage) {
  auto image = std::make_shared<int>(1);
  {
    FramePairing<std::shared_ptr<int>> pairing(10 * kMs);
    FramePairing<std::shared_ptr<int>>::Pair pair;
    const auto nothing = [](auto, auto&) {};
    for (int i = 0; i < 20; ++i) pairing.add(pairing.kDepth, i * 33 * kMs, image, pair, nothing);
    EXPECT_EQ(image.use_count(), 1 + static_cast<long>(pairing.kPending));
    pairing.add(pairing.kColour, 19 * 33 * kMs, image, pair, nothing);
    EXPECT_EQ(image.use_count(), 3);  // this one and the pair
  }
  EXPECT_EQ(image.use_count(), 1);
}

TEST(FramePairing, DoesNotAllocate) {
  const uint64_t before = heap_guard::allocations();
  {
    const heap_guard::Scope armed;
    Pairing pairing(10 * kMs);
    Pairing::Pair pair;
    for (int i = 0; i < 100; ++i) {
      pairing.add(Pairing::kDepth, i * 33 * kMs, i, pair, [](auto, int) {});
      if (i % 3 != 0) pairing.add(Pairing::kColour, (i * 33 + 2) * kMs, i, pair, [](auto, int) {});
    }
  }
  EXPECT_EQ(heap_guard::allocations(), before);
}

}  // namespace
}  // namespace stillmap
