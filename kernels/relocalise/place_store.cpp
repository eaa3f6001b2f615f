#include "kernels/relocalise/place_store.hpp"

#include <algorithm>
#include <cmath>
#include <cstring>

#include "kernels/relocalise/fern_code.hpp"
#include "kernels/relocalise/place_record.hpp"

namespace stillmap {
namespace {

constexpr float kSamePlace_m = 0.05f;  ///< nearer keyframes differ only by who walks there
constexpr float kSamePlace_deg = 3.0f;
constexpr float kDegrees = 57.2957795f;
float degrees_between(const Se3& a, const Se3& b) {
  return kDegrees * norm(log_rotation(transposed(a.rotation) * b.rotation));
}

bool is_pose(const Se3& T) {
  constexpr float kRounding = 1e-3f;
  const Mat3 unit = T.rotation * transposed(T.rotation);
  for (int32_t i = 0; i < 9; ++i)
    if (!(std::fabs(unit.m[i] - (i % 4 == 0 ? 1.0f : 0.0f)) < kRounding)) return false;
  return std::isfinite(norm(T.translation));
}

}  // namespace

void PlaceStore::carve(Arena& arena, const EngineParams& params) {
  params_ = params.relocalise;
  if (!params_.enabled) return;
  px_ = stillmap::cell_px(params.camera.k.width);
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
}

View<const uint8_t> PlaceStore::code_of(uint32_t keyframe) const {
  return {codes_.data + static_cast<size_t>(keyframe) * code_.size, code_.size};
}

/// Code of the frame at hand, and its similarity to every keyframe.
void PlaceStore::encode() {
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

void PlaceStore::compare_with_keyframes() {
  for (uint32_t i = 0; i < count_; ++i)
    similarity_[i] = code_similarity({code_.data, code_.size}, code_of(i));
}

/// Not when a keyframe was taken at the same place, or a similar one near by.
bool PlaceStore::shows_something_new(const Se3& T_map_cam) const {
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

void PlaceStore::find_closest(uint32_t keyframe) {
  Keyframe& k = keyframes_[keyframe];
  k.closest = -1;
  for (uint32_t i = 0; i < count_; ++i) {
    if (i == keyframe) continue;
    const float similarity = code_similarity(code_of(keyframe), code_of(i));
    if (similarity > k.closest) k.closest = similarity, k.closest_to = i;
  }
}

uint32_t PlaceStore::most_redundant() const {
  const Keyframe* worst =
      std::max_element(keyframes_.data, keyframes_.data + count_,
                       [](const Keyframe& a, const Keyframe& b) { return a.closest < b.closest; });
  return static_cast<uint32_t>(worst - keyframes_.data);
}

/// Puts the frame at hand into a place, and keeps every keyframe's closest one right.
void PlaceStore::insert(uint32_t place, const Se3& T_map_cam) {
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

void PlaceStore::remember(const Se3& T_map_cam) {
  if (!params_.enabled) return;
  encode();
  if (!shows_something_new(T_map_cam)) return;
  insert(count_ < keyframes_.size ? count_ : most_redundant(), T_map_cam);
}

uint32_t PlaceStore::write(uint32_t keyframe, View<uint8_t> record) const {
  const uint32_t bytes = static_cast<uint32_t>(sizeof(PlaceRecordHead)) + code_.size;
  if (keyframe >= count_ || record.size < bytes) return 0;
  const PlaceRecordHead head = {keyframes_[keyframe].T_map_cam, code_.size, k_[1].height, k_[1].width};
  std::memcpy(record.data, &head, sizeof head);
  std::memcpy(record.data + sizeof head, code_of(keyframe).data, code_.size);
  return bytes;
}

Status PlaceStore::read(View<const uint8_t> record) {
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
uint32_t PlaceStore::list_candidates() {
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

PlaceResult PlaceStore::find(const Se3& T_map_cam_guess, int32_t attempt, const TryFollower& follow) {
  if (!params_.enabled) return {};
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
  PlaceResult result = best_of(tries, follow);
  result.similarity = similarity;
  result.T_map_wanted = T_map_wanted;
  return result;
}

PlaceResult PlaceStore::confirm(const Se3& T_map_cam_start, const TryFollower& follow) {
  if (!params_.enabled) return {};
  tries_[0].T_map_cam = T_map_cam_start;
  return best_of(1, follow);
}

/// Follows the first `tries` starts to their end and takes the one with the most cells on the map.
PlaceResult PlaceStore::best_of(uint32_t tries, const TryFollower& follow) {
  follow({tries_, tries});
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

}  // namespace stillmap
