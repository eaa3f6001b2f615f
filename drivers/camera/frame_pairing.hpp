#pragma once

#include <array>
#include <atomic>
#include <cstdint>
#include <utility>

namespace stillmap {

/// Brings depth and colour images together that were taken at about the same time, as they come in. Each goes
/// with the nearest image of the other kind that is there and within the bound; what is left behind by that,
/// or can have no partner any more, is given up and counted. Holds at most kPending images of a kind, and so
/// keeps as many of the library's or the kernel's buffers from being used again.
/// @tparam Image a handle of an image (a reference, a buffer's number); a default one is no image
/// @thread one; the counters: any
template <class Image>
class FramePairing {
 public:
  enum Kind : uint8_t { kDepth, kColour };
  static constexpr uint32_t kPending = 4;

  struct Stamped {
    int64_t stamp_ns = 0;
    Image image{};
  };
  struct Pair {
    Stamped depth, colour;
  };

  /// @param max_ns largest distance of the stamps of a pair, itself allowed
  explicit FramePairing(int64_t max_ns) : max_ns_(max_ns) {}

  /// Takes an image. Stamps of a kind rise; one that does not begins anew: what waits is given up.
  /// @param give_up called with (Kind, Image&) for each image that will not be part of a pair
  /// @return whether `pair` was filled
  template <class GiveUp>
  bool add(Kind kind, int64_t stamp_ns, Image image, Pair& pair, GiveUp give_up) {
    Waiting& own = waiting_[kind];
    Waiting& other = waiting_[kind == kDepth ? kColour : kDepth];
    if (own.any && stamp_ns <= own.last_ns) clear(give_up);
    own.any = true;
    own.last_ns = stamp_ns;
    while (other.count > 0 && other.images[0].stamp_ns < stamp_ns - max_ns_)
      drop_first(other, give_up);  // what comes later is later still
    const uint32_t nearest = nearest_of(other, stamp_ns);
    if (nearest == other.count) {
      if (own.count == kPending) drop_first(own, give_up);
      own.images[own.count++] = {stamp_ns, std::move(image)};
      return false;
    }
    while (own.count > 0) drop_first(own, give_up);  // older than half of this pair
    for (uint32_t i = 0; i < nearest; ++i) drop_first(other, give_up);
    Stamped partner = take_first(other);
    Stamped here = {stamp_ns, std::move(image)};
    pair = kind == kDepth ? Pair{std::move(here), std::move(partner)}
                          : Pair{std::move(partner), std::move(here)};
    return true;
  }

  /// Gives up what waits, as at the end of a recording or when the device is closed.
  template <class GiveUp>
  void clear(GiveUp give_up) {
    for (Waiting& waiting : waiting_) {
      while (waiting.count > 0) drop_first(waiting, give_up);
      waiting.any = false;
    }
  }

  /// Images of a kind that were given up since it was made.
  uint32_t unpaired(Kind kind) const { return waiting_[kind].unpaired.load(std::memory_order_relaxed); }

 private:
  struct Waiting {
    std::array<Stamped, kPending> images;  ///< oldest first
    uint32_t count = 0;
    bool any = false;
    int64_t last_ns = 0;
    std::atomic<uint32_t> unpaired{0};
  };

  /// @return waiting.count where none is near enough
  uint32_t nearest_of(const Waiting& waiting, int64_t stamp_ns) const {
    uint32_t nearest = waiting.count;
    int64_t least_ns = max_ns_;
    for (uint32_t i = 0; i < waiting.count; ++i) {
      const int64_t apart_ns = waiting.images[i].stamp_ns < stamp_ns ? stamp_ns - waiting.images[i].stamp_ns
                                                                     : waiting.images[i].stamp_ns - stamp_ns;
      if (apart_ns > least_ns) continue;
      least_ns = apart_ns;
      nearest = i;
    }
    return nearest;
  }
  Stamped take_first(Waiting& waiting) {
    Stamped first = std::exchange(waiting.images[0], {});
    for (uint32_t i = 1; i < waiting.count; ++i) std::swap(waiting.images[i - 1], waiting.images[i]);
    --waiting.count;
    return first;
  }
  template <class GiveUp>
  void drop_first(Waiting& waiting, GiveUp& give_up) {
    Stamped dropped = take_first(waiting);
    waiting.unpaired.fetch_add(1, std::memory_order_relaxed);
    give_up(&waiting == &waiting_[kDepth] ? kDepth : kColour, dropped.image);
  }

  const int64_t max_ns_;
  std::array<Waiting, 2> waiting_;
};

}  // namespace stillmap
