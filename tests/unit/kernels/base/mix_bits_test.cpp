#include "kernels/base/mix_bits.hpp"

#include <gtest/gtest.h>

namespace stillmap {
namespace {

/// The rendered scenes, and so every figure measured on them, hang on these bits.
TEST(MixBits, AreTheSameForEver) {
  EXPECT_EQ(mix_bits(0), 0u);
  EXPECT_EQ(mix_bits(1), 0x688990c0u);
  EXPECT_EQ(mix_bits(2), 0xd1132181u);
  EXPECT_EQ(mix_bits(0x9e3779b9u), 0x01fce552u);
  EXPECT_EQ(mix_bits(0xffffffffu), 0x6768824au);
}

}  // namespace
}  // namespace stillmap
