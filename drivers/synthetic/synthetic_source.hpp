#pragma once

// `synthetic:SCENE`: a rendered room with exact truth and the noise of a structured-light camera. Needs
// nothing but a compiler.

#include <memory>
#include <string>
#include <vector>

#include "config/result.hpp"
#include "runtime/ports/frame_source.hpp"

namespace stillmap {

/// Makes a source from what follows "synthetic:", SCENE[,seed=N][,size=WxH][,seconds=S][,odometry=0|1|slip].
/// SCENE-static is the scene's twin: same camera path and noise, nothing that ever moves. Defaults: seed 1,
/// 640x480, the scene's own length (10 s or more), 30 frames a second, depth 1/5000 m. Sizes 64x48 to
/// 1920x1080; the lens is the Xtion's (fx = fy = 525 at 640 columns, no distortion). The same spec gives the
/// same bytes, with any number of threads. Past a scene's own length people go on walking and boxes stay
/// where they are. Frames carry truth_T_world_cam and, where the caller gives memory for it, truth_mask: 255
/// where the visible surface moves; a carried box is dynamic until it rests, a hand on the lens is the whole
/// view (in twins as well). World: z up, origin on the floor, metres. `odometry=1` adds noisy odometry of a
/// body that carries the camera level (see odometry.hpp), `odometry=slip` wheels that slip at times. An error
/// of `next` is answered with bad_data: the caller's images have another size than the source.
/// @param threads 1..64 render a frame, the caller of `next` included
/// @return an error that lists the valid scenes or options   @thread boot
Result<std::unique_ptr<FrameSource>> open_synthetic(const std::string& spec, int threads = 2);

/// The scenes, without their "-static" twins.
std::vector<std::string> synthetic_scene_names();

/// Something moves in this scene, so that its "-static" twin is another one. False for names of no scene.
bool synthetic_scene_moves(const std::string& name);

/// Much of this scene cannot be measured, so that movers stay in its map unless depth.invalid = complete; its
/// frames come with a reading of a sonar. False for names of no scene.
bool synthetic_scene_wants_completion(const std::string& name);

}  // namespace stillmap
