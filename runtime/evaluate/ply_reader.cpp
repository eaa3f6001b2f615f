#include "runtime/evaluate/ply_reader.hpp"

#include <bit>
#include <cerrno>
#include <cmath>
#include <cstdio>
#include <cstring>
#include <filesystem>
#include <memory>
#include <optional>
#include <sstream>
#include <string_view>

#include <fmt/format.h>

#include "runtime/evaluate/trajectory.hpp"

namespace stillmap {
namespace {

static_assert(std::endian::native == std::endian::little, "binary little-endian PLY is read in place");

constexpr uint64_t kMaxElements = 50'000'000;
constexpr uint64_t kMaxPolygon = 1024;
constexpr std::size_t kMaxHeaderLines = 1000;
constexpr std::size_t kMaxTokenBytes = 256;

enum class Number : uint8_t { i8, u8, i16, u16, i32, u32, f32, f64 };

std::optional<Number> number_from(const std::string& name) {
  if (name == "char" || name == "int8") return Number::i8;
  if (name == "uchar" || name == "uint8") return Number::u8;
  if (name == "short" || name == "int16") return Number::i16;
  if (name == "ushort" || name == "uint16") return Number::u16;
  if (name == "int" || name == "int32") return Number::i32;
  if (name == "uint" || name == "uint32") return Number::u32;
  if (name == "float" || name == "float32") return Number::f32;
  if (name == "double" || name == "float64") return Number::f64;
  return std::nullopt;
}

std::size_t bytes_of(Number type) {
  constexpr std::size_t kBytes[] = {1, 1, 2, 2, 4, 4, 4, 8};
  return kBytes[static_cast<std::size_t>(type)];
}

template <class T>
double load(const char* bytes) {
  T value;
  std::memcpy(&value, bytes, sizeof(T));
  return static_cast<double>(value);
}

double value_at(const char* bytes, Number type) {
  switch (type) {
    case Number::i8:
      return load<int8_t>(bytes);
    case Number::u8:
      return load<uint8_t>(bytes);
    case Number::i16:
      return load<int16_t>(bytes);
    case Number::u16:
      return load<uint16_t>(bytes);
    case Number::i32:
      return load<int32_t>(bytes);
    case Number::u32:
      return load<uint32_t>(bytes);
    case Number::f32:
      return static_cast<double>(load<float>(bytes));
    case Number::f64:
      return load<double>(bytes);
  }
  return 0;
}

/// What a property means to us.
enum class Role : uint8_t { other, x, y, z, red, green, blue, indices };

struct Property {
  Number type = Number::f32;
  std::optional<Number> list_count;  ///< type of the count when it is a list
  Role role = Role::other;
};

struct Element {
  std::string name;
  uint64_t count = 0;
  std::vector<Property> properties;
};

struct Header {
  bool ascii = false;
  std::vector<Element> elements;
};

Role role_from(const std::string& element, const std::string& name, const Property& property) {
  if (property.list_count)
    return element == "face" && (name == "vertex_indices" || name == "vertex_index") ? Role::indices
                                                                                     : Role::other;
  if (element != "vertex") return Role::other;
  if (name == "x") return Role::x;
  if (name == "y") return Role::y;
  if (name == "z") return Role::z;
  if (property.type != Number::u8) return Role::other;
  if (name == "red") return Role::red;
  if (name == "green") return Role::green;
  if (name == "blue") return Role::blue;
  return Role::other;
}

bool has_role(const Element& element, Role role) {
  for (const Property& property : element.properties)
    if (property.role == role) return true;
  return false;
}

/// A file read once from front to back, a megabyte at a time: meshes have tens of millions of numbers.
class ByteFile {
 public:
  static constexpr int kEnd = -1;

  bool open(const std::string& path) {
    file_.reset(std::fopen(path.c_str(), "rb"));
    return file_ != nullptr;
  }
  /// The next `count` bytes (at most 64), null at the end of the file.
  const char* take(std::size_t count) {
    if (end_ - begin_ < count && !refill(count)) return nullptr;
    begin_ += count;
    return buffer_.data() + begin_ - count;
  }
  int peek() { return begin_ < end_ || refill(1) ? static_cast<unsigned char>(buffer_[begin_]) : kEnd; }
  int next() {  // drops a byte and looks at the one behind it
    ++begin_;
    return peek();
  }

 private:
  struct Close {
    void operator()(std::FILE* file) const { std::fclose(file); }
  };

  bool refill(std::size_t count) {
    std::memmove(buffer_.data(), buffer_.data() + begin_, end_ - begin_);
    end_ -= begin_;
    begin_ = 0;
    end_ += std::fread(buffer_.data() + end_, 1, buffer_.size() - end_, file_.get());
    return end_ >= count;
  }

  std::unique_ptr<std::FILE, Close> file_;
  std::vector<char> buffer_ = std::vector<char>(1 << 20);
  std::size_t begin_ = 0, end_ = 0;
};

/// One read of a PLY file.
class Reader {
 public:
  explicit Reader(const std::string& path) : path_(path) {}

  /// Calls `vertex(position, colour)` for each vertex and `face(indices)` for each face when `face` is set.
  template <class OnVertex, class OnFace>
  std::optional<Error> read(const OnVertex& vertex, const OnFace& face, bool with_faces) {
    if (std::optional<Error> error = open()) return error;
    for (const Element& element : header_.elements) {
      const bool is_face = element.name == "face";
      if (is_face && !with_faces) return std::nullopt;
      for (uint64_t i = 0; i < element.count; ++i) {
        if (!read_record(element))
          return fail(fmt::format("{} {} of {} is cut off or no number", element.name, i + 1, element.count));
        if (element.name == "vertex") vertex(position_, colour_);
        if (is_face && !face(indices_))
          return fail(fmt::format("face {} names a vertex that is not there", i + 1));
      }
    }
    return std::nullopt;
  }

  const Header& header() const { return header_; }
  bool has_colour() const {
    for (const Element& element : header_.elements)
      if (element.name == "vertex")
        return has_role(element, Role::red) && has_role(element, Role::green) &&
               has_role(element, Role::blue);
    return false;
  }
  Error fail(const std::string& why) const { return Error{fmt::format("{}: {}", path_, why)}; }

  std::optional<Error> open() {
    if (opened_) return std::nullopt;
    opened_ = true;
    std::error_code code;
    if (std::filesystem::is_directory(path_, code)) return fail("is a folder; expected a PLY file");
    if (!file_.open(path_))
      return fail(fmt::format("cannot be opened: {}; expected a PLY file", std::strerror(errno)));
    if (std::optional<Error> error = read_header()) return error;
    return check_sizes();
  }

 private:
  bool header_line(std::string& line) {
    line.clear();
    int c = file_.peek();
    for (; c != '\n'; c = file_.next()) {
      if (c == ByteFile::kEnd || line.size() > 4096) return false;
      line.push_back(static_cast<char>(c));
    }
    file_.take(1);
    if (!line.empty() && line.back() == '\r') line.pop_back();
    return true;
  }

  std::optional<Error> read_header() {
    std::string line;
    if (!header_line(line) || line != "ply") return fail("does not begin with 'ply'; expected a PLY file");
    bool format_known = false;
    for (std::size_t i = 0; i < kMaxHeaderLines; ++i) {
      if (!header_line(line)) return fail("the header is cut off before 'end_header'");
      if (line == "end_header")
        return format_known ? std::nullopt : std::optional<Error>(fail("the header has no 'format' line"));
      std::istringstream words(line);
      std::string keyword;
      words >> keyword;
      if (keyword == "format") {
        std::string format;
        words >> format;
        if (format != "ascii" && format != "binary_little_endian")
          return fail(fmt::format("format '{}'; expected ascii or binary_little_endian", format));
        header_.ascii = format == "ascii";
        format_known = true;
      } else if (keyword == "element") {
        Element element;
        std::string count;
        words >> element.name >> count;
        const std::optional<double> number = parse_number(count);
        if (!number || *number < 0 || *number > 1e15 || std::floor(*number) != *number)
          return fail(fmt::format("'{}': expected a number of elements", line));
        element.count = static_cast<uint64_t>(*number);
        header_.elements.push_back(element);
      } else if (keyword == "property") {
        if (!header_property(words)) return fail(fmt::format("'{}' is no property", line));
      }
    }
    return fail("the header has more than 1000 lines");
  }

  bool header_property(std::istringstream& words) {
    if (header_.elements.empty()) return false;
    Property property;
    std::string type, name;
    words >> type;
    if (type == "list") {
      std::string count;
      words >> count >> type;
      property.list_count = number_from(count);
      if (!property.list_count) return false;
    }
    words >> name;
    const std::optional<Number> number = number_from(type);
    if (!number || name.empty()) return false;
    property.type = *number;
    Element& element = header_.elements.back();
    property.role = role_from(element.name, name, property);
    element.properties.push_back(property);
    return true;
  }

  /// Counts that the file is too short for are found before anybody reserves memory for them.
  std::optional<Error> check_sizes() {
    std::error_code code;
    const uintmax_t bytes = std::filesystem::file_size(path_, code);
    double least_bytes = 0;
    bool vertices = false;
    for (const Element& element : header_.elements) {
      double record = 0;
      for (const Property& p : element.properties)
        record += header_.ascii ? 2.0 : static_cast<double>(bytes_of(p.list_count ? *p.list_count : p.type));
      if (element.properties.empty())
        return fail(fmt::format("element '{}' has no properties", element.name));
      least_bytes += record * static_cast<double>(element.count);
      if (element.name != "vertex") continue;
      vertices = true;
      if (!has_role(element, Role::x) || !has_role(element, Role::y) || !has_role(element, Role::z))
        return fail("the vertices have no x, y and z");
    }
    if (!vertices) return fail("has no element 'vertex'");
    if (!code && least_bytes > static_cast<double>(bytes) + 2.0)
      return fail(
          fmt::format("is cut off: {} bytes, its header promises {:.0f} or more", bytes, least_bytes));
    return std::nullopt;
  }

  bool read_number(Number type, double& value) {
    if (header_.ascii) return read_token(value);
    const char* bytes = file_.take(bytes_of(type));
    if (bytes == nullptr) return false;
    value = value_at(bytes, type);
    return true;
  }

  bool read_token(double& value) {
    int c = file_.peek();
    while (c == ' ' || c == '\n' || c == '\r' || c == '\t') c = file_.next();
    char token[kMaxTokenBytes];
    std::size_t length = 0;
    for (; c > ' ' && length < kMaxTokenBytes; c = file_.next()) token[length++] = static_cast<char>(c);
    const std::string_view text(token, length);
    if (text == "nan" || text == "-nan" || text == "inf" || text == "-inf") {
      value = std::nan("");
      return true;
    }
    const std::optional<double> number = parse_number(text);
    if (number) value = *number;
    return number.has_value();
  }

  bool read_list(const Property& property) {
    double count = 0;
    if (!read_number(*property.list_count, count)) return false;
    if (!(count >= 0 && count <= static_cast<double>(kMaxPolygon))) return false;
    if (property.role == Role::indices) indices_.clear();
    for (uint64_t i = 0; i < static_cast<uint64_t>(count); ++i) {
      double value = 0;
      if (!read_number(property.type, value)) return false;
      if (property.role == Role::indices) indices_.push_back(value);
    }
    return true;
  }

  bool read_record(const Element& element) {
    indices_.clear();
    for (const Property& property : element.properties) {
      if (property.list_count) {
        if (!read_list(property)) return false;
        continue;
      }
      double value = 0;
      if (!read_number(property.type, value)) return false;
      keep(property.role, value);
    }
    return true;
  }

  void keep(Role role, double value) {
    // A colour outside of a byte can only stand in an ASCII file.
    const auto byte = [](double v) { return static_cast<uint8_t>(v >= 0 && v <= 255 ? v : 0); };
    switch (role) {
      case Role::x:
        position_.x = static_cast<float>(value);
        break;
      case Role::y:
        position_.y = static_cast<float>(value);
        break;
      case Role::z:
        position_.z = static_cast<float>(value);
        break;
      case Role::red:
        colour_.r = byte(value);
        break;
      case Role::green:
        colour_.g = byte(value);
        break;
      case Role::blue:
        colour_.b = byte(value);
        break;
      case Role::indices:
      case Role::other:
        break;
    }
  }

  std::string path_;
  ByteFile file_;
  Header header_;
  bool opened_ = false;
  Vec3 position_;
  Rgb8 colour_;
  std::vector<double> indices_;  ///< of the last face
};

bool finite(Vec3 p) {
  return std::isfinite(p.x) && std::isfinite(p.y) && std::isfinite(p.z);
}

/// Adds a polygon as a fan. @return false for an index that no vertex has
bool add_fan(const std::vector<double>& polygon, PlyMesh& mesh) {
  const double count = static_cast<double>(mesh.vertices_m.size());
  for (const double index : polygon)
    if (!(index >= 0 && index < count)) return false;
  for (std::size_t i = 2; i < polygon.size(); ++i)
    mesh.triangles.push_back({static_cast<uint32_t>(polygon[0]), static_cast<uint32_t>(polygon[i - 1]),
                              static_cast<uint32_t>(polygon[i])});
  return true;
}

}  // namespace

Result<PlyMesh> read_ply_mesh(const std::string& path) {
  Reader reader(path);
  if (const std::optional<Error> error = reader.open()) return *error;
  PlyMesh mesh;
  for (const Element& element : reader.header().elements) {
    if (element.count > kMaxElements)
      return reader.fail(
          fmt::format("{} elements '{}'; at most 50 million are read", element.count, element.name));
    if (element.name == "vertex") mesh.vertices_m.reserve(element.count);
    if (element.name == "face") mesh.triangles.reserve(element.count);
  }
  const bool coloured = reader.has_colour();
  bool all_finite = true;
  const auto vertex = [&](Vec3 position_m, Rgb8 colour) {
    all_finite = all_finite && finite(position_m);
    mesh.vertices_m.push_back(position_m);
    if (coloured) mesh.colours.push_back(colour);
  };
  const auto face = [&](const std::vector<double>& polygon) {
    return mesh.triangles.size() + polygon.size() <= 4 * kMaxElements && add_fan(polygon, mesh);
  };
  if (const std::optional<Error> error = reader.read(vertex, face, true)) return *error;
  if (!all_finite) return reader.fail("has a vertex that is not finite");
  return mesh;
}

Result<uint64_t> read_ply_points(const std::string& path, const std::function<void(Vec3)>& point) {
  Reader reader(path);
  uint64_t left_out = 0;
  const auto vertex = [&](Vec3 position_m, Rgb8) {
    if (finite(position_m))
      point(position_m);
    else
      ++left_out;
  };
  const auto face = [](const std::vector<double>&) { return true; };
  if (const std::optional<Error> error = reader.read(vertex, face, false)) return *error;
  return left_out;
}

}  // namespace stillmap
