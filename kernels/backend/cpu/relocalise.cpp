#include "kernels/backend/cpu/relocalise.hpp"

#include <algorithm>
#include <cmath>
#include <cstring>

#include "kernels/backend/cpu/raycast.hpp"
#include "kernels/relocalise/fern_code.hpp"
#include "kernels/relocalise/place_record.hpp"
#include "kernels/relocalise/view_check.hpp"

namespace stillmap {
namespace {

constexpr float kModelMargin = 0.2f;   ///< by which a view of the map is wider than the frame, on each side
constexpr float kSamePlace_m = 0.05f;  ///< nearer keyframes differ only by who walks there
constexpr float kSamePlace_deg = 3.0f;
constexpr float kDegrees = 57.2957795f;
constexpr float kTypicalArm_m = 2.0f;  ///< from the camera to what it sees
constexpr float kNoise_m = 0.01f;
constexpr float kColourWeight = 0.025f;

float degrees_between(const Se3& a, const Se3& b) {
  return kDegrees * norm(log_rotation(transposed(a.rotation) * b.rotation));
}

Intrinsics widened(const Intrinsics& k) {
  const int32_t x = static_cast<int32_t>(kModelMargin * static_cast<float>(k.width));
  const int32_t y = static_cast<int32_t>(kModelMargin * static_cast<float>(k.height));
  return {k.fx,
          k.fy,
          k.cx + static_cast<float>(x),
          k.cy + static_cast<float>(y),
          k.width + 2 * x,
          k.height + 2 * y};
}

bool is_pose(const Se3& T) {
  constexpr float kRounding = 1e-3f;
  const Mat3 unit = T.rotation * transposed(T.rotation);
  for (int32_t i = 0; i < 9; ++i)
    if (!(std::fabs(unit.m[i] - (i % 4 == 0 ? 1.0f : 0.0f)) < kRounding)) return false;
  return std::isfinite(norm(T.translation));
}

/// Gauss-Newton step about the camera centre. @return false when the system is singular
bool step(const NormalEq& sums, Se3& T_map_cam) {
  constexpr double kDamping = 1e-3;
  Cholesky6 cholesky;
  if (!cholesky.factor(sums.sum + kHessian, kDamping)) return false;
  double x[6];
  cholesky.solve(sums.sum + kGradient, x);
  for (const double value : x)
    if (!std::isfinite(value)) return false;
  const Se3d turn = exp(Twistd{{}, {-x[3], -x[4], -x[5]}});
  const Se3d T = cast<double>(T_map_cam);
  T_map_cam =
      cast<float>(Se3d{orthonormalized(turn.rotation * T.rotation), T.translation - Vec3d{x[0], x[1], x[2]}});
  return true;
}

/// Standard deviation of the worst direction for kNoise_m in each of the points, all of them pulling the same
/// way: what the geometry binds, whatever the number of points.
float weakest_direction_m(const NormalEq& sums) {
  constexpr float kUnbound_m = 1e3f;
  Cholesky6 cholesky;
  if (sums.sum[kInliers] < 1 || !cholesky.factor(sums.sum + kHessian, 0.0)) return kUnbound_m;
  double worst = 0;
  for (int32_t i = 0; i < 6; ++i) {
    double unit[6] = {}, x[6];
    unit[i] = 1;
    cholesky.solve(unit, x);
    const double arm_m = i < 3 ? 1.0 : static_cast<double>(kTypicalArm_m);
    worst = std::max(worst, x[i] * arm_m * arm_m);
  }
  return kNoise_m * static_cast<float>(std::sqrt(worst * sums.sum[kInliers]));
}

template <class Pass>
AlignSums sum_over(const SmallView& view, const Pass& pass) {
  AlignSums sums;
  for (int32_t r = 0; r < view.depth_m.rows; ++r)
    for (int32_t c = 0; c < view.depth_m.cols; ++c) pass(r, c, sums);
  return sums;
}

/// How many of the cells that say something say what.
struct VerdictShares {
  float share[5] = {};
  float of(CellVerdict verdict) const { return share[static_cast<int32_t>(verdict)]; }
};
VerdictShares count_verdicts(const ViewCheckPass& pass, int32_t& cells) {
  RecentBlocks<6> cache;
  int32_t count[5] = {};
  for (int32_t r = 0; r < pass.k.height; ++r)
    for (int32_t c = 0; c < pass.k.width; ++c) ++count[static_cast<int32_t>(pass(r, c, cache))];
  cells = pass.k.height * pass.k.width - count[static_cast<int32_t>(CellVerdict::none)];
  VerdictShares shares;
  for (int32_t i = 0; i < 5; ++i)
    shares.share[i] = static_cast<float>(count[i]) / static_cast<float>(std::max(cells, 1));
  return shares;
}

/// Correlation of two numbers from their sums.
struct Correlation {
  double n = 0, a = 0, b = 0, aa = 0, bb = 0, ab = 0;

  void add(float x, float y) {
    const double p = static_cast<double>(x), q = static_cast<double>(y);
    n += 1;
    a += p;
    b += q;
    aa += p * p;
    bb += q * q;
    ab += p * q;
  }
  float value() const {
    const double va = n * aa - a * a, vb = n * bb - b * b;
    return va > 0 && vb > 0 ? static_cast<float>((n * ab - a * b) / std::sqrt(va * vb)) : 0.0f;
  }
};

}  // namespace

void CpuRelocaliser::carve(Arena& arena, const EngineParams& params) {
  params_ = params.relocalise;
  max_m_ = params.depth.max_m;
  if (!params_.enabled) return;
  px_ = cell_px(params.camera.k.width);
  k_[0] = shrunk(params.camera.k, px_);
  k_[1] = shrunk(k_[0], 2);
  const auto small_view = [&](const Intrinsics& k) {
    return SmallView{arena.take_image<float>("relocalisation: views", k.height, k.width),
                     arena.take_image<float>("relocalisation: views", k.height, k.width)};
  };
  small_[0] = small_view(k_[0]);
  small_[1] = small_view(k_[1]);
  const auto ferns = static_cast<uint64_t>(params_.ferns),
             most = static_cast<uint64_t>(params_.max_keyframes);
  code_ = arena.take<uint8_t>("relocalisation: keyframes", ferns);
  codes_ = arena.take<uint8_t>("relocalisation: keyframes", ferns * most);
  keyframes_ = arena.take<Keyframe>("relocalisation: keyframes", most);
  similarity_ = arena.take<float>("relocalisation: keyframes", most);
  order_ = arena.take<uint32_t>("relocalisation: keyframes", static_cast<uint64_t>(params_.candidates));
  const Intrinsics wide = widened(k_[1]);
  for (Try& t : tries_) {
    t.model.k = wide;
    t.model.depth_m = arena.take_image<float>("relocalisation: views", wide.height, wide.width);
    t.model.normal = arena.take_image<Vec3>("relocalisation: views", wide.height, wide.width);
    t.colour = arena.take<Rgb8>(
        "relocalisation: views",
        static_cast<uint64_t>(std::max(wide.width * wide.height, k_[0].width * k_[0].height)));
    t.expected_m = arena.take_image<float>("relocalisation: views", k_[0].height, k_[0].width);
    t.map_luma = arena.take_image<float>("relocalisation: views", k_[0].height, k_[0].width);
  }
}

View<const uint8_t> CpuRelocaliser::code_of(uint32_t keyframe) const {
  return {codes_.data + static_cast<size_t>(keyframe) * code_.size, code_.size};
}

void CpuRelocaliser::shrink(const PreparedView& frame) {
  const ShrinkPass shrink{frame.depth_m, frame.colour, frame.mask, px_, max_m_, small_[0]};
  for (int32_t r = 0; r < k_[0].height; ++r)
    for (int32_t c = 0; c < k_[0].width; ++c) shrink(r, c);
  const HalvePass halve{small_[0], small_[1]};
  for (int32_t r = 0; r < k_[1].height; ++r)
    for (int32_t c = 0; c < k_[1].width; ++c) halve(r, c);
}

/// Code of the frame at hand, and its similarity to every keyframe.
void CpuRelocaliser::encode() {
  float luma = 0;
  int32_t cells = 0;
  const ImageView<float>& image = small_[1].luma;
  for (int32_t i = 0; i < image.pixels(); ++i)
    if (image.data[i] != kNoLuma) {
      luma += image.data[i];
      ++cells;
    }
  const FernPass ferns{small_[1], cells > 0 ? luma / static_cast<float>(cells) : 0.0f, code_};
  for (uint32_t f = 0; f < code_.size; ++f) ferns(f);
  compare_with_keyframes();
}

void CpuRelocaliser::compare_with_keyframes() {
  for (uint32_t i = 0; i < count_; ++i)
    similarity_[i] = code_similarity({code_.data, code_.size}, code_of(i));
}

/// Not when a keyframe was taken at the same place, or a similar one near by.
bool CpuRelocaliser::shows_something_new(const Se3& T_map_cam) const {
  for (uint32_t i = 0; i < count_; ++i) {
    const Se3& other = keyframes_[i].T_map_cam;
    const float distance_m = norm(other.translation - T_map_cam.translation);
    if (distance_m > params_.keyframe_m) continue;
    const float turned_deg = degrees_between(other, T_map_cam);
    if (distance_m < kSamePlace_m && turned_deg < kSamePlace_deg) return false;
    if (turned_deg < params_.keyframe_deg && similarity_[i] > params_.keyframe_similarity) return false;
  }
  return true;
}

void CpuRelocaliser::find_closest(uint32_t keyframe) {
  Keyframe& k = keyframes_[keyframe];
  k.closest = -1;
  for (uint32_t i = 0; i < count_; ++i) {
    if (i == keyframe) continue;
    const float similarity = code_similarity(code_of(keyframe), code_of(i));
    if (similarity > k.closest) k.closest = similarity, k.closest_to = i;
  }
}

uint32_t CpuRelocaliser::most_redundant() const {
  const Keyframe* worst =
      std::max_element(keyframes_.data, keyframes_.data + count_,
                       [](const Keyframe& a, const Keyframe& b) { return a.closest < b.closest; });
  return static_cast<uint32_t>(worst - keyframes_.data);
}

/// Puts the frame at hand into a place, and keeps every keyframe's closest one right.
void CpuRelocaliser::insert(uint32_t place, const Se3& T_map_cam) {
  const bool replaced = place < count_;
  if (!replaced) ++count_;
  std::copy_n(code_.data, code_.size, codes_.data + static_cast<size_t>(place) * code_.size);
  keyframes_[place].T_map_cam = T_map_cam;
  find_closest(place);
  for (uint32_t i = 0; i < count_; ++i) {
    Keyframe& k = keyframes_[i];
    if (i == place) continue;
    if (replaced && k.closest_to == place)
      find_closest(i);
    else if (similarity_[i] > k.closest)
      k.closest = similarity_[i], k.closest_to = place;
  }
}

void CpuRelocaliser::remember(const PreparedView& frame, const Se3& T_map_cam) {
  if (!params_.enabled) return;
  shrink(frame);
  encode();
  if (!shows_something_new(T_map_cam)) return;
  insert(count_ < keyframes_.size ? count_ : most_redundant(), T_map_cam);
}

uint32_t CpuRelocaliser::write(uint32_t keyframe, View<uint8_t> record) const {
  const uint32_t bytes = static_cast<uint32_t>(sizeof(PlaceRecordHead)) + code_.size;
  if (keyframe >= count_ || record.size < bytes) return 0;
  const PlaceRecordHead head = {keyframes_[keyframe].T_map_cam, code_.size, k_[1].height, k_[1].width};
  std::memcpy(record.data, &head, sizeof head);
  std::memcpy(record.data + sizeof head, code_of(keyframe).data, code_.size);
  return bytes;
}

Status CpuRelocaliser::read(View<const uint8_t> record) {
  PlaceRecordHead head;
  if (record.size < sizeof head) return Status::bad_data;
  std::memcpy(&head, record.data, sizeof head);
  if (head.ferns != record.size - sizeof head || !is_pose(head.T_map_cam)) return Status::bad_data;
  const bool usable =
      params_.enabled && head.ferns == code_.size && head.rows == k_[1].height && head.cols == k_[1].width;
  if (!usable) return Status::unavailable;
  std::memcpy(code_.data, record.data + sizeof head, code_.size);
  compare_with_keyframes();
  insert(count_ < keyframes_.size ? count_ : most_redundant(), head.T_map_cam);
  return Status::ok;
}

/// The most similar keyframes, in falling order. @return how many
uint32_t CpuRelocaliser::list_candidates() {
  const uint32_t wanted = std::min(count_, order_.size);
  for (uint32_t n = 0; n < wanted; ++n) {
    uint32_t best = 0;
    for (uint32_t i = 1; i < count_; ++i)
      if (similarity_[i] > similarity_[best]) best = i;
    order_[n] = best;
    similarity_[best] = -1;
  }
  return wanted;
}

PlaceResult CpuRelocaliser::find(const PreparedView& frame, const VolumeView& map, const Se3& T_map_cam_guess,
                                 int32_t attempt, ThreadPool& threads) {
  if (!params_.enabled) return {};
  shrink(frame);
  encode();
  const float similarity = count_ > 0 ? *std::max_element(similarity_.data, similarity_.data + count_) : 0.0f;
  const uint32_t candidates = list_candidates(), per_frame = static_cast<uint32_t>(params_.tries);
  uint32_t tries = 0;
  if (attempt == 0) tries_[tries++].T_map_cam = T_map_cam_guess;
  if (candidates > 0) {
    const uint32_t rounds = (candidates + per_frame - 1) / per_frame;
    const uint32_t first = static_cast<uint32_t>(attempt) % rounds * per_frame;
    for (uint32_t i = first; i < std::min(first + per_frame, candidates); ++i)
      tries_[tries++].T_map_cam = keyframes_[order_[i]].T_map_cam;
  }
  Se3 T_map_wanted = T_map_cam_guess;
  if (candidates > 0) {
    // Every round another one of each frame's keyframes.
    const uint32_t rounds = (candidates + per_frame - 1) / per_frame,
                   round = static_cast<uint32_t>(attempt) / rounds;
    const uint32_t first = static_cast<uint32_t>(attempt) % rounds * per_frame;
    T_map_wanted = keyframes_[order_[std::min(first + round % per_frame, candidates - 1)]].T_map_cam;
  }
  PlaceResult result = best_of(tries, map, threads);
  result.similarity = similarity;
  result.T_map_wanted = T_map_wanted;
  return result;
}

PlaceResult CpuRelocaliser::confirm(const PreparedView& frame, const VolumeView& map,
                                    const Se3& T_map_cam_start, ThreadPool& threads) {
  if (!params_.enabled) return {};
  shrink(frame);
  tries_[0].T_map_cam = T_map_cam_start;
  return best_of(1, map, threads);
}

/// Follows the first `tries` starts to their end and takes the one with the most cells on the map.
PlaceResult CpuRelocaliser::best_of(uint32_t tries, const VolumeView& map, ThreadPool& threads) {
  threads.for_each(tries, [&](uint32_t i) { align_and_check(map, tries_[i]); });
  PlaceResult result;
  result.keyframes = static_cast<int32_t>(count_);
  for (uint32_t i = 0; i < tries; ++i) {
    const ViewCheck& check = tries_[i].check;
    const bool good = fits(check, params_), have_good = result.status == Status::ok;
    const bool better = good != have_good ? good : check.on > result.check.on;
    if (i > 0 && !better) continue;
    result.status = good ? Status::ok : Status::unavailable;
    result.T_map_cam = tries_[i].T_map_cam;
    result.check = check;
  }
  return result;
}

/// From wide to narrow; the view of the map is made again when the pose has come near.
void CpuRelocaliser::align_and_check(const VolumeView& map, Try& t) const {
  t.check = {};
  cast_model(map, t);
  if (!align_to_model(0.4f, 6, t) || !align_to_model(0.2f, 4, t)) return;
  cast_model(map, t);
  if (!align_to_model(0.2f, 4, t) || !align_to_model(0.1f, 4, t) || !align_to_map(map, t)) return;
  check_view(map, t);
}

/// The map with its normals from a pose, wider than the frame.
void CpuRelocaliser::cast_model(const VolumeView& map, Try& t) const {
  t.model.T_map_model = t.T_map_cam;
  const Intrinsics& k = t.model.k;
  const ImageView<Rgb8> colour{t.colour.data, k.height, k.width, k.width};
  raycast_rows({map, k, t.T_map_cam, t.model.depth_m, colour}, 0, k.height);
  const NormalPass normals{t.model};
  for (int32_t r = 0; r < k.height; ++r)
    for (int32_t c = 0; c < k.width; ++c) normals(r, c);
}

/// @return false when too little of the frame meets the model
bool CpuRelocaliser::align_to_model(float gate_m, int32_t iterations, Try& t) const {
  constexpr double kLeastShare = 0.15;
  const SmallView& view = small_[1];
  for (int32_t i = 0; i < iterations; ++i) {
    const AlignSums sums = sum_over(view, ModelAlignPass{view, k_[1], t.model, t.T_map_cam, gate_m});
    if (sums.eq.sum[kInliers] < kLeastShare * view.depth_m.pixels() || !step(sums.eq, t.T_map_cam))
      return false;
  }
  return true;
}

bool CpuRelocaliser::align_to_map(const VolumeView& map, Try& t) const {
  constexpr int32_t kIterations = 8;
  constexpr double kLeastShare = 0.1;
  MapAlignPass pass{map, small_[0], k_[0], t.T_map_cam, 0.08f, kColourWeight, 1.0f};
  for (int32_t i = 0; i < kIterations; ++i) {
    pass.T_map_cam = t.T_map_cam;
    RecentBlocks<6> cache;
    const AlignSums sums =
        sum_over(small_[0], [&](int32_t r, int32_t c, AlignSums& s) { pass(r, c, cache, s); });
    if (sums.eq.sum[kInliers] < kLeastShare * small_[0].depth_m.pixels()) return false;
    t.check.weakest_m = weakest_direction_m(sums.eq);
    if (!step(sums.eq, t.T_map_cam)) return false;
    if (sums.map_luma > 0) pass.gain = static_cast<float>(sums.measured_luma / sums.map_luma);
    if (i == kIterations / 2) pass.gate_m = 0.04f;
  }
  return true;
}

/// Most wrong poses fail by their luminances, which cost little; only the others are held against the view
/// that the map promises.
void CpuRelocaliser::check_view(const VolumeView& map, Try& t) const {
  const Intrinsics& k = k_[0];
  ViewCheckPass pass{map, small_[0], k, t.T_map_cam, {}, t.map_luma};
  t.check.on = count_verdicts(pass, t.check.cells).of(CellVerdict::on);
  compare_luma(t);
  if (t.check.on < params_.min_on || t.check.luma_correlation < params_.min_luma_correlation ||
      t.check.texture_correlation < params_.min_texture_correlation)
    return;
  const ImageView<Rgb8> colour{t.colour.data, k.height, k.width, k.width};
  raycast_rows({map, k, t.T_map_cam, t.expected_m, colour}, 0, k.height);
  pass.expected_m = t.expected_m;
  const VerdictShares shares = count_verdicts(pass, t.check.cells);
  t.check.on = shares.of(CellVerdict::on);
  t.check.front = shares.of(CellVerdict::front);
  t.check.through = shares.of(CellVerdict::through);
  t.check.unknown = shares.of(CellVerdict::unknown);
}

/// Correlation of measured and mapped luminance over the cells on the map, and of their steps from cell to
/// cell.
void CpuRelocaliser::compare_luma(Try& t) const {
  const ImageView<float>& measured = small_[0].luma;
  const auto usable = [&](int32_t row, int32_t col) {
    return row < measured.rows && col < measured.cols && t.map_luma.at(row, col) != kNoLuma &&
           measured.at(row, col) != kNoLuma;
  };
  Correlation luma, texture;
  for (int32_t r = 0; r < measured.rows; ++r)
    for (int32_t c = 0; c < measured.cols; ++c) {
      if (!usable(r, c)) continue;
      const float here = measured.at(r, c), mapped = t.map_luma.at(r, c);
      luma.add(here, mapped);
      if (usable(r, c + 1)) texture.add(measured.at(r, c + 1) - here, t.map_luma.at(r, c + 1) - mapped);
      if (usable(r + 1, c)) texture.add(measured.at(r + 1, c) - here, t.map_luma.at(r + 1, c) - mapped);
    }
  t.check.luma_correlation = luma.value();
  t.check.texture_correlation = texture.value();
}

}  // namespace stillmap
