#pragma once

// Every number of the method: default, unit, range, where the paper says it. The only place with such
// defaults. "ours" marks what the paper leaves open. config/ reads the `fields` lists to load, check,
// describe and write presets.

#include <cstdint>

namespace stillmap {

/// What a switch with names can say; the names are in `kNames` in the same order.
enum class InvalidDepth : uint8_t { ignore, complete };
enum class RobustKernel : uint8_t { huber, geman_mcclure };
enum class MaskMethod : uint8_t { residual, parts };
enum class FreeSpace : uint8_t { dense, hierarchical };
enum class MotionPrior : uint8_t { last_pose, constant_velocity, odometry };

/// Depth image to metres, paper III-E.
struct DepthParams {
  float min_m = 0.1f;
  float max_m = 5.0f;
  InvalidDepth invalid = InvalidDepth::ignore;
  int32_t complete_frames = 10;
  float far_m = 10.0f;
  int32_t min_valid_pixels = 3000;
  float noise_m = 0.001f;
  float noise_per_m2 = 0.0015f;
  float noise_lateral_px = 1.0f;

  template <class F>
  static void fields(F&& f) {
    using P = DepthParams;
    f("min_m", &P::min_m, 0.01, 10.0, "m", "ours", "nearer measurements are invalid");
    f("max_m", &P::max_m, 0.1, 20.0, "m", "ours",
      "farther measurements only make free space, up to integrate.free_max_m");
    f("invalid", &P::invalid, 0, 1, "ignore|complete", "III-E",
      "zeros are ignored, or filled from a temporary model");
    f("complete_frames", &P::complete_frames, 2, 60, "frames", "III-E, IV-A",
      "frames of the temporary model");
    f("far_m", &P::far_m, 0.1, 65.0, "m", "III-E",
      "what stays invalid after completion is taken to be so far away");
    f("min_valid_pixels", &P::min_valid_pixels, 10, 1e7, "pixels of 640x480", "ours",
      "with fewer (scaled to the image size) a frame neither moves the pose nor touches the map");
    f("noise_m", &P::noise_m, 0, 0.1, "m", "ours", "standard deviation of a measurement close by");
    f("noise_per_m2", &P::noise_per_m2, 0, 0.1, "1/m", "ours", "and its growth with the square of the depth");
    f("noise_lateral_px", &P::noise_lateral_px, 0, 10.0, "pixels of 640 columns", "ours",
      "standard deviation of where on the surface it was taken: matters at grazing angles and edges");
  }
};

/// Registration, paper III-B. Used by the first registration and, with the mask, by the second.
struct TrackParams {
  float colour_weight = 0.05f;
  RobustKernel kernel = RobustKernel::geman_mcclure;
  float huber_depth_m = 0.02f;
  float kernel_coarse_m = 0.06f;
  float kernel_middle_m = 0.03f;
  float kernel_fine_m = 0.015f;
  float kernel_sigmas = 2.0f;
  float trust_noise_m = 0.015f;
  float trust_area_m = 2.5f;
  float probation_trust = 0.5f;
  int32_t sample_cols = 320;
  int32_t first_finest_level = 1;
  int32_t levels = 3;
  int32_t iterations_coarse = 6;
  int32_t iterations_middle = 3;
  int32_t iterations_fine = 2;
  float damping_initial = 1e-4f;
  float damping_up = 10.0f;
  float damping_down = 0.1f;
  float converged_m = 1e-4f;
  float converged_rad = 1e-4f;
  float settled_m = 0.002f;
  float settled_rad = 0.002f;
  float settled_cost = 0.0003f;
  MotionPrior prior = MotionPrior::constant_velocity;
  float prior_point_m = 0.03f;
  float prior_gain = 0.5f;
  float prior_fade_s = 0.3f;
  float prior_forget = 0.1f;
  float prior_floor_m = 0.002f;
  float prior_floor_rad = 0.002f;
  float prior_reach_m = 0.3f;
  float prior_reach_rad = 0.3f;
  float second_start_drop = 0.05f;
  float lost_inlier_ratio = 0.2f;
  float poor_inlier_ratio = 0.4f;
  float inlier_m = 0.03f;
  float correlated_points = 140.0f;

  template <class F>
  static void fields(F&& f) {
    using P = TrackParams;
    f("colour_weight", &P::colour_weight, 0, 10.0, "1", "Tab. I, Eq. (4)",
      "w_c, weight of the intensity error (0..1 scale)");
    f("huber_depth_m", &P::huber_depth_m, 0, 1.0, "m", "ours",
      "Huber threshold on the depth residual; 0: squared error everywhere");
    f("kernel", &P::kernel, 0, 1, "huber|geman_mcclure", "ours",
      "huber: of the depth residual, scale huber_depth_m; geman_mcclure: of depth and intensity together, "
      "what does not fit has no pull");
    f("kernel_coarse_m", &P::kernel_coarse_m, 1e-3, 1.0, "m", "ours",
      "scale of geman_mcclure at the coarsest level, without noise");
    f("kernel_middle_m", &P::kernel_middle_m, 1e-3, 1.0, "m", "ours", "see kernel_coarse_m");
    f("kernel_fine_m", &P::kernel_fine_m, 1e-3, 1.0, "m", "ours", "see kernel_coarse_m");
    f("kernel_sigmas", &P::kernel_sigmas, 0, 10.0, "1", "ours",
      "and this many standard deviations of the depth are added to the scale");
    f("trust_noise_m", &P::trust_noise_m, 0, 1.0, "m", "ours",
      "a point weighs s^2 / (s^2 + variance along the normal); 0: noise changes no weight");
    f("trust_area_m", &P::trust_area_m, 0, 20.0, "m", "ours",
      "in the first registration nearer points weigh less, with the square of their depth, as the area that "
      "they cover, once the map is mask.reabsorb_s old; 0: off");
    f("probation_trust", &P::probation_trust, 0, 1.0, "1", "ours",
      "in the second registration, of what the map has seen too seldom for its mesh (map.mesh_min_surface)");
    f("sample_cols", &P::sample_cols, 0, 10000, "pixels", "ours",
      "every pixel is every 2nd or every 4th one of a row and of a column where a row has more; 0: all of "
      "them");
    f("first_finest_level", &P::first_finest_level, 0, 2, "level", "ours",
      "where the first registration ends: 0 every pixel, 1 every 2nd; the second one goes to 0");
    f("levels", &P::levels, 1, 3, "levels", "III-B", "coarse-to-fine sub-samplings, finest is every pixel");
    f("iterations_coarse", &P::iterations_coarse, 0, 100, "iterations", "ours", "at most, every 4th pixel");
    f("iterations_middle", &P::iterations_middle, 0, 100, "iterations", "ours", "at most, every 2nd pixel");
    f("iterations_fine", &P::iterations_fine, 0, 100, "iterations", "ours", "at most, every pixel");
    f("damping_initial", &P::damping_initial, 0, 1e3, "1", "ours",
      "Levenberg-Marquardt damping, relative to the diagonal");
    f("damping_up", &P::damping_up, 1.0, 1e3, "1", "ours", "factor after a rejected step");
    f("damping_down", &P::damping_down, 1e-3, 1.0, "1", "ours", "factor after an accepted step");
    f("converged_m", &P::converged_m, 0, 0.1, "m", "ours",
      "a level ends when a step translates and rotates less");
    f("converged_rad", &P::converged_rad, 0, 0.1, "rad", "ours", "see converged_m");
    f("settled_m", &P::settled_m, 0, 0.1, "m", "ours",
      "a shorter step that does not lower the cost ends its level, and the last one of a level is taken "
      "without another pass; 0: every step is judged");
    f("settled_rad", &P::settled_rad, 0, 0.1, "rad", "ours", "see settled_m");
    f("settled_cost", &P::settled_cost, 0, 1.0, "1", "ours",
      "share of the cost by which such a step may raise it and is taken all the same");
    f("prior", &P::prior, 0, 2, "last_pose|constant_velocity|odometry", "ours",
      "where the registration starts; odometry: constant velocity while it is stale");
    f("prior_point_m", &P::prior_point_m, 0, 1.0, "m", "ours",
      "the prior is worth so many points as this error of one goes into its variance; 0: it is only where "
      "the "
      "registration starts");
    f("prior_gain", &P::prior_gain, 0.01, 1.0, "1", "ours",
      "share of the newest motion in the velocity that is continued");
    f("prior_fade_s", &P::prior_fade_s, 0.01, 10.0, "s", "ours",
      "a continued velocity fades with this time constant: over a gap the prediction goes back to the last "
      "pose");
    f("prior_forget", &P::prior_forget, 0.001, 1.0, "a frame", "ours",
      "how fast past errors of the prediction leave its sigma");
    f("prior_floor_m", &P::prior_floor_m, 1e-4, 1.0, "m", "ours", "no sigma of the prediction is smaller");
    f("prior_floor_rad", &P::prior_floor_rad, 1e-4, 1.0, "rad", "ours", "see prior_floor_m");
    f("prior_reach_m", &P::prior_reach_m, 1e-3, 10.0, "m", "ours",
      "no sigma is larger, and no prediction farther from the last pose along an axis");
    f("prior_reach_rad", &P::prior_reach_rad, 1e-3, 3.0, "rad", "ours", "see prior_reach_m");
    f("second_start_drop", &P::second_start_drop, 0, 1.0, "share", "ours",
      "when so much less of the picture lies on the map than in the last frame, the registration is tried "
      "from the last pose as well; 1: never");
    f("lost_inlier_ratio", &P::lost_inlier_ratio, 0, 1.0, "1", "ours",
      "lost below this share of points within inlier_m of the map");
    f("poor_inlier_ratio", &P::poor_inlier_ratio, 0, 1.0, "1", "ours", "poor below this share");
    f("inlier_m", &P::inlier_m, 1e-3, 1.0, "m", "ours",
      "a point this near to the mapped surface is an inlier");
    f("correlated_points", &P::correlated_points, 1, 1e5, "points of 640x480", "ours",
      "so many points err together: the covariance of the pose is larger by this");
  }
};

/// Dynamics from residuals, paper III-C.
struct MaskParams {
  bool enabled = true;
  float gamma = 0.5f;
  float flood_depth_ratio = 0.007f;
  int32_t erode_px = 15;
  int32_t dilate_px = 10;
  MaskMethod method = MaskMethod::parts;
  float contradict_m = 0.05f;
  float contradict_sigmas = 2.0f;
  float share_on = 0.5f;
  float share_off = 0.25f;
  float moved_m = 0.004f;
  float moved_sigmas = 0.5f;
  float moved_usual = 5.0f;
  float moved_m2 = 0.03f;
  float part_concave_deg = 35.0f;
  float blob_m2 = 0.004f;
  float grow_m = 0.03f;
  bool warp = true;
  int32_t empty_looks = 1;
  float empty_s = 0.0f;
  float empty_reach_m = 0.0f;
  float drift = 0.001f;
  float reabsorb_s = 1.0f;

  template <class F>
  static void fields(F&& f) {
    using P = MaskParams;
    f("enabled", &P::enabled, 0, 1, "bool", "III-C", "false: everything is taken as static");
    f("gamma", &P::gamma, 0, 1.0, "1", "Tab. I, Eq. (5)", "a squared residual above gamma tau^2 is suspect");
    f("flood_depth_ratio", &P::flood_depth_ratio, 0, 0.1, "1", "Tab. I, Alg. 1",
      "theta, depth step to a neighbour over depth");
    f("erode_px", &P::erode_px, 0, 32, "pixels of 640 columns", "ours",
      "radius of the square erosion of the raw mask");
    f("dilate_px", &P::dilate_px, 0, 32, "pixels of 640 columns", "ours",
      "radius of the square dilation after the flood fill");
    f("method", &P::method, 0, 1, "residual|parts", "ours",
      "residual: the paper's; parts: decides for connected parts of the picture from all their points");
    f("contradict_m", &P::contradict_m, 0, 1.0, "m", "ours",
      "parts: a point contradicts the map when it is farther from its surface, without noise");
    f("contradict_sigmas", &P::contradict_sigmas, 0, 10.0, "1", "ours",
      "and this many standard deviations of the depth are added");
    f("share_on", &P::share_on, 0, 1.0, "share", "ours",
      "a part is dynamic when more of its known points contradict the map");
    f("share_off", &P::share_off, 0, 1.0, "share", "ours", "and when it was, it stays so while more do");
    f("moved_m", &P::moved_m, 0, 1.0, "m", "ours",
      "a part whose surface lies farther off than the motion of most of the space would have it is dynamic, "
      "without noise; 0: not looked at");
    f("moved_sigmas", &P::moved_sigmas, 0, 10.0, "1", "ours",
      "and this many standard deviations of the depth are added");
    f("moved_usual", &P::moved_usual, 0, 100.0, "1", "ours",
      "and never less than this many times what the parts of the picture usually lie off (median over the "
      "area)");
    f("moved_m2", &P::moved_m2, 0, 10.0, "m^2", "ours", "smaller parts are not asked whether they moved");
    f("part_concave_deg", &P::part_concave_deg, 1.0, 180.0, "degrees", "ours",
      "a concave edge with a larger bend parts the picture");
    f("blob_m2", &P::blob_m2, 0, 1.0, "m^2", "ours",
      "a connected area of contradicting points this large is dynamic by itself");
    f("grow_m", &P::grow_m, 0, 0.5, "m", "ours", "how far the mask grows beyond what was found");
    f("warp", &P::warp, 0, 1, "bool", "ours", "the last mask, carried into this frame, is the first guess");
    f("empty_looks", &P::empty_looks, 1, 255, "observations", "ours",
      "parts: space is reliably empty once it was seen free so often, at most integrate.weight_cap; what is "
      "in it sooner is unknown, not dynamic");
    f("empty_s", &P::empty_s, 0, 8.0, "s", "ours", "and for so long, at the rate of the frames");
    f("empty_reach_m", &P::empty_reach_m, 0, 0.5, "m", "ours",
      "and so were its six neighbours at this distance; 0: they are not asked");
    f("drift", &P::drift, 0, 0.1, "share", "ours",
      "parts: of how far the camera has been from where the map begins, at most 4 cm: so much a map may not "
      "fit itself, and what lies off it by no more has moved only if it did against earlier frames, too");
    f("reabsorb_s", &P::reabsorb_s, 0, 600.0, "s", "ours",
      "what contradicts the map but stood still in view for so long is static; 0: never");
  }
};

/// Fusion and free space, paper III-A and III-D.
struct IntegrateParams {
  int32_t weight_cap = 64;
  float free_max_m = 5.0f;
  bool free_space = true;
  bool through_movers = true;
  bool relearn = true;

  template <class F>
  static void fields(F&& f) {
    using P = IntegrateParams;
    f("weight_cap", &P::weight_cap, 1, 255, "observations", "ours", "the running mean forgets older ones");
    f("free_max_m", &P::free_max_m, 0.1, 20.0, "m", "III-D", "clipping plane of free space");
    f("free_space", &P::free_space, 0, 1, "bool", "III-D", "false: only the truncation band is mapped");
    f("through_movers", &P::through_movers, 0, 1, "bool", "ours",
      "what lies before a dynamic point is seen free, too; false: masked pixels change nothing (III-D)");
    f("relearn", &P::relearn, 0, 1, "bool", "ours",
      "what was there is soon forgotten where a static surface stands in free space or is seen through");
  }
};

/// The voxel map, paper III-A.
struct MapParams {
  float voxel_m = 0.01f;
  float truncation_m = 0.1f;
  FreeSpace free_space = FreeSpace::hierarchical;
  int32_t pool_blocks = 100000;
  float high_water = 0.98f;
  int32_t mesh_min_weight = 3;
  int32_t mesh_min_surface = 10;

  template <class F>
  static void fields(F&& f) {
    using P = MapParams;
    f("voxel_m", &P::voxel_m, 1e-3, 0.5, "m", "Tab. I", "edge of a voxel");
    f("truncation_m", &P::truncation_m, 4e-3, 2.0, "m", "Tab. I", "tau; at least 4 voxels");
    f("free_space", &P::free_space, 0, 1, "dense|hierarchical", "III-D",
      "the truncation distance in every free voxel, or free blocks and groups of blocks without voxels");
    f("pool_blocks", &P::pool_blocks, 1, 4000000, "blocks of 4 kB", "ours",
      "fixed at boot; the hash table has twice as many slots or more");
    f("high_water", &P::high_water, 0.1, 1.0, "share", "ours",
      "above this fill the blocks farthest from the camera are dropped");
    f("mesh_min_weight", &P::mesh_min_weight, 1, 255, "observations", "ours",
      "voxels seen less often do not make a mesh");
    f("mesh_min_surface", &P::mesh_min_surface, 0, 64, "observations", "ours",
      "nor do those on whose surface fewer measurements lay: what came into view is on probation");
  }
};

/// Finding a lost camera again in the known map.
struct RelocaliseParams {
  bool enabled = true;
  float blind_s = 0.2f;
  int32_t ferns = 512;
  int32_t max_keyframes = 256;
  float keyframe_similarity = 0.8f;
  float keyframe_m = 0.25f;
  float keyframe_deg = 12.0f;
  int32_t candidates = 16;
  int32_t tries = 4;
  int32_t confirm_frames = 2;
  float min_on = 0.25f;
  float max_through = 0.025f;
  float max_front = 0.75f;
  float max_unknown = 0.35f;
  float min_luma_correlation = 0.85f;
  float min_texture_correlation = 0.65f;
  float max_weakest_m = 0.07f;

  template <class F>
  static void fields(F&& f) {
    using P = RelocaliseParams;
    f("enabled", &P::enabled, 0, 1, "bool", "ours",
      "false: a lost camera is only tracked on from its last pose");
    f("blind_s", &P::blind_s, 0.03, 100, "s", "ours",
      "a longer stretch without a usable frame is a loss: the camera may be anywhere");
    f("ferns", &P::ferns, 32, 4096, "ferns", "ours", "of four tests each, the code of a keyframe");
    f("max_keyframes", &P::max_keyframes, 2, 4096, "keyframes", "ours",
      "fixed at boot; then the most redundant one is replaced");
    f("keyframe_similarity", &P::keyframe_similarity, 0, 1.0, "share", "ours",
      "a frame that shares fewer ferns with every keyframe becomes one");
    f("keyframe_m", &P::keyframe_m, 0.01, 10.0, "m", "ours",
      "or that was taken farther from all similar ones");
    f("keyframe_deg", &P::keyframe_deg, 1.0, 180.0, "degrees", "ours", "or turned farther");
    f("candidates", &P::candidates, 1, 64, "keyframes", "ours", "the most similar ones that are tried");
    f("tries", &P::tries, 1, 8, "keyframes", "ours", "of these in one frame; the others in the next ones");
    f("confirm_frames", &P::confirm_frames, 0, 30, "frames", "ours",
      "that must fit as well before a found pose is believed");
    f("min_on", &P::min_on, 0, 1.0, "share", "ours", "of the cells that lie on the map");
    f("max_through", &P::max_through, 0, 1.0, "share", "ours", "of the cells seen through a mapped surface");
    f("max_front", &P::max_front, 0, 1.0, "share", "ours", "of the cells before the map: movers");
    f("max_unknown", &P::max_unknown, 0, 1.0, "share", "ours", "of the cells where the map knows nothing");
    f("min_luma_correlation", &P::min_luma_correlation, -1.0, 1.0, "1", "ours",
      "of measured and mapped luminance");
    f("min_texture_correlation", &P::min_texture_correlation, -1.0, 1.0, "1", "ours",
      "of their differences between neighbouring cells");
    f("max_weakest_m", &P::max_weakest_m, 1e-3, 10.0, "m", "ours",
      "deviation of the least bound direction of the pose for 1 cm of noise");
  }
};

}  // namespace stillmap
