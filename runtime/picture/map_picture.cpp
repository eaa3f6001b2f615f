#include <algorithm>
#include <cmath>

#include <fmt/format.h>

#include "runtime/evaluate/ply_reader.hpp"
#include "runtime/picture/painters.hpp"
#include "runtime/picture/plot.hpp"
#include "runtime/picture/rasterise.hpp"
#include "runtime/picture/run_data.hpp"

namespace stillmap {
namespace {

constexpr int kPanelWidth_px = 585, kPanelHeight_px = 560;
constexpr double kHead_px = 72, kGap_px = 10;
constexpr Rgb8 kBackground = {244, 245, 247};
constexpr float kCeilingShare = 0.15f;  ///< of the height of the map, left out from above

/// Up in the map frame: the first camera's -y, straightened to the mean direction of the floors and table
/// tops that look roughly that way.
Vec3 up_direction(const PlyMesh& mesh) {
  Vec3 up = {0, -1, 0};
  const std::size_t stride = std::max<std::size_t>(1, mesh.triangles.size() / 200'000);
  for (const float cosine : {0.71f, 0.87f, 0.94f, 0.97f}) {  // 45, 30, 20, 14 degrees
    Vec3 sum = {};
    for (std::size_t i = 0; i < mesh.triangles.size(); i += stride) {
      const auto& face = mesh.triangles[i];
      const Vec3 a = mesh.vertices_m[face[0]];
      const Vec3 n =
          cross(mesh.vertices_m[face[1]] - a, mesh.vertices_m[face[2]] - a);  // longer where larger
      if (dot(n, up) > cosine * norm(n)) sum = sum + n;
    }
    if (norm(sum) > 0) up = normalized(sum);
  }
  return up;
}

/// Range without the outermost two in a thousand: a lone speck is not to shrink the room.
Range without_specks(std::vector<double> values) {
  if (values.empty()) return {};
  std::sort(values.begin(), values.end());
  const std::size_t cut = values.size() / 500;
  return {values[cut], values[values.size() - 1 - cut]};
}

Range spread(const PlyMesh& mesh, Vec3 direction) {
  std::vector<double> values;
  const std::size_t stride = std::max<std::size_t>(1, mesh.vertices_m.size() / 200'000);
  for (std::size_t i = 0; i < mesh.vertices_m.size(); i += stride)
    values.push_back(static_cast<double>(dot(direction, mesh.vertices_m[i])));
  return without_specks(std::move(values));
}

/// The room as a box along its own axes.
struct Room {
  Vec3 right, up, forward;  ///< forward: where the first camera looks, level
  Range along_right, along_up, along_forward;

  Vec3 middle() const {
    const auto half = [](Range r) { return static_cast<float>(0.5 * (r.low + r.high)); };
    return half(along_right) * right + half(along_up) * up + half(along_forward) * forward;
  }
};

Room room_of(const PlyMesh& mesh) {
  Room room;
  room.up = up_direction(mesh);
  room.right = normalized(cross(Vec3{0, 0, 1}, room.up));
  if (!(norm(room.right) > 0.5f)) room.right = {1, 0, 0};  // the first camera looked straight up or down
  room.forward = normalized(cross(room.up, room.right));
  room.along_right = spread(mesh, room.right);
  room.along_up = spread(mesh, room.up);
  room.along_forward = spread(mesh, room.forward);
  return room;
}

/// View with the given axes (in the map frame) that has `centre_map` in its middle, `distance_m` before it.
ViewPoint view_along(Vec3 right, Vec3 down, Vec3 into, Vec3 centre_map, float distance_m) {
  ViewPoint view;
  view.T_view_map.rotation = {{right.x, right.y, right.z, down.x, down.y, down.z, into.x, into.y, into.z}};
  view.T_view_map.translation = Vec3{0, 0, distance_m} - view.T_view_map.rotation * centre_map;
  return view;
}

ViewPoint from_above(const Room& room) {
  return view_along(room.right, -room.forward, -room.up, room.middle(), 0);
}

/// From behind the first camera, turned aside and looking down, far enough to be outside of the room.
ViewPoint from_behind(const Room& room) {
  const float aside = 0.5f, down = 0.75f;  // radians
  const Vec3 level = std::cos(aside) * room.forward + std::sin(aside) * room.right;
  const Vec3 into = normalized(std::cos(down) * level - std::sin(down) * room.up);
  const Vec3 right = normalized(std::cos(aside) * room.right - std::sin(aside) * room.forward);
  const double diagonal =
      std::hypot(room.along_right.span(), room.along_up.span(), room.along_forward.span());
  ViewPoint view =
      view_along(right, cross(into, right), into, room.middle(), static_cast<float>(1.3 * diagonal + 0.3));
  view.perspective = true;
  return view;
}

/// Scales and shifts the view so that the mesh, all but a few specks, and the path fill the panel.
ViewPoint fitted(ViewPoint view, const PlyMesh& mesh, const std::vector<Vec3>& path) {
  view.scale_px = 1;
  view.offset_px = {};
  std::vector<double> xs, ys;
  const std::size_t stride = std::max<std::size_t>(1, mesh.vertices_m.size() / 100'000);
  for (std::size_t i = 0; i < mesh.vertices_m.size(); i += stride)
    if (const std::optional<Point> pixel = view.project(mesh.vertices_m[i])) {
      xs.push_back(pixel->x);
      ys.push_back(pixel->y);
    }
  Range x = without_specks(xs), y = without_specks(ys);
  for (const Vec3& p : path)
    if (const std::optional<Point> pixel = view.project(p)) {
      x = {std::min(x.low, pixel->x), std::max(x.high, pixel->x)};
      y = {std::min(y.low, pixel->y), std::max(y.high, pixel->y)};
    }
  const double scale =
      0.94 * std::min(kPanelWidth_px / std::max(x.span(), 1e-3), kPanelHeight_px / std::max(y.span(), 1e-3));
  view.scale_px = static_cast<float>(scale);
  view.offset_px = {-0.5 * scale * (x.low + x.high), -0.5 * scale * (y.low + y.high)};
  return view;
}

std::vector<Vec3> path_of(const RunInputs& inputs) {
  std::vector<Vec3> path;
  if (!inputs.estimate || !*inputs.estimate) return path;
  for (const TimedPose& pose : (*inputs.estimate)->poses) {
    const Vec3d t = pose.T_world_cam.translation;
    path.push_back({static_cast<float>(t.x), static_cast<float>(t.y), static_cast<float>(t.z)});
  }
  return path;
}

void draw_view(Canvas& canvas, const Rect& at, const PlyMesh& mesh, const ViewPoint& view,
               const std::vector<Vec3>& path, const std::function<bool(Vec3)>& keep) {
  ViewPoint doubled = view;
  doubled.scale_px *= 2;
  doubled.offset_px = {2 * view.offset_px.x, 2 * view.offset_px.y};
  canvas.image(halved(rasterise(mesh, doubled, 2 * kPanelWidth_px, 2 * kPanelHeight_px, kBackground, keep)),
               at);
  std::vector<Point> line;
  for (const Vec3& p : path)
    if (const std::optional<Point> pixel = view.project(p))
      line.push_back({at.x + at.width / 2 + pixel->x, at.y + at.height / 2 + pixel->y});
  if (line.empty()) return;
  canvas.clip(at);
  canvas.line(thinned(line), {1, 1, 1, 0.9}, 4);
  canvas.line(thinned(line), kEstimateColour, 2);
  canvas.dot(line.front(), 5, kAccent);
  canvas.unclip();
}

void draw_scale_bar(Canvas& canvas, const Rect& at, double pixels_per_metre) {
  const double length_m = 90 / pixels_per_metre < 0.5 ? 0.5 : 90 / pixels_per_metre < 1 ? 1 : 5;
  const double length_px = length_m * pixels_per_metre;
  const double y = at.y + at.height - 16;
  canvas.fill({at.x + 8, y - 24, length_px + 24, 36}, {1, 1, 1, 0.8});
  canvas.line({{at.x + 20, y}, {at.x + 20 + length_px, y}}, kInk, 3);
  canvas.text({at.x + 20 + length_px / 2, y - 7}, fmt::format("{} m", length_m), {13, Align::centre});
}

}  // namespace

Painted paint_map(const RunInputs& inputs) {
  const std::string path = inputs.path("mesh.ply");
  if (!have_file(path)) return Missing{path + " is not there"};
  const Result<PlyMesh> mesh = read_ply_mesh(path);
  if (!mesh) return Error{mesh.error()};
  if (mesh->vertices_m.empty()) return Missing{path + " holds no vertices"};
  const Room room = room_of(*mesh);
  const float ceiling =
      static_cast<float>(room.along_up.high - static_cast<double>(kCeilingShare) * room.along_up.span());
  Canvas canvas(kPageWidth_px, static_cast<int>(kHead_px + kPanelHeight_px + kGap_px));
  canvas.text({kGap_px, 30},
              fmt::format("The still map: {} vertices, {} triangles", mesh->vertices_m.size(),
                          mesh->triangles.size()),
              {20, Align::left, true});
  const Rect left = {kGap_px, kHead_px, kPanelWidth_px, kPanelHeight_px};
  const Rect right = {2 * kGap_px + kPanelWidth_px, kHead_px, kPanelWidth_px, kPanelHeight_px};
  canvas.text({left.x, kHead_px - 10}, "from above, without the topmost 15 % of the height", {15});
  canvas.text({right.x, kHead_px - 10}, "from behind the first camera; blue: path of the camera", {15});
  const std::vector<Vec3> camera_path = path_of(inputs);
  const ViewPoint above = fitted(from_above(room), *mesh, camera_path);
  draw_view(canvas, left, *mesh, above, camera_path, [&](Vec3 p) { return dot(room.up, p) <= ceiling; });
  draw_scale_bar(canvas, left, static_cast<double>(above.scale_px));
  draw_view(canvas, right, *mesh, fitted(from_behind(room), *mesh, camera_path), camera_path, {});
  return canvas;
}

}  // namespace stillmap
