#include "runtime/range/echo_ranger.hpp"

#include <algorithm>
#include <cmath>

namespace stillmap {
namespace {

constexpr int64_t kMillisecond_ns = 1'000'000;
/// HC-SR04: an answer, also that of nothing near, begins and ends within this time after the trigger.
constexpr int64_t kLongestAnswer_ns = 100 * kMillisecond_ns;
/// Some keep the line high for so long when nothing came back. After that its fall was not seen.
constexpr int64_t kLongestPulse_ns = 250 * kMillisecond_ns;

int64_t nanoseconds(float seconds) {
  return static_cast<int64_t>(static_cast<double>(seconds) * 1e9);
}

float metres_per_ns(const SonarConfig& sonar) {
  if (sonar.kind == SonarKind::hc_sr04) return 0.5f * speed_of_sound(sonar.temperature_c) * 1e-9f;
  return 1e-3f / sonar.pulse_us_per_m;
}

}  // namespace

float speed_of_sound(float temperature_c) {
  constexpr float kAtZero_m_s = 331.3f, kZero_kelvin = 273.15f;
  return kAtZero_m_s * std::sqrt(1.0f + temperature_c / kZero_kelvin);
}

EchoRanger::EchoRanger(const SonarConfig& sonar, Stamp now)
    : sonar_(sonar),
      m_per_ns_(metres_per_ns(sonar)),
      period_ns_(nanoseconds(1.0f / sonar.rate_hz)),
      answer_ns_(sonar.kind == SonarKind::hc_sr04 ? std::min(period_ns_, kLongestAnswer_ns)
                                                  : nanoseconds(sonar.max_age_s)),
      lost_ns_(nanoseconds(sonar.lost_s)),
      stuck_ns_(nanoseconds(sonar.stuck_s)),
      filter_(sonar) {
  reopened(now);
  gone_ = false;
}

void EchoRanger::reopened(Stamp now) {
  heard_ = now;
  gone_ = true;
  any_valid_ = false;
  rose_.reset();
  waiting_since_.reset();
  if (!triggers()) waiting_since_ = now;
  waiting_ = !triggers();
  asked_ = triggers() ? Stamp{now.ns - period_ns_} : now;
}

bool EchoRanger::wants_trigger(Stamp now) const {
  if (!triggers() || waiting_ || now.ns - asked_.ns < period_ns_) return false;
  return !rose_ || now.ns - rose_->ns >= kLongestPulse_ns;
}

void EchoRanger::triggered(Stamp at) {
  asked_ = at;
  waiting_ = true;
  rose_.reset();
  if (!waiting_since_) waiting_since_ = at;
}

std::optional<RangeReading> EchoRanger::take(const EchoEdge& edge) {
  if (triggers())
    waiting_since_.reset();
  else
    waiting_since_ = edge.stamp;
  if (!edge.rising) return end_pulse(edge.stamp);
  if (rose_ || !waiting_) ++spurious_;  // the fall between the two was lost, or nobody asked
  rose_ = edge.stamp;
  return {};
}

std::optional<RangeReading> EchoRanger::end_pulse(Stamp fell) {
  if (!rose_) {
    ++spurious_;
    return {};
  }
  const Stamp rose = *rose_;
  rose_.reset();
  // Nobody asked; or the answer came too late: that there was no echo has been said.
  if (!waiting_ || rose < asked_) return {};
  const int64_t pulse_ns = fell.ns - rose.ns;
  const float range_m = metres(pulse_ns);
  if (range_m < sonar_.min_m) {  // the answer may still come
    ++spurious_;
    return {};
  }
  waiting_ = !triggers();
  if (!triggers()) asked_ = fell;
  const Stamp middle{rose.ns + pulse_ns / 2};
  return range_m > sonar_.max_m ? no_echo(middle) : echo(middle, range_m);
}

RangeReading EchoRanger::echo(Stamp at, float range_m) {
  const std::optional<float> believed_m = filter_.add(at, range_m);
  if (believed_m) {
    heard_ = at;
    any_valid_ = true;
    gone_ = false;
  }
  if (range_m < sonar_.stop_m)
    stop_ = true;
  else if (believed_m && *believed_m >= sonar_.stop_m)
    stop_ = false;
  return {at, believed_m.value_or(range_m), believed_m.has_value(), stop_};
}

std::optional<RangeReading> EchoRanger::take_silence(Stamp now) {
  if (!waiting_ || now.ns - asked_.ns < answer_ns_) return {};
  if (triggers()) {
    waiting_ = false;
    return no_echo(asked_);
  }
  asked_ = now;
  return no_echo(now);
}

Stamp EchoRanger::next_due(Stamp now) const {
  int64_t due_ns = asked_.ns + (waiting_ ? answer_ns_ : period_ns_);
  if (!waiting_ && rose_) due_ns = std::max(due_ns, rose_->ns + kLongestPulse_ns);
  return {std::max(due_ns, now.ns)};
}

}  // namespace stillmap
