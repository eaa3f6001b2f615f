#include "drivers/synthetic/spec.hpp"

#include <charconv>
#include <cmath>
#include <string_view>
#include <vector>

namespace stillmap::synthetic {

namespace {

constexpr std::string_view kTwinEnding = "-static";

std::string scene_list() {
  std::string list;
  for (const Scene& scene : all_scenes()) list += (list.empty() ? "" : ", ") + std::string(scene.name);
  return list + " (each also with -static appended: the twin without movers)";
}

Error bad_option(std::string_view option) {
  return Error{
      "synthetic: option '" + std::string(option) +
      "' is not known or has no valid value: expected seed=N (0 or more), size=WxH (64x48 to 1920x1080), "
      "seconds=S (0.1 to 100000), odometry=0, 1 or slip, each at most once"};
}

template <class T>
bool parse_number(std::string_view text, T& value) {
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), value);
  return error == std::errc() && end == text.data() + text.size() && !text.empty();
}

bool parse_size(std::string_view text, Spec& spec) {
  const size_t x = text.find('x');
  return x != std::string_view::npos && parse_number(text.substr(0, x), spec.width) &&
         parse_number(text.substr(x + 1), spec.height) && spec.width >= 64 && spec.width <= 1920 &&
         spec.height >= 48 && spec.height <= 1080;
}

bool parse_odometry(std::string_view text, Spec& spec) {
  spec.wheels_slip = text == "slip";
  spec.odometry = text == "1" || spec.wheels_slip;
  return spec.odometry || text == "0";
}

bool parse_option(std::string_view key, std::string_view value, Spec& spec) {
  if (key == "seed") return parse_number(value, spec.seed);
  if (key == "size") return parse_size(value, spec);
  if (key == "odometry") return parse_odometry(value, spec);
  if (key == "seconds")
    return parse_number(value, spec.seconds) && std::isfinite(spec.seconds) && spec.seconds >= 0.1 &&
           spec.seconds <= 100000.0;
  return false;
}

bool find_scene_or_twin(std::string_view name, Spec& spec) {
  spec.scene = find_scene(std::string(name));
  if (spec.scene != nullptr || !name.ends_with(kTwinEnding)) return spec.scene != nullptr;
  spec.scene = find_scene(std::string(name.substr(0, name.size() - kTwinEnding.size())));
  spec.without_movers = true;
  return spec.scene != nullptr;
}

}  // namespace

Result<Spec> parse_spec(const std::string& text) {
  std::string_view rest = text;
  const auto take = [&rest] {
    const size_t comma = rest.find(',');
    const std::string_view part = rest.substr(0, comma);
    rest = comma == std::string_view::npos ? std::string_view() : rest.substr(comma + 1);
    return part;
  };
  Spec spec;
  const std::string_view name = take();
  if (!find_scene_or_twin(name, spec))
    return Error{"synthetic: there is no scene '" + std::string(name) + "': expected one of " + scene_list()};
  spec.seconds = spec.scene->default_seconds;
  std::vector<std::string_view> seen;
  for (bool more = text.find(',') != std::string::npos; more;) {
    more = rest.find(',') != std::string_view::npos;
    const std::string_view option = take();
    const size_t equals = option.find('=');
    if (equals == std::string_view::npos) return bad_option(option);
    const std::string_view key = option.substr(0, equals);
    for (const std::string_view earlier : seen)
      if (earlier == key) return bad_option(option);
    seen.push_back(key);
    if (!parse_option(key, option.substr(equals + 1), spec)) return bad_option(option);
  }
  return spec;
}

}  // namespace stillmap::synthetic
