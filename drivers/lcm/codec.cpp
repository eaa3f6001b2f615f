#include "drivers/lcm/codec.hpp"

#include <algorithm>
#include <concepts>

#include "drivers/lcm/lcm.hpp"
#include "drivers/lcm/wire.hpp"

namespace stillmap {
namespace {

using lcm_wire::Reader;
using lcm_wire::Writer;

/// lcm-gen's hash over the members' names, types and dimensions. They belong to the contract: a type whose
/// hash changes is another type to everyone who listens.
template <class Message>
constexpr uint64_t kFingerprint = 0;
template <>
constexpr uint64_t kFingerprint<PoseMessage> = 0x2e16efb052b0105e;
template <>
constexpr uint64_t kFingerprint<StatusMessage> = 0x6d8bbe86f7d7b363;
template <>
constexpr uint64_t kFingerprint<RangeMessage> = 0xec54b2e9289a2818;
template <>
constexpr uint64_t kFingerprint<CommandMessage> = 0x1a187596c10f0700;
template <>
constexpr uint64_t kFingerprint<FrameMessage> = 0xe55d6bb0fd38e560;
template <>
constexpr uint64_t kFingerprint<DecisionMessage> = 0xa07c902f4788300a;
template <>
constexpr uint64_t kFingerprint<SessionMessage> = 0x8d536f0dbff685c8;
template <>
constexpr uint64_t kFingerprint<EventMessage> = 0x772f33c0be0c70c9;

/// What an event log may hold that an older program wrote: the same type without its last member.
template <class Message>
constexpr uint64_t kOlderFingerprint = kFingerprint<Message>;
template <>
constexpr uint64_t kOlderFingerprint<DecisionMessage> = 0x58644e1b0cab23bd;
template <>
constexpr uint64_t kOlderFingerprint<SessionMessage> = 0x534fa6b20e22fff9;

/// Of fault_count on the wire: a bit each in faults_latched.
constexpr uint32_t kMostFaults = 64;
constexpr float kFarthest_m = 1e3f;  ///< that any sonar reaches
constexpr size_t kAnyLength = 1 << 20;
constexpr size_t kLongestEventName = 64, kLongestEventText = 1000;

template <class M, class Message>
concept Is = std::same_as<std::remove_const_t<M>, Message>;

/// The members in the order of pose_t.lcm; so each of these.
template <class Wire, Is<PoseMessage> M>
void members(Wire& wire, M& m) {
  wire.number(m.utime.us);
  wire.numbers(m.pos_m);
  wire.numbers(m.vel_m_s);
  wire.numbers(m.orientation_wxyz);
  wire.numbers(m.rotation_rate_rad_s);
  wire.numbers(m.accel_m_s2);
}

void fault_counts(Writer& wire, const uint32_t (&counts)[kFaults]) {
  wire.number(kFaults);
  for (uint32_t count : counts) wire.count(count);
}
/// Of a newer program there may be kinds that this one does not know: they are passed over.
void fault_counts(Reader& wire, uint32_t (&counts)[kFaults]) {
  uint32_t kinds = 0;
  wire.number(kinds);
  wire.require(kinds <= kMostFaults);
  std::fill(std::begin(counts), std::end(counts), 0);
  for (uint32_t kind = 0; kind < std::min(kinds, kMostFaults); ++kind) {
    uint32_t count = 0;
    wire.count(count);
    if (kind < kFaults) counts[kind] = count;
  }
}

template <class Wire, Is<StatusMessage> M>
void members(Wire& wire, M& m) {
  wire.number(m.utime.us);
  wire.count(m.frame);
  wire.one_of(m.mode, Mode::boot, Mode::safe_stop);
  wire.one_of(m.state, uint8_t{0}, uint8_t{2});
  wire.one_of(m.shed, Shed::nothing, Shed::finest_level);
  wire.numbers(m.covariance);
  for (auto* value : {&m.p_good, &m.inlier_ratio, &m.masked_fraction, &m.prepare_ms, &m.track_ms, &m.mask_ms,
                      &m.refine_ms, &m.integrate_ms, &m.total_ms, &m.pose_age_ms, &m.rate_hz, &m.map_fill})
    wire.number(*value);
  for (auto* value : {&m.map_blocks, &m.frames_dropped, &m.results_dropped, &m.deadline_misses})
    wire.count(*value);
  wire.number(m.faults_latched);
  wire.number(m.faults_active);
  fault_counts(wire, m.fault_count);
  wire.count(m.pose_epoch);
  wire.number(m.map_id);
  wire.number(m.command_id);
  wire.one_of(m.command_result, CommandResult::none, CommandResult::refused);
}

template <class Wire, Is<RangeMessage> M>
void members(Wire& wire, M& m) {
  wire.number(m.utime.us);
  wire.number(m.range_m);
  wire.number(m.max_range_m);
  wire.boolean(m.valid);
  wire.boolean(m.stop);
}

template <class Wire, Is<CommandMessage> M>
void members(Wire& wire, M& m) {
  wire.number(m.utime.us);
  wire.number(m.id);
  wire.one_of(m.command, Command::save_map, Command::stop);
  wire.text(m.file);
}

template <class Wire, Is<FrameMessage> M>
void members(Wire& wire, M& m) {
  wire.number(m.utime.us);
  wire.number(m.depth_stamp.ns);
  wire.number(m.colour_stamp.ns);
  wire.count(m.sequence);
  wire.one_of(m.depth_coding, ImageCoding::none, ImageCoding::jpeg);
  wire.one_of(m.colour_coding, ImageCoding::none, ImageCoding::jpeg);
  wire.number(m.crc32c);
  wire.bytes(m.depth);
  wire.bytes(m.colour);
}

/// Rotation by rows, then the place: what was written is what is read, to the last bit.
template <class Wire, Is<Se3d> T>
void pose(Wire& wire, T& T_a_b) {
  wire.numbers(T_a_b.rotation.m);
  for (auto* value : {&T_a_b.translation.x, &T_a_b.translation.y, &T_a_b.translation.z}) wire.number(*value);
}

template <class Wire, Is<DecisionMessage> M>
void members(Wire& wire, M& m) {
  wire.number(m.utime.us);
  wire.count(m.sequence);
  wire.boolean(m.used);
  wire.one_of(m.shed, Shed::nothing, Shed::finest_level);
  wire.boolean(m.integrated);
  wire.boolean(m.new_map);
  wire.count(m.archive_answers);
  wire.number(m.odometry_answers);
  wire.require(m.odometry_answers <= kOdometryAnswers);
  for (auto& answer : m.odometry) wire.number(answer.asked.ns);
  for (auto& answer : m.odometry) wire.number(answer.sample.stamp.ns);
  for (auto& answer : m.odometry) pose(wire, answer.sample.T_odom_body);
  if (wire.older) return;
  wire.number(m.sonar_m);
  wire.require(m.sonar_m >= 0 && m.sonar_m < kFarthest_m);
}

template <class Wire, Is<SessionMessage> M>
void members(Wire& wire, M& m) {
  wire.number(m.utime.us);
  wire.text(m.version, kAnyLength);
  wire.text(m.source, kAnyLength);
  wire.text(m.config_toml, kAnyLength);
  wire.number(m.width);
  wire.number(m.height);
  wire.numbers(m.k);
  wire.numbers(m.distortion);
  wire.number(m.depth_units_per_m);
  pose(wire, m.T_map_cam);
  wire.text(m.map, kAnyLength);
  if (!wire.older) wire.numbers(m.depth_bias);
}

template <class Wire, Is<EventMessage> M>
void members(Wire& wire, M& m) {
  wire.number(m.utime.us);
  wire.boolean(m.fault);
  wire.text(m.name, kLongestEventName);
  wire.text(m.text, kLongestEventText);
}

template <class Message>
uint32_t encoded(const Message& message, View<uint8_t> to) {
  Writer wire(to);
  wire.number(kFingerprint<Message>);
  members(wire, message);
  return wire.size();
}

template <class Message>
Status decoded(View<const uint8_t> from, Message& message) {
  Reader wire(from);
  uint64_t fingerprint = 0;
  wire.number(fingerprint);
  wire.older = fingerprint != kFingerprint<Message>;
  wire.require(!wire.older || fingerprint == kOlderFingerprint<Message>);
  Message read;
  members(wire, read);
  if (!wire.complete()) return Status::bad_data;
  message = read;
  return Status::ok;
}

}  // namespace

std::unique_ptr<MessageCodec> make_lcm_codec() {
  return std::make_unique<LcmCodec>();
}

uint32_t LcmCodec::encode(const PoseMessage& message, View<uint8_t> to) const {
  return encoded(message, to);
}
uint32_t LcmCodec::encode(const StatusMessage& message, View<uint8_t> to) const {
  return encoded(message, to);
}
uint32_t LcmCodec::encode(const RangeMessage& message, View<uint8_t> to) const {
  return encoded(message, to);
}
uint32_t LcmCodec::encode(const CommandMessage& message, View<uint8_t> to) const {
  return encoded(message, to);
}
uint32_t LcmCodec::encode(const FrameMessage& message, View<uint8_t> to) const {
  return encoded(message, to);
}
uint32_t LcmCodec::encode(const DecisionMessage& message, View<uint8_t> to) const {
  return encoded(message, to);
}
uint32_t LcmCodec::encode(const SessionMessage& message, View<uint8_t> to) const {
  return encoded(message, to);
}
uint32_t LcmCodec::encode(const EventMessage& message, View<uint8_t> to) const {
  return encoded(message, to);
}

Status LcmCodec::decode(View<const uint8_t> from, PoseMessage& message) const {
  return decoded(from, message);
}
Status LcmCodec::decode(View<const uint8_t> from, StatusMessage& message) const {
  return decoded(from, message);
}
Status LcmCodec::decode(View<const uint8_t> from, RangeMessage& message) const {
  return decoded(from, message);
}
Status LcmCodec::decode(View<const uint8_t> from, CommandMessage& message) const {
  return decoded(from, message);
}
Status LcmCodec::decode(View<const uint8_t> from, FrameMessage& message) const {
  return decoded(from, message);
}
Status LcmCodec::decode(View<const uint8_t> from, DecisionMessage& message) const {
  return decoded(from, message);
}
Status LcmCodec::decode(View<const uint8_t> from, SessionMessage& message) const {
  return decoded(from, message);
}
Status LcmCodec::decode(View<const uint8_t> from, EventMessage& message) const {
  return decoded(from, message);
}

}  // namespace stillmap
