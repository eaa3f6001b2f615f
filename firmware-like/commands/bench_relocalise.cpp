// Kidnappings: a map is made from a scene, then the camera is put somewhere else and has a second of frames
// to find itself again. Every trial starts from the same map; nothing is mapped in it.

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <chrono>
#include <cmath>
#include <cstdio>
#include <memory>
#include <nlohmann/json.hpp>
#include <optional>
#include <random>
#include <string>
#include <vector>

#include "config/engine_params.hpp"
#include "drivers/registry.hpp"
#include "drivers/synthetic/renderer.hpp"
#include "drivers/synthetic/scene.hpp"
#include "drivers/synthetic/sensor_model.hpp"
#include "firmware-like/commands/bench_options.hpp"
#include "firmware-like/commands/command.hpp"
#include "firmware-like/commands/common.hpp"
#include "firmware-like/commands/stop_signal.hpp"
#include "runtime/pipeline/pipeline.hpp"
#include "runtime/pipeline/pose_quality.hpp"
#include "runtime/pipeline/relocaliser.hpp"
#include "runtime/record/truth_frame.hpp"

namespace stillmap {
namespace {

using Json = nlohmann::ordered_json;
using synthetic::Scene;

constexpr double kFrame_s = 1.0 / 30.0;
constexpr int kTrialFrames = 30;
constexpr double kDegrees = 57.29577951308232;
constexpr double kLeastStill = 0.25;       ///< of the valid pixels of each frame
constexpr double kMostSeenOfUnseen = 0.1;  ///< of an unseen view that is in the map
constexpr int kMaxDraws = 400;

/// A scene to map, and how many kidnappings into it. The map of a scene whose movers drag the camera along is
/// made from its twin: what is measured here is the search, not the map.
struct Course {
  const char* map;
  const char* scene;       ///< in the same room, with movers
  const char* other_room;  ///< a scene in another room
  double seconds;          ///< of the map; 0: the whole scene
  int seen, unseen;
  bool has_unseen_side;  ///< part of its own room was never looked at
};
constexpr Course kFull[] = {{"static", "static", "crowd_close", 0, 30, 8, true},
                            {"loop", "loop", "moving_box", 0, 40, 8, false},
                            {"crowd", "crowd", "synchronous", 0, 40, 10, true},
                            {"balloon", "balloon", "kidnapping_box", 0, 30, 8, true},
                            {"synchronous-static", "synchronous", "static", 0, 40, 8, true},
                            {"crowd_close-static", "crowd_close", "loop", 0, 20, 8, true}};
constexpr Course kShort[] = {{"crowd", "crowd", "crowd_close", 5, 8, 4, true}};

struct Trial {
  std::string map, to;
  bool seen = true, found = false;
  int frames = 0;  ///< until found
  double error_m = 0, error_deg = 0;
  double ms = 0;  ///< of the longest search in a frame
  ViewCheck check;
  float similarity = 0;

  /// Accepted and not a good pose, or accepted where nothing was mapped.
  bool is_false() const {
    return found && (!seen || error_m > static_cast<double>(kGoodPoseM) ||
                     error_deg > static_cast<double>(kGoodPoseDeg));
  }
  bool good() const { return seen ? found && !is_false() : !found; }
};

double angle_deg(const Se3d& a, const Se3d& b) {
  return kDegrees * norm(log_rotation(transposed(a.rotation) * b.rotation));
}

/// Images of any scene from any place.
class Eye {
 public:
  Eye(const SourceInfo& info, int threads)
      : slot_(info),
        workers_(threads),
        renderer_(info.camera.k),
        sensor_(info.camera.k, info.depth_units_per_m, kSeed) {}

  /// @return the share of still pixels among those that the sensor can measure
  double look(const synthetic::World& world, const Se3d& T_world_cam) {
    renderer_.render(world, T_world_cam, workers_, images_);
    int valid = 0, still = 0;
    for (size_t i = 0; i < images_.mask.size(); ++i) {
      if (images_.depth_m[i] < synthetic::kDepthMinM || images_.depth_m[i] > synthetic::kDepthMaxM) continue;
      ++valid;
      still += images_.mask[i] == 0 ? 1 : 0;
    }
    return static_cast<double>(still) / std::max(valid, 1);
  }
  /// What the sensor makes of the last look.
  const RgbdFrame& measure(uint32_t noise, double t_s) {
    sensor_.measure(images_, noise, t_s, workers_, slot_.frame().depth_raw, slot_.frame().colour);
    return slot_.frame();
  }
  const synthetic::IdealImages& images() const { return images_; }

 private:
  static constexpr uint64_t kSeed = 7;  ///< not that of the map
  FrameSlot slot_;
  ThreadPool workers_;
  synthetic::Renderer renderer_;
  synthetic::SensorModel sensor_;
  synthetic::IdealImages images_;
};

/// Where a trial goes.
struct Journey {
  const Scene* scene = nullptr;
  double start_s = 0, movers_s = 0;
  Se3d T_path_cam;  ///< beside the scene's own path

  Se3d pose(int frame) const { return scene->camera(start_s + frame * kFrame_s) * T_path_cam; }
  synthetic::World world(int frame) const {
    return synthetic::world_at(*scene, movers_s + frame * kFrame_s, false);
  }
};

using Random = std::mt19937;
double uniform(Random& random, double low, double high) {
  return low + (high - low) * (static_cast<double>(random() >> 5) / 134217728.0);
}
Vec3d direction(Random& random) {
  const double z = uniform(random, -1, 1), turn = uniform(random, 0, 6.283185307179586);
  const double r = std::sqrt(1 - z * z);
  return {r * std::cos(turn), r * std::sin(turn), z};
}

class Relocalisations {
 public:
  Relocalisations(const Config& config, const Course& course) : config_(config), course_(course) {}

  /// Maps the scene. @return what went wrong, else nothing
  std::string map_scene() {
    std::string name = fmt::format("synthetic:{},size=320x240", course_.map);
    if (course_.seconds > 0) name += fmt::format(",seconds={}", course_.seconds);
    auto source = open_source(name, source_options(config_));
    if (!source) return source.error();
    const SourceInfo& info = (*source)->info();
    engine_ = make_cpu_engine(engine_params(config_, info.camera, info.depth_units_per_m));
    if (!engine_) return "the memory of the engine cannot be had";
    k_ = info.camera.k;
    eye_ = std::make_unique<Eye>(info, config_.runtime.threads);
    Pipeline pipeline(*engine_, config_);
    FrameSlot slot(info);
    while ((*source)->next(slot.frame(), 1000) == Status::ok && !stop_requested()) {
      const FrameResult result = pipeline.process(slot.frame(), {.sonar_m = slot.frame().sonar_m});
      T_map_cam_ = result.T_map_cam;
      if (!truth_.anchored()) truth_.anchor(result.T_map_cam, *slot.frame().truth_T_world_cam);
      drift_m_ = norm(T_map_cam_.translation - truth_.to_map(*slot.frame().truth_T_world_cam).translation);
    }
    return {};
  }
  double drift_m() const { return drift_m_; }

  std::optional<Journey> to_seen_place(Random& random) {
    const Scene* scene = synthetic::find_scene(course_.scene);
    const double mapped_s = course_.seconds > 0 ? course_.seconds : scene->default_seconds;
    return draw([&](Journey& j) {
      j.scene = scene;
      j.start_s = uniform(random, 0.5, mapped_s - 1.1);
      j.movers_s = uniform(random, 0.5, scene->default_seconds - 1.1);
      j.T_path_cam = exp(Twistd{uniform(random, 0.03, 0.13) * direction(random),
                                uniform(random, 2.0, 10.0) / kDegrees * direction(random)});
      return true;
    });
  }

  std::optional<Journey> to_unseen_place(Random& random, int number) {
    const bool other_room = !course_.has_unseen_side || number % 2 == 0;
    const Scene* scene = synthetic::find_scene(other_room ? course_.other_room : course_.scene);
    return draw([&](Journey& j) {
      j.scene = scene;
      j.start_s = uniform(random, 0.5, scene->default_seconds - 1.1);
      j.movers_s = uniform(random, 0.5, scene->default_seconds - 1.1);
      const double turn = other_room ? uniform(random, -0.5, 0.5) : uniform(random, 2.3, 4.0);
      j.T_path_cam = exp(Twistd{{}, {0, turn, 0}});
      return other_room || seen_share(j) < kMostSeenOfUnseen;
    });
  }

  Trial run(const Journey& journey, bool seen, uint32_t number) {
    Trial trial;
    trial.map = course_.map;
    trial.to = journey.scene->name;
    trial.seen = seen;
    Relocaliser relocaliser(*engine_, config_.relocalise);
    for (int frame = 0; frame < kTrialFrames && !trial.found; ++frame) {
      const Se3d T_world_cam = journey.pose(frame);
      eye_->look(journey.world(frame), T_world_cam);
      const RgbdFrame& image = eye_->measure(1000 * number + static_cast<uint32_t>(frame), journey.start_s);
      if (engine_->prepare({image.depth_raw, image.colour}).status != Status::ok) continue;
      const auto start = std::chrono::steady_clock::now();
      const std::optional<Se3d> found = relocaliser.find(T_map_cam_);
      trial.ms = std::max(
          trial.ms,
          std::chrono::duration<double, std::milli>(std::chrono::steady_clock::now() - start).count());
      trial.frames = frame + 1;
      if (relocaliser.last().check.on >= trial.check.on) trial.check = relocaliser.last().check;
      trial.similarity = relocaliser.last().similarity;
      if (!found) continue;
      trial.found = true;
      const Se3d tracked = tracked_from(*found), truth = truth_.to_map(T_world_cam);
      trial.error_m = norm(tracked.translation - truth.translation);
      trial.error_deg = angle_deg(tracked, truth);
      trial.check = relocaliser.last().check;
    }
    return trial;
  }

 private:
  /// Draws until the camera keeps clear of everything and enough of the view stands still.
  template <class Draw>
  std::optional<Journey> draw(const Draw& propose) {
    for (int i = 0; i < kMaxDraws; ++i) {
      Journey journey;
      if (propose(journey) && possible(journey)) return journey;
    }
    return std::nullopt;
  }

  bool possible(const Journey& journey) {
    for (int frame = 0; frame < kTrialFrames; frame += 5) {
      const synthetic::World world = journey.world(frame);
      const Vec3 lens = cast<float>(journey.pose(frame)).translation;
      for (const synthetic::Shape& shape : world.shapes)
        if (distance_m(shape, lens) < 0.3f) return false;
      if (eye_->look(world, journey.pose(frame)) < kLeastStill) return false;
    }
    return true;
  }

  /// Share of the true view that the map shows as it is.
  double seen_share(const Journey& journey) {
    constexpr int32_t kStep = 4;
    const Intrinsics k = subsampled(k_, kStep);
    depth_.resize(static_cast<size_t>(k.width) * static_cast<size_t>(k.height));
    colour_.resize(depth_.size());
    int seen = 0, valid = 0;
    for (const int frame : {0, kTrialFrames - 1}) {
      const Se3d T_world_cam = journey.pose(frame);
      eye_->look(journey.world(frame), T_world_cam);
      engine_->raycast(cast<float>(truth_.to_map(T_world_cam)), k,
                       {depth_.data(), k.height, k.width, k.width},
                       {colour_.data(), k.height, k.width, k.width});
      for (int32_t r = 0; r < k.height; ++r)
        for (int32_t c = 0; c < k.width; ++c) {
          const float truth_m = eye_->images().depth_m[static_cast<size_t>(r * kStep * k_.width + c * kStep)];
          if (truth_m > synthetic::kDepthMaxM) continue;
          ++valid;
          const float map_m = depth_[static_cast<size_t>(r * k.width + c)];
          seen += map_m > 0 && std::abs(map_m - truth_m) < 0.1f ? 1 : 0;
        }
    }
    return static_cast<double>(seen) / std::max(valid, 1);
  }

  /// As the pipeline goes on from a found pose.
  Se3d tracked_from(const Se3d& found) {
    const TrackResult initial = engine_->track(cast<float>(found));
    engine_->mask(initial.T_world_cam);
    const TrackResult refined = engine_->refine(initial.T_world_cam);
    return cast<double>(refined.status == Status::ok ? refined.T_world_cam : cast<float>(found));
  }

  const Config& config_;
  const Course& course_;
  std::unique_ptr<Engine> engine_;
  std::unique_ptr<Eye> eye_;
  Intrinsics k_;
  TruthFrame truth_;
  Se3d T_map_cam_;  ///< the last pose of the map's making
  double drift_m_ = 0;
  std::vector<float> depth_;
  std::vector<Rgb8> colour_;
};

Json json_row(const Trial& t) {
  const ViewCheck& c = t.check;
  return {{"map", t.map},
          {"to", t.to},
          {"seen", t.seen},
          {"found", t.found},
          {"false", t.is_false()},
          {"frames", t.frames},
          {"error_m", t.error_m},
          {"error_deg", t.error_deg},
          {"search_ms_max", t.ms},
          {"similarity", t.similarity},
          {"check",
           {{"cells", c.cells},
            {"on", c.on},
            {"front", c.front},
            {"through", c.through},
            {"unknown", c.unknown},
            {"luma_correlation", c.luma_correlation},
            {"texture_correlation", c.texture_correlation},
            {"weakest_m", c.weakest_m}}}};
}

struct Tally {
  int seen = 0, found = 0, unseen = 0, stayed_lost = 0, false_poses = 0;

  void add(const Trial& t) {
    (t.seen ? seen : unseen) += 1;
    if (t.seen && t.good()) ++found;
    if (!t.seen && t.good()) ++stayed_lost;
    if (t.is_false()) ++false_poses;
  }
  bool reached() const {
    constexpr double kFound = 0.95;
    return seen > 0 && found >= kFound * seen && stayed_lost == unseen && false_poses == 0;
  }
};

}  // namespace

int bench_relocalise(const BenchOptions& o) {
  catch_stop_signals();
  const auto config = read_config(o.configs.empty() ? "" : o.configs[0], o.settings);
  if (!config) return fail(config.error(), config.error_kind());
  if (const auto good = check(*config); !good) return fail(good.error(), good.error_kind());
  const std::vector<Course> courses = o.brief ? std::vector<Course>(std::begin(kShort), std::end(kShort))
                                              : std::vector<Course>(std::begin(kFull), std::end(kFull));
  Tally all;
  Json rows = Json::array();
  for (const Course& course : courses) {
    if (!o.sources.empty() && std::find(o.sources.begin(), o.sources.end(), course.map) == o.sources.end())
      continue;
    Relocalisations trials(*config, course);
    if (const std::string error = trials.map_scene(); !error.empty()) return fail(error, ErrorKind::failed);
    Random random(static_cast<uint32_t>(o.seed));
    Tally tally;
    for (int i = 0; i < course.seen + course.unseen && !stop_requested(); ++i) {
      const bool seen = i < course.seen;
      const auto journey = seen ? trials.to_seen_place(random) : trials.to_unseen_place(random, i);
      if (!journey) return fail(fmt::format("{}: no place could be drawn", course.scene), ErrorKind::failed);
      const Trial trial = trials.run(*journey, seen, static_cast<uint32_t>(i + 1));
      rows.push_back(json_row(trial));
      tally.add(trial);
      all.add(trial);
    }
    if (!o.json)
      fmt::print("{:<24} found {:>3} of {:>3}, stayed lost {:>3} of {:>3}, false {}, drift {:.1f} cm\n",
                 course.map, tally.found, tally.seen, tally.stayed_lost, tally.unseen, tally.false_poses,
                 100 * trials.drift_m());
    std::fflush(stdout);
  }
  if (o.json)
    fmt::print("{}\n", Json{{"seen", all.seen},
                            {"found", all.found},
                            {"unseen", all.unseen},
                            {"stayed_lost", all.stayed_lost},
                            {"false", all.false_poses},
                            {"trials", rows}}
                           .dump(2));
  else
    fmt::print("{:<24} found {:>3} of {:>3}, stayed lost {:>3} of {:>3}, false {}\n", "all", all.found,
               all.seen, all.stayed_lost, all.unseen, all.false_poses);
  return all.reached() ? kExitDone : kExitFailed;
}

}  // namespace stillmap
