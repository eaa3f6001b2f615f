#include "runtime/evaluate/accuracy_bars.hpp"

#include <algorithm>
#include <cmath>
#include <functional>
#include <initializer_list>
#include <map>
#include <string_view>

namespace stillmap {
namespace {

/// One value against one limit; `excess` above 0 misses the bar.
struct Case {
  std::string scene;
  double value = kUnknown, limit = kUnknown, excess = kUnknown;
};

Case at_most(const std::string& scene, double value, double limit) {
  return {scene, value, limit, value - limit};
}
Case at_least(const std::string& scene, double value, double limit) {
  return {scene, value, limit, limit - value};
}

/// "crowd" of "crowd,size=320x240".
std::string_view bare(const std::string& scene) {
  return std::string_view(scene).substr(0, std::min(scene.find(','), scene.size()));
}

bool one_of(const std::string& scene, std::initializer_list<std::string_view> names) {
  return std::find(names.begin(), names.end(), bare(scene)) != names.end();
}

/// Scenes in which nothing can be tracked for a while: to be lost there is right.
bool may_be_lost(const std::string& scene) {
  return one_of(scene, {"covered", "camera_kidnapped", "covered-static", "camera_kidnapped-static"});
}

class Judge {
 public:
  Judge(const std::vector<AccuracyRun>& runs, const std::string& preset, const std::string& yardstick)
      : runs_(runs), preset_(preset), yardstick_(yardstick) {}

  std::vector<Bar> all() {
    movers();
    still_scenes();
    recordings();
    losses();
    masks();
    meshes();
    calibration();
    drift();
    time();
    return std::move(bars_);
  }

 private:
  using Filter = std::function<bool(const AccuracyRun&)>;
  using Measure = std::function<Case(const AccuracyRun&)>;

  const AccuracyRun* find(const std::string& scene, const std::string& preset, uint64_t seed) const {
    for (const AccuracyRun& run : runs_)
      if (run.scene == scene && run.preset == preset && run.seed == seed) return &run;
    return nullptr;
  }
  double figure(const AccuracyRun* run, double AccuracyFigures::*member) const {
    return run ? run->figures.*member : kUnknown;
  }
  double yardstick(const AccuracyRun& run, double AccuracyFigures::*member) const {
    return figure(find(run.scene, yardstick_, run.seed), member);
  }

  /// Cases of one bar: each run of the preset that `filter` lets through. What nobody can measure is left
  /// out, what failed counts as missed.
  std::vector<Case> cases_of(const Filter& filter, const Measure& measure) const {
    std::vector<Case> cases;
    for (const AccuracyRun& run : runs_) {
      if (run.preset != preset_ || !filter(run)) continue;
      Case c = run.error.empty() ? measure(run) : Case{run.scene, kUnknown, kUnknown, HUGE_VAL};
      if (!std::isnan(c.excess)) cases.push_back(std::move(c));
    }
    return cases;
  }

  void add(const std::string& what, const std::string& unit, double scale, const std::vector<Case>& cases) {
    Bar bar{what, unit, Verdict::unknown, static_cast<uint32_t>(cases.size()), {}, kUnknown, kUnknown};
    if (!cases.empty()) {
      const Case& worst = *std::max_element(cases.begin(), cases.end(),
                                            [](const Case& a, const Case& b) { return a.excess < b.excess; });
      bar.scene = worst.scene;
      bar.value = scale * worst.value;
      bar.limit = scale * worst.limit;
      bar.verdict = worst.excess <= 0     ? Verdict::passed
                    : medians_hold(cases) ? Verdict::median_only
                                          : Verdict::failed;
    }
    bars_.push_back(std::move(bar));
  }

  static bool medians_hold(const std::vector<Case>& cases) {
    std::map<std::string, std::vector<double>> scenes;
    for (const Case& c : cases) scenes[c.scene].push_back(c.excess);
    return std::all_of(scenes.begin(), scenes.end(),
                       [](const auto& scene) { return median_of(scene.second) <= 0; });
  }

  /// One case a seed, from all runs of it together.
  std::vector<Case> pooled(const std::function<Case(const std::vector<const AccuracyRun*>&)>& measure) const {
    std::map<uint64_t, std::vector<const AccuracyRun*>> seeds;
    for (const AccuracyRun& run : runs_)
      if (run.preset == preset_ && run.synthetic) seeds[run.seed].push_back(&run);
    std::vector<Case> cases;
    for (const auto& [seed, runs] : seeds) {
      Case c = measure(runs);
      c.scene = "all";
      if (!std::isnan(c.excess)) cases.push_back(std::move(c));
    }
    return cases;
  }

  /// Sum of one count over that of another, where both are known.
  static double share(const std::vector<const AccuracyRun*>& runs, double AccuracyFigures::*part,
                      double AccuracyFigures::*all) {
    double parts = 0, alls = 0;
    for (const AccuracyRun* run : runs) {
      if (std::isnan(run->figures.*part) || std::isnan(run->figures.*all)) continue;
      parts += run->figures.*part;
      alls += run->figures.*all;
    }
    return alls > 0 ? parts / alls : kUnknown;
  }

  /// Geometric mean over runs of this preset's figure over the yardstick's.
  double ratio_to_yardstick(const std::vector<const AccuracyRun*>& runs, double AccuracyFigures::*member,
                            bool dynamic_only) const {
    double sum = 0;
    int count = 0;
    for (const AccuracyRun* run : runs) {
      if (dynamic_only && !run->dynamic()) continue;
      const double log_ratio = std::log(run->figures.*member / yardstick(*run, member));
      if (std::isnan(log_ratio)) continue;
      sum += log_ratio;
      ++count;
    }
    return count > 0 ? std::exp(sum / count) : kUnknown;
  }

  static bool synthetic(const AccuracyRun& run) { return run.synthetic; }
  static bool dynamic(const AccuracyRun& run) { return run.dynamic(); }
  /// ATE takes in the poses of lost frames, which are guesses.
  static bool still(const AccuracyRun& run) {
    return run.synthetic && !run.dynamic() && !may_be_lost(run.scene);
  }

  void movers() {
    add("dynamic scenes: ATE at most 1.3 times the static twin's plus 0.3 cm", "cm", 100,
        cases_of(dynamic, [&](const AccuracyRun& run) {
          const double twin_m = figure(find(run.twin, preset_, run.seed), &AccuracyFigures::ate_rmse_m);
          return at_most(run.scene, run.figures.ate_rmse_m, 1.3 * twin_m + 0.003);
        }));
    add("crowd_close, obstructing_box, placing_obstructing_box: ATE at most 3 cm", "cm", 100,
        cases_of(
            [](const AccuracyRun& run) {
              return one_of(run.scene, {"crowd_close", "obstructing_box", "placing_obstructing_box"});
            },
            [](const AccuracyRun& run) { return at_most(run.scene, run.figures.ate_rmse_m, 0.03); }));
    add("dynamic scenes: geometric mean of ATE at most a third of the yardstick's", "", 1,
        pooled([&](const auto& runs) {
          return at_most("", ratio_to_yardstick(runs, &AccuracyFigures::ate_rmse_m, true), 1.0 / 3.0);
        }));
  }

  void still_scenes() {
    add("static scenes: ATE at most 1.05 times the yardstick's, or 1 mm more", "cm", 100,
        cases_of(still, [&](const AccuracyRun& run) {
          const double other_m = yardstick(run, &AccuracyFigures::ate_rmse_m);
          return at_most(run.scene, run.figures.ate_rmse_m, std::max(1.05 * other_m, other_m + 0.001));
        }));
    add("static scenes: ATE under 0.8 cm", "cm", 100, cases_of(still, [](const AccuracyRun& run) {
          return at_most(run.scene, run.figures.ate_rmse_m, 0.008);
        }));
  }

  void recordings() {
    add("kitchen_walkers: ATE at most 1.3 times that of kitchen_clip@10+200", "cm", 100,
        cases_of([](const AccuracyRun& run) { return run.scene == "kitchen_walkers"; },
                 [&](const AccuracyRun& run) {
                   const double clip_m =
                       figure(find("kitchen_clip@10+200", preset_, run.seed), &AccuracyFigures::ate_rmse_m);
                   return at_most(run.scene, run.figures.ate_rmse_m, 1.3 * clip_m);
                 }));
    add("kitchen_clip, rpy_clip: ATE no worse than the yardstick's", "cm", 100,
        cases_of(
            [](const AccuracyRun& run) {
              return one_of(run.scene, {"kitchen_clip", "rpy_clip"});
            },
            [&](const AccuracyRun& run) {
              return at_most(run.scene, run.figures.ate_rmse_m, yardstick(run, &AccuracyFigures::ate_rmse_m));
            }));
    add("rpy_clip: ATE under 3.9 cm", "cm", 100,
        cases_of([](const AccuracyRun& run) { return run.scene == "rpy_clip"; },
                 [](const AccuracyRun& run) { return at_most(run.scene, run.figures.ate_rmse_m, 0.039); }));
  }

  void losses() {
    add("no undeclared loss", "frames", 1, cases_of(synthetic, [](const AccuracyRun& run) {
          return at_most(run.scene, run.figures.undeclared_loss, 0);
        }));
    add("no declared loss where 25 % of the valid pixels stand still", "frames", 1,
        cases_of([](const AccuracyRun& run) { return run.synthetic && !may_be_lost(run.scene); },
                 [](const AccuracyRun& run) { return at_most(run.scene, run.figures.declared_loss, 0); }));
  }

  void masks() {
    add("masks: intersection over union at least 85 % in each scene", "%", 100,
        cases_of(dynamic,
                 [](const AccuracyRun& run) { return at_least(run.scene, run.figures.mask_iou, 0.85); }));
    add("masks: intersection over union at least 85 % on average over the scenes", "%", 100,
        pooled([](const auto& runs) {
          double sum = 0;
          int count = 0;
          for (const AccuracyRun* run : runs) {
            if (std::isnan(run->figures.mask_iou)) continue;
            sum += run->figures.mask_iou;
            ++count;
          }
          return at_least("", count > 0 ? sum / count : kUnknown, 0.85);
        }));
    add("masks: at most 1 % of the static pixels masked", "%", 100,
        cases_of(synthetic,
                 [](const AccuracyRun& run) { return at_most(run.scene, run.figures.static_masked, 0.01); }));
  }

  void meshes() {
    add("mesh: at most 0.3 % of the vertices farther than 10 cm from the true static surface", "%", 100,
        cases_of(synthetic,
                 [](const AccuracyRun& run) { return at_most(run.scene, run.figures.ghosts, 0.003); }));
    add("mesh: at least 90 % of the surface seen for a second is there within 2 cm", "%", 100,
        cases_of(synthetic,
                 [](const AccuracyRun& run) { return at_least(run.scene, run.figures.completeness, 0.9); }));
  }

  void calibration() {
    add("at least 99.5 % of the poses called good are within 5 cm and 3 degrees", "%", 100,
        pooled([](const auto& runs) {
          return at_least("", 1 - share(runs, &AccuracyFigures::good_off, &AccuracyFigures::good), 0.995);
        }));
    add("at least 97 % of the frames with 25 % static valid pixels are called good", "%", 100,
        pooled([](std::vector<const AccuracyRun*> runs) {
          std::erase_if(runs, [](const AccuracyRun* run) { return may_be_lost(run->scene); });
          return at_least("", share(runs, &AccuracyFigures::in_view_good, &AccuracyFigures::in_view), 0.97);
        }));
    const auto inside = [](const auto& runs) {
      return share(runs, &AccuracyFigures::chi2_inside, &AccuracyFigures::chi2_frames);
    };
    add("covariance: at least 85 % inside the 95 % bound of chi-square", "%", 100,
        pooled([&](const auto& runs) { return at_least("", inside(runs), 0.85); }));
    add("covariance: at most 99 % inside the 95 % bound of chi-square", "%", 100,
        pooled([&](const auto& runs) { return at_most("", inside(runs), 0.99); }));
  }

  void drift() {
    add("long_loop: error of the last pose at most 0.5 % of the path", "%", 100,
        cases_of([](const AccuracyRun& run) { return one_of(run.scene, {"long_loop"}); },
                 [](const AccuracyRun& run) {
                   return at_most(run.scene, run.figures.end_error_m / run.figures.path_m, 0.005);
                 }));
  }

  void time() {
    add("time of a frame (median), geometric mean over the scenes: at most 4/3 of the yardstick's", "", 1,
        pooled([&](const auto& runs) {
          return at_most("", ratio_to_yardstick(runs, &AccuracyFigures::total_ms_p50, false), 4.0 / 3.0);
        }));
  }

  const std::vector<AccuracyRun>& runs_;
  const std::string& preset_;
  const std::string& yardstick_;
  std::vector<Bar> bars_;
};

}  // namespace

const char* to_string(Verdict verdict) {
  switch (verdict) {
    case Verdict::passed:
      return "passed";
    case Verdict::median_only:
      return "median only";
    case Verdict::failed:
      return "FAILED";
    case Verdict::unknown:
      return "not measured";
  }
  return "unknown";
}

std::vector<Bar> judge(const std::vector<AccuracyRun>& runs, const std::string& preset,
                       const std::string& yardstick) {
  return Judge(runs, preset, yardstick).all();
}

double dynamic_mean_m(const std::vector<AccuracyRun>& runs, const std::string& preset) {
  double sum = 0;
  int count = 0;
  std::vector<AccuracyRun> moving;
  std::copy_if(runs.begin(), runs.end(), std::back_inserter(moving),
               [&](const AccuracyRun& run) { return run.dynamic() && run.preset == preset; });
  for (const AccuracySummary& scene : summarise(moving)) {
    if (std::isnan(scene.median.ate_rmse_m)) continue;
    sum += std::log(scene.median.ate_rmse_m);
    ++count;
  }
  return count > 0 ? std::exp(sum / count) : kUnknown;
}

}  // namespace stillmap
