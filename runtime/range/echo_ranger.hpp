#pragma once

#include <cstdint>
#include <optional>

#include "config/config.hpp"
#include "runtime/ports/range_sensor.hpp"
#include "runtime/range/range_filter.hpp"

namespace stillmap {

/// Metres a second, in dry air.
float speed_of_sound(float temperature_c);

/// From the edges of an echo line to readings, and to what is wrong with the sonar. Knows no clock and no
/// line: it is told what happened when (CLOCK_MONOTONIC), in rising order.              test:
/// echo_ranger_test
///
/// hc_sr04: a trigger, then the line is high for as long as the sound was on its way there and back.
/// pulse_width: the line is high for sonar.pulse_us_per_m a metre, whenever the sensor likes; what the sensor
/// makes of the temperature is in that number.
/// A pulse longer than that of max_m is an answer, but no echo. One shorter than that of min_m is noise.
/// @thread one; neither waits nor allocates
class EchoRanger {
 public:
  /// @param now when the sonar was opened
  EchoRanger(const SonarConfig& sonar, Stamp now);

  /// It was opened again: what the line did before is forgotten. Whether to stop is not.
  void reopened(Stamp now);

  /// hc_sr04: it is time, and the last pulse is over. Always false for pulse_width.
  bool wants_trigger(Stamp now) const;
  void triggered(Stamp at);
  /// @return the reading that ends with this edge, where one does
  std::optional<RangeReading> take(const EchoEdge& edge);
  /// @return the reading that says that there was no echo, when its time is over
  std::optional<RangeReading> take_silence(Stamp now);
  /// When wants_trigger or take_silence will have something to say, if no edge comes.
  Stamp next_due(Stamp now) const;

  /// No valid reading for sonar.lost_s, or none since it was opened again.
  bool lost(Stamp now) const { return gone_ || now.ns - heard_.ns > lost_ns_; }
  /// No edge for sonar.stuck_s although one was due.
  bool stuck(Stamp now) const { return waiting_since_ && now.ns - waiting_since_->ns > stuck_ns_; }
  /// Something is nearer than sonar.stop_m. One echo is enough to say so, believed or not; it takes a valid
  /// reading, and an echo, from farther away to take it back: what comes too near is not heard any more.
  bool stop() const { return stop_; }
  /// The level of the stop line: low only while a valid reading that is not too old says that nothing is
  /// near.
  bool stop_line(Stamp now) const { return stop_ || !any_valid_ || lost(now) || stuck(now); }

  /// Edges and pulses that cannot be of the sensor.
  uint32_t spurious() const { return spurious_; }

 private:
  std::optional<RangeReading> end_pulse(Stamp fell);
  RangeReading echo(Stamp at, float range_m);
  RangeReading no_echo(Stamp at) const { return {at, 0, false, stop_}; }
  float metres(int64_t pulse_ns) const { return static_cast<float>(pulse_ns) * m_per_ns_; }
  bool triggers() const { return sonar_.kind == SonarKind::hc_sr04; }

  const SonarConfig sonar_;
  const float m_per_ns_;  ///< of a pulse
  const int64_t period_ns_, answer_ns_, lost_ns_, stuck_ns_;
  RangeFilter filter_;
  Stamp asked_;                         ///< hc_sr04: the last trigger; else the last pulse or silence
  bool waiting_ = false;                ///< for the pulse that comes after that
  std::optional<Stamp> rose_;           ///< the line is high since
  std::optional<Stamp> waiting_since_;  ///< for an edge
  Stamp heard_;                         ///< the last valid reading, or when it was opened
  bool any_valid_ = false;              ///< since then
  bool gone_ = false;                   ///< opened again, and no valid reading came
  bool stop_ = false;
  uint32_t spurious_ = 0;
};

}  // namespace stillmap
