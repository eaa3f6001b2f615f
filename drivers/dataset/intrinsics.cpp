#include "drivers/dataset/intrinsics.hpp"

#include <algorithm>
#include <cctype>
#include <cmath>
#include <filesystem>

#include "config/calibration.hpp"
#include "config/validate.hpp"
#include "drivers/dataset/text.hpp"

namespace stillmap {
namespace {

struct KnownCamera {
  const char* name;  ///< part of the folder's name, lower case
  CameraModel model;
};

/// TUM: the benchmark's calibration of the colour cameras; depth is registered to them. Bonn: as published
/// with it.
constexpr KnownCamera kKnownCameras[] = {
    {"freiburg1",
     {{517.306408f, 516.469215f, 318.643040f, 255.313989f, 0, 0},
      {0.262383f, -0.953104f, -0.005358f, 0.002628f, 1.163314f}}},
    {"freiburg2",
     {{520.908620f, 521.007327f, 325.141442f, 249.701764f, 0, 0},
      {0.231222f, -0.784899f, -0.003257f, -0.000105f, 0.917205f}}},
    {"freiburg3", {{535.433105f, 539.212524f, 320.106653f, 247.632132f, 0, 0}, {}}},
    {"bonn",
     {{542.822841f, 542.576870f, 315.593520f, 237.756098f, 0, 0},
      {0.039903f, -0.099343f, -0.000730f, -0.000144f, 0}}},
};

Error bad(std::string message) {
  return {std::move(message), ErrorKind::bad_usage};
}

/// fx 0 cx; 0 fy cy; 0 0 1
Result<CameraModel> read_matrix(const std::string& path) {
  const Result<TextFile> file = TextFile::read(path);
  if (!file) return bad(file.error());
  std::vector<float> numbers;
  for (const TextLine& line : file->lines())
    for (const std::string_view word : line.words) {
      const std::optional<double> number = parse_number(word);
      if (!number) return bad(path + ": '" + std::string(word.substr(0, 40)) + "' is no finite number");
      numbers.push_back(static_cast<float>(*number));
    }
  if (numbers.size() != 9 || std::abs(numbers[8] - 1) > 1e-6f)
    return bad(path + ": expected the 3x3 matrix fx 0 cx, 0 fy cy, 0 0 1");
  return CameraModel{{numbers[0], numbers[4], numbers[2], numbers[5], 0, 0}, {}};
}

std::string folder_name(const std::string& dir) {
  std::error_code failed;
  std::filesystem::path path =
      std::filesystem::weakly_canonical(std::filesystem::absolute(dir, failed), failed);
  if (failed) path = dir;
  if (!path.has_filename()) path = path.parent_path();
  return path.filename().string();
}

/// Intrinsics of the first place that has them.
Result<DatasetCamera> first_found(const std::string& dir, const DatasetOptions& options,
                                  const CameraDefaults& defaults, const Calibration& file) {
  const std::filesystem::path folder(dir);
  const std::string matrix = (folder / "camera-intrinsics.txt").string();
  if (options.camera) return DatasetCamera{*options.camera, 0, options.camera_origin};
  if (file.colour) return DatasetCamera{*file.colour, 0, (folder / "camera.toml").string()};
  if (is_there(matrix)) {
    const Result<CameraModel> model = read_matrix(matrix);
    if (!model) return bad(model.error());
    return DatasetCamera{*model, 0, matrix};
  }
  if (const auto known = camera_by_folder_name(folder_name(dir))) return DatasetCamera{*known, 0, dir};
  if (defaults.model) return DatasetCamera{*defaults.model, 0, dir};
  return bad(dir + ": intrinsics are not known; give --camera FX,FY,CX,CY[,K1,K2,P1,P2,K3] or write " +
             (folder / "camera.toml").string() + " with fx, fy, cx, cy");
}

}  // namespace

std::optional<CameraModel> camera_by_folder_name(const std::string& folder_name) {
  std::string name = folder_name;
  std::transform(name.begin(), name.end(), name.begin(),
                 [](unsigned char c) { return static_cast<char>(std::tolower(c)); });
  for (const KnownCamera& known : kKnownCameras)
    if (name.find(known.name) != std::string::npos) return known.model;
  return std::nullopt;
}

Result<DatasetCamera> find_camera(const std::string& dir, const DatasetOptions& options,
                                  const CameraDefaults& defaults) {
  Calibration file;
  const std::string toml = (std::filesystem::path(dir) / "camera.toml").string();
  if (is_there(toml)) {
    const Result<Calibration> loaded = load_calibration(toml, OtherKeys::let_be);
    if (!loaded) return bad(loaded.error());
    file = *loaded;
  }
  Result<DatasetCamera> camera = first_found(dir, options, defaults, file);
  if (!camera) return camera;
  if (const std::string problem = camera_problem(camera->model); !problem.empty())
    return bad(camera->origin + ": " + problem);

  camera->depth_units_per_m = defaults.depth_units_per_m;
  if (file.depth_units_per_m > 0) camera->depth_units_per_m = file.depth_units_per_m;
  if (options.depth_units_per_m != 0) camera->depth_units_per_m = options.depth_units_per_m;
  if (!(camera->depth_units_per_m > 0) || !std::isfinite(camera->depth_units_per_m))
    return bad(dir + ": the depth scale must be a finite number of units per metre above 0");
  camera->depth_bias = file.depth_bias;
  camera->depth_camera = file.depth;
  return camera;
}

}  // namespace stillmap
