#include <algorithm>
#include <cmath>

#include <fmt/format.h>

#include "runtime/picture/painters.hpp"
#include "runtime/picture/plot.hpp"
#include "runtime/picture/run_data.hpp"

namespace stillmap {
namespace {

constexpr double kHeight_px = 560, kHead_px = 44;
constexpr std::size_t kMaxBins = 1000;  // about one a pixel
constexpr std::array<Colour, kStages> kStageColours = {{{0.55, 0.75, 0.90, 1},
                                                        {0.20, 0.50, 0.80, 1},
                                                        {0.90, 0.45, 0.40, 1},
                                                        {0.35, 0.70, 0.45, 1},
                                                        {0.95, 0.75, 0.35, 1}}};

/// Smallest value that at least `share` of the sorted values do not exceed.
double quantile(const std::vector<double>& sorted, double share) {
  const double rank = std::ceil(share * static_cast<double>(sorted.size())) - 1;
  return sorted[std::min(static_cast<std::size_t>(std::max(rank, 0.0)), sorted.size() - 1)];
}

/// Means over runs of equal length, so that an hour fits the page.
std::vector<TimingRow> binned(const std::vector<TimingRow>& rows, std::size_t per_bin) {
  std::vector<TimingRow> bins;
  for (std::size_t begin = 0; begin < rows.size(); begin += per_bin) {
    const std::size_t end = std::min(begin + per_bin, rows.size());
    const double n = static_cast<double>(end - begin);
    TimingRow mean;
    for (std::size_t i = begin; i < end; ++i) {
      for (std::size_t s = 0; s < kStages; ++s) mean.stage_ms[s] += rows[i].stage_ms[s] / n;
      mean.total_ms += rows[i].total_ms / n;
    }
    bins.push_back(mean);
  }
  return bins;
}

void draw_stages(Plot& plot, const std::vector<TimingRow>& bins, double frames_per_bin) {
  // Steps rather than slopes: one frame is one block, also when there is only one.
  std::vector<Point> low, total;
  for (std::size_t i = 0; i < bins.size(); ++i)
    for (std::size_t edge = i; edge <= i + 1; ++edge) {
      const double frame = frames_per_bin * static_cast<double>(edge);
      low.push_back({frame, 0});
      total.push_back({frame, bins[i].total_ms});
    }
  for (std::size_t s = 0; s < kStages; ++s) {
    std::vector<Point> high = low;
    for (std::size_t i = 0; i < bins.size(); ++i)
      for (std::size_t edge = 0; edge < 2; ++edge) high[2 * i + edge].y += bins[i].stage_ms[s];
    plot.area(low, high, kStageColours[s]);
    low = std::move(high);
  }
  plot.line(total, kInk, 1);
}

}  // namespace

Painted paint_timing(const RunInputs& inputs) {
  const std::string path = inputs.path("timing.csv");
  if (!have_file(path)) return Missing{path + " is not there"};
  const Result<std::vector<TimingRow>> rows = read_timing(path);
  if (!rows) return Error{rows.error()};
  if (rows->empty()) return Missing{path + " holds no frame"};
  std::vector<double> totals;
  for (const TimingRow& row : *rows) totals.push_back(row.total_ms);
  std::sort(totals.begin(), totals.end());
  const double p50 = quantile(totals, 0.5), p95 = quantile(totals, 0.95), p99 = quantile(totals, 0.99);
  const double top_ms = std::max({1.15 * p99, 1.2 * p50, 1e-3});
  const std::size_t per_bin = (rows->size() + kMaxBins - 1) / kMaxBins;
  Canvas canvas(kPageWidth_px, static_cast<int>(kHeight_px));
  canvas.text({20, 32},
              fmt::format("Time a frame: median {:.1f} ms, p95 {:.1f} ms, p99 {:.1f} ms, max {:.1f} ms{}",
                          p50, p95, p99, totals.back(), totals.back() > top_ms ? " (beyond the axis)" : ""),
              {20, Align::left, true});
  std::string x_label = fmt::format("frame (of {})", rows->size());
  if (per_bin > 1) x_label += fmt::format(", means of {}", per_bin);
  Plot plot(canvas, {0, kHead_px, kPageWidth_px, kHeight_px - kHead_px},
            {0, static_cast<double>(rows->size())}, {0, top_ms}, {"", x_label, "time [ms]"});
  draw_stages(plot, binned(*rows, per_bin), static_cast<double>(per_bin));
  plot.line({{0, p50}, {static_cast<double>(rows->size()), p50}}, kAccent, 1.5, true);
  std::vector<LegendItem> legend = {{"total", kInk}, {"median", kAccent, Mark::dashed}};
  for (std::size_t s = kStages; s-- > 0;) legend.push_back({kStageNames[s], kStageColours[s], Mark::box});
  plot.legend_above(legend);
  return canvas;
}

}  // namespace stillmap
