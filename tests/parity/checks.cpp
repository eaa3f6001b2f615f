#include "tests/parity/checks.hpp"

#include <algorithm>
#include <cmath>
#include <cstdlib>

namespace stillmap::parity {
namespace {

/// Frames of the comparison step by step; whole runs take all.
constexpr size_t kStepFrames = 12;

EngineParams params_for(const Scene& scene) {
  EngineParams p;
  p.camera = scene.camera;
  p.depth_units_per_m = scene.depth_units_per_m;
  p.map.voxel_m = 0.025f;
  p.map.pool_blocks = 30000;
  return p;
}

/// Largest of the values given; a value that is not a number stays.
class Worst {
 public:
  void add(double x) {
    if (!(x <= value_) && !std::isnan(value_)) value_ = x;
  }
  double value() const { return value_; }

 private:
  double value_ = 0;
};

/// Largest and middle of the values given, one a frame.
class Spread {
 public:
  void add(double x) { values_.push_back(std::isnan(x) ? HUGE_VAL : x); }
  double worst() const { return values_.empty() ? 0 : *std::max_element(values_.begin(), values_.end()); }
  double median() const {
    if (values_.empty()) return 0;
    std::vector<double> sorted = values_;
    std::sort(sorted.begin(), sorted.end());
    return sorted[sorted.size() / 2];
  }

 private:
  std::vector<double> values_;
};

double share(double count, double of) {
  return of > 0 ? count / of : 0;
}
double relative(double a, double b) {
  return share(std::fabs(a - b), std::max(a, b));
}

template <class Image, class Differ>
double share_of_pixels(const Image& a, const Image& b, const Differ& differ) {
  int32_t n = 0;
  for (int32_t i = 0; i < a.pixels(); ++i) n += differ(a.data[i], b.data[i]);
  return share(n, a.pixels());
}
bool colours_differ(Rgb8 a, Rgb8 b, int levels) {
  return std::abs(a.r - b.r) > levels || std::abs(a.g - b.g) > levels || std::abs(a.b - b.b) > levels;
}

/// What a mesh amounts to.
class MeshSums : public MeshSink {
 public:
  bool begin(uint64_t vertex_count, uint64_t triangle_count) override {
    vertices_ = static_cast<double>(vertex_count);
    triangles_ = static_cast<double>(triangle_count);
    return true;
  }
  bool vertices(View<const Vec3> positions_m, View<const Rgb8>) override {
    for (const Vec3& p : positions_m) {
      const Vec3d at = {static_cast<double>(p.x), static_cast<double>(p.y), static_cast<double>(p.z)};
      positions_.push_back(at);
      sum_ = sum_ + at;
    }
    return true;
  }
  bool triangles(View<const uint32_t> indices) override {
    for (uint32_t i = 0; i + 2 < indices.size; i += 3) {
      const Vec3d a = positions_.at(indices[i]), b = positions_.at(indices[i + 1]),
                  c = positions_.at(indices[i + 2]);
      area_m2_ += 0.5 * norm(cross(b - a, c - a));
    }
    return true;
  }
  double difference(const MeshSums& other) const {
    return std::max({relative(vertices_, other.vertices_), relative(triangles_, other.triangles_),
                     relative(area_m2_, other.area_m2_)});
  }
  /// Of the centres of all vertices. Nothing is multiplied before equal sums are subtracted: fused into one
  /// operation, as on ARM, that would leave the rounding of one of the products.
  double centre_distance_m(const MeshSums& other) const {
    const double n = std::max(vertices_, 1.0), m = std::max(other.vertices_, 1.0);
    return n == m ? norm(sum_ - other.sum_) / n : norm((1.0 / n) * sum_ - (1.0 / m) * other.sum_);
  }

 private:
  double vertices_ = 0, triangles_ = 0, area_m2_ = 0;
  Vec3d sum_;
  std::vector<Vec3d> positions_;
};

/// Memory of a view.
struct Picture {
  std::vector<float> depth_m;
  std::vector<Rgb8> colour;
  Intrinsics k;

  explicit Picture(const Intrinsics& camera)
      : depth_m(static_cast<size_t>(camera.width * camera.height)), colour(depth_m.size()), k(camera) {}
  ImageView<float> depth() { return {depth_m.data(), k.height, k.width, k.width}; }
  ImageView<Rgb8> colours() { return {colour.data(), k.height, k.width, k.width}; }
};

/// Two engines side by side.
class StepComparison {
 public:
  StepComparison(Engine& reference, Engine& candidate, const Scene& scene)
      : reference_(reference), candidate_(candidate), scene_(scene) {}

  void frame(size_t i) {
    prepare(scene_.view(i));
    if (i > 0) {
      const Se3 T_tracked = registered(&Engine::track, T_, track_, track_timer_);
      mask(T_tracked);
      T_ = registered(&Engine::refine, T_tracked, refine_, refine_timer_);
    }
    integrate();
  }

  void report(const std::string& prefix, const Tolerance& limit, Report& report) {
    report.check(prefix + "prepare/depth_m", depth_m_.value(), limit.depth_m, prepare_timer_.ms());
    report.check(prefix + "prepare/colour", colour_.value(), limit.colour_share, prepare_timer_.ms());
    track_.report(prefix + "track", limit, track_timer_.ms(), report);
    report.check(prefix + "mask/pixels", mask_.value(), limit.mask_share, mask_timer_.ms());
    if (scene_.movers)
      report.check(prefix + "mask/nothing", masked_.value() > 0.01 ? 0 : 1, 0, mask_timer_.ms());
    refine_.report(prefix + "refine", limit, refine_timer_.ms(), report);
    report.check(prefix + "integrate/blocks", blocks_.value(), limit.blocks_share, integrate_timer_.ms());
    view(prefix, limit, report);
    mesh(prefix, limit, report);
  }

 private:
  struct PoseDifference {
    Spread m, rad;
    Worst ratio;

    void report(const std::string& step, const Tolerance& limit, double ms, Report& report) const {
      report.check(step + "/median_m", m.median(), limit.pose_m, ms);
      report.check(step + "/median_rad", rad.median(), limit.pose_rad, ms);
      report.check(step + "/worst_m", m.worst(), limit.worst_pose_m, ms);
      report.check(step + "/worst_rad", rad.worst(), limit.worst_pose_rad, ms);
      report.check(step + "/ratios", ratio.value(), limit.ratio, ms);
    }
  };

  void prepare(const FrameView& frame) {
    const PrepareResult expected = reference_.prepare(frame);
    prepare_timer_.start();
    const PrepareResult got = candidate_.prepare(frame);
    prepare_timer_.stop();
    const ImageView<const float> a = reference_.depth_image_m(), b = candidate_.depth_image_m();
    for (int32_t i = 0; i < a.pixels(); ++i)
      depth_m_.add(static_cast<double>(std::fabs(a.data[i] - b.data[i])));
    if (got.status != expected.status || got.valid_pixels != expected.valid_pixels) depth_m_.add(HUGE_VAL);
    colour_.add(share_of_pixels(reference_.colour_image(), candidate_.colour_image(),
                                [](Rgb8 x, Rgb8 y) { return colours_differ(x, y, 1); }));
  }

  /// @return the reference's pose
  Se3 registered(TrackResult (Engine::*step)(const Se3&, const PosePrior&), const Se3& T_start,
                 PoseDifference& worst, Timer& timer) {
    const TrackResult expected = (reference_.*step)(T_start, {});
    timer.start();
    const TrackResult got = (candidate_.*step)(T_start, {});
    timer.stop();
    const Se3d off = inverse(cast<double>(expected.T_world_cam)) * cast<double>(got.T_world_cam);
    worst.m.add(norm(off.translation));
    worst.rad.add(norm(log_rotation(off.rotation)));
    worst.ratio.add(static_cast<double>(std::fabs(expected.inlier_ratio - got.inlier_ratio)));
    worst.ratio.add(static_cast<double>(std::fabs(expected.mapped_ratio - got.mapped_ratio)));
    if (got.status != Status::ok || expected.status != Status::ok) worst.m.add(HUGE_VAL);
    return expected.T_world_cam;
  }

  void mask(const Se3& T) {
    reference_.mask(T);
    mask_timer_.start();
    candidate_.mask(T);
    mask_timer_.stop();
    masked_.add(share_of_pixels(candidate_.mask_image(), candidate_.mask_image(),
                                [](uint8_t x, uint8_t) { return x != 0; }));
    mask_.add(share_of_pixels(reference_.mask_image(), candidate_.mask_image(),
                              [](uint8_t x, uint8_t y) { return x != y; }));
  }

  void integrate() {
    const IntegrateResult expected = reference_.integrate(T_);
    integrate_timer_.start();
    const IntegrateResult got = candidate_.integrate(T_);
    integrate_timer_.stop();
    blocks_.add(relative(expected.map.blocks, got.map.blocks));
    if (got.status != Status::ok || expected.status != Status::ok) blocks_.add(HUGE_VAL);
  }

  void view(const std::string& prefix, const Tolerance& limit, Report& report) {
    Picture expected(scene_.camera.k), got(scene_.camera.k);
    Worst different;
    Timer timer;
    // Where the camera is, and from a place where it never was.
    for (const Se3& T : {T_, T_ * exp(Twist{{0.1f, -0.05f, -0.1f}, {0.05f, 0.1f, 0.02f}})}) {
      const Status reference_status = reference_.raycast(T, expected.k, expected.depth(), expected.colours());
      timer.start();
      const Status status = candidate_.raycast(T, got.k, got.depth(), got.colours());
      timer.stop();
      if (status != Status::ok || reference_status != Status::ok) different.add(HUGE_VAL);
      different.add(share_of_pixels(expected.depth(), got.depth(),
                                    [](float x, float y) { return !(std::fabs(x - y) <= 0.002f); }));
      different.add(share_of_pixels(expected.colours(), got.colours(),
                                    [](Rgb8 x, Rgb8 y) { return colours_differ(x, y, 4); }));
    }
    report.check(prefix + "raycast/pixels", different.value(), limit.view_share, timer.ms());
    const double hits = share_of_pixels(got.depth(), got.depth(), [](float x, float) { return x > 0; });
    report.check(prefix + "raycast/empty", 1 - hits, 0.5, timer.ms());
  }

  void mesh(const std::string& prefix, const Tolerance& limit, Report& report) {
    MeshSums expected, got;
    reference_.extract_mesh(expected);
    Timer timer;
    timer.start();
    const Status status = candidate_.extract_mesh(got);
    timer.stop();
    report.check(prefix + "extract/size", status == Status::ok ? expected.difference(got) : HUGE_VAL,
                 limit.mesh_share, timer.ms());
    report.check(prefix + "extract/centre_m", expected.centre_distance_m(got), limit.mesh_m, timer.ms());
  }

  Engine& reference_;
  Engine& candidate_;
  const Scene& scene_;
  Se3 T_;
  Worst depth_m_, colour_, mask_, masked_, blocks_;
  PoseDifference track_, refine_;
  Timer prepare_timer_, track_timer_, mask_timer_, refine_timer_, integrate_timer_;
};

}  // namespace

void check_steps(const NamedEngine& reference, const NamedEngine& candidate, const Scene& scene,
                 Report& report) {
  const EngineParams params = params_for(scene);
  const std::unique_ptr<Engine> expected = reference.make(params), got = candidate.make(params);
  const std::string prefix = candidate.name + "/" + scene.name + "/";
  if (!expected || !got) {
    report.failed(prefix + "steps", "the engine cannot be made; is there enough memory?");
    return;
  }
  StepComparison comparison(*expected, *got, scene);
  for (size_t i = 0; i < std::min(kStepFrames, scene.frames.size()); ++i) comparison.frame(i);
  comparison.report(prefix, candidate.tolerance, report);
}

Trajectory run_whole(const NamedEngine& engine, const Scene& scene) {
  Trajectory run;
  const std::unique_ptr<Engine> made = engine.make(params_for(scene));
  if (!made) return run;
  Timer timer;
  Se3 T;
  for (size_t i = 0; i < scene.frames.size(); ++i) {
    timer.start();
    made->prepare(scene.view(i));
    if (i > 0) {
      T = made->track(T).T_world_cam;
      made->mask(T);
      T = made->refine(T).T_world_cam;
    }
    made->integrate(T);
    timer.stop();
    run.T_first_cam.push_back(T);
  }
  run.ms = timer.ms();
  return run;
}

void check_whole(const NamedEngine& reference, const NamedEngine* candidate, const Scene& scene,
                 const Trajectory& reference_run, double truth_limit_m, Report& report) {
  const NamedEngine& engine = candidate ? *candidate : reference;
  const std::string name = engine.name + "/" + scene.name + "/whole/";
  const Trajectory run = candidate ? run_whole(*candidate, scene) : reference_run;
  if (run.T_first_cam.empty() || reference_run.T_first_cam.empty()) {
    report.failed(name, "the engine cannot be made; is there enough memory?");
    return;
  }
  Worst to_truth, to_reference;
  for (size_t i = 0; i < run.T_first_cam.size(); ++i) {
    const Vec3d at = cast<double>(run.T_first_cam[i]).translation;
    to_truth.add(norm(at - scene.frames[i].T_first_cam.translation));
    to_reference.add(norm(at - cast<double>(reference_run.T_first_cam[i]).translation));
  }
  report.check(name + "truth_m", to_truth.value(), truth_limit_m, run.ms);
  if (candidate)
    report.check(name + "reference_m", to_reference.value(), engine.tolerance.trajectory_m, run.ms);
}

}  // namespace stillmap::parity
