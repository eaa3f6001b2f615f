#include "drivers/registry.hpp"

#include <optional>
#include <utility>

#include "drivers/camera/calibrated_source.hpp"
#include "drivers/dataset/sevenscenes_source.hpp"
#include "drivers/dataset/tum_source.hpp"
#include "drivers/recording/log_source.hpp"
#include "drivers/synthetic/synthetic_source.hpp"
#include "drivers/v4l2/v4l2_source.hpp"
#include "drivers/v4l2/with_colour.hpp"

namespace stillmap {
namespace {

using Opened = Result<std::unique_ptr<FrameSource>>;

/// What camera.calibration does to a kind of source.
enum class Calibrates : uint8_t {
  nothing,        ///< its camera is known exactly
  but_registers,  ///< depth is registered already, whatever the file says of it
  all
};

/// How one scheme is opened; `open` is null where this build lacks the part.
struct Scheme {
  const char* name;
  const char* usage;
  Opened (*open)(const std::string& rest, const SourceOptions& options);
  Calibrates calibrates = Calibrates::all;
  bool rest_needed = true;
};

Opened tum(const std::string& dir, const SourceOptions& options) {
  return open_tum(dir, options.dataset);
}

Opened sevenscenes(const std::string& dir, const SourceOptions& options) {
  return open_sevenscenes(dir, options.dataset);
}

Opened synthetic(const std::string& spec, const SourceOptions& options) {
  Opened source = open_synthetic(spec, options.threads);
  if (!source) return Error{source.error(), ErrorKind::bad_usage};  // nothing outside the program can fail it
  return source;
}

Opened log(const std::string& path, const SourceOptions& options) {
  auto source = LogSource::open(path, options.dataset);
  if (!source) return Error{source.error(), source.error_kind()};
  return std::unique_ptr<FrameSource>(std::move(*source));
}

#ifdef STILLMAP_OPENNI2
Opened xtion(const std::string& serial, const SourceOptions& options) {
  return open_xtion(serial, options.camera);
}

Opened oni(const std::string& path, const SourceOptions& options) {
  return open_oni(path, options.camera);
}
#else
constexpr auto xtion = nullptr, oni = nullptr;
#endif

/// The depth may be another camera's: v4l2:xtion,/dev/video1.
Opened v4l2(const std::string& nodes, const SourceOptions& options) {
  const size_t comma = nodes.find(',');
  const std::string depth_name = nodes.substr(0, comma);
  if (comma == std::string::npos || !is_camera(depth_name)) return open_v4l2(nodes, options.camera);
  SourceOptions of_depth = options;
  of_depth.dataset.calibration.clear();  // it is for both cameras together
  auto depth = open_source(depth_name, of_depth);
  if (!depth) return depth;
  auto both = WithColour::open(std::move(*depth), nodes.substr(comma + 1), options.camera);
  if (!both) return Error{both.error(), both.error_kind()};
  return std::unique_ptr<FrameSource>(std::move(*both));
}

constexpr Scheme kSchemes[] = {
    {"tum", "tum:DIR", tum},
    {"sevenscenes", "sevenscenes:DIR", sevenscenes},
    {"synthetic", "synthetic:SCENE[,seed=N][,size=WxH][,seconds=S]", synthetic, Calibrates::nothing},
    {"log", "log:FILE", log, Calibrates::but_registers},
    {"xtion", "xtion[:SERIAL]", xtion, Calibrates::all, false},
    {"oni", "oni:FILE", oni},
    {"v4l2", "v4l2:DEPTH_DEV[,COLOUR_DEV]", v4l2},
};

/// camera.calibration into the options that a source is opened with; the options' own camera and scale win.
Result<Calibration> read_calibration(SourceOptions& options) {
  const auto file = find_calibration(options.dataset.calibration);
  if (!file) return Error{file.error(), file.error_kind()};
  auto calibration = load_calibration(*file);
  if (!calibration) return Error{calibration.error(), calibration.error_kind()};
  if (!options.dataset.camera) options.dataset.camera_origin = *file;
  const auto fill = [&](auto& said) {
    if (!said.camera) said.camera = calibration->colour;
    if (said.depth_units_per_m == 0) said.depth_units_per_m = calibration->depth_units_per_m;
  };
  fill(options.dataset);
  fill(options.camera);
  return calibration;
}

/// An error where the calibration is for images of another size.
std::string size_problem(const Calibration& calibration, const SourceInfo& info, const std::string& file) {
  if (!calibration.colour || calibration.colour->k.width == 0) return {};
  const Intrinsics &said = calibration.colour->k, &k = info.camera.k;
  if (said.width == k.width && said.height == k.height) return {};
  return "camera.calibration = \"" + file + "\": is for " + std::to_string(said.width) + "x" +
         std::to_string(said.height) + " pixels, the images of " + info.name + " have " +
         std::to_string(k.width) + "x" + std::to_string(k.height);
}

Opened open_calibrated(const Scheme& scheme, const std::string& rest, SourceOptions options) {
  std::optional<Calibration> calibration;
  if (!options.dataset.calibration.empty() && scheme.calibrates != Calibrates::nothing) {
    auto read = read_calibration(options);
    if (!read) return Error{read.error(), read.error_kind()};
    calibration = std::move(*read);
  }
  Opened source = scheme.open(rest, options);
  if (!source) return source;
  const SourceInfo& info = (*source)->info();
  DepthBias bias = info.depth_bias;
  std::optional<DepthCamera> depth_camera = info.depth_camera;
  if (calibration) {
    if (std::string problem = size_problem(*calibration, info, options.dataset.calibration); !problem.empty())
      return Error{std::move(problem), ErrorKind::bad_usage};
    bias = calibration->depth_bias;
    depth_camera.reset();
    if (scheme.calibrates == Calibrates::all) depth_camera = calibration->depth;
  }
  if (!calibration && !depth_camera) return source;
  return CalibratedSource::make(std::move(*source), bias, depth_camera);
}

std::string schemes_of_this_build() {
  std::string text;
  for (const Scheme& scheme : kSchemes)
    if (scheme.open) text += std::string(text.empty() ? "" : ", ") + scheme.usage;
  return text;
}

}  // namespace

Result<std::vector<OpenNi2Camera>> xtion_cameras() {
#ifdef STILLMAP_OPENNI2
  return openni2_cameras();
#else
  return Error{"this build has no OpenNI2", ErrorKind::bad_usage};
#endif
}

bool is_camera(const std::string& source) {
  const std::string scheme = source.substr(0, source.find(':'));
  return scheme == "xtion" || scheme == "v4l2";
}

Result<std::unique_ptr<FrameSource>> open_source(const std::string& source, const SourceOptions& options) {
  const auto refused = [&](const std::string& why) {
    return Error{"source '" + source + "': " + why + "; this build has " + schemes_of_this_build(),
                 ErrorKind::bad_usage};
  };
  const size_t colon = source.find(':');
  const std::string name = source.substr(0, colon);
  const std::string rest = colon == std::string::npos ? "" : source.substr(colon + 1);
  for (const Scheme& scheme : kSchemes) {
    if (name != scheme.name) continue;
    if (!scheme.open) return refused(std::string(scheme.usage) + " is not part of this build");
    if (rest.empty() && scheme.rest_needed) return refused(std::string("expected ") + scheme.usage);
    return open_calibrated(scheme, rest, options);
  }
  return refused("there is no such kind of source");
}

}  // namespace stillmap
