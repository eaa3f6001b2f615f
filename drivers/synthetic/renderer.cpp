#include "drivers/synthetic/renderer.hpp"

#include <algorithm>
#include <cmath>
#include <limits>

#include "runtime/ports/frame_source.hpp"

namespace stillmap::synthetic {

namespace {

constexpr float kNearM = 0.02f;       // hits nearer than this are ignored
constexpr float kLampHeightM = 2.3f;  // one lamp under the ceiling, one window
constexpr Vec3 kLamp = {0.2f, 0.1f, kLampHeightM};
constexpr Vec3 kWindowDirection = {-0.1f, 0.85f, 0.52f};

/// Pixels of one row of a tile, and what their rays have hit so far.
struct Row {
  const float* x;  // direction (x, y, 1) in the camera frame: the ray parameter is the depth
  float y;
  int32_t count;
  float* depth;
  int32_t* index;
};

template <class Entry>
inline void keep_nearest(const Row& row, const Mat3& direction, int32_t index, const Entry& entry) {
  const float cx = direction.m[1] * row.y + direction.m[2];
  const float cy = direction.m[4] * row.y + direction.m[5];
  const float cz = direction.m[7] * row.y + direction.m[8];
  for (int32_t i = 0; i < row.count; ++i) {
    const float x = row.x[i];
    const float t = entry(direction.m[0] * x + cx, direction.m[3] * x + cy, direction.m[6] * x + cz);
    // Of two at the same depth the first of the world wins, in whatever order they are asked.
    const bool nearer = t < row.depth[i] || (t == row.depth[i] && index < row.index[i]);
    row.depth[i] = nearer ? t : row.depth[i];
    row.index[i] = nearer ? index : row.index[i];
  }
}

constexpr float kMiss = 1e9f;

inline float smaller(float a, float b) {
  return a < b ? a : b;
}
inline float larger(float a, float b) {
  return a > b ? a : b;
}

/// Depths at which a ray enters and leaves a box about the origin.
struct Span {
  float enter, leave;
};
inline Span box_span(Vec3 o, Vec3 half, float dx, float dy, float dz) {
  const float ix = 1.0f / dx, iy = 1.0f / dy, iz = 1.0f / dz;
  const float ax = (-half.x - o.x) * ix, bx = (half.x - o.x) * ix;
  const float ay = (-half.y - o.y) * iy, by = (half.y - o.y) * iy;
  const float az = (-half.z - o.z) * iz, bz = (half.z - o.z) * iz;
  return {larger(larger(smaller(ax, bx), smaller(ay, by)), smaller(az, bz)),
          smaller(smaller(larger(ax, bx), larger(ay, by)), larger(az, bz))};
}

/// Unit sphere about the origin.
inline float sphere_entry(Vec3 o, float radius2, float dx, float dy, float dz) {
  const float a = dx * dx + dy * dy + dz * dz;
  const float b = o.x * dx + o.y * dy + o.z * dz;
  const float c = o.x * o.x + o.y * o.y + o.z * o.z - radius2;
  const float discriminant = b * b - a * c;
  const float t = (-b - std::sqrt(larger(discriminant, 0.0f))) / a;
  return discriminant > 0.0f && t > kNearM ? t : kMiss;
}

inline float capsule_entry(Vec3 o, float radius, float half_axis, float dx, float dy, float dz) {
  const float a = larger(dx * dx + dy * dy, 1e-12f);
  const float b = o.x * dx + o.y * dy;
  const float c = o.x * o.x + o.y * o.y - radius * radius;
  const float discriminant = b * b - a * c;
  const float t = (-b - std::sqrt(larger(discriminant, 0.0f))) / a;
  const float z = o.z + t * dz;
  const float cap = z > 0.0f ? half_axis : -half_axis;
  const float t_cap = sphere_entry({o.x, o.y, o.z - cap}, radius * radius, dx, dy, dz);
  const bool side = discriminant > 0.0f && t > kNearM && z <= half_axis && z >= -half_axis;
  return side ? t : t_cap;
}

/// Where on a solid, in its own coordinates: outward normal and the two numbers that textures use.
struct Spot {
  Vec3 normal;
  float s, t;
};

Spot box_spot(Vec3 p, Vec3 half) {
  const float qx = std::abs(p.x) - half.x, qy = std::abs(p.y) - half.y, qz = std::abs(p.z) - half.z;
  if (qx >= qy && qx >= qz) return {{p.x > 0.0f ? 1.0f : -1.0f, 0, 0}, p.y, p.z};
  if (qy >= qz) return {{0, p.y > 0.0f ? 1.0f : -1.0f, 0}, p.x, p.z};
  return {{0, 0, p.z > 0.0f ? 1.0f : -1.0f}, p.x, p.y};
}

Spot round_spot(Vec3 p, Vec3 normal) {
  const float ax = std::abs(normal.x), ay = std::abs(normal.y), az = std::abs(normal.z);
  if (az > 0.8f && az > ax && az > ay) return {normal, p.x, p.y};
  return ax > ay ? Spot{normal, p.y, p.z} : Spot{normal, p.x, p.z};
}

Spot spot_of(const Shape& shape, Vec3 p) {
  switch (shape.kind) {
    case Kind::room: {
      Spot spot = box_spot(p, shape.half_m);
      spot.normal = -spot.normal;
      return spot;
    }
    case Kind::box:
      return box_spot(p, shape.half_m);
    case Kind::ellipsoid: {
      const Vec3 h = shape.half_m;
      return round_spot(p, normalized(Vec3{p.x / (h.x * h.x), p.y / (h.y * h.y), p.z / (h.z * h.z)}));
    }
    case Kind::capsule: {
      const float z = p.z - std::clamp(p.z, -shape.half_m.z, shape.half_m.z);
      return round_spot(p, normalized(Vec3{p.x, p.y, z}));
    }
  }
  return {};
}

/// What a lamp in direction `to_lamp` adds.
float lamp_light(Vec3 to_lamp, Vec3 normal) {
  const float distance2 = dot(to_lamp, to_lamp);
  const float lamp = larger(dot(normal, to_lamp), 0.0f) / std::sqrt(distance2 + 1e-4f);
  return 0.7f * lamp / (1.0f + 0.1f * distance2);
}

/// Of a row of lamps those two count between which `p` is: the others are far.
float row_light(Vec3 to_lamp, Vec3 normal, float spacing_m) {
  const float behind_m = to_lamp.x - spacing_m * std::ceil(to_lamp.x / spacing_m);  // -spacing .. 0
  return lamp_light({behind_m, to_lamp.y, to_lamp.z}, normal) +
         lamp_light({behind_m + spacing_m, to_lamp.y, to_lamp.z}, normal);
}

/// Share of the light that comes back, about 0.35..1.1.
float light(Vec3 p, Vec3 normal, float lamp_spacing_m) {
  const Vec3 to_lamp = kLamp - p;
  const float lamps =
      lamp_spacing_m > 0.0f ? row_light(to_lamp, normal, lamp_spacing_m) : lamp_light(to_lamp, normal);
  const float window = larger(dot(normal, kWindowDirection), 0.0f);
  return 0.45f + lamps + 0.16f * window + 0.05f * normal.z;
}

}  // namespace

void cover_lens(IdealImages& images) {
  constexpr float kHand_m = 0.03f;
  constexpr Rgb8 kDarkRed = {26, 9, 7};
  std::fill(images.depth_m.begin(), images.depth_m.end(), kHand_m);
  std::fill(images.cos_incidence.begin(), images.cos_incidence.end(), 1.0f);
  std::fill(images.colour.begin(), images.colour.end(), kDarkRed);
  std::fill(images.mask.begin(), images.mask.end(), uint8_t{255});
}

/// Nearest shape of every pixel of one tile.
struct Renderer::Hits {
  int32_t row0, col0, rows, cols;
  float x[kTile];
  float y[kTile];
  float depth[kTile * kTile];
  int32_t index[kTile * kTile];

  float farthest_m() const {
    float farthest = 0.0f;
    for (int32_t r = 0; r < rows; ++r)
      for (int32_t c = 0; c < cols; ++c) farthest = larger(farthest, depth[r * kTile + c]);
    return farthest;
  }
};

Renderer::Renderer(const Intrinsics& k)
    : k_(k), tile_cols_((k.width + kTile - 1) / kTile), tile_rows_((k.height + kTile - 1) / kTile) {}

void Renderer::render(const World& world, const Se3d& T_world_cam, ThreadPool& workers, IdealImages& images) {
  const auto pixels = static_cast<size_t>(k_.width) * static_cast<size_t>(k_.height);
  images.depth_m.resize(pixels);
  images.cos_incidence.resize(pixels);
  images.colour.resize(pixels);
  images.mask.resize(pixels);

  const Se3 T_cam_world = cast<float>(inverse(T_world_cam));
  cast_.clear();
  for (const Shape& shape : world.shapes) {
    cast_.push_back(cast_shape(shape, T_world_cam));
    find_tiles(shape, T_cam_world, cast_.back());
  }
  find_order();
  workers.for_each(static_cast<uint32_t>(tile_cols_ * tile_rows_), [&](uint32_t tile) {
    render_tile(world, T_world_cam, static_cast<int32_t>(tile), images);
  });
}

Renderer::CastShape Renderer::cast_shape(const Shape& shape, const Se3d& T_world_cam) const {
  const Se3d T_local_cam = inverse(cast<double>(shape.T_world_local)) * T_world_cam;
  CastShape out;
  out.kind = shape.kind;
  out.half_m = shape.half_m;
  out.direction = cast<float>(T_local_cam).rotation;
  out.origin = cast<float>(T_local_cam).translation;
  out.radius = shape.half_m.x;
  out.half_axis = shape.half_m.z;
  if (shape.kind != Kind::ellipsoid) return out;
  // An ellipsoid becomes a unit sphere in stretched coordinates.
  const float scale[3] = {1.0f / shape.half_m.x, 1.0f / shape.half_m.y, 1.0f / shape.half_m.z};
  for (int r = 0; r < 3; ++r)
    for (int c = 0; c < 3; ++c) out.direction.m[3 * r + c] *= scale[r];
  out.origin = {out.origin.x * scale[0], out.origin.y * scale[1], out.origin.z * scale[2]};
  return out;
}

void Renderer::find_tiles(const Shape& shape, const Se3& T_cam_world, CastShape& cast) const {
  if (shape.kind == Kind::room) {
    cast.last_tile_col = tile_cols_ - 1;
    cast.last_tile_row = tile_rows_ - 1;
    return;
  }
  // Eight corners of the local bounding box; of a capsule that is radius about its axis.
  const Vec3 h = shape.kind == Kind::capsule
                     ? Vec3{shape.half_m.x, shape.half_m.x, shape.half_m.z + shape.half_m.x}
                     : shape.half_m;
  const Se3 T_cam_local = T_cam_world * shape.T_world_local;
  const float tan_left = (-0.5f - k_.cx) / k_.fx, tan_top = (-0.5f - k_.cy) / k_.fy;
  const float tan_right = (static_cast<float>(k_.width) - 0.5f - k_.cx) / k_.fx;
  const float tan_bottom = (static_cast<float>(k_.height) - 0.5f - k_.cy) / k_.fy;
  float left = 1e9f, right = -1e9f, top = 1e9f, bottom = -1e9f, nearest_m = 1e9f;
  int in_front = 0, out_left = 0, out_right = 0, out_top = 0, out_bottom = 0;
  for (int corner = 0; corner < 8; ++corner) {
    const Vec3 p =
        T_cam_local * Vec3{corner & 1 ? h.x : -h.x, corner & 2 ? h.y : -h.y, corner & 4 ? h.z : -h.z};
    nearest_m = smaller(nearest_m, p.z);
    out_left += p.x < tan_left * p.z ? 1 : 0;
    out_right += p.x > tan_right * p.z ? 1 : 0;
    out_top += p.y < tan_top * p.z ? 1 : 0;
    out_bottom += p.y > tan_bottom * p.z ? 1 : 0;
    if (p.z < kNearM) continue;
    ++in_front;
    const Pixel px = project(k_, p);
    left = smaller(left, px.u);
    right = larger(right, px.u);
    top = smaller(top, px.v);
    bottom = larger(bottom, px.v);
  }
  // All corners beyond one side of the view: nothing of it is seen.
  if (in_front == 0 || std::max({out_left, out_right, out_top, out_bottom}) == 8) return;
  cast.nearest_m = nearest_m - kNearM;
  if (in_front < 8) left = top = -1e9f, right = bottom = 1e9f;  // reaches behind the camera: anywhere
  const auto tile_of = [](float pixel, int32_t tiles) {
    return static_cast<int32_t>(
        std::clamp(std::floor(pixel / static_cast<float>(kTile)), -1.0f, static_cast<float>(tiles)));
  };
  cast.first_tile_col = std::max(tile_of(left - 1.0f, tile_cols_), 0);
  cast.last_tile_col = std::min(tile_of(right + 1.0f, tile_cols_), tile_cols_ - 1);
  cast.first_tile_row = std::max(tile_of(top - 1.0f, tile_rows_), 0);
  cast.last_tile_row = std::min(tile_of(bottom + 1.0f, tile_rows_), tile_rows_ - 1);
}

void Renderer::find_order() {
  // The near ones first: they hide the others. The room is everywhere, so that it bounds what follows.
  nearest_first_.clear();
  for (size_t i = 0; i < cast_.size(); ++i)
    if (cast_[i].last_tile_col >= 0) nearest_first_.push_back(static_cast<int32_t>(i));
  std::sort(nearest_first_.begin(), nearest_first_.end(), [&](int32_t a, int32_t b) {
    const float a_m = cast_[static_cast<size_t>(a)].nearest_m, b_m = cast_[static_cast<size_t>(b)].nearest_m;
    return a_m < b_m || (a_m == b_m && a < b);
  });
}

void Renderer::render_tile(const World& world, const Se3d& T_world_cam, int32_t tile,
                           IdealImages& images) const {
  const int32_t tile_row = tile / tile_cols_, tile_col = tile % tile_cols_;
  Hits hits;
  hits.row0 = tile_row * kTile;
  hits.col0 = tile_col * kTile;
  hits.rows = std::min(kTile, k_.height - hits.row0);
  hits.cols = std::min(kTile, k_.width - hits.col0);
  for (int32_t i = 0; i < kTile; ++i) {
    hits.x[i] = (static_cast<float>(hits.col0 + i) - k_.cx) / k_.fx;
    hits.y[i] = (static_cast<float>(hits.row0 + i) - k_.cy) / k_.fy;
  }
  std::fill(std::begin(hits.depth), std::end(hits.depth), kMiss);
  std::fill(std::begin(hits.index), std::end(hits.index), 0);
  float farthest_m = kMiss;
  for (const int32_t i : nearest_first_) {
    const CastShape& c = cast_[static_cast<size_t>(i)];
    if (c.nearest_m > farthest_m) break;
    if (tile_col < c.first_tile_col || tile_col > c.last_tile_col || tile_row < c.first_tile_row ||
        tile_row > c.last_tile_row)
      continue;
    intersect(c, i, hits);
    farthest_m = hits.farthest_m();
  }
  shade(world, cast<float>(T_world_cam).translation, hits, images);
}

void Renderer::intersect(const CastShape& c, int32_t index, Hits& hits) const {
  for (int32_t r = 0; r < hits.rows; ++r) {
    const Row row = {hits.x, hits.y[r], hits.cols, hits.depth + r * kTile, hits.index + r * kTile};
    switch (c.kind) {
      case Kind::room:
        keep_nearest(row, c.direction, index, [&](float dx, float dy, float dz) {
          return box_span(c.origin, c.half_m, dx, dy, dz).leave;
        });
        break;
      case Kind::box:
        keep_nearest(row, c.direction, index, [&](float dx, float dy, float dz) {
          const Span span = box_span(c.origin, c.half_m, dx, dy, dz);
          return span.enter < span.leave && span.enter > kNearM ? span.enter : kMiss;
        });
        break;
      case Kind::ellipsoid:
        keep_nearest(row, c.direction, index,
                     [&](float dx, float dy, float dz) { return sphere_entry(c.origin, 1.0f, dx, dy, dz); });
        break;
      case Kind::capsule:
        keep_nearest(row, c.direction, index, [&](float dx, float dy, float dz) {
          return capsule_entry(c.origin, c.radius, c.half_axis, dx, dy, dz);
        });
        break;
    }
  }
}

void Renderer::shade(const World& world, Vec3 camera_world, const Hits& hits, IdealImages& images) const {
  for (int32_t r = 0; r < hits.rows; ++r) {
    const auto line =
        static_cast<size_t>(hits.row0 + r) * static_cast<size_t>(k_.width) + static_cast<size_t>(hits.col0);
    for (int32_t c = 0; c < hits.cols; ++c) {
      const float depth = hits.depth[r * kTile + c];
      const int32_t index = hits.index[r * kTile + c];
      const Shape& shape = world.shapes[static_cast<size_t>(index)];
      const CastShape& cast = cast_[static_cast<size_t>(index)];
      const Vec3 ray = {hits.x[c], hits.y[r], 1.0f};
      Vec3 p_local = cast.origin + depth * (cast.direction * ray);
      if (shape.kind == Kind::ellipsoid)
        p_local = {p_local.x * shape.half_m.x, p_local.y * shape.half_m.y, p_local.z * shape.half_m.z};
      const Spot spot = spot_of(shape, p_local);
      const Vec3 p = shape.T_world_local * p_local;
      const Vec3 normal = shape.T_world_local.rotation * spot.normal;
      const Material* material = &shape.material;
      if (shape.kind == Kind::room && spot.normal.z > 0.5f) material = &world.room.floor;
      if (shape.kind == Kind::room && spot.normal.z < -0.5f) material = &world.room.ceiling;
      const Vec3 to_camera = camera_world - p;
      const float cos_incidence = std::abs(dot(normal, to_camera)) / norm(to_camera);
      const float footprint_m = depth / k_.fx / larger(cos_incidence, 0.15f);
      const Vec3 colour = light(p, normal, world.lamp_spacing_m) *
                          surface_colour(*material, noise_, spot.s, spot.t, footprint_m);

      const size_t i = line + static_cast<size_t>(c);
      images.depth_m[i] = depth;
      images.cos_incidence[i] = cos_incidence;
      images.colour[i] = {to_byte(colour.x), to_byte(colour.y), to_byte(colour.z)};
      images.mask[i] = shape.moving ? kTrulyDynamic : shape.put_down ? kPutDown : uint8_t{0};
    }
  }
}

}  // namespace stillmap::synthetic
