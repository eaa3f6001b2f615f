#include "runtime/picture/pictures.hpp"

#include <filesystem>
#include <new>
#include <utility>

#include <fmt/format.h>

#include "runtime/picture/painters.hpp"
#include "runtime/picture/run_data.hpp"

namespace stillmap {
namespace {

namespace fs = std::filesystem;

RunInputs read_inputs(const std::string& dir, const PictureOptions& options) {
  RunInputs inputs;
  inputs.dir = dir;
  inputs.truth_path = options.truth;
  for (const char* name : {"truth.txt", "groundtruth.txt"})
    if (inputs.truth_path.empty() && have_file(inputs.path(name))) inputs.truth_path = inputs.path(name);
  if (have_file(inputs.path("trajectory.txt")))
    inputs.estimate = read_trajectory(inputs.path("trajectory.txt"));
  if (!inputs.truth_path.empty()) inputs.truth = read_trajectory(inputs.truth_path);
  if (inputs.estimate && *inputs.estimate && inputs.truth && *inputs.truth)
    inputs.ate = absolute_trajectory_error(**inputs.truth, **inputs.estimate);
  return inputs;
}

PictureOutcome make(const std::string& name, Painted (*paint)(const RunInputs&), const RunInputs& inputs) {
  Painted painted = [&]() -> Painted {
    try {
      return paint(inputs);
    } catch (const std::bad_alloc&) {
      return Error{fmt::format("{}: out of memory", inputs.dir)};
    }
  }();
  if (const Missing* missing = std::get_if<Missing>(&painted))
    return {name, PictureState::skipped, missing->what};
  if (const Error* error = std::get_if<Error>(&painted)) return {name, PictureState::failed, error->message};
  const Result<Done> written = std::get<Canvas>(painted).write_png(inputs.path("pictures/" + name));
  if (!written) return {name, PictureState::failed, written.error()};
  return {name, PictureState::written, {}};
}

}  // namespace

std::optional<Error> RunInputs::broken() const {
  for (const auto* trajectory : {&estimate, &truth})
    if (*trajectory && !**trajectory) return Error{(*trajectory)->error()};
  return std::nullopt;
}

Result<std::vector<PictureOutcome>> make_pictures(const std::string& dir, const PictureOptions& options) {
  std::error_code code;
  if (!fs::is_directory(dir, code))
    return Error{fmt::format("{}: is no folder; expected what `stillmap run --out` left", dir)};
  fs::create_directories(dir + "/pictures", code);
  if (code) return Error{fmt::format("{}/pictures: cannot be made: {}", dir, code.message())};
  const RunInputs inputs = read_inputs(dir, options);
  const std::pair<const char*, Painted (*)(const RunInputs&)> painters[] = {
      {"trajectory.png", paint_trajectory}, {"error.png", paint_error},   {"frames.png", paint_frames},
      {"cumulative.png", paint_cumulative}, {"timing.png", paint_timing}, {"map.png", paint_map}};
  std::vector<PictureOutcome> outcomes;
  for (const auto& [name, paint] : painters) outcomes.push_back(make(name, paint, inputs));
  fs::remove(dir + "/pictures", code);  // only when nothing came into it
  return outcomes;
}

}  // namespace stillmap
