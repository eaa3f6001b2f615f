#include "config/calibration.hpp"

#include "config/toml_text.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <filesystem>
#include <limits>
#include <numbers>
#include <string_view>
#include <system_error>

#include "config/fields.hpp"
#include "config/read_file.hpp"
#include "config/validate.hpp"

namespace stillmap {
namespace {

/// A problem with the value of a key; empty: none.
using Complaint = std::string;

constexpr int64_t kMostPixels = 4096;

Complaint read_float(const toml::node& node, float& out) {
  const auto number = node.value<double>();
  if (!number || node.is_boolean() || !std::isfinite(*number) ||
      std::abs(*number) > static_cast<double>(std::numeric_limits<float>::max()))
    return "expected a finite number";
  out = static_cast<float>(*number);
  return {};
}

/// Between `fewest` and N numbers; those that are left out stay as they are.
template <size_t N>
Complaint read_floats(const toml::node& node, size_t fewest, const char* expected,
                      std::array<float, N>& out) {
  const toml::array* numbers = node.as_array();
  if (!numbers || numbers->size() < fewest || numbers->size() > N) return std::string("expected ") + expected;
  for (size_t i = 0; i < numbers->size(); ++i)
    if (Complaint complaint = read_float(*numbers->get(i), out[i]); !complaint.empty()) return complaint;
  return {};
}

Complaint read_pixels(const toml::node& node, int32_t& out) {
  const auto pixels = node.value_exact<int64_t>();
  if (!pixels || *pixels < 1 || *pixels > kMostPixels) return "expected 1 to 4096 pixels";
  out = static_cast<int32_t>(*pixels);
  return {};
}

Complaint read_pose(const toml::node& node, Se3d& out) {
  std::array<float, 7> v{};
  constexpr const char* kExpected = "[x, y, z, qx, qy, qz, qw], metres and a unit quaternion";
  if (Complaint complaint = read_floats(node, 7, kExpected, v); !complaint.empty()) return complaint;
  const auto d = [&](size_t i) { return static_cast<double>(v[i]); };
  const double length = std::sqrt(d(3) * d(3) + d(4) * d(4) + d(5) * d(5) + d(6) * d(6));
  constexpr double kRounding = 0.01;
  if (std::abs(length - 1) > kRounding) return std::string("expected ") + kExpected + " of length 1";
  const QuatT<double> q{d(3) / length, d(4) / length, d(5) / length, d(6) / length};
  out = {rotation_from(q), {d(0), d(1), d(2)}};
  return {};
}

/// The lens of one camera, as far as it was read.
struct Lens {
  CameraModel model;
  uint32_t pinhole_keys = 0;
  bool said = false;  ///< anything

  static const std::vector<std::string>& keys() {
    static const std::vector<std::string> kKeys = {"width", "height", "fx", "fy", "cx", "cy", "distortion"};
    return kKeys;
  }
  /// @return whether the key is one of a lens
  bool read(std::string_view key, const toml::node& node, Complaint& complaint) {
    if (std::find(keys().begin(), keys().end(), key) == keys().end()) return false;
    said = true;
    Intrinsics& k = model.k;
    if (key == "width" || key == "height") {
      complaint = read_pixels(node, key == "width" ? k.width : k.height);
    } else if (key == "distortion") {
      std::array<float, 5> v{};
      complaint = read_floats(node, 4, "[k1, k2, p1, p2, k3]", v);
      model.distortion = {v[0], v[1], v[2], v[3], v[4]};
    } else {
      ++pinhole_keys;
      complaint = read_float(node, key == "fx" ? k.fx : key == "fy" ? k.fy : key == "cx" ? k.cx : k.cy);
    }
    return true;
  }
  Complaint whole() const {
    if (pinhole_keys == 0 && model.distortion.none()) return {};
    if (pinhole_keys < 4) return "expected all of fx, fy, cx and cy, or none";
    if ((model.k.width == 0) != (model.k.height == 0)) return "expected both width and height, or none";
    return camera_problem(model);
  }
};

class Reader {
 public:
  Reader(std::string file, OtherKeys others) : file_(std::move(file)), others_(others) {}

  Result<Calibration> read(const toml::table& root) {
    for (const auto& [toml_key, node] : root) read_key(std::string(toml_key.str()), node);
    finish();
    if (!problems_.empty()) return Error{toml_text::list(problems_), ErrorKind::bad_usage};
    return calibration_;
  }

 private:
  void read_key(const std::string& key, const toml::node& node) {
    Complaint complaint;
    if (lenient() && (key == "width" || key == "height")) return;  // the images say
    if (alone_.read(key, node, complaint)) return say(key, node, complaint);
    if (key == "colour") return read_section(key, node, colour_);
    if (key == "depth") return read_section(key, node, depth_);
    if (key == "depth_scale") {
      complaint = read_float(node, calibration_.depth_units_per_m);
      if (complaint.empty() && !(calibration_.depth_units_per_m > 0))
        complaint = "expected units per metre, above 0";
      return say(key, node, complaint);
    }
    if (key == "depth_bias") return say(key, node, read_bias(node));
    if (!lenient() || looks_misspelt(key)) unknown(key, key, node, root_keys());
  }

  void read_section(const std::string& section, const toml::node& node, Lens& lens) {
    const toml::table* table = node.as_table();
    if (!table && lenient()) return;
    if (!table) return say(section, node, "is a section: expected [" + section + "] with keys below it");
    lens.said = !lenient();
    for (const auto& [toml_key, value] : *table) {
      const std::string key(toml_key.str()), name = section + "." + key;
      Complaint complaint;
      if (lens.read(key, value, complaint)) {
        say(name, value, complaint);
      } else if (&lens == &depth_ && key == "T_colour_depth") {
        Se3d pose;
        complaint = read_pose(value, pose);
        T_colour_depth_ = pose;
        say(name, value, complaint);
      } else if (!lenient() || looks_misspelt(key)) {
        std::vector<std::string> known;
        for (const std::string& of_lens : Lens::keys()) known.push_back(section + "." + of_lens);
        if (&lens == &depth_) known.push_back("depth.T_colour_depth");
        unknown(key, name, value, known);
      }
    }
  }

  Complaint read_bias(const toml::node& node) {
    std::array<float, 4> c = {0, 0, 0, 0};
    if (Complaint complaint = read_floats(node, 2, "[c0, c1], [c0, c1, c2] or [c0, c1, c2, c3]", c);
        !complaint.empty())
      return complaint;
    std::copy(c.begin(), c.end(), calibration_.depth_bias.c);
    return {};
  }

  bool lenient() const { return others_ == OtherKeys::let_be; }

  /// What can only be said of the whole.
  void finish() {
    if (!problems_.empty()) return;
    if (alone_.said && colour_.said)
      return of_file(
          "fx and the like stand before the first heading and in [colour]: expected one of the two");
    const bool in_section = colour_.said;
    const Lens& colour = in_section ? colour_ : alone_;
    const bool alone = lenient() && colour.pinhole_keys == 0;  // the lens is known from elsewhere
    if (const Complaint complaint = alone ? Complaint() : colour.whole(); !complaint.empty())
      return of_file((in_section ? "colour: " : "") + complaint);
    if (colour.pinhole_keys > 0) calibration_.colour = colour.model;
    if (!depth_.said) return;
    if (depth_.pinhole_keys == 0 || !T_colour_depth_)
      return of_file("depth: expected fx, fy, cx, cy and T_colour_depth; without [depth] it is registered");
    if (!calibration_.colour)
      return of_file("depth: is to be registered to colour; expected fx, fy, cx, cy of [colour] as well");
    if (const Complaint complaint = depth_.whole(); !complaint.empty()) return of_file("depth: " + complaint);
    calibration_.depth = DepthCamera{depth_.model, *T_colour_depth_};
  }

  static std::vector<std::string> root_keys() {
    std::vector<std::string> keys = Lens::keys();
    for (const char* key : {"depth_scale", "depth_bias", "colour", "depth"}) keys.emplace_back(key);
    return keys;
  }

  /// A key that is none of ours but was meant to be: ignoring it would silently use the wrong camera.
  static bool looks_misspelt(std::string_view key) {
    for (const char* coefficient : {"k1", "k2", "k3", "p1", "p2", "T_colour_depth"})
      if (key == coefficient) return true;
    key = key.substr(0, 64);
    return edit_distance(key, "distortion") <= 3 || edit_distance(key, "depth_scale") <= 3 ||
           edit_distance(key, "depth_bias") <= 2;
  }

  void unknown(std::string_view key, const std::string& name, const toml::node& node,
               const std::vector<std::string>& known) {
    const bool coefficient = key.size() == 2 && (key[0] == 'k' || key[0] == 'p');
    say(name, node,
        "unknown key; " + (coefficient ? std::string("expected distortion = [k1, k2, p1, p2, k3]")
                                       : "did you mean " + nearest(name, known) + "?"));
  }
  void say(const std::string& key, const toml::node& node, const Complaint& complaint) {
    if (!complaint.empty())
      problems_.push_back(toml_text::at_line(file_, node.source()) + key + ": " + complaint);
  }
  void of_file(const std::string& complaint) { problems_.push_back(file_ + ": " + complaint); }

  const std::string file_;
  const OtherKeys others_;
  Lens alone_, colour_, depth_;
  std::optional<Se3d> T_colour_depth_;
  Calibration calibration_;
  std::vector<std::string> problems_;
};

std::string degrees_text(double radians) {
  return std::to_string(static_cast<int>(std::lround(radians * 180 / std::numbers::pi)));
}

/// Area of what becomes of a pixel: negative where the image is folded over.
float area_after(const CameraModel& camera, Pixel p) {
  const Pixel o = distort(camera, p), u = distort(camera, {p.u + 1, p.v}),
              v = distort(camera, {p.u, p.v + 1});
  return (u.u - o.u) * (v.v - o.v) - (u.v - o.v) * (v.u - o.u);
}

bool folds_over(const CameraModel& camera) {
  constexpr int32_t kSteps = 32;
  const auto at = [](int32_t step, int32_t pixels) {
    return static_cast<float>(step) * static_cast<float>(pixels - 2) / kSteps;
  };
  for (int32_t row = 0; row <= kSteps; ++row)
    for (int32_t col = 0; col <= kSteps; ++col)
      if (area_after(camera, {at(col, camera.k.width), at(row, camera.k.height)}) <= 0) return true;
  return false;
}

CameraModel with_size(CameraModel camera, int32_t cols, int32_t rows) {
  if (camera.k.width == 0) camera.k.width = cols;
  if (camera.k.height == 0) camera.k.height = rows;
  return camera;
}

std::vector<std::string> implausible_bias(const DepthBias& bias, const std::string& file,
                                          const DepthParams& depth) {
  constexpr float kMost = 0.1f;
  constexpr int kSteps = 64;
  float before = -std::numeric_limits<float>::infinity();
  for (int step = 0; step <= kSteps; ++step) {
    const float m = depth.min_m + (depth.max_m - depth.min_m) * static_cast<float>(step) / kSteps;
    const float true_m = bias.corrected(m, depth.max_m);
    const std::string found =
        file + ": depth_bias: makes " + float_text(m) + " m " + float_text(true_m) + " m; ";
    if (!(std::abs(true_m - m) <= kMost * m)) return {found + "expected less than a tenth of it"};
    if (!(true_m > before)) return {found + "expected that farther stays farther"};
    before = true_m;
  }
  return {};
}

}  // namespace

Result<Calibration> parse_calibration(const std::string& text, const std::string& name, OtherKeys others) {
  const Result<toml::table> root = toml_text::parse(text, name);
  if (!root) return Error{root.error(), ErrorKind::bad_usage};
  return Reader(name, others).read(*root);
}

Result<Calibration> load_calibration(const std::string& path, OtherKeys others) {
  const Result<std::string> text = read_file(path, toml_text::kMaxFileBytes);
  if (!text) return Error{text.error(), ErrorKind::bad_usage};
  return parse_calibration(*text, path, others);
}

Result<std::string> find_calibration(const std::string& name) {
  namespace fs = std::filesystem;
  if (name.find('/') != std::string::npos || name.ends_with(".toml")) return name;
  std::error_code error;
  const fs::path program = fs::read_symlink("/proc/self/exe", error).parent_path();
  std::string tried;
  for (const fs::path& folder : {program / "../share/stillmap/calibrations",
                                 program / "../../config/calibrations", fs::path("config/calibrations")}) {
    const fs::path path = (folder / (name + ".toml")).lexically_normal();
    if (fs::exists(path, error)) return path.string();
    tried += (tried.empty() ? "" : ", ") + path.string();
  }
  return Error{
      "camera.calibration = \"" + name + "\": is none of " + tried + "; expected one of those or a file",
      ErrorKind::bad_usage};
}

std::vector<std::string> implausible(const CameraModel& camera, const std::string& before) {
  std::vector<std::string> lines;
  const Intrinsics& k = camera.k;
  const auto check_axis = [&](const char* focal, float f, const char* centre, float c, int32_t pixels,
                              const char* across) {
    constexpr double kNarrowest = 20 * std::numbers::pi / 180, kWidest = 120 * std::numbers::pi / 180;
    const auto size = static_cast<float>(pixels);
    const double angle = 2 * std::atan(static_cast<double>(size / (2 * f)));
    if (angle < kNarrowest || angle > kWidest)
      lines.push_back(before + focal + " = " + float_text(f) + ": an angle of view of " +
                      degrees_text(angle) + " degrees over the " + across + " of " + std::to_string(pixels) +
                      " pixels; expected 20 to 120");
    if (c < 0.25f * size || c > 0.75f * size)
      lines.push_back(before + centre + " = " + float_text(c) + ": expected within the middle half, " +
                      float_text(0.25f * size) + " to " + float_text(0.75f * size));
  };
  check_axis("fx", k.fx, "cx", k.cx, k.width, "width");
  check_axis("fy", k.fy, "cy", k.cy, k.height, "height");
  if (folds_over(camera)) {
    const Distortion& d = camera.distortion;
    std::string values;
    for (const float value : {d.k1, d.k2, d.p1, d.p2, d.k3})
      values += (values.empty() ? "" : ", ") + float_text(value);
    lines.push_back(before + "distortion = [" + values +
                    "]: folds the image over within its edges; expected that what is farther out stays so");
  }
  return lines;
}

std::vector<std::string> implausible(const Calibration& calibration, const std::string& file, int32_t cols,
                                     int32_t rows, const DepthParams& depth) {
  std::vector<std::string> lines;
  const auto add = [&](std::vector<std::string> more) {
    lines.insert(lines.end(), more.begin(), more.end());
  };
  if (calibration.colour) add(implausible(with_size(*calibration.colour, cols, rows), file + ": colour."));
  if (calibration.depth) {
    const DepthCamera& camera = *calibration.depth;
    add(implausible(with_size(camera.model, cols, rows), file + ": depth."));
    constexpr double kLongest_m = 0.5;
    const double baseline_m = norm(camera.T_colour_depth.translation);
    if (baseline_m > kLongest_m)
      lines.push_back(file + ": depth.T_colour_depth: the cameras are " +
                      float_text(static_cast<float>(baseline_m)) + " m apart; expected at most 0.5 m");
  }
  if (!calibration.depth_bias.none()) add(implausible_bias(calibration.depth_bias, file, depth));
  return lines;
}

}  // namespace stillmap
