#pragma once

// The one interface of both engines (CPU now, CUDA later). Host code; only plain structs cross it.

#include <cstdint>
#include <memory>

#include "kernels/base/pinhole.hpp"
#include "kernels/base/se3.hpp"
#include "kernels/base/status.hpp"
#include "kernels/base/view.hpp"
#include "kernels/complete/near_echo.hpp"
#include "kernels/params.hpp"
#include "kernels/prepare/depth_bias.hpp"

namespace stillmap {

/// All that an engine needs to be made.
struct EngineParams {
  CameraModel camera;              ///< of the colour image; depth is registered to it
  float depth_units_per_m = 5000;  ///< raw depth units in a metre, > 0
  DepthParams depth;
  TrackParams track;
  MaskParams mask;
  IntegrateParams integrate;
  MapParams map;
  RelocaliseParams relocalise;
  int32_t threads = 2;  ///< CPU engine: 1..64, the calling thread included
  /// CPU engine: called by each worker, with true when it starts and with false before it ends; may be null.
  void (*on_worker)(bool starts) = nullptr;
  float fetch_m = 0;  ///< with an archive: so near to the view its groups are wanted back
  DepthBias depth_bias = {};
};

/// One line of the memory plan.
struct MemoryItem {
  const char* name;
  uint64_t bytes;
};
inline constexpr uint32_t kMaxMemoryItems = 32;
struct MemoryItems {
  MemoryItem item[kMaxMemoryItems];
  uint32_t count = 0;
  uint64_t total_bytes = 0;
};

/// Raw frame: rows x cols of the camera model, row-major. Depth 0 and 65535 are invalid.
struct FrameView {
  ImageView<const uint16_t> depth_raw;
  ImageView<const Rgb8> colour;
  float period_s =
      0;  ///< mean time between frames, of what is counted in seconds; 0: as before, at first 1/30
};

struct PrepareResult {
  Status status = Status::ok;  ///< bad_data: wrong size or fewer valid pixels than depth.min_valid_pixels
  int32_t valid_pixels = 0;
};

/// Where the pose is expected before the frame is looked at, and how sure that is.
struct PosePrior {
  Se3 T_world_cam;
  /// Inverse covariance of the twist (v, w) in the map's axes about the camera's centre, upper triangle row
  /// by row, x y z rx ry rz, 1/m^2 and 1/rad^2. All 0: nothing is expected.
  float information[21] = {};
};

struct TrackResult {
  Status status = Status::ok;  ///< degenerate: T_world_cam is the start pose
  Se3 T_world_cam;
  float covariance[21] =
      {};  ///< upper triangle, row by row; order x y z rx ry rz, left perturbation, m and rad
  float inlier_ratio =
      0;  ///< of the points that have a value in the map, share within track.inlier_m of its surface
  float mapped_ratio = 0;  ///< of the valid unmasked pixels, share that has a value in the map
  float rmse_m = 0;        ///< of the depth residuals of the points used
  int32_t iterations = 0;
  bool converged = false;  ///< the last step was below track.converged_m and converged_rad
};

struct MaskResult {
  Status status = Status::ok;
  int32_t masked_pixels = 0;        ///< valid or not
  int32_t masked_valid_pixels = 0;  ///< with a valid depth
};

/// Map counters since boot, read back once a frame.
struct MapHealth {
  uint32_t blocks = 0;  ///< in use
  uint32_t capacity = 0;
  uint32_t peak_blocks = 0;
  uint64_t dropped_blocks = 0;   ///< far blocks given up because the pool was full
  uint64_t contended = 0;        ///< insertions answered `contended`
  uint64_t table_full = 0;       ///< insertions answered `table_full`
  uint64_t pool_empty = 0;       ///< insertions answered `pool_empty`
  uint64_t bytes = 0;            ///< peak bytes of blocks and their table entries
  uint32_t archived_groups = 0;  ///< groups of blocks that are in the archive now
  float fill = 0;                ///< of the fullest of the pools, 0..1
};

struct IntegrateResult {
  Status status =
      Status::ok;  ///< capacity_exhausted: the map was full and something was not mapped; it is counted
  MapHealth map;
  uint32_t visible_blocks = 0;        ///< blocks looked at in this frame
  uint32_t visible_voxel_blocks = 0;  ///< of them, those that take a place of map.pool_blocks
};

/// How a frame fits the map at a pose, over the cells of its small view (kernels/relocalise). Shares are of
/// the cells that say something.
struct ViewCheck {
  int32_t cells = 0;              ///< that say something
  float on = 0;                   ///< on a mapped surface
  float front = 0;                ///< before one, in free space: a mover, or a wrong pose
  float through = 0;              ///< behind one: contradicts the pose
  float unknown = 0;              ///< where the map knows nothing
  float luma_correlation = 0;     ///< of measured and mapped luminance over the cells `on`, -1..1
  float texture_correlation = 0;  ///< the same of the differences between neighbouring cells
  float weakest_m = 0;  ///< standard deviation of the worst bound direction for 1 cm of noise in every cell
};

/// A group of blocks that is in the archive.
struct ArchivedGroup {
  uint64_t key;
  uint32_t entry;  ///< as put_away was told
  bool in_view;    ///< else it is only near it
};

/// What the map knows of a point, by the voxel next to it.
enum class PointState : uint8_t {
  unknown,
  free,     ///< seen free, or before a surface
  occupied  ///< on a surface, or behind it by less than tau
};

/// An answer of the search for a lost camera.
struct PlaceResult {
  Status status =
      Status::unavailable;  ///< ok: the frame fits the map at this pose; unavailable: found nothing
  Se3 T_map_cam;            ///< best try, also when it does not fit
  Se3 T_map_wanted;         ///< the try whose part of the map is to come from the archive
  ViewCheck check;          ///< of that try
  float similarity = 0;     ///< of the most similar keyframe, 0..1
  int32_t keyframes = 0;    ///< in store
};

/// Receives a mesh as it is extracted: first the counts, then all vertices in order, then all triangles.
/// A false answer stops the extraction.
class MeshSink {
 public:
  virtual ~MeshSink() = default;
  virtual bool begin(uint64_t vertices, uint64_t triangles) = 0;
  /// @param positions_m map frame; @param colours as many as positions
  virtual bool vertices(View<const Vec3> positions_m, View<const Rgb8> colours) = 0;
  /// @param indices three a triangle, counter-clockwise seen from free space
  virtual bool triangles(View<const uint32_t> indices) = 0;
};

/// One frame is prepare, track, mask, track again with the mask (paper: refine), integrate; in this order.
/// @thread one thread at a time; after make_* no call allocates or throws
class Engine {
 public:
  virtual ~Engine() = default;

  /// Metres, range gate, undistortion, intensity. The views need to live until the call returns.
  virtual PrepareResult prepare(const FrameView& frame) = 0;
  /// First registration (paper III-B), all pixels.
  virtual TrackResult track(const Se3& T_world_cam_start, const PosePrior& prior = {}) = 0;
  /// Dynamic pixels from the residuals at this pose (paper III-C). Replaces the mask of the last frame.
  virtual MaskResult mask(const Se3& T_world_cam) = 0;
  /// Second registration, masked pixels excluded (paper III-C).
  virtual TrackResult refine(const Se3& T_world_cam_start, const PosePrior& prior = {}) = 0;
  /// From now on both registrations end at this level at the finest: less work, less exact.
  /// @param level 0: as configured; cut to the coarsest one
  virtual void limit_finest_level(int32_t level) = 0;
  /// Allocates on unmasked rays, fuses, carves (paper III-A, III-D).
  virtual IntegrateResult integrate(const Se3& T_world_cam) = 0;

  /// With depth.invalid = complete (paper III-E), instead of `integrate`: the last prepared frame with its
  /// mask waits until others have been seen. There is room for depth.complete_frames and one more; then the
  /// oldest goes.
  /// @param echo what the sonar heard when it was taken  @return how many are kept now
  virtual uint32_t keep_frame(const Se3& T_world_cam, const NearEcho& echo) = 0;
  /// Completes the i-th oldest kept frame from all the others and fuses it, as `integrate` does. It stays.
  /// @return unavailable: there is no such frame
  virtual IntegrateResult integrate_kept(uint32_t index) = 0;
  /// Of the kept frames the `oldest` oldest ones go.
  virtual void forget_kept(uint32_t oldest) = 0;
  virtual uint32_t kept_frames() const = 0;

  /// Keeps the last prepared frame as a keyframe when it shows something new. Masked pixels have no say.
  virtual void remember_place(const Se3& T_map_cam) = 0;
  /// Looks for the pose of the last prepared frame: relocalise.tries keyframes and, at attempt 0, the guess.
  /// When it finds nothing, wanted_groups asks for what one of the tries would show.
  /// @param attempt counts up from 0 while lost: every attempt tries other keyframes
  virtual PlaceResult find_place(const Se3& T_map_cam_guess, int32_t attempt) = 0;
  /// The same from one pose near by (some 20 degrees and 30 cm), without keyframes.
  virtual PlaceResult confirm_place(const Se3& T_map_cam_start) = 0;

  /// The map seen from any pose: depth in metres (0: nothing) and colour; both images of the size of `k`.
  virtual Status raycast(const Se3& T_world_cam, const Intrinsics& k, ImageView<float> depth_m,
                         ImageView<Rgb8> colour) = 0;
  /// Welded coloured mesh of the zero level, same bytes for the same map.
  virtual Status extract_mesh(MeshSink& sink) = 0;

  /// @param states as many as points (map frame, metres)
  virtual void look_up(View<const Vec3> points_map_m, View<PointState> states) const = 0;
  /// The map in pieces (kernels/map/group_record.hpp), to be saved, archived or copied.
  /// @return how many there are (never above group_capacity); as many of their keys as fit, ascending when
  /// all fit
  virtual uint32_t list_groups(View<uint64_t> keys) const = 0;
  /// @return bytes of the record; 0: there is no such group, or it does not fit
  virtual uint32_t write_group(uint64_t key, View<uint8_t> record) const = 0;
  /// Puts a group into the map, in place of what is known there.
  /// @return bad_data: not a record; capacity_exhausted: no room, nothing was changed
  virtual Status read_group(View<const uint8_t> record) = 0;
  virtual uint32_t group_capacity() const = 0;
  /// The keyframes of find_place (kernels/relocalise/place_record.hpp), numbered from 0.
  virtual uint32_t place_count() const = 0;
  /// @return bytes of the record; 0: there is no such keyframe, or it does not fit
  virtual uint32_t write_place(uint32_t index, View<uint8_t> record) const = 0;
  /// Adds a keyframe; when the store is full it replaces the most redundant one.
  /// @return bad_data: not a record; unavailable: of another size of camera or number of ferns, nothing was
  /// changed
  virtual Status read_place(View<const uint8_t> record) = 0;

  /// Groups with blocks that the last integrated frame does not come near, the farthest from `centre_map`
  /// first. @param near_view_too those that it comes near but does not see as well  @return how many
  virtual uint32_t farthest_groups(Vec3 centre_map, View<uint64_t> keys, bool near_view_too) = 0;
  /// Frees the blocks of a group that was written to the archive; until read_group brings it back the map
  /// knows nothing of it, and frames leave it as it is.
  virtual void put_away(uint64_t key, uint32_t entry) = 0;
  /// The archive has lost the group: what it held is unknown.
  virtual void forget_group(uint64_t key) = 0;
  /// Groups of the archive that came into view, or near it, in the last integrated frame, or would from where
  /// a lost camera was looked for last; first those in view. @return how many
  virtual uint32_t wanted_groups(View<ArchivedGroup> groups) const = 0;

  /// 255: dynamic. Size of the camera; valid until the next `prepare`.
  virtual ImageView<const uint8_t> mask_image() const = 0;
  /// Undistorted depth in metres (0: invalid) of the last prepared frame; may exceed depth.max_m.
  virtual ImageView<const float> depth_image_m() const = 0;
  /// Undistorted colour of the last prepared frame.
  virtual ImageView<const Rgb8> colour_image() const = 0;
  virtual MapHealth map_health() const = 0;
  /// Forgets the map, its keyframes and the frames that wait for it; memory stays.
  virtual void reset_map() = 0;
};

/// What make_cpu_engine would take, item by item. Same code as the one that carves, so it cannot differ.
MemoryItems plan_cpu_engine(const EngineParams& params);
/// Engine::group_capacity of what make_cpu_engine would make.
uint32_t plan_group_capacity(const EngineParams& params);

/// Allocates everything, starts the workers.
/// @return null when the memory cannot be had.  @thread boot
std::unique_ptr<Engine> make_cpu_engine(const EngineParams& params);

/// Whether this program has the CUDA engine.
bool cuda_is_built();
/// Null when the CUDA engine can be had here, else why not.  @thread boot
const char* cuda_missing();
/// What make_cuda_engine would take, on the device and of memory that both sides reach.
MemoryItems plan_cuda_engine(const EngineParams& params);
/// Takes all memory, records what the steps of a frame launch.
/// @return null when there is no device, or not enough memory.  @thread boot
std::unique_ptr<Engine> make_cuda_engine(const EngineParams& params);

}  // namespace stillmap
