#include <gtest/gtest.h>

#include <array>
#include <bot_core/pose_t.hpp>
#include <cstdlib>
#include <random>
#include <stillmap/command_t.hpp>
#include <stillmap/decision_t.hpp>
#include <stillmap/event_t.hpp>
#include <stillmap/frame_t.hpp>
#include <stillmap/pose_t.hpp>
#include <stillmap/range_t.hpp>
#include <stillmap/session_t.hpp>
#include <stillmap/status_t.hpp>
#include <string>
#include <vector>

#include "drivers/lcm/lcm.hpp"
#include "tests/support/sample_messages.hpp"

namespace stillmap {
namespace {

using Bytes = std::vector<uint8_t>;

View<const uint8_t> view_of(const Bytes& bytes) {
  return {bytes.data(), static_cast<uint32_t>(bytes.size())};
}

template <class Message>
Bytes encoded(const Message& message) {
  Bytes bytes(4096);
  bytes.resize(make_lcm_codec()->encode(message, {bytes.data(), static_cast<uint32_t>(bytes.size())}));
  return bytes;
}

template <class Message>
Status decode(const Bytes& bytes, Message& message) {
  return make_lcm_codec()->decode(view_of(bytes), message);
}

/// @param theirs a type of lcm-gen
template <class Theirs>
Bytes generated(const Theirs& theirs) {
  Bytes bytes(static_cast<size_t>(theirs.getEncodedSize()));
  EXPECT_EQ(theirs.encode(bytes.data(), 0, static_cast<int>(bytes.size())), static_cast<int>(bytes.size()));
  return bytes;
}

template <class Theirs, class Ours>
void copy_pose(Theirs& theirs, const Ours& ours) {
  theirs.utime = ours.utime.us;
  std::copy_n(ours.pos_m, 3, theirs.pos);
  std::copy_n(ours.vel_m_s, 3, theirs.vel);
  std::copy_n(ours.orientation_wxyz, 4, theirs.orientation);
  std::copy_n(ours.rotation_rate_rad_s, 3, theirs.rotation_rate);
  std::copy_n(ours.accel_m_s2, 3, theirs.accel);
}

stillmap::status_t lcm_status(const StatusMessage& m) {
  stillmap::status_t t;
  t.utime = m.utime.us, t.frame = m.frame;
  t.mode = stillmap::status_t::MODE_DEGRADED, t.state = stillmap::status_t::STATE_POOR;
  t.shed = stillmap::status_t::SHED_FINEST_LEVEL;
  std::copy_n(m.covariance, 21, t.covariance);
  t.p_good = m.p_good, t.inlier_ratio = m.inlier_ratio, t.masked_fraction = m.masked_fraction;
  t.prepare_ms = m.prepare_ms, t.track_ms = m.track_ms, t.mask_ms = m.mask_ms, t.refine_ms = m.refine_ms;
  t.integrate_ms = m.integrate_ms, t.total_ms = m.total_ms, t.pose_age_ms = m.pose_age_ms;
  t.rate_hz = m.rate_hz, t.map_fill = m.map_fill, t.map_blocks = m.map_blocks;
  t.frames_dropped = m.frames_dropped, t.results_dropped = m.results_dropped;
  t.deadline_misses = m.deadline_misses;
  t.faults_latched = static_cast<int64_t>(m.faults_latched);
  t.faults_active = static_cast<int64_t>(m.faults_active);
  t.fault_kinds = kFaults;
  t.fault_count.assign(std::begin(m.fault_count), std::end(m.fault_count));
  t.pose_epoch = m.pose_epoch, t.map_id = static_cast<int64_t>(m.map_id);
  t.command_id = static_cast<int32_t>(m.command_id), t.command_result = stillmap::status_t::COMMAND_FAILED;
  return t;
}

stillmap::frame_t lcm_frame(const FrameMessage& m) {
  stillmap::frame_t t;
  t.utime = m.utime.us, t.depth_stamp_ns = m.depth_stamp.ns, t.colour_stamp_ns = m.colour_stamp.ns;
  t.sequence = m.sequence;
  t.depth_coding = stillmap::frame_t::CODING_ZSTD_DEPTH, t.colour_coding = stillmap::frame_t::CODING_JPEG;
  t.crc32c = static_cast<int32_t>(m.crc32c);
  t.depth_size = static_cast<int32_t>(m.depth.size), t.depth.assign(m.depth.begin(), m.depth.end());
  t.colour_size = static_cast<int32_t>(m.colour.size), t.colour.assign(m.colour.begin(), m.colour.end());
  return t;
}

void copy_transform(const Se3d& from, double* to) {
  std::copy_n(from.rotation.m, 9, to);
  to[9] = from.translation.x, to[10] = from.translation.y, to[11] = from.translation.z;
}

stillmap::decision_t lcm_decision(const DecisionMessage& m) {
  stillmap::decision_t t;
  t.utime = m.utime.us, t.sequence = m.sequence, t.used = m.used;
  t.shed = stillmap::status_t::SHED_EVERY_SECOND_INTEGRATION;
  t.integrated = m.integrated, t.new_map = m.new_map, t.archive_answers = m.archive_answers;
  t.odometry_answers = static_cast<int32_t>(m.odometry_answers);
  for (size_t i = 0; i < kOdometryAnswers; ++i) {
    t.odometry_asked_ns[i] = m.odometry[i].asked.ns;
    t.odometry_stamp_ns[i] = m.odometry[i].sample.stamp.ns;
    copy_transform(m.odometry[i].sample.T_odom_body, t.T_odom_body[i]);
  }
  t.sonar_m = m.sonar_m;
  return t;
}

stillmap::session_t lcm_session(const SessionMessage& m) {
  stillmap::session_t t;
  t.utime = m.utime.us, t.version = m.version, t.source = m.source, t.config_toml = m.config_toml;
  t.width = m.width, t.height = m.height, t.depth_units_per_m = m.depth_units_per_m;
  std::copy_n(m.k, 4, t.k);
  std::copy_n(m.distortion, 5, t.distortion);
  copy_transform(m.T_map_cam, t.T_map_cam);
  t.map = m.map;
  std::copy_n(m.depth_bias, 4, t.depth_bias);
  return t;
}

TEST(LcmCodec, WritesPosesAsLcmGenDoes) {
  const PoseMessage message = samples::pose();
  stillmap::pose_t theirs;
  copy_pose(theirs, message);
  EXPECT_EQ(encoded(message), generated(theirs));
}

TEST(LcmCodec, APoseIsThatOfBotCore) {
  const PoseMessage message = samples::pose();
  bot_core::pose_t theirs;
  copy_pose(theirs, message);
  EXPECT_EQ(encoded(message), generated(theirs));
}

TEST(LcmCodec, WritesTheStatusAsLcmGenDoes) {
  const StatusMessage message = samples::status();
  EXPECT_EQ(encoded(message), generated(lcm_status(message)));
}

TEST(LcmCodec, WritesRangesAsLcmGenDoes) {
  const RangeMessage message = samples::range();
  stillmap::range_t theirs;
  theirs.utime = message.utime.us, theirs.range = message.range_m, theirs.max_range = message.max_range_m;
  theirs.valid = 1, theirs.stop = 1;
  EXPECT_EQ(encoded(message), generated(theirs));
}

TEST(LcmCodec, WritesCommandsAsLcmGenDoes) {
  const CommandMessage message = samples::command();
  stillmap::command_t theirs;
  theirs.utime = message.utime.us, theirs.id = 77, theirs.command = stillmap::command_t::SAVE_MESH;
  theirs.file = "hall.ply";
  EXPECT_EQ(encoded(message), generated(theirs));
}

TEST(LcmCodec, WritesFramesAsLcmGenDoes) {
  EXPECT_EQ(encoded(samples::frame()), generated(lcm_frame(samples::frame())));
  EXPECT_EQ(encoded(FrameMessage{}).size(), generated(stillmap::frame_t{}).size()) << "without images";
}

TEST(LcmCodec, WritesDecisionsAsLcmGenDoes) {
  EXPECT_EQ(encoded(samples::decision()), generated(lcm_decision(samples::decision())));
}

TEST(LcmCodec, WritesSessionsAsLcmGenDoes) {
  EXPECT_EQ(encoded(samples::session()), generated(lcm_session(samples::session())));
}

/// As a program before this one wrote it: another fingerprint, and the last member is missing.
Bytes as_older(Bytes bytes, uint64_t fingerprint, size_t last_member_bytes) {
  for (size_t i = 0; i < 8; ++i) bytes[i] = static_cast<uint8_t>(fingerprint >> (56 - 8 * i));
  bytes.resize(bytes.size() - last_member_bytes);
  return bytes;
}

TEST(LcmCodec, ReadsDecisionsAndSessionsOfOlderLogs) {
  const Bytes decision = as_older(encoded(samples::decision()), 0x58644e1b0cab23bd, 4);
  DecisionMessage read;
  read.sonar_m = 9;
  ASSERT_EQ(decode(decision, read), Status::ok);
  EXPECT_EQ(read.sonar_m, 0.0f);
  EXPECT_EQ(read.sequence, samples::decision().sequence);
  EXPECT_EQ(decode(as_older(decision, 0x58644e1b0cab23bd, 1), read), Status::bad_data);
  SessionMessage session;
  const Bytes bytes = as_older(encoded(samples::session()), 0x534fa6b20e22fff9, 32);
  ASSERT_EQ(decode(bytes, session), Status::ok);
  EXPECT_EQ(session.map, samples::session().map);
  EXPECT_EQ(session.depth_bias[1], 1.0) << "none";
}

TEST(LcmCodec, RefusesADistanceThatIsNone) {
  DecisionMessage message = samples::decision(), read;
  for (const float sonar_m : {-1.0f, 1e9f, std::numeric_limits<float>::quiet_NaN()}) {
    message.sonar_m = sonar_m;
    EXPECT_EQ(decode(encoded(message), read), Status::bad_data) << sonar_m;
  }
}

TEST(LcmCodec, WritesEventsAsLcmGenDoes) {
  const EventMessage message = samples::event();
  stillmap::event_t theirs;
  theirs.utime = message.utime.us, theirs.fault = 1, theirs.name = message.name, theirs.text = message.text;
  EXPECT_EQ(encoded(message), generated(theirs));
}

template <class Message>
void expect_same_after_reading(const Message& message) {
  const Bytes bytes = encoded(message);
  Message read;
  ASSERT_EQ(decode(bytes, read), Status::ok);
  EXPECT_EQ(encoded(read), bytes);
}

// The bytes are lcm-gen's, each member's differ from its neighbours': what encodes to the same bytes is the
// same.
TEST(LcmCodec, ReadsWhatItWrote) {
  expect_same_after_reading(samples::pose());
  expect_same_after_reading(samples::status());
  expect_same_after_reading(samples::range());
  expect_same_after_reading(samples::command());
  expect_same_after_reading(samples::frame());
  expect_same_after_reading(samples::decision());
  expect_same_after_reading(samples::session());
  expect_same_after_reading(samples::event());
}

template <class Message>
void expect_every_cut_refused(const Message& message) {
  const Bytes bytes = encoded(message);
  ASSERT_GT(bytes.size(), 0u);
  for (size_t length = 0; length < bytes.size(); ++length) {
    Message read;
    EXPECT_EQ(decode(Bytes(bytes.begin(), bytes.begin() + static_cast<ptrdiff_t>(length)), read),
              Status::bad_data);
    Bytes room(length);
    EXPECT_EQ(make_lcm_codec()->encode(message, {room.data(), static_cast<uint32_t>(length)}), 0u);
  }
  Bytes longer = bytes;
  longer.push_back(0);
  Message read;
  EXPECT_EQ(decode(longer, read), Status::bad_data);
}

TEST(LcmCodec, RefusesEveryOtherLength) {
  expect_every_cut_refused(samples::pose());
  expect_every_cut_refused(samples::status());
  expect_every_cut_refused(samples::range());
  expect_every_cut_refused(samples::command());
  expect_every_cut_refused(samples::frame());
  expect_every_cut_refused(samples::decision());
  expect_every_cut_refused(samples::session());
  expect_every_cut_refused(samples::event());
}

TEST(LcmCodec, RefusesAnotherType) {
  RangeMessage range;
  EXPECT_EQ(decode(encoded(samples::pose()), range), Status::bad_data);
}

TEST(LcmCodec, LeavesTheMessageAloneWhenItRefuses) {
  Bytes bytes = encoded(samples::range());
  bytes.back() = 2;  // no boolean
  RangeMessage message = samples::range();
  message.range_m = 9;
  EXPECT_EQ(decode(bytes, message), Status::bad_data);
  EXPECT_EQ(message.range_m, 9);
}

TEST(LcmCodec, RefusesACommandThatDoesNotExist) {
  stillmap::command_t theirs;
  theirs.utime = 1, theirs.id = 2;
  for (int command : {-1, 0, 5, 127}) {
    theirs.command = static_cast<int8_t>(command);
    CommandMessage message;
    EXPECT_EQ(decode(generated(theirs), message), Status::bad_data) << command;
  }
}

TEST(LcmCodec, RefusesAFileNameThatIsTooLong) {
  stillmap::command_t theirs;
  theirs.utime = 1, theirs.id = 2, theirs.command = stillmap::command_t::SAVE_MAP;
  CommandMessage message;
  theirs.file = std::string(63, 'x');
  EXPECT_EQ(decode(generated(theirs), message), Status::ok);
  EXPECT_EQ(std::string(message.file.data()), theirs.file);
  theirs.file += 'x';
  EXPECT_EQ(decode(generated(theirs), message), Status::bad_data);
}

TEST(LcmCodec, RefusesAStringWithA0Inside) {
  stillmap::event_t theirs;
  theirs.utime = 1, theirs.fault = 0, theirs.text = "text";
  theirs.name = "name";
  Bytes bytes = generated(theirs);
  EventMessage message;
  ASSERT_EQ(decode(bytes, message), Status::ok);
  const size_t name_at = 8 + 8 + 1 + 4;
  bytes[name_at + 1] = 0;
  EXPECT_EQ(decode(bytes, message), Status::bad_data);
}

TEST(LcmCodec, RefusesACounterBelow0) {
  stillmap::decision_t theirs = lcm_decision(samples::decision());
  theirs.sequence = -1;
  DecisionMessage message;
  EXPECT_EQ(decode(generated(theirs), message), Status::bad_data);
}

TEST(LcmCodec, CutsLongEventsBetweenCharacters) {
  std::string name(63, 'n'), text(1200, 't');
  name += "\xC3\xA4";  // its first byte would be the 64th
  EventMessage message = samples::event();
  message.name = name, message.text = text;
  const Bytes bytes = encoded(message);
  EventMessage read;
  ASSERT_EQ(decode(bytes, read), Status::ok);
  EXPECT_EQ(read.name, std::string(63, 'n'));
  EXPECT_EQ(read.text, std::string(1000, 't'));
}

TEST(LcmCodec, ReadsTheStatusOfProgramsThatKnowMoreOrFewerFaults) {
  stillmap::status_t theirs = lcm_status(samples::status());
  for (int32_t kinds : {0, 3, 64}) {
    theirs.fault_kinds = kinds;
    theirs.fault_count.assign(static_cast<size_t>(kinds), 5);
    StatusMessage message;
    ASSERT_EQ(decode(generated(theirs), message), Status::ok);
    for (int32_t kind = 0; kind < static_cast<int32_t>(kFaults); ++kind)
      EXPECT_EQ(message.fault_count[kind], kind < kinds ? 5u : 0u);
    EXPECT_EQ(message.command_result, CommandResult::failed);
  }
  theirs.fault_kinds = 65;
  theirs.fault_count.assign(65, 5);
  StatusMessage message;
  EXPECT_EQ(decode(generated(theirs), message), Status::bad_data);
}

TEST(LcmCodec, EveryMessageOfTheNetworkFitsADatagram) {
  StatusMessage status = samples::status();
  EXPECT_LE(encoded(status).size(), kDatagramBytes);
  EventMessage event = samples::event();
  const std::string text(2000, 't');
  event.text = event.name = text;
  EXPECT_LE(encoded(event).size(), kDatagramBytes);
}

/// Any bytes that are read as a message are written as the same bytes again.
template <class Message>
bool survives(const Bytes& bytes) {
  Message message;
  if (decode(bytes, message) != Status::ok) return false;
  const Bytes again = encoded(message);
  if constexpr (std::is_same_v<Message, StatusMessage>)  // unknown kinds of faults are not kept
    EXPECT_EQ(again.size(), encoded(StatusMessage{}).size());
  else
    EXPECT_EQ(again, bytes);
  return true;
}

// Random damage to good messages: bits, lengths, other messages' bodies, noise. Under the address sanitizer
// every read beyond the exact length of the input is seen.
TEST(LcmCodec, ReadsAnythingWithoutHarm) {
  const char* chosen = std::getenv("STILLMAP_FUZZ_SEED");
  const uint64_t seed = chosen ? std::strtoull(chosen, nullptr, 10) : 1;
  SCOPED_TRACE("STILLMAP_FUZZ_SEED=" + std::to_string(seed));
  std::mt19937_64 random(seed);
  const auto below = [&](size_t n) { return static_cast<size_t>(random() % n); };
  const std::array<Bytes, 8> good = {encoded(samples::pose()),    encoded(samples::status()),
                                     encoded(samples::range()),   encoded(samples::command()),
                                     encoded(samples::frame()),   encoded(samples::decision()),
                                     encoded(samples::session()), encoded(samples::event())};
#ifdef __SANITIZE_THREAD__  // slow there, and nothing is shared
  const int inputs = 10'000;
#else
  const int inputs = 1'000'000;
#endif
  int accepted = 0;
  for (int input = 0; input < inputs && !HasFailure(); ++input) {
    const size_t kind = below(good.size());
    Bytes bytes = good[kind];
    for (size_t damage = below(4); damage > 0; --damage) {
      const size_t at = below(bytes.size());
      const size_t what = below(4);
      if (what == 0) bytes[at] ^= static_cast<uint8_t>(1u << below(8));
      if (what == 1) bytes[at] = static_cast<uint8_t>(random());
      if (what == 2) bytes.resize(8 + below(bytes.size()));
      if (what == 3)
        std::fill_n(bytes.begin() + static_cast<ptrdiff_t>(at), std::min<size_t>(4, bytes.size() - at),
                    random());
    }
    const Bytes exact(bytes.begin(), bytes.end());
    switch (kind) {
      case 0:
        accepted += survives<PoseMessage>(exact);
        break;
      case 1:
        accepted += survives<StatusMessage>(exact);
        break;
      case 2:
        accepted += survives<RangeMessage>(exact);
        break;
      case 3:
        accepted += survives<CommandMessage>(exact);
        break;
      case 4:
        accepted += survives<FrameMessage>(exact);
        break;
      case 5:
        accepted += survives<DecisionMessage>(exact);
        break;
      case 6:
        accepted += survives<SessionMessage>(exact);
        break;
      default:
        accepted += survives<EventMessage>(exact);
        break;
    }
  }
  EXPECT_GT(accepted, inputs / 4);  // the undamaged quarter
  EXPECT_LT(accepted, inputs / 4 * 3);
}

}  // namespace
}  // namespace stillmap
