#include <cmath>
#include <optional>

#include "drivers/lcm/codec.hpp"
#include "drivers/lcm/lcm.hpp"
#include "drivers/lcm/listener.hpp"
#include "runtime/core/bounded_queue.hpp"
#include "runtime/ports/odometry_ring.hpp"

namespace stillmap {
namespace {

constexpr uint32_t kWaitingSamples = OdometryRing::kSamples;
constexpr int64_t kGapNs = 1'000'000'000;
constexpr double kUnitTolerance = 1e-3;          // of the quaternion's length
constexpr int64_t kLatestUs = int64_t{1} << 52;  // year 2112; keeps the sums below within 64 bits
constexpr double kFarthestM = 1e7;               // no body on the ground gets there

/// @return nothing: a value is not finite, the time none or the orientation no rotation
std::optional<Se3d> body_pose(const PoseMessage& message) {
  if (message.utime.us < 0 || message.utime.us > kLatestUs) return std::nullopt;
  const double* p = message.pos_m;
  const double* q = message.orientation_wxyz;
  const double length = std::sqrt(q[0] * q[0] + q[1] * q[1] + q[2] * q[2] + q[3] * q[3]);
  if (!(std::abs(length - 1) < kUnitTolerance)) return std::nullopt;
  for (int i = 0; i < 3; ++i)
    if (!(std::abs(p[i]) < kFarthestM)) return std::nullopt;
  return Se3d{rotation_from(Quatd{q[1], q[2], q[3], q[0]}), {p[0], p[1], p[2]}};
}

class NetworkOdometry final : public OdometryPort {
 public:
  explicit NetworkOdometry(std::function<Stamp(Utime)> clock) : clock_(std::move(clock)) {}

  Status at(Stamp stamp, OdometrySample& sample) override {
    take_what_came();
    return ring_.at(stamp, sample);
  }
  uint32_t refused() const override { return refused_.load(std::memory_order_relaxed); }

  Result<Done> open(const std::string& url) {
    auto listener = LcmListener::open(
        url, [this](std::string_view channel, View<const uint8_t> payload) { hear(channel, payload); });
    if (!listener) return Error{listener.error(), listener.error_kind()};
    listener_ = std::move(*listener);
    return Done{};
  }

 private:
  /// @thread listening
  void hear(std::string_view channel, View<const uint8_t> payload) {
    if (channel != kOdometryChannel) return;
    PoseMessage message;
    std::optional<Se3d> T_odom_body;
    if (codec_.decode(payload, message) == Status::ok) T_odom_body = body_pose(message);
    if (!T_odom_body || !waiting_.push({clock_(message.utime), *T_odom_body}))
      refused_.fetch_add(1, std::memory_order_relaxed);
  }

  /// @thread real-time
  void take_what_came() {
    OdometrySample sample;
    for (uint32_t taken = 0; taken < kWaitingSamples && waiting_.pop(sample); ++taken) {
      // One wrong stamp must not shut out the right ones that follow.
      if (std::abs(sample.stamp.ns - newest_.ns) > kGapNs) ring_.clear();
      if (ring_.push(sample)) newest_ = sample.stamp;
    }
  }

  std::function<Stamp(Utime)> clock_;
  LcmCodec codec_;
  BoundedQueue<OdometrySample> waiting_{kWaitingSamples};
  std::atomic<uint32_t> refused_{0};
  OdometryRing ring_;
  Stamp newest_;
  std::unique_ptr<LcmListener> listener_;  ///< last: its thread uses all the others
};

}  // namespace

Result<std::unique_ptr<OdometryPort>> open_lcm_odometry(const std::string& url,
                                                        std::function<Stamp(Utime)> clock) {
  auto odometry = std::make_unique<NetworkOdometry>(std::move(clock));
  if (const auto opened = odometry->open(url); !opened) return Error{opened.error(), opened.error_kind()};
  return std::unique_ptr<OdometryPort>(std::move(odometry));
}

}  // namespace stillmap
