#include "drivers/registry.hpp"

#include "drivers/dataset/sevenscenes_source.hpp"
#include "drivers/dataset/tum_source.hpp"
#include "drivers/recording/log_source.hpp"
#include "drivers/synthetic/synthetic_source.hpp"
#include "drivers/v4l2/v4l2_source.hpp"
#include "drivers/v4l2/with_colour.hpp"

namespace stillmap {
namespace {

using Opened = Result<std::unique_ptr<FrameSource>>;

/// How one scheme is opened; `open` is null where this build lacks the part.
struct Scheme {
  const char* name;
  const char* usage;
  Opened (*open)(const std::string& rest, const SourceOptions& options);
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

/// The depth may be another camera's: v4l2:xtion,/dev/video1.
Opened v4l2(const std::string& nodes, const SourceOptions& options) {
  const size_t comma = nodes.find(',');
  const std::string depth_name = nodes.substr(0, comma);
  if (comma == std::string::npos || !is_camera(depth_name)) return open_v4l2(nodes, options.camera);
  auto depth = open_source(depth_name, options);
  if (!depth) return depth;
  auto both = WithColour::open(std::move(*depth), nodes.substr(comma + 1), options.camera);
  if (!both) return Error{both.error(), both.error_kind()};
  return std::unique_ptr<FrameSource>(std::move(*both));
}

constexpr Scheme kSchemes[] = {
    {"tum", "tum:DIR", tum},
    {"sevenscenes", "sevenscenes:DIR", sevenscenes},
    {"synthetic", "synthetic:SCENE[,seed=N][,size=WxH][,seconds=S]", synthetic},
    {"log", "log:FILE", log},
    {"xtion", "xtion[:SERIAL]", nullptr},
    {"oni", "oni:FILE", nullptr},
    {"v4l2", "v4l2:DEPTH_DEV[,COLOUR_DEV]", v4l2},
};

std::string schemes_of_this_build() {
  std::string text;
  for (const Scheme& scheme : kSchemes)
    if (scheme.open) text += std::string(text.empty() ? "" : ", ") + scheme.usage;
  return text;
}

}  // namespace

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
    if (rest.empty()) return refused(std::string("expected ") + scheme.usage);
    return scheme.open(rest, options);
  }
  return refused("there is no such kind of source");
}

}  // namespace stillmap
