#include "drivers/synthetic/odometry.hpp"

#include <cmath>

#include "drivers/synthetic/motion.hpp"
#include "drivers/synthetic/random.hpp"

namespace stillmap::synthetic {

namespace {

constexpr Mat3T<double> kBodyFromCamera = {{0, 0, 1, -1, 0, 0, 0, -1, 0}};  // level, looks forward
constexpr uint32_t kFirstField = 100;  // apart from the fields of the images' noise
constexpr double kSlowest_s = 17.0;

double seconds_of(int64_t index) {
  return static_cast<double>(index) / kOdometryRateHz;
}
Stamp stamp_of(int64_t index) {
  return {std::llround(seconds_of(index) * 1e9)};
}

bool slipping(double t_s) {
  return std::fmod(t_s, kSlipEveryS) >= kSlipEveryS - kSlipS;
}

}  // namespace

WheelOdometry::WheelOdometry(const Scene& scene, uint64_t seed, bool slips)
    : scene_(scene), seed_(seed), slips_(slips) {}

Status WheelOdometry::at(Stamp stamp, OdometrySample& sample) {
  // Asked far ahead (frames were passed over): begin anew, with what the ring would still hold.
  const auto latest = static_cast<int64_t>(std::floor(stamp.seconds() * kOdometryRateHz));
  constexpr auto kHeld = static_cast<int64_t>(OdometryRing::kSamples);
  if (latest - next_ > kHeld) {
    ring_.clear();
    next_ = latest - kHeld;
  }
  while (!(stamp < stamp_of(next_))) add_sample();
  return ring_.at(stamp, sample);
}

Se3d WheelOdometry::true_body(int64_t index) const {
  const Se3d T_world_cam = scene_.camera(seconds_of(index));
  return {T_world_cam.rotation * transposed(kBodyFromCamera), T_world_cam.translation};
}

/// About normal, variance 1.
double WheelOdometry::noise(uint32_t field) const {
  const uint32_t key = field_key(seed_, static_cast<uint32_t>(next_), kFirstField + field);
  double sum = 0;
  for (int32_t i = 0; i < 12; ++i) sum += static_cast<double>(unit(pixel_bits(key, i, 0)));
  return sum - 6.0;
}

void WheelOdometry::add_sample() {
  const Se3d body = true_body(next_);
  if (ring_.count() > 0) {
    const double t_s = seconds_of(next_);
    Twistd step = log(inverse(T_world_body_) * body);
    const double way_m = norm(step.v);
    const double start = static_cast<double>(seed_ % 97) / 97.0;
    const double place_noise = kOdometryNoise * std::sqrt(way_m) + kOdometryRestNoiseM;
    const double turn_noise = kDegree * kOdometryTurnNoiseDeg * std::sqrt(way_m) + kOdometryRestNoiseM;
    step.v = (1.0 + kOdometryScale * wave(t_s, kSlowest_s, start)) * step.v +
             place_noise * Vec3d{noise(0), noise(1), noise(2)};
    step.w = (1.0 + kOdometryTurnScale * wave(t_s, kSlowest_s, start + 0.3)) * step.w +
             turn_noise * Vec3d{noise(3), noise(4), noise(5)};
    if (slips_ && slipping(t_s)) step.v.x += kSlipMPerS / kOdometryRateHz;
    T_odom_body_ = T_odom_body_ * exp(step);
    T_odom_body_.rotation = orthonormalized(T_odom_body_.rotation);
  }
  T_world_body_ = body;
  ring_.push({stamp_of(next_), T_odom_body_});
  ++next_;
}

}  // namespace stillmap::synthetic
