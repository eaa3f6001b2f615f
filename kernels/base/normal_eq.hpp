#pragma once

#include <cstdint>

#include "kernels/base/se3.hpp"

namespace stillmap {

/// Places of the sums of one registration pass.
enum NormalEqTerm : int32_t {
  kHessian = 0,      ///< J^T W J, upper triangle row by row, 21 of them
  kGradient = 21,    ///< J^T W r, 6 of them
  kCost = 27,        ///< of the points used, robust and weighted
  kSumSdf2 = 28,     ///< of the inliers' squared distances, m^2
  kPoints = 29,      ///< points with a value in the map
  kInliers = 30,     ///< of those, within track.inlier_m of the surface
  kConsidered = 31,  ///< points measured, unmasked, in range
  kWeight = 32,      ///< of the points used: each counts as much as it is trusted, 0..1
  kTerms = 33
};

/// Sums of one registration pass. T is float within a tile of pixels and double over the image; tiles are
/// added in a fixed order, so the result does not depend on the number of threads.
template <class T>
struct NormalEqT {
  T sum[kTerms] = {};

  template <class U>
  STILLMAP_HD void add(const NormalEqT<U>& other) {
    for (int32_t i = 0; i < kTerms; ++i) sum[i] += static_cast<T>(other.sum[i]);
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
