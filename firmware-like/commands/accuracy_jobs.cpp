#include "firmware-like/commands/accuracy_jobs.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <charconv>
#include <filesystem>
#include <optional>

#include "drivers/synthetic/synthetic_source.hpp"

namespace stillmap {
namespace {

namespace fs = std::filesystem;

constexpr std::string_view kSynthetic = "synthetic:";

/// One thing to run on, before presets and seeds.
struct Subject {
  std::string source;
  std::string scene, twin;  ///< as in AccuracyRun
  bool synthetic = false, own_seed = false;
  uint32_t skip_frames = 0, max_frames = 0;
  std::string truth;
};

/// Beside the sources, or where the program was built or installed.
Result<std::string> find_preset(const std::string& file) {
  std::error_code ignored;
  const fs::path program = fs::read_symlink("/proc/self/exe", ignored).parent_path();
  for (const fs::path& dir :
       {fs::path("config/presets"), program / "../../config/presets", program / "../share/stillmap/presets"})
    if (fs::is_regular_file(dir / file, ignored)) return (dir / file).lexically_normal().string();
  return Error{"config/presets/" + file + " is not found from here; name the presets with --config",
               ErrorKind::bad_usage};
}

Result<std::vector<std::string>> presets(const BenchOptions& o) {
  if (!o.configs.empty()) return o.configs;
  const auto paper = find_preset("paper.toml");
  if (!paper) return Error{paper.error(), paper.error_kind()};
  return std::vector<std::string>{"", *paper};
}

std::string preset_name(const std::string& config) {
  return config.empty() ? "default" : fs::path(config).stem().string();
}

bool has_option(const std::string& spec, const std::string& key) {
  return spec.find(fmt::format(",{}=", key)) != std::string::npos;
}

/// "crowd,size=320x240" -> "crowd-static,size=320x240"; nothing when nothing moves in it.
std::string twin_of(const std::string& spec) {
  const size_t comma = std::min(spec.find(','), spec.size());
  const std::string name = spec.substr(0, comma);
  return synthetic_scene_moves(name) ? name + "-static" + spec.substr(comma) : std::string();
}

Subject synthetic_subject(const std::string& spec, const BenchOptions& o) {
  Subject s;
  s.scene = spec;
  s.twin = twin_of(spec);
  s.synthetic = true;
  s.own_seed = has_option(spec, "seed");
  s.source = std::string(kSynthetic) + spec;
  if (!o.size.empty() && !has_option(spec, "size")) s.source += ",size=" + o.size;
  if (!o.seconds.empty() && !has_option(spec, "seconds")) s.source += ",seconds=" + o.seconds;
  return s;
}

/// "SOURCE@SKIP+MAX": the frames that are used.
void take_cut(std::string& source, Subject& subject) {
  const size_t at = source.rfind('@');
  if (at == std::string::npos) return;
  const char* const end = source.data() + source.size();
  uint32_t skip = 0, max = 0;
  const auto [plus, skip_error] = std::from_chars(source.data() + at + 1, end, skip);
  if (skip_error != std::errc() || plus == end || *plus != '+') return;
  const auto [last, max_error] = std::from_chars(plus + 1, end, max);
  if (max_error != std::errc() || last != end) return;
  subject.skip_frames = skip;
  subject.max_frames = max;
  source.resize(at);
}

Subject recording_subject(std::string source, const BenchOptions& o) {
  Subject s;
  s.skip_frames = o.skip_frames;
  s.max_frames = o.max_frames;
  take_cut(source, s);
  s.source = source;
  fs::path dir = source.substr(std::min(source.find(':') + 1, source.size()));
  if (!dir.has_filename()) dir = dir.parent_path();
  s.scene = dir.filename().string();
  if (s.skip_frames > 0 || s.max_frames > 0) s.scene += fmt::format("@{}+{}", s.skip_frames, s.max_frames);
  std::error_code ignored;
  if (fs::is_regular_file(dir / "groundtruth.txt", ignored)) s.truth = (dir / "groundtruth.txt").string();
  return s;
}

void add_once(std::vector<Subject>& subjects, Subject subject) {
  for (const Subject& other : subjects)
    if (other.scene == subject.scene) return;
  subjects.push_back(std::move(subject));
}

std::vector<Subject> subjects(const BenchOptions& o) {
  std::vector<std::string> sources = o.sources;
  if (sources.empty())
    for (const std::string& scene : synthetic_scene_names())
      if (!synthetic_scene_wants_completion(scene)) sources.push_back(std::string(kSynthetic) + scene);
  const bool twins = o.twins || o.sources.empty();
  std::vector<Subject> all;
  for (const std::string& source : sources) {
    if (!source.starts_with(kSynthetic)) {
      add_once(all, recording_subject(source, o));
      continue;
    }
    const Subject scene = synthetic_subject(source.substr(kSynthetic.size()), o);
    add_once(all, scene);
    if (twins && !scene.twin.empty()) add_once(all, synthetic_subject(scene.twin, o));
  }
  return all;
}

std::string folder_name(std::string text) {
  std::replace(text.begin(), text.end(), '/', '_');
  return text;
}

AccuracyJob job_of(const BenchOptions& o, const Subject& subject, const std::string& config, uint64_t seed) {
  AccuracyJob job;
  job.truth = subject.truth;
  AccuracyRun& run = job.run;
  run.scene = subject.scene;
  run.twin = subject.twin;
  run.preset = preset_name(config);
  run.seed = seed;
  run.synthetic = subject.synthetic;
  run.source = subject.source;
  if (subject.synthetic && !subject.own_seed) run.source += ",seed=" + std::to_string(seed);
  job.options.source = run.source;
  job.options.config = config;
  job.options.skip_frames = subject.skip_frames;
  job.options.max_frames = subject.max_frames;
  job.options.quiet = true;
  job.options.settings = {"record.keep_previous=0", "record.mesh=true", "record.snapshots=0"};
  job.options.settings.insert(job.options.settings.end(), o.settings.begin(), o.settings.end());
  job.options.out = o.out + "/" + run.preset + "/" + folder_name(run.scene);
  if (o.seeds > 1 && subject.synthetic) job.options.out += "/seed-" + std::to_string(seed);
  return job;
}

}  // namespace

Result<std::vector<AccuracyJob>> accuracy_jobs(const BenchOptions& o) {
  const auto configs = presets(o);
  if (!configs) return Error{configs.error(), configs.error_kind()};
  std::vector<AccuracyJob> jobs;
  for (const Subject& subject : subjects(o)) {
    const uint64_t seeds = subject.synthetic && !subject.own_seed ? o.seeds : 1;
    for (uint64_t seed = 1; seed <= seeds; ++seed)
      for (const std::string& config : *configs) jobs.push_back(job_of(o, subject, config, seed));
  }
  return jobs;
}

}  // namespace stillmap
