#pragma once

#include <cstdint>

#include "kernels/base/se3.hpp"

namespace stillmap {

/// Sums of one registration pass: J^T W J (upper triangle), J^T W r, the cost and what went into it.
/// T is float within a tile of pixels and double over the image; tiles are added in a fixed order.
template <class T>
struct NormalEqT {
  static constexpr int kHessian = 21;
  T hessian[kHessian] = {};
  T gradient[6] = {};
  T cost = 0;        ///< of the points used, robust where asked
  T sum_sdf2 = 0;    ///< of the inliers' squared distances, m^2
  T points = 0;      ///< with a value in the map
  T inliers = 0;     ///< of those, within track.inlier_m of the surface
  T considered = 0;  ///< valid, unmasked, in range

  /// Adds one residual with Jacobian `j` and weight `w`.
  STILLMAP_HD void add(const float j[6], float residual, float w) {
    int k = 0;
    for (int r = 0; r < 6; ++r) {
      const float wj = w * j[r];
      for (int c = r; c < 6; ++c) hessian[k++] += wj * j[c];
      gradient[r] += wj * residual;
    }
  }
  template <class U>
  STILLMAP_HD void add(const NormalEqT<U>& other) {
    for (int i = 0; i < kHessian; ++i) hessian[i] += static_cast<T>(other.hessian[i]);
    for (int i = 0; i < 6; ++i) gradient[i] += static_cast<T>(other.gradient[i]);
    cost += static_cast<T>(other.cost);
    sum_sdf2 += static_cast<T>(other.sum_sdf2);
    points += static_cast<T>(other.points);
    inliers += static_cast<T>(other.inliers);
    considered += static_cast<T>(other.considered);
  }
};
using NormalEq = NormalEqT<double>;

/// Cholesky factor of a symmetric 6x6 matrix given by its upper triangle, and what can be done with it.
struct Cholesky6 {
  double l[6][6] = {};

  /// @param damping relative to the diagonal (Levenberg-Marquardt)
  /// @return false when not positive definite or worse conditioned than 1e-12
  STILLMAP_HD bool factor(const double upper[21], double damping) {
    double a[6][6];
    int k = 0;
    double largest = 0;
    for (int r = 0; r < 6; ++r)
      for (int c = r; c < 6; ++c) a[r][c] = a[c][r] = upper[k++];
    for (int i = 0; i < 6; ++i) {
      a[i][i] *= 1.0 + damping;
      largest = a[i][i] > largest ? a[i][i] : largest;
    }
    for (int i = 0; i < 6; ++i)
      for (int j = 0; j <= i; ++j) {
        double sum = a[i][j];
        for (int m = 0; m < j; ++m) sum -= l[i][m] * l[j][m];
        if (i != j) {
          l[i][j] = sum / l[j][j];
        } else {
          if (!(sum > 1e-12 * largest)) return false;  // also NaN
          l[i][i] = sqrt(sum);
        }
      }
    return true;
  }
  /// Solves A x = b.
  STILLMAP_HD void solve(const double b[6], double x[6]) const {
    double y[6];
    for (int i = 0; i < 6; ++i) {
      y[i] = b[i];
      for (int j = 0; j < i; ++j) y[i] -= l[i][j] * y[j];
      y[i] /= l[i][i];
    }
    for (int i = 5; i >= 0; --i) {
      x[i] = y[i];
      for (int j = i + 1; j < 6; ++j) x[i] -= l[j][i] * x[j];
      x[i] /= l[i][i];
    }
  }
};

}  // namespace stillmap
