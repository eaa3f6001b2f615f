#include "runtime/picture/rasterise.hpp"

#include <algorithm>
#include <cmath>
#include <limits>

namespace stillmap {
namespace {

constexpr float kAmbient = 0.55f;
constexpr Rgb8 kPlain = {190, 190, 195};

struct Corner {
  float x = 0, y = 0, z = 0;  ///< pixels, and depth along the view
  bool visible = false;
};

class Raster {
 public:
  Raster(const PlyMesh& mesh, const ViewPoint& view, int32_t width, int32_t height, Rgb8 background)
      : mesh_(mesh),
        picture_(width, height, background),
        depth_(picture_.pixels.size(), std::numeric_limits<float>::max()),
        view_axis_map_{view.T_view_map.rotation(2, 0), view.T_view_map.rotation(2, 1),
                       view.T_view_map.rotation(2, 2)} {
    corners_.reserve(mesh.vertices_m.size());
    for (const Vec3& p : mesh.vertices_m) corners_.push_back(corner_of(view, p));
  }

  void triangle(const std::array<uint32_t, 3>& face) {
    const Corner &a = corners_[face[0]], &b = corners_[face[1]], &c = corners_[face[2]];
    if (!a.visible || !b.visible || !c.visible) return;
    const float doubled = (b.x - a.x) * (c.y - a.y) - (b.y - a.y) * (c.x - a.x);
    // Counter-clockwise from the front is clockwise where y grows downwards; <= also drops the degenerate.
    if (!(doubled < 0)) return;
    const float shade = shade_of(face);
    const int32_t left = first(std::min({a.x, b.x, c.x})),
                  right = last(std::max({a.x, b.x, c.x}), picture_.width);
    const int32_t top = first(std::min({a.y, b.y, c.y})),
                  bottom = last(std::max({a.y, b.y, c.y}), picture_.height);
    for (int32_t row = top; row <= bottom; ++row)
      for (int32_t col = left; col <= right; ++col) {
        const float px = static_cast<float>(col) + 0.5f, py = static_cast<float>(row) + 0.5f;
        const float wa = ((b.x - px) * (c.y - py) - (b.y - py) * (c.x - px)) / doubled;
        const float wb = ((c.x - px) * (a.y - py) - (c.y - py) * (a.x - px)) / doubled;
        const float wc = 1 - wa - wb;
        if (wa < 0 || wb < 0 || wc < 0) continue;
        put(row, col, wa * a.z + wb * b.z + wc * c.z, mixed(face, wa, wb, wc, shade));
      }
  }

  void point(uint32_t vertex) {
    const Corner& corner = corners_[vertex];
    if (!corner.visible) return;
    for (int32_t row = first(corner.y - 1); row <= last(corner.y + 1, picture_.height); ++row)
      for (int32_t col = first(corner.x - 1); col <= last(corner.x + 1, picture_.width); ++col)
        put(row, col, corner.z, colour_of(vertex));
  }

  Picture take() { return std::move(picture_); }

 private:
  Corner corner_of(const ViewPoint& view, Vec3 p_map) const {
    const std::optional<Point> pixel = view.project(p_map);
    if (!pixel) return {};
    Corner corner;
    corner.x = static_cast<float>(pixel->x) + 0.5f * static_cast<float>(picture_.width);
    corner.y = static_cast<float>(pixel->y) + 0.5f * static_cast<float>(picture_.height);
    corner.z = (view.T_view_map * p_map).z;
    // What is far outside the picture is no use and would overflow the pixel numbers.
    constexpr float kFar_px = 1e6f;
    corner.visible = std::abs(corner.x) < kFar_px && std::abs(corner.y) < kFar_px;
    return corner;
  }

  static int32_t first(float value) { return std::max(0, static_cast<int32_t>(std::floor(value))); }
  static int32_t last(float value, int32_t size) {
    return std::min(size - 1, static_cast<int32_t>(std::floor(value)));
  }

  /// Brightest when the face looks at the view, a little tilted so that the three walls of a corner differ.
  float shade_of(const std::array<uint32_t, 3>& face) const {
    const Vec3 a = mesh_.vertices_m[face[0]];
    const Vec3 n = normalized(cross(mesh_.vertices_m[face[1]] - a, mesh_.vertices_m[face[2]] - a));
    const Vec3 light = normalized(-view_axis_map_ + Vec3{0.25f, -0.35f, -0.15f});
    return std::min(1.0f, kAmbient + (1 - kAmbient) * std::abs(dot(n, light)));
  }

  Rgb8 colour_of(uint32_t vertex) const { return mesh_.colours.empty() ? kPlain : mesh_.colours[vertex]; }

  Rgb8 mixed(const std::array<uint32_t, 3>& face, float wa, float wb, float wc, float shade) const {
    const Rgb8 a = colour_of(face[0]), b = colour_of(face[1]), c = colour_of(face[2]);
    const auto mix = [&](uint8_t x, uint8_t y, uint8_t z) {
      const float value =
          wa * static_cast<float>(x) + wb * static_cast<float>(y) + wc * static_cast<float>(z);
      return static_cast<uint8_t>(std::clamp(shade * value, 0.0f, 255.0f));
    };
    return {mix(a.r, b.r, c.r), mix(a.g, b.g, c.g), mix(a.b, b.b, c.b)};
  }

  void put(int32_t row, int32_t col, float z, Rgb8 colour) {
    float& nearest = depth_[static_cast<std::size_t>(row) * static_cast<std::size_t>(picture_.width) +
                            static_cast<std::size_t>(col)];
    if (z >= nearest) return;
    nearest = z;
    picture_.at(row, col) = colour;
  }

  const PlyMesh& mesh_;
  Picture picture_;
  std::vector<float> depth_;
  std::vector<Corner> corners_;
  Vec3 view_axis_map_;
};

}  // namespace

std::optional<Point> ViewPoint::project(Vec3 p_map) const {
  const Vec3 p = T_view_map * p_map;
  if (perspective && p.z < near_m) return std::nullopt;
  const float factor = perspective ? scale_px / p.z : scale_px;
  return Point{offset_px.x + static_cast<double>(factor * p.x),
               offset_px.y + static_cast<double>(factor * p.y)};
}

Picture rasterise(const PlyMesh& mesh, const ViewPoint& view, int32_t width_px, int32_t height_px,
                  Rgb8 background, const std::function<bool(Vec3)>& keep) {
  Raster raster(mesh, view, width_px, height_px, background);
  if (mesh.triangles.empty())
    for (uint32_t i = 0; i < mesh.vertices_m.size(); ++i)
      if (!keep || keep(mesh.vertices_m[i])) raster.point(i);
  for (const auto& face : mesh.triangles) {
    const Vec3 middle =
        (1.0f / 3) * (mesh.vertices_m[face[0]] + mesh.vertices_m[face[1]] + mesh.vertices_m[face[2]]);
    if (!keep || keep(middle)) raster.triangle(face);
  }
  return raster.take();
}

Picture halved(const Picture& picture) {
  Picture half(picture.width / 2, picture.height / 2, {});
  for (int32_t row = 0; row < half.height; ++row)
    for (int32_t col = 0; col < half.width; ++col) {
      const Rgb8 p[4] = {picture.at(2 * row, 2 * col), picture.at(2 * row, 2 * col + 1),
                         picture.at(2 * row + 1, 2 * col), picture.at(2 * row + 1, 2 * col + 1)};
      const auto mean = [&](uint8_t Rgb8::*channel) {
        return static_cast<uint8_t>((p[0].*channel + p[1].*channel + p[2].*channel + p[3].*channel + 2) / 4);
      };
      half.at(row, col) = {mean(&Rgb8::r), mean(&Rgb8::g), mean(&Rgb8::b)};
    }
  return half;
}

}  // namespace stillmap
