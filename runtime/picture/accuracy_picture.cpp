#include "runtime/picture/accuracy_picture.hpp"

#include <algorithm>
#include <cmath>

#include <fmt/format.h>

#include "runtime/evaluate/accuracy_table.hpp"
#include "runtime/picture/painters.hpp"
#include "runtime/picture/plot.hpp"

namespace stillmap {
namespace {

constexpr double kHeight_px = 640, kNames_px = 190, kLeft_px = 90, kTop_px = 90, kRight_px = 20;
constexpr Colour kBarColours[] = {
    kEstimateColour, {0.72, 0.72, 0.76, 1}, {0.35, 0.70, 0.45, 1}, {0.95, 0.75, 0.35, 1}};

Colour bar_colour(size_t preset) {
  return kBarColours[preset % std::size(kBarColours)];
}

/// One group of bars: a scene.
struct Group {
  std::string scene, twin;
};

const AccuracySummary* find(const std::vector<AccuracySummary>& all, const std::string& scene,
                            const std::string& preset) {
  for (const AccuracySummary& s : all)
    if (s.scene == scene && s.preset == preset) return &s;
  return nullptr;
}

/// Scenes that are not just another's twin.
std::vector<Group> groups_of(const std::vector<AccuracyRun>& runs) {
  const auto is_twin = [&](const std::string& scene) {
    return std::any_of(runs.begin(), runs.end(), [&](const AccuracyRun& run) { return run.twin == scene; });
  };
  std::vector<Group> groups;
  for (const AccuracyRun& run : runs) {
    const auto same = [&](const Group& g) { return g.scene == run.scene; };
    if (!is_twin(run.scene) && std::none_of(groups.begin(), groups.end(), same))
      groups.push_back({run.scene, run.twin});
  }
  return groups;
}

/// Bars with values on an axis that may be logarithmic: errors of both presets differ a hundredfold.
class BarChart {
 public:
  BarChart(const std::string& title, double low, double high, bool logarithmic, size_t groups)
      : canvas_(kPageWidth_px, static_cast<int>(kHeight_px)),
        low_(low),
        high_(high),
        logarithmic_(logarithmic),
        inner_{kLeft_px, kTop_px, kPageWidth_px - kLeft_px - kRight_px, kHeight_px - kTop_px - kNames_px},
        group_px_(inner_.width / static_cast<double>(std::max<size_t>(groups, 1))) {
    canvas_.text({20, 32}, title, {19, Align::left, true});
  }

  double y_of(double value) const {
    const double at = logarithmic_ ? std::log(std::max(value, low_) / low_) / std::log(high_ / low_)
                                   : (value - low_) / (high_ - low_);
    return inner_.y + inner_.height * (1 - std::clamp(at, 0.0, 1.0));
  }

  void tick(double value, const std::string& label) {
    const double y = y_of(value);
    canvas_.line({{inner_.x, y}, {inner_.x + inner_.width, y}}, kGrid, 1);
    canvas_.text({inner_.x - 8, y + 5}, label, {14, Align::right});
  }

  void name(size_t group, const std::string& name) {
    TextStyle style = {14, Align::right};
    style.upright = true;
    const double x = inner_.x + (static_cast<double>(group) + 0.5) * group_px_;
    canvas_.text({x + 5, inner_.y + inner_.height + 10}, name, style);
  }

  /// @param value, worst NaN: no bar, no whisker  @param mark a line across the bar, NaN: none
  void bar(size_t group, size_t index, size_t count, double value, double worst, double mark) {
    const double width = 0.8 * group_px_ / static_cast<double>(count);
    const double x =
        inner_.x + (static_cast<double>(group) + 0.1) * group_px_ + static_cast<double>(index) * width;
    const double bottom = inner_.y + inner_.height;
    if (!std::isnan(value))
      canvas_.fill({x, y_of(value), width - 2, bottom - y_of(value)}, bar_colour(index));
    if (!std::isnan(worst) && !std::isnan(value)) {
      const double middle = x + 0.5 * width - 1;
      canvas_.line({{middle, y_of(value)}, {middle, y_of(worst)}}, kInk, 1.5);
    }
    if (!std::isnan(mark)) canvas_.line({{x - 1, y_of(mark)}, {x + width - 1, y_of(mark)}}, kAccent, 3);
  }

  void limit(double value) {
    const double y = y_of(value);
    canvas_.line({{inner_.x, y}, {inner_.x + inner_.width, y}}, kInk, 1.5, true);
  }

  void legend(const std::vector<LegendItem>& items) {
    Point at = {inner_.x, inner_.y - 22};
    for (const LegendItem& item : items) {
      if (item.mark == Mark::box) canvas_.fill({at.x, at.y - 6, 26, 12}, item.colour);
      if (item.mark != Mark::box)
        canvas_.line({{at.x, at.y}, {at.x + 26, at.y}}, item.colour, item.mark == Mark::dashed ? 1.5 : 3,
                     item.mark == Mark::dashed);
      canvas_.text({at.x + 34, at.y + 5}, item.name, {14});
      at.x += 58 + canvas_.text_width(item.name, 14);
    }
  }

  Result<Done> write(const std::string& path) {
    canvas_.outline(inner_, {0.55, 0.55, 0.58, 1}, 1);
    return canvas_.write_png(path);
  }

 private:
  Canvas canvas_;
  double low_, high_;
  bool logarithmic_;
  Rect inner_;
  double group_px_;
};

std::vector<LegendItem> preset_legend(const std::vector<std::string>& presets) {
  std::vector<LegendItem> items;
  for (size_t i = 0; i < presets.size(); ++i) items.push_back({presets[i], bar_colour(i), Mark::box});
  return items;
}

Result<Done> write_ate(const std::string& path, const std::vector<AccuracyRun>& runs,
                       const std::vector<AccuracySummary>& summaries) {
  const std::vector<Group> groups = groups_of(runs);
  const std::vector<std::string> presets = presets_of(runs);
  double highest_cm = 1;
  for (const AccuracySummary& s : summaries)
    if (!std::isnan(s.worst.ate_rmse_m)) highest_cm = std::max(highest_cm, 100 * s.worst.ate_rmse_m);
  const double top_cm = std::pow(10, std::ceil(std::log10(1.01 * highest_cm)));
  BarChart chart("ATE RMSE of each scene [cm], logarithmic", 0.05, top_cm, true, groups.size());
  for (double decade = 0.01; decade < 1.01 * top_cm; decade *= 10)
    for (const double step : {1, 2, 5})
      if (step * decade >= 0.05 && step * decade < 1.01 * top_cm)
        chart.tick(step * decade, fmt::format("{:g}", step * decade));
  for (size_t g = 0; g < groups.size(); ++g) {
    chart.name(g, groups[g].scene);
    for (size_t p = 0; p < presets.size(); ++p) {
      const AccuracySummary* s = find(summaries, groups[g].scene, presets[p]);
      const AccuracySummary* twin = find(summaries, groups[g].twin, presets[p]);
      const double none = kUnknown;
      chart.bar(g, p, presets.size(), s ? 100 * s->median.ate_rmse_m : none,
                s && s->runs > 1 ? 100 * s->worst.ate_rmse_m : none,
                twin ? 100 * twin->median.ate_rmse_m : none);
    }
  }
  std::vector<LegendItem> items = preset_legend(presets);
  items.push_back({"static twin", kAccent, Mark::line});
  chart.legend(items);
  return chart.write(path);
}

Result<Done> write_iou(const std::string& path, const std::vector<AccuracyRun>& runs,
                       const std::vector<AccuracySummary>& summaries) {
  std::vector<Group> groups = groups_of(runs);
  std::erase_if(groups, [](const Group& g) { return g.twin.empty(); });
  if (groups.empty()) return Done{};
  const std::vector<std::string> presets = presets_of(runs);
  BarChart chart("Mask against truth: mean intersection over union of each scene [%]", 0, 100, false,
                 groups.size());
  for (int percent = 0; percent <= 100; percent += 20) chart.tick(percent, fmt::format("{}", percent));
  for (size_t g = 0; g < groups.size(); ++g) {
    chart.name(g, groups[g].scene);
    for (size_t p = 0; p < presets.size(); ++p) {
      const AccuracySummary* s = find(summaries, groups[g].scene, presets[p]);
      const double none = kUnknown;
      chart.bar(g, p, presets.size(), s ? 100 * s->median.mask_iou : none,
                s && s->runs > 1 ? 100 * s->worst.mask_iou : none, none);
    }
  }
  chart.limit(85);
  std::vector<LegendItem> items = preset_legend(presets);
  items.push_back({"bar: 85 %", kInk, Mark::dashed});
  chart.legend(items);
  return chart.write(path);
}

}  // namespace

Result<Done> write_accuracy_pictures(const std::string& dir, const std::vector<AccuracyRun>& runs) {
  const std::vector<AccuracySummary> summaries = summarise(runs);
  if (auto done = write_ate(dir + "/ate.png", runs, summaries); !done) return done;
  return write_iou(dir + "/mask_iou.png", runs, summaries);
}

}  // namespace stillmap
