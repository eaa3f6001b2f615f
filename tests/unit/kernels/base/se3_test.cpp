#include "kernels/base/se3.hpp"

#include <gtest/gtest.h>

#include <numbers>
#include <random>

namespace stillmap {
namespace {

constexpr double kPi = std::numbers::pi;

class Se3Test : public testing::Test {
 protected:
  double uniform(double low, double high) {
    return std::uniform_real_distribution<double>(low, high)(random_);
  }
  Vec3d direction() {
    while (true) {
      const Vec3d v = {uniform(-1, 1), uniform(-1, 1), uniform(-1, 1)};
      if (norm(v) > 0.1 && norm(v) < 1) return normalized(v);
    }
  }
  Twistd twist(double angle_rad) { return {uniform(0, 5) * direction(), angle_rad * direction()}; }
  Se3d pose() { return exp(twist(uniform(0, kPi))); }

  std::mt19937 random_{20240611};
};

double distance(const Mat3T<double>& a, const Mat3T<double>& b) {
  double d = 0;
  for (int i = 0; i < 9; ++i) d = std::max(d, std::fabs(a.m[i] - b.m[i]));
  return d;
}
double distance(const Se3d& a, const Se3d& b) {
  return std::max(distance(a.rotation, b.rotation), norm(a.translation - b.translation));
}
double determinant(const Mat3T<double>& r) {
  return dot(Vec3d{r(0, 0), r(0, 1), r(0, 2)},
             cross(Vec3d{r(1, 0), r(1, 1), r(1, 2)}, Vec3d{r(2, 0), r(2, 1), r(2, 2)}));
}
double off_orthonormal(const Mat3T<double>& r) {
  return distance(r * transposed(r), Mat3T<double>{});
}

/// The exponential by its definition, sum of (hat xi)^n / n!.
Se3d exp_by_series(const Twistd& xi) {
  const double hat[4][4] = {
      {0, -xi.w.z, xi.w.y, xi.v.x}, {xi.w.z, 0, -xi.w.x, xi.v.y}, {-xi.w.y, xi.w.x, 0, xi.v.z}, {0, 0, 0, 0}};
  double term[4][4] = {}, sum[4][4] = {};
  for (int i = 0; i < 4; ++i) term[i][i] = sum[i][i] = 1;
  for (int n = 1; n < 60; ++n) {
    double next[4][4] = {};
    for (int r = 0; r < 4; ++r)
      for (int c = 0; c < 4; ++c)
        for (int k = 0; k < 4; ++k) next[r][c] += term[r][k] * hat[k][c] / n;
    for (int r = 0; r < 4; ++r)
      for (int c = 0; c < 4; ++c) sum[r][c] += term[r][c] = next[r][c];
  }
  Se3d T;
  for (int r = 0; r < 3; ++r)
    for (int c = 0; c < 3; ++c) T.rotation.m[3 * r + c] = sum[r][c];
  T.translation = {sum[0][3], sum[1][3], sum[2][3]};
  return T;
}

TEST_F(Se3Test, ExpIsTheSeriesOfItsDefinition) {
  for (const double angle : {0.0, 1e-8, 1e-3, 9.99e-3, 1.001e-2, 0.1, 1.0, 3.0, 3.1415}) {
    const Twistd xi = twist(angle);
    EXPECT_LT(distance(exp(xi), exp_by_series(xi)), 1e-11) << "angle " << angle;
  }
}

TEST_F(Se3Test, LogUndoesExpForRandomTwists) {
  for (int i = 0; i < 2000; ++i) {
    const Twistd xi = twist(uniform(0, 3.1)), back = log(exp(xi));
    EXPECT_LT(norm(back.w - xi.w), 1e-9);
    EXPECT_LT(norm(back.v - xi.v), 1e-8);
  }
}

TEST_F(Se3Test, LogUndoesExpNearZero) {
  for (const double angle : {0.0, 1e-15, 1e-10, 1e-7, 1e-5, 1e-3, 0.9999e-2, 1.0001e-2, 0.02})
    for (int i = 0; i < 20; ++i) {
      const Twistd xi = twist(angle), back = log(exp(xi));
      EXPECT_LT(norm(back.w - xi.w), 1e-12) << "angle " << angle;
      EXPECT_LT(norm(back.v - xi.v), 1e-10) << "angle " << angle;
    }
}

// There the axis comes from the symmetric part, and its sign is that of the last bit of the skew part.
TEST_F(Se3Test, ExpUndoesLogNearPi) {
  for (const double below : {0.0, 1e-15, 1e-12, 1e-9, 1e-6, 1e-4, 0.9e-3, 1.1e-3, 1e-2})
    for (int i = 0; i < 50; ++i) {
      const Se3d T = exp(twist(kPi - below));
      const Twistd xi = log(T);
      EXPECT_LE(norm(xi.w), kPi + 1e-9);
      EXPECT_LT(distance(exp(xi), T), 1e-8) << "pi less " << below;
    }
  for (const Vec3d axis : {Vec3d{1, 0, 0}, Vec3d{0, 1, 0}, Vec3d{0, 0, 1}}) {
    const Se3d half_turn = exp(Twistd{{1, 2, 3}, kPi * axis});
    EXPECT_LT(distance(exp(log(half_turn)), half_turn), 1e-9);
  }
}

TEST_F(Se3Test, LogOfSinglePrecisionIsFiniteAndCloseEverywhere) {
  for (int i = 0; i < 500; ++i) {
    const double angle = i < 100 ? kPi - uniform(0, 1e-2) : uniform(0, kPi);
    const Se3 T = cast<float>(exp(twist(angle)));
    EXPECT_LT(distance(cast<double>(exp(log(T))), cast<double>(T)), 5e-4) << "angle " << angle;
  }
}

// Property: SE(3) is a group, and `exp` of multiples of one twist a subgroup of it.
TEST_F(Se3Test, GroupLaws) {
  const Se3d identity;
  for (int i = 0; i < 500; ++i) {
    const Se3d a = pose(), b = pose(), c = pose();
    const Vec3d p = 3.0 * direction();
    EXPECT_LT(distance((a * b) * c, a * (b * c)), 1e-12);
    EXPECT_LT(distance(a * identity, a), 1e-15);
    EXPECT_LT(distance(identity * a, a), 1e-15);
    EXPECT_LT(distance(a * inverse(a), identity), 1e-12);
    EXPECT_LT(distance(inverse(a) * a, identity), 1e-12);
    EXPECT_LT(distance(inverse(a * b), inverse(b) * inverse(a)), 1e-12);
    EXPECT_LT(norm((a * b) * p - a * (b * p)), 1e-12);
    EXPECT_LT(std::fabs(norm(a * p - a * (-p)) - 2 * norm(p)), 1e-12);  // lengths stay

    const Twistd xi = twist(uniform(0, 1));
    const double s = uniform(-1, 1), t = uniform(-1, 1);
    const auto times = [&](double f) { return exp(Twistd{f * xi.v, f * xi.w}); };
    EXPECT_LT(distance(times(s) * times(t), times(s + t)), 1e-12);
    EXPECT_LT(distance(inverse(times(t)), times(-t)), 1e-12);
  }
}

TEST_F(Se3Test, OrthonormalizedMendsAndLeavesRotationsAlone) {
  for (int i = 0; i < 200; ++i) {
    const Mat3T<double> r = pose().rotation;
    EXPECT_LT(distance(orthonormalized(r), r), 1e-14);
    Mat3T<double> worn = r;
    for (double& x : worn.m) x += uniform(-1e-3, 1e-3);
    const Mat3T<double> mended = orthonormalized(worn);
    EXPECT_LT(off_orthonormal(mended), 1e-14);
    EXPECT_NEAR(determinant(mended), 1.0, 1e-14);
    EXPECT_LT(distance(mended, r), 5e-3);
  }
}

TEST_F(Se3Test, AMillionProductsStayOrthonormal) {
  Se3 T;
  const Se3 step = exp(Twist{{0.001f, 0, 0}, {1e-3f, 2e-3f, -1e-3f}});
  for (int i = 0; i < 1000000; ++i) T.rotation = orthonormalized(step.rotation * T.rotation);
  EXPECT_LT(off_orthonormal(cast<double>(T).rotation), 1e-6);
}

TEST_F(Se3Test, QuaternionsRoundTrip) {
  for (int i = 0; i < 1000; ++i) {
    // Near half turns too: there each of the four branches has its part.
    const Mat3T<double> r = exp(Twistd{{}, (i % 2 ? kPi - 1e-3 : uniform(0, kPi)) * direction()}).rotation;
    const Quatd q = quaternion_from(r);
    EXPECT_NEAR(q.x * q.x + q.y * q.y + q.z * q.z + q.w * q.w, 1.0, 1e-12);
    EXPECT_GE(q.w, 0.0);
    EXPECT_LT(distance(rotation_from(q), r), 1e-12);
    const Quatd longer = {-3 * q.x, -3 * q.y, -3 * q.z, -3 * q.w};  // the same rotation
    EXPECT_LT(distance(rotation_from(longer), r), 1e-12);
  }
}

TEST_F(Se3Test, QuaternionOfAKnownRotation) {
  // A quarter turn about z moves x to y.
  const double half = std::sqrt(0.5);
  const Mat3T<double> r = rotation_from(Quatd{0, 0, half, half});
  EXPECT_LT(norm(r * Vec3d{1, 0, 0} - Vec3d{0, 1, 0}), 1e-15);
  for (const Vec3d axis : {Vec3d{1, 0, 0}, Vec3d{0, 1, 0}, Vec3d{0, 0, 1}}) {
    const Quatd q = quaternion_from(exp(Twistd{{}, kPi * axis}).rotation);
    EXPECT_NEAR(std::fabs(q.x * axis.x + q.y * axis.y + q.z * axis.z), 1.0, 1e-12);
  }
}

TEST_F(Se3Test, CastChangesOnlyPrecision) {
  const Se3d T = pose();
  EXPECT_LT(distance(cast<double>(cast<float>(T)), T), 1e-6);
  EXPECT_EQ(distance(cast<double>(T), T), 0);
  const Se3 narrow = cast<float>(T);
  EXPECT_EQ(norm(cast<float>(cast<double>(narrow)).translation - narrow.translation), 0);
}

}  // namespace
}  // namespace stillmap
