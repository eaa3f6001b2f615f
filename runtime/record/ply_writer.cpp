#include "runtime/record/ply_writer.hpp"

#include <fmt/format.h>

#include <array>
#include <bit>
#include <cmath>
#include <cstring>
#include <limits>
#include <utility>

namespace stillmap {
namespace {

static_assert(std::endian::native == std::endian::little, "records are written as they lie in memory");

constexpr size_t kVertexBytes = 3 * sizeof(float) + 3;
constexpr size_t kTriangleBytes = 1 + 3 * sizeof(int32_t);

std::string header(uint64_t vertices, uint64_t triangles) {
  return fmt::format(
      "ply\nformat binary_little_endian 1.0\ncomment stillmap, metres, map frame\nelement vertex "
      "{}\nproperty float x\n"
      "property float y\nproperty float z\nproperty uchar red\nproperty uchar green\nproperty uchar blue\n"
      "element face {}\nproperty list uchar int vertex_indices\nend_header\n",
      vertices, triangles);
}

}  // namespace

PlyWriter::PlyWriter(std::string path) : path_(std::move(path)) {}

bool PlyWriter::refuse(const std::string& why) {
  if (error_.empty()) error_ = path_ + ": " + why;
  file_.reset();
  return false;
}

bool PlyWriter::checked(bool written) {
  if (written) return true;
  if (error_.empty()) error_ = file_->error();
  file_.reset();
  return false;
}

bool PlyWriter::begin(uint64_t vertices, uint64_t triangles) {
  if (file_ || !error_.empty()) return refuse("a mesh can begin only once");
  if (vertices > static_cast<uint64_t>(std::numeric_limits<int32_t>::max()))
    return refuse("more vertices than PLY indices can name (2^31)");
  auto file = OutputFile::create(path_, OutputFile::Kind::whole);
  if (!file) {
    error_ = file.error();
    return false;
  }
  file_.emplace(std::move(*file));
  vertices_ = vertices;
  triangles_ = triangles;
  return checked(file_->write(header(vertices, triangles)));
}

bool PlyWriter::vertices(View<const Vec3> positions_m, View<const Rgb8> colours) {
  if (!file_) return false;
  if (positions_m.size != colours.size) return refuse("as many colours as positions are needed");
  if (triangles_done_ > 0 || positions_m.size > vertices_ - vertices_done_)
    return refuse(fmt::format("more vertices came than the {} announced", vertices_));
  for (uint32_t i = 0; i < positions_m.size; ++i) {
    const Vec3& p = positions_m[i];
    if (!std::isfinite(p.x) || !std::isfinite(p.y) || !std::isfinite(p.z))
      return refuse("a vertex is not finite");
    std::array<char, kVertexBytes> record{};
    std::memcpy(record.data(), &p, 3 * sizeof(float));
    std::memcpy(record.data() + 3 * sizeof(float), &colours[i], 3);
    if (!checked(file_->write(record.data(), record.size()))) return false;
  }
  vertices_done_ += positions_m.size;
  return true;
}

bool PlyWriter::triangles(View<const uint32_t> indices) {
  if (!file_) return false;
  if (indices.size % 3 != 0 || indices.size / 3 > triangles_ - triangles_done_)
    return refuse(fmt::format("other triangles came than the {} announced", triangles_));
  for (uint32_t i = 0; i < indices.size; i += 3) {
    if (indices[i] >= vertices_ || indices[i + 1] >= vertices_ || indices[i + 2] >= vertices_)
      return refuse("a triangle names a vertex that does not exist");
    std::array<char, kTriangleBytes> record{3};
    std::memcpy(record.data() + 1, &indices[i], 3 * sizeof(uint32_t));
    if (!checked(file_->write(record.data(), record.size()))) return false;
  }
  triangles_done_ += indices.size / 3;
  return true;
}

bool PlyWriter::close() {
  if (!file_) return error_.empty() ? refuse("no mesh came") : false;
  if (vertices_done_ != vertices_ || triangles_done_ != triangles_)
    return refuse(fmt::format("{} of {} vertices and {} of {} triangles came; the mesh is not kept",
                              vertices_done_, vertices_, triangles_done_, triangles_));
  if (!checked(file_->close())) return false;
  file_.reset();
  return true;
}

std::string write_point_cloud(const std::string& path, const std::vector<Vec3>& points_m) {
  auto file = OutputFile::create(path, OutputFile::Kind::whole);
  if (!file) return file.error();
  file->write(fmt::format(
      "ply\nformat binary_little_endian 1.0\ncomment stillmap, metres, map frame\nelement vertex {}\n"
      "property float x\nproperty float y\nproperty float z\nend_header\n",
      points_m.size()));
  static_assert(sizeof(Vec3) == 3 * sizeof(float));
  if (!points_m.empty()) file->write(points_m.data(), points_m.size() * sizeof(Vec3));
  file->close();
  return file->error();
}

}  // namespace stillmap
