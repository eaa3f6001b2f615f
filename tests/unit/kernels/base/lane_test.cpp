#include "kernels/base/lane.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <random>

#include "kernels/backend/cpu/lanes.hpp"

namespace stillmap {
namespace {

const float kNumbers[] = {0.0f,  -0.0f, 0.25f,   0.5f,     0.75f,    1.5f,      2.5f, -0.5f,
                          -1.5f, -2.5f, -0.001f, 32767.0f, 65280.0f, -32767.0f, 1e6f, -1e6f};

TEST(Lane, FloorAndRoundAreThoseOfTheStandard) {
  for (const float x : kNumbers) {
    EXPECT_EQ(floor_int(x), static_cast<int32_t>(std::floor(x))) << x;
    EXPECT_EQ(round_nearest(x), std::nearbyint(x)) << x;
    EXPECT_EQ(abs_of(x), std::fabs(x)) << x;
  }
}

TEST(Lane, EightLanesEqualOneAtATime) {
  std::mt19937 random(9);
  std::uniform_real_distribution<float> number(-40000, 40000);
  for (int n = 0; n < 200; ++n) {
    float a[8], b[8];
    for (int i = 0; i < 8; ++i) a[i] = number(random), b[i] = n % 3 ? number(random) : a[i];
    const Float8 va = Float8::load(a), vb = Float8::load(b);
    const Int8 ia = to_int(va), ib = to_int(vb);
    for (int i = 0; i < 8; ++i) {
      EXPECT_EQ((va + vb)[i], a[i] + b[i]);
      EXPECT_EQ((va - vb)[i], a[i] - b[i]);
      EXPECT_EQ((va * vb)[i], a[i] * b[i]);
      EXPECT_EQ((va / vb)[i], a[i] / b[i]);
      EXPECT_EQ((-va)[i], -a[i]);
      EXPECT_EQ(min_of(va, vb)[i], min_of(a[i], b[i]));
      EXPECT_EQ(max_of(va, vb)[i], max_of(a[i], b[i]));
      EXPECT_EQ(abs_of(va)[i], abs_of(a[i]));
      EXPECT_EQ(round_nearest(va)[i], round_nearest(a[i]));
      EXPECT_EQ(floor_int(va)[i], floor_int(a[i]));
      EXPECT_EQ(to_int(va)[i], to_int(a[i]));
      EXPECT_EQ(to_float(ia)[i], to_float(ia[i]));
      EXPECT_EQ((ia & ib)[i], ia[i] & ib[i]);
      EXPECT_EQ(wrapping_add(ia << 17, ib << 17)[i], wrapping_add((ia << 17)[i], (ib << 17)[i]));
      EXPECT_EQ(wrapping_multiply(ia << 8, ib)[i], wrapping_multiply((ia << 8)[i], ib[i]));
      EXPECT_EQ((ia | ib)[i], ia[i] | ib[i]);
      EXPECT_EQ((ia ^ ib)[i], ia[i] ^ ib[i]);
      EXPECT_EQ(shift_right(ia, 5)[i], shift_right(ia[i], 5));
      EXPECT_EQ(select(va < vb, va, vb)[i], a[i] < b[i] ? a[i] : b[i]);
      EXPECT_EQ(select(va <= vb, Int8(1), Int8(0))[i], a[i] <= b[i]);
      EXPECT_EQ(select(va >= vb, Int8(1), Int8(0))[i], a[i] >= b[i]);
      EXPECT_EQ(select(!(va > vb), Int8(1), Int8(0))[i], !(a[i] > b[i]));
      EXPECT_EQ(select((ia == ib) | (ia < ib), Int8(1), Int8(0))[i], ia[i] <= ib[i]);
      EXPECT_EQ(select((ia != ib) & (ia > ib), Int8(1), Int8(0))[i], ia[i] > ib[i]);
    }
  }
}

TEST(Lane, AnyGatherAndRamp) {
  const Float8 ramp = Float8::ramp();
  for (int i = 0; i < 8; ++i) EXPECT_EQ(ramp[i], static_cast<float>(i));
  EXPECT_FALSE((ramp > Float8(7.0f)).any());
  EXPECT_TRUE((ramp > Float8(6.0f)).any());
  const float table[] = {10, 11, 12, 13, 14, 15, 16, 17};
  const int32_t words[] = {-1, 2, -3, 4, -5, 6, -7, 8};
  const Int8 reversed = Int8(7) - to_int(ramp);
  for (int i = 0; i < 8; ++i) {
    EXPECT_EQ(gather_float(table, reversed)[i], table[7 - i]);
    EXPECT_EQ(gather_word(words, reversed)[i], words[7 - i]);
  }
}

}  // namespace
}  // namespace stillmap
