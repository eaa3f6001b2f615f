#include <fmt/format.h>

#include "runtime/evaluate/model.hpp"
#include "runtime/picture/painters.hpp"
#include "runtime/picture/plot.hpp"
#include "runtime/picture/run_data.hpp"

namespace stillmap {
namespace {

constexpr double kHeight_px = 600, kHead_px = 44;
constexpr Colour kPointColour = {0.55, 0.55, 0.60, 1};
constexpr Colour kGhostColour = {0.6, 0.2, 0.2, 0.7};
constexpr uint64_t kMaxVertices = 300'000;  // a curve to the eye needs no more

std::vector<Point> curve(const DistanceSummary& summary) {
  std::vector<Point> points;
  for (std::size_t i = 0; i < summary.curve.size(); ++i)
    points.push_back({100 * kCurveStep_m * static_cast<double>(i), 100 * summary.curve[i]});
  return points;
}

}  // namespace

Painted paint_cumulative(const RunInputs& inputs) {
  for (const char* name : {"mesh.ply", "truth_cloud.ply"})
    if (!have_file(inputs.path(name))) return Missing{inputs.path(name) + " is not there"};
  ModelOptions options;
  options.max_vertices = kMaxVertices;
  const Result<ModelResult> model =
      evaluate_model(inputs.path("truth_cloud.ply"), inputs.path("mesh.ply"), options);
  if (!model) return Error{model.error()};
  Canvas canvas(kPageWidth_px, static_cast<int>(kHeight_px));
  const DistanceSummary& s = model->to_surface;
  canvas.text({20, 32},
              fmt::format("Mesh against truth: within 1 cm {:.1f} %, 2 cm {:.1f} %, 5 cm {:.1f} %; ghosts "
                          "(over 10 cm) {:.2f} %",
                          100 * s.within_1cm, 100 * s.within_2cm, 100 * s.within_5cm, 100 * s.ghosts),
              {19, Align::left, true});
  Plot plot(canvas, {0, kHead_px, kPageWidth_px, kHeight_px - kHead_px}, {0, 20}, {0, 102},
            {"", "distance to the true surface [cm]", "share of the mesh [%]"});
  plot.line({{10, 0}, {10, 102}}, kGhostColour, 1.2, true);
  plot.line(curve(model->to_point), kPointColour, 1.6, true);
  plot.line(curve(s), kEstimateColour, 2.5);
  plot.legend_above({{"to the surface (local plane of the truth)", kEstimateColour},
                     {"to the nearest point of the truth", kPointColour, Mark::dashed},
                     {"beyond: ghosts", kGhostColour, Mark::dashed}});
  return canvas;
}

}  // namespace stillmap
