#pragma once

// Shaded views of a mesh: a z-buffer and triangles, nothing more.

#include <optional>

#include "kernels/base/se3.hpp"
#include "runtime/evaluate/ply_reader.hpp"
#include "runtime/picture/canvas.hpp"

namespace stillmap {

/// Where a view stands. Optical frame: x right, y down, z into the picture.
struct ViewPoint {
  Se3 T_view_map;
  bool perspective = false;
  float scale_px = 100;  ///< pixels a metre, or focal length in pixels when perspective
  Point offset_px;       ///< from the middle of the picture
  float near_m = 0.05f;  ///< perspective: what is nearer is not drawn

  /// Pixel from the middle of the picture; nothing when it lies before `near_m` of a perspective view.
  std::optional<Point> project(Vec3 p_map) const;
};

/// Faces seen from behind are left out, so ceilings and near walls do not hide the room. Without faces,
/// vertices are drawn as points. Colours from the vertices (grey where there are none), lit from the view.
/// test: rasterise_test
/// @param keep null, or says of a face's middle whether it is drawn
Picture rasterise(const PlyMesh& mesh, const ViewPoint& view, int32_t width_px, int32_t height_px,
                  Rgb8 background, const std::function<bool(Vec3)>& keep = {});

/// Half the size, each pixel the mean of four.
Picture halved(const Picture& picture);

}  // namespace stillmap
