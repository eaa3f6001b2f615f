#include "kernels/base/normal_eq.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <random>

namespace stillmap {
namespace {

/// Upper triangle of J^T J of random rows, and the matrix in full.
struct RandomSystem {
  double upper[21] = {}, full[6][6] = {};

  explicit RandomSystem(uint32_t seed, int rows = 20) {
    std::mt19937 random(seed);
    std::normal_distribution<double> normal;
    for (int i = 0; i < rows; ++i) {
      double j[6];
      for (double& x : j) x = normal(random);
      for (int r = 0; r < 6; ++r)
        for (int c = 0; c < 6; ++c) full[r][c] += j[r] * j[c];
    }
    int k = 0;
    for (int r = 0; r < 6; ++r)
      for (int c = r; c < 6; ++c) upper[k++] = full[r][c];
  }
};

TEST(Cholesky6, SolvesWithAndWithoutDamping) {
  for (uint32_t seed = 1; seed < 50; ++seed)
    for (const double damping : {0.0, 1e-4, 3.0}) {
      const RandomSystem system(seed);
      Cholesky6 cholesky;
      ASSERT_TRUE(cholesky.factor(system.upper, damping));
      const double b[6] = {1, -2, 3, 0.5, 0, 7};
      double x[6];
      cholesky.solve(b, x);
      for (int r = 0; r < 6; ++r) {
        double sum = damping * system.full[r][r] * x[r];
        for (int c = 0; c < 6; ++c) sum += system.full[r][c] * x[c];
        EXPECT_NEAR(sum, b[r], 1e-9);
      }
    }
}

TEST(Cholesky6, RefusesSingularAndForeignMatrices) {
  Cholesky6 cholesky;
  EXPECT_FALSE(cholesky.factor(RandomSystem(1, 5).upper, 0.0));  // rank 5
  const double zero[21] = {};
  EXPECT_FALSE(cholesky.factor(zero, 0.0));
  EXPECT_FALSE(cholesky.factor(zero, 10.0));
  RandomSystem negative(2);
  for (double& x : negative.upper) x = -x;
  EXPECT_FALSE(cholesky.factor(negative.upper, 0.0));
  for (const double bad : {std::numeric_limits<double>::quiet_NaN(), std::numeric_limits<double>::infinity()})
    for (const int at : {0, 3, 20}) {
      RandomSystem broken(3);
      broken.upper[at] = bad;
      EXPECT_FALSE(cholesky.factor(broken.upper, 1e-4)) << bad << " at " << at;
    }
}

TEST(NormalEq, AddsTermByTermInDouble) {
  NormalEqT<float> tile;
  for (int32_t i = 0; i < kTerms; ++i) tile.sum[i] = static_cast<float>(i) + 0.5f;
  NormalEq total;
  for (int n = 0; n < 1000; ++n) total.add(tile);
  for (int32_t i = 0; i < kTerms; ++i) EXPECT_EQ(total.sum[i], 1000 * (i + 0.5));
}

}  // namespace
}  // namespace stillmap
