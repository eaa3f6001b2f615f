#pragma once

// Not <cmath>: this one brings the float overloads of sqrt, sin and so on that unqualified calls need on both
// engines.
#include <math.h>  // NOLINT(modernize-deprecated-headers)

#include "kernels/base/hd.hpp"

namespace stillmap {

/// Three numbers: a point in metres or a direction; the name of the variable says in which frame.
template <class T>
struct Vec3T {
  T x{}, y{}, z{};
};

using Vec3 = Vec3T<float>;
using Vec3d = Vec3T<double>;

template <class T>
STILLMAP_HD Vec3T<T> operator+(Vec3T<T> a, Vec3T<T> b) {
  return {a.x + b.x, a.y + b.y, a.z + b.z};
}
template <class T>
STILLMAP_HD Vec3T<T> operator-(Vec3T<T> a, Vec3T<T> b) {
  return {a.x - b.x, a.y - b.y, a.z - b.z};
}
template <class T>
STILLMAP_HD Vec3T<T> operator-(Vec3T<T> a) {
  return {-a.x, -a.y, -a.z};
}
template <class T>
STILLMAP_HD Vec3T<T> operator*(T s, Vec3T<T> a) {
  return {s * a.x, s * a.y, s * a.z};
}
template <class T>
STILLMAP_HD T dot(Vec3T<T> a, Vec3T<T> b) {
  return a.x * b.x + a.y * b.y + a.z * b.z;
}
template <class T>
STILLMAP_HD Vec3T<T> cross(Vec3T<T> a, Vec3T<T> b) {
  return {a.y * b.z - a.z * b.y, a.z * b.x - a.x * b.z, a.x * b.y - a.y * b.x};
}
template <class T>
STILLMAP_HD T norm(Vec3T<T> a) {
  return sqrt(dot(a, a));
}
/// @return `a` scaled to length 1; `a` itself when its length is 0.
template <class T>
STILLMAP_HD Vec3T<T> normalized(Vec3T<T> a) {
  const T n = norm(a);
  return n > T(0) ? (T(1) / n) * a : a;
}

}  // namespace stillmap
