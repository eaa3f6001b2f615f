#pragma once

#include "kernels/base/vec.hpp"

namespace stillmap {

/// Rotation matrix, row-major.
template <class T>
struct Mat3T {
  T m[9] = {1, 0, 0, 0, 1, 0, 0, 0, 1};

  STILLMAP_HD T operator()(int row, int col) const { return m[3 * row + col]; }
};
using Mat3 = Mat3T<float>;

template <class T>
STILLMAP_HD Vec3T<T> operator*(const Mat3T<T>& a, Vec3T<T> v) {
  return {a.m[0] * v.x + a.m[1] * v.y + a.m[2] * v.z, a.m[3] * v.x + a.m[4] * v.y + a.m[5] * v.z,
          a.m[6] * v.x + a.m[7] * v.y + a.m[8] * v.z};
}
template <class T>
STILLMAP_HD Mat3T<T> operator*(const Mat3T<T>& a, const Mat3T<T>& b) {
  Mat3T<T> c;
  for (int r = 0; r < 3; ++r)
    for (int k = 0; k < 3; ++k)
      c.m[3 * r + k] = a.m[3 * r] * b.m[k] + a.m[3 * r + 1] * b.m[3 + k] + a.m[3 * r + 2] * b.m[6 + k];
  return c;
}
template <class T>
STILLMAP_HD Mat3T<T> transposed(const Mat3T<T>& a) {
  return {{a.m[0], a.m[3], a.m[6], a.m[1], a.m[4], a.m[7], a.m[2], a.m[5], a.m[8]}};
}

/// Rigid transformation. `T_a_b` maps points of frame b to frame a: p_a = T_a_b * p_b, metres.
template <class T>
struct Se3T {
  Mat3T<T> rotation;
  Vec3T<T> translation;
};
using Se3 = Se3T<float>;    ///< inside kernels
using Se3d = Se3T<double>;  ///< trajectories on the host

template <class T>
STILLMAP_HD Vec3T<T> operator*(const Se3T<T>& a, Vec3T<T> p) {
  return a.rotation * p + a.translation;
}
template <class T>
STILLMAP_HD Se3T<T> operator*(const Se3T<T>& a, const Se3T<T>& b) {
  return {a.rotation * b.rotation, a.rotation * b.translation + a.translation};
}
template <class T>
STILLMAP_HD Se3T<T> inverse(const Se3T<T>& a) {
  const Mat3T<T> rt = transposed(a.rotation);
  return {rt, -(rt * a.translation)};
}

/// Twist: translation part first, then rotation (x y z rx ry rz), metres and radians.
template <class T>
struct TwistT {
  Vec3T<T> v;  ///< metres
  Vec3T<T> w;  ///< radians
};
using Twist = TwistT<float>;
using Twistd = TwistT<double>;

namespace se3_detail {
/// sin(t)/t, (1-cos t)/t^2 and (t-sin t)/t^3, by their series near 0.
template <class T>
STILLMAP_HD void coefficients(T theta2, T& a, T& b, T& c) {
  if (theta2 < T(1e-4)) {
    a = T(1) - theta2 / T(6) * (T(1) - theta2 / T(20));
    b = T(0.5) - theta2 / T(24) * (T(1) - theta2 / T(30));
    c = T(1) / T(6) - theta2 / T(120) * (T(1) - theta2 / T(42));
    return;
  }
  const T theta = sqrt(theta2);
  a = sin(theta) / theta;
  b = (T(1) - cos(theta)) / theta2;
  c = (T(1) - a) / theta2;
}
/// I + a [w]x + b [w]x^2
template <class T>
STILLMAP_HD Mat3T<T> rodrigues(Vec3T<T> w, T a, T b) {
  const T xx = w.x * w.x, yy = w.y * w.y, zz = w.z * w.z, xy = w.x * w.y, xz = w.x * w.z, yz = w.y * w.z;
  return {{T(1) - b * (yy + zz), b * xy - a * w.z, b * xz + a * w.y, b * xy + a * w.z, T(1) - b * (xx + zz),
           b * yz - a * w.x, b * xz - a * w.y, b * yz + a * w.x, T(1) - b * (xx + yy)}};
}
}  // namespace se3_detail

/// Exponential map of se(3), paper section III-B.                       test: se3_test
/// @thread any (pure)
template <class T>
STILLMAP_HD Se3T<T> exp(const TwistT<T>& xi) {
  T a, b, c;
  se3_detail::coefficients(dot(xi.w, xi.w), a, b, c);
  const Mat3T<T> left_jacobian = se3_detail::rodrigues(xi.w, b, c);
  return {se3_detail::rodrigues(xi.w, a, b), left_jacobian * xi.v};
}

/// Rotation vector of a rotation matrix, angle in [0, pi].              test: se3_test
template <class T>
STILLMAP_HD Vec3T<T> log_rotation(const Mat3T<T>& r) {
  const Vec3T<T> axis2 = {r(2, 1) - r(1, 2), r(0, 2) - r(2, 0), r(1, 0) - r(0, 1)};  // 2 sin(angle) axis
  const T sine = T(0.5) * norm(axis2);
  const T cosine = T(0.5) * (r(0, 0) + r(1, 1) + r(2, 2) - T(1));
  const T angle = atan2(sine, cosine);
  if (sine > T(1e-3) || (cosine > T(0) && sine > T(0))) return (T(0.5) * angle / sine) * axis2;
  if (cosine > T(0)) return T(0.5) * axis2;
  // Near pi: (R + R^T) / 2 - cos I = (1 - cos) axis axis^T; the axis is its largest column, the sign comes
  // from what is left of the skew part.
  int k = 0;
  for (int i = 1; i < 3; ++i)
    if (r(i, i) > r(k, k)) k = i;
  Vec3T<T> column = T(0.5) * Vec3T<T>{r(0, k) + r(k, 0), r(1, k) + r(k, 1), r(2, k) + r(k, 2)};
  (k == 0 ? column.x : k == 1 ? column.y : column.z) -= cosine;
  const Vec3T<T> axis = normalized(column);
  return (dot(axis, axis2) < T(0) ? -angle : angle) * axis;
}

/// Logarithm of SE(3); exp(log(T)) = T.                                 test: se3_test
template <class T>
STILLMAP_HD TwistT<T> log(const Se3T<T>& t) {
  const Vec3T<T> w = log_rotation(t.rotation);
  const T theta2 = dot(w, w);
  T a, b, c;
  se3_detail::coefficients(theta2, a, b, c);
  // V^-1 = I - 1/2 [w]x + (1/theta^2)(1 - a / (2 b)) [w]x^2
  const T d = theta2 < T(1e-4) ? T(1) / T(12) + theta2 / T(720) : (T(1) - a / (T(2) * b)) / theta2;
  return {se3_detail::rodrigues(w, T(-0.5), d) * t.translation, w};
}

/// Nearest rotation by one Gram-Schmidt pass: keeps a pose orthonormal over millions of products.
template <class T>
STILLMAP_HD Mat3T<T> orthonormalized(const Mat3T<T>& r) {
  const Vec3T<T> x = normalized(Vec3T<T>{r(0, 0), r(1, 0), r(2, 0)});
  Vec3T<T> y = {r(0, 1), r(1, 1), r(2, 1)};
  y = normalized(y - dot(x, y) * x);
  const Vec3T<T> z = cross(x, y);
  return {{x.x, y.x, z.x, x.y, y.y, z.y, x.z, y.z, z.z}};
}

/// Unit quaternion in the order of the TUM trajectory format.
template <class T>
struct QuatT {
  T x = 0, y = 0, z = 0, w = 1;
};
using Quatd = QuatT<double>;

/// @param q any length above 0; it is normalised.                       test: se3_test
template <class T>
STILLMAP_HD Mat3T<T> rotation_from(const QuatT<T>& q) {
  const T s = T(2) / (q.x * q.x + q.y * q.y + q.z * q.z + q.w * q.w);
  const T xx = s * q.x * q.x, yy = s * q.y * q.y, zz = s * q.z * q.z;
  const T xy = s * q.x * q.y, xz = s * q.x * q.z, yz = s * q.y * q.z;
  const T wx = s * q.w * q.x, wy = s * q.w * q.y, wz = s * q.w * q.z;
  return {
      {T(1) - yy - zz, xy - wz, xz + wy, xy + wz, T(1) - xx - zz, yz - wx, xz - wy, yz + wx, T(1) - xx - yy}};
}

/// @return unit quaternion with w >= 0.                                 test: se3_test
template <class T>
STILLMAP_HD QuatT<T> quaternion_from(const Mat3T<T>& r) {
  const T trace = r(0, 0) + r(1, 1) + r(2, 2);
  QuatT<T> q;
  if (trace > T(0)) {
    const T s = T(2) * sqrt(trace + T(1));
    q = {(r(2, 1) - r(1, 2)) / s, (r(0, 2) - r(2, 0)) / s, (r(1, 0) - r(0, 1)) / s, T(0.25) * s};
  } else if (r(0, 0) > r(1, 1) && r(0, 0) > r(2, 2)) {
    const T s = T(2) * sqrt(T(1) + r(0, 0) - r(1, 1) - r(2, 2));
    q = {T(0.25) * s, (r(0, 1) + r(1, 0)) / s, (r(0, 2) + r(2, 0)) / s, (r(2, 1) - r(1, 2)) / s};
  } else if (r(1, 1) > r(2, 2)) {
    const T s = T(2) * sqrt(T(1) + r(1, 1) - r(0, 0) - r(2, 2));
    q = {(r(0, 1) + r(1, 0)) / s, T(0.25) * s, (r(1, 2) + r(2, 1)) / s, (r(0, 2) - r(2, 0)) / s};
  } else {
    const T s = T(2) * sqrt(T(1) + r(2, 2) - r(0, 0) - r(1, 1));
    q = {(r(0, 2) + r(2, 0)) / s, (r(1, 2) + r(2, 1)) / s, T(0.25) * s, (r(1, 0) - r(0, 1)) / s};
  }
  if (q.w < T(0)) q = {-q.x, -q.y, -q.z, -q.w};
  return q;
}

/// Changes precision.
template <class To, class From>
STILLMAP_HD Se3T<To> cast(const Se3T<From>& a) {
  Se3T<To> out;
  for (int i = 0; i < 9; ++i) out.rotation.m[i] = static_cast<To>(a.rotation.m[i]);
  out.translation = {static_cast<To>(a.translation.x), static_cast<To>(a.translation.y),
                     static_cast<To>(a.translation.z)};
  return out;
}

}  // namespace stillmap
