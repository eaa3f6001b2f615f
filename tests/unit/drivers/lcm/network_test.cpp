// Our side of the network against LCM's own library, in a network of the test's own.

#include <gtest/gtest.h>
#include <lcm/lcm.h>

#include <bot_core/pose_t.hpp>
#include <chrono>
#include <cmath>
#include <limits>
#include <random>
#include <stillmap/command_t.hpp>
#include <string>
#include <thread>
#include <vector>

#include "drivers/lcm/lcm.hpp"
#include "tests/support/private_network.hpp"
#include "tests/support/sample_messages.hpp"

namespace stillmap {
namespace {

using Bytes = std::vector<uint8_t>;
using std::chrono::milliseconds;

constexpr milliseconds kPatience{10000};

/// @return whether it came true in time
template <class Condition>
bool eventually(Condition condition) {
  const auto until = std::chrono::steady_clock::now() + kPatience;
  while (!condition()) {
    if (std::chrono::steady_clock::now() > until) return false;
    std::this_thread::sleep_for(milliseconds(2));
  }
  return true;
}

/// The library.
class Library {
 public:
  struct Heard {
    std::string channel;
    Bytes payload;
  };

  Library() : lcm_(lcm_create(kLcmDefaultUrl)) {
    if (lcm_) lcm_subscribe(lcm_, ".*", hear, this);
  }
  ~Library() {
    if (lcm_) lcm_destroy(lcm_);
  }
  Library(const Library&) = delete;
  Library& operator=(const Library&) = delete;

  void publish(const char* channel, const Bytes& payload) {
    EXPECT_EQ(lcm_publish(lcm_, channel, payload.data(), static_cast<unsigned>(payload.size())), 0);
  }
  template <class Type>
  void publish(const char* channel, const Type& message) {
    Bytes payload(static_cast<size_t>(message.getEncodedSize()));
    message.encode(payload.data(), 0, static_cast<int>(payload.size()));
    publish(channel, payload);
  }
  /// The next message, or none in time.
  Heard next() {
    heard_ = {};
    lcm_handle_timeout(lcm_, static_cast<int>(kPatience.count()));
    return heard_;
  }

 private:
  static void hear(const lcm_recv_buf_t* buffer, const char* channel, void* self) {
    const auto* data = static_cast<const uint8_t*>(buffer->data);
    static_cast<Library*>(self)->heard_ = {channel, {data, data + buffer->data_size}};
  }

  lcm_t* lcm_;
  Heard heard_;
};

template <class Message>
Bytes on_the_wire(const Message& message) {
  Bytes bytes(kDatagramBytes);
  bytes.resize(make_lcm_codec()->encode(message, {bytes.data(), kDatagramBytes}));
  return bytes;
}

View<const uint8_t> bytes_of(const Bytes& bytes) {
  return {bytes.data(), static_cast<uint32_t>(bytes.size())};
}

bot_core::pose_t body_at(int64_t utime, double x) {
  bot_core::pose_t pose{};
  pose.utime = utime;
  pose.pos[0] = x;
  pose.orientation[0] = 1;
  return pose;
}

Stamp plain_clock(Utime utime) {
  return {utime.us * 1000};
}

class LcmNetwork : public ::testing::Test {
 protected:
  static void SetUpTestSuite() { private_ = PrivateNetwork::enter(); }
  void SetUp() override {
    if (!private_) GTEST_SKIP() << "network namespaces are not permitted here";
    ASSERT_TRUE(PrivateNetwork::add_multicast_route());
  }
  void TearDown() override {
    if (private_) PrivateNetwork::remove_multicast_route();
  }
  static bool private_;
};
bool LcmNetwork::private_ = false;

TEST_F(LcmNetwork, TheLibraryHearsWhatTheBusPublishes) {
  Library library;
  auto bus = open_lcm_bus(kLcmDefaultUrl);
  ASSERT_TRUE(bus) << bus.error();
  const Bytes pose = on_the_wire(samples::pose()), longest(kDatagramBytes, 0xA5);
  ASSERT_EQ((*bus)->publish(kPoseChannel, bytes_of(pose)), Status::ok);
  ASSERT_EQ((*bus)->publish(std::string(63, 'c').c_str(), bytes_of(longest)), Status::ok);
  const Library::Heard first = library.next(), second = library.next();
  EXPECT_EQ(first.channel, "STILLMAP_POSE");
  EXPECT_EQ(first.payload, pose);
  EXPECT_EQ(second.channel, std::string(63, 'c'));
  EXPECT_EQ(second.payload, longest);
}

TEST_F(LcmNetwork, TheBusRefusesWhatDoesNotFit) {
  auto bus = open_lcm_bus(kLcmDefaultUrl);
  ASSERT_TRUE(bus) << bus.error();
  EXPECT_EQ((*bus)->publish(kPoseChannel, bytes_of(Bytes(kDatagramBytes + 1))), Status::out_of_range);
  EXPECT_EQ((*bus)->publish(std::string(64, 'c').c_str(), bytes_of(Bytes(8))), Status::out_of_range);
}

TEST_F(LcmNetwork, TheBusGoesOnWithoutARouteAndFindsOneThatComesBack) {
  PrivateNetwork::remove_multicast_route();
  auto bus = open_lcm_bus(kLcmDefaultUrl);
  ASSERT_TRUE(bus) << bus.error();
  const Bytes pose = on_the_wire(samples::pose());
  for (int i = 0; i < 3; ++i) EXPECT_EQ((*bus)->publish(kPoseChannel, bytes_of(pose)), Status::unavailable);
  PrivateNetwork::add_multicast_route();
  EXPECT_TRUE(eventually([&] { return (*bus)->publish(kPoseChannel, bytes_of(pose)) == Status::ok; }));
}

TEST_F(LcmNetwork, WithATtlTheBusFindsARouteAtOnce) {
  PrivateNetwork::remove_multicast_route();
  auto bus = open_lcm_bus("udpm://239.255.76.67:7667?ttl=1");
  ASSERT_TRUE(bus) << bus.error();
  const Bytes pose = on_the_wire(samples::pose());
  EXPECT_EQ((*bus)->publish(kPoseChannel, bytes_of(pose)), Status::unavailable);
  PrivateNetwork::add_multicast_route();
  EXPECT_EQ((*bus)->publish(kPoseChannel, bytes_of(pose)), Status::ok);
}

TEST_F(LcmNetwork, CommandsOfTheLibraryComeInInOrder) {
  auto commands = open_lcm_commands(kLcmDefaultUrl);
  ASSERT_TRUE(commands) << commands.error();
  Library library;
  stillmap::command_t sent;
  sent.utime = 5, sent.command = stillmap::command_t::SAVE_MAP, sent.file = "hall.smap";
  CommandMessage command;
  EXPECT_EQ((*commands)->next(command), Status::timeout);
  for (sent.id = 1; sent.id <= 10; ++sent.id) library.publish(kCommandChannel, sent);
  for (uint32_t id = 1; id <= 10; ++id) {
    ASSERT_TRUE(eventually([&] { return (*commands)->next(command) == Status::ok; }));
    EXPECT_EQ(command.id, id);
    EXPECT_EQ(command.command, Command::save_map);
    EXPECT_EQ(command.utime.us, 5);
    EXPECT_STREQ(command.file.data(), "hall.smap");
  }
  EXPECT_EQ((*commands)->refused(), 0u);
}

TEST_F(LcmNetwork, CommandsBeyondTheQueueAreRefusedAndCounted) {
  auto commands = open_lcm_commands(kLcmDefaultUrl);
  ASSERT_TRUE(commands) << commands.error();
  Library library;
  stillmap::command_t sent;
  sent.utime = 5, sent.command = stillmap::command_t::RESET;
  for (sent.id = 1; sent.id <= 20; ++sent.id) library.publish(kCommandChannel, sent);
  ASSERT_TRUE(eventually([&] { return (*commands)->refused() == 4; })) << (*commands)->refused();
  CommandMessage command;
  for (uint32_t id = 1; id <= 16; ++id) {
    ASSERT_EQ((*commands)->next(command), Status::ok);
    EXPECT_EQ(command.id, id);
  }
  EXPECT_EQ((*commands)->next(command), Status::timeout);
}

TEST_F(LcmNetwork, ForeignMessagesOnOurChannelsAreCountedAndDoNoHarm) {
  auto commands = open_lcm_commands(kLcmDefaultUrl);
  ASSERT_TRUE(commands) << commands.error();
  Library library;
  std::mt19937_64 random(7);
  const Bytes good = on_the_wire(samples::command());
  const int kWrong = 500;
  for (int i = 0; i < kWrong; ++i) {
    Bytes bytes = good;
    if (i % 3 == 0) bytes.resize(random() % good.size());                      // short
    if (i % 3 == 1) bytes[random() % 8] ^= static_cast<uint8_t>(1 + i % 255);  // another type
    if (i % 3 == 2)
      bytes.assign(random() % 5000, static_cast<uint8_t>(random()));  // noise, some in fragments
    library.publish(kCommandChannel, bytes);
    library.publish("ELSEWHERE", bytes);
    // Not to flood the receiver, which is slow on a busy machine.
    if (i % 20 != 19) continue;
    ASSERT_TRUE(eventually([&] { return (*commands)->refused() == static_cast<uint32_t>(i + 1); })) << i;
  }
  library.publish(kCommandChannel, good);
  CommandMessage command;
  ASSERT_TRUE(eventually([&] { return (*commands)->next(command) == Status::ok; }));
  EXPECT_EQ(command.id, samples::command().id);
  EXPECT_EQ((*commands)->refused(), static_cast<uint32_t>(kWrong));
}

TEST_F(LcmNetwork, CommandsAreHeardOnceThereIsARoute) {
  PrivateNetwork::remove_multicast_route();
  auto commands = open_lcm_commands(kLcmDefaultUrl);
  ASSERT_TRUE(commands) << commands.error();
  PrivateNetwork::add_multicast_route();
  auto bus = open_lcm_bus("udpm://239.255.76.67:7667?ttl=1");  // with ttl 0 it would be a member itself
  ASSERT_TRUE(bus) << bus.error();
  CommandMessage command;
  EXPECT_TRUE(eventually([&] {
    (void)(*bus)->publish(kCommandChannel, bytes_of(on_the_wire(samples::command())));
    return (*commands)->next(command) == Status::ok;
  }));
}

/// Waits until `odometry` answers with a sample of that stamp.
bool heard(OdometryPort& odometry, int64_t stamp_ns) {
  OdometrySample sample;
  return eventually(
      [&] { return odometry.at({stamp_ns}, sample) == Status::ok && sample.stamp.ns == stamp_ns; });
}

TEST_F(LcmNetwork, OdometryIsThatOfBotCoresPose) {
  auto odometry = open_lcm_odometry(kLcmDefaultUrl, [](Utime utime) { return Stamp{utime.us * 1000 - 500}; });
  ASSERT_TRUE(odometry) << odometry.error();
  Library library;
  bot_core::pose_t pose = body_at(1'000'000, 1.5);
  pose.orientation[0] = std::cos(0.2), pose.orientation[3] = std::sin(0.2);  // a turn of 0.4 about z
  library.publish(kOdometryChannel, pose);
  library.publish(kOdometryChannel, body_at(1'020'000, 2.5));
  ASSERT_TRUE(heard(**odometry, 1'020'000'000 - 500));
  OdometrySample sample;
  ASSERT_EQ((*odometry)->at({1'000'000'000 - 500}, sample), Status::ok);
  EXPECT_EQ(sample.stamp.ns, 1'000'000'000 - 500);
  EXPECT_EQ(sample.T_odom_body.translation.x, 1.5);
  EXPECT_NEAR(log_rotation(sample.T_odom_body.rotation).z, 0.4, 1e-12);
  EXPECT_EQ((*odometry)->at({1'000'000'000 - 501}, sample), Status::timeout);
}

TEST_F(LcmNetwork, OdometryThatIsNoPoseOfABodyIsRefused) {
  auto odometry = open_lcm_odometry(kLcmDefaultUrl, plain_clock);
  ASSERT_TRUE(odometry) << odometry.error();
  Library library;
  std::vector<bot_core::pose_t> wrong(6, body_at(1000, 1));
  wrong[0].pos[1] = std::numeric_limits<double>::quiet_NaN();
  wrong[1].pos[2] = std::numeric_limits<double>::infinity();
  wrong[2].orientation[0] = 0;
  wrong[3].orientation[1] = std::numeric_limits<double>::quiet_NaN();
  wrong[4].utime = -1;
  wrong[5].utime = std::numeric_limits<int64_t>::max();
  for (const auto& pose : wrong) library.publish(kOdometryChannel, pose);
  library.publish(kOdometryChannel, on_the_wire(samples::range()));
  library.publish(kOdometryChannel, body_at(2000, 1));
  EXPECT_TRUE(heard(**odometry, 2'000'000));
  EXPECT_EQ((*odometry)->refused(), 7u);
}

TEST_F(LcmNetwork, OneWrongStampDoesNotShutOutTheOdometry) {
  auto odometry = open_lcm_odometry(kLcmDefaultUrl, plain_clock);
  ASSERT_TRUE(odometry) << odometry.error();
  Library library;
  library.publish(kOdometryChannel, body_at(1'000'000, 1));
  library.publish(kOdometryChannel, body_at(4'000'000'000'000'000, 9));
  library.publish(kOdometryChannel, body_at(1'020'000, 2));
  library.publish(kOdometryChannel, body_at(1'010'000, 7));  // late: passed over
  library.publish(kOdometryChannel, body_at(1'040'000, 3));
  ASSERT_TRUE(heard(**odometry, 1'040'000'000));
  OdometrySample sample;
  ASSERT_EQ((*odometry)->at({1'030'000'000}, sample), Status::ok);
  EXPECT_DOUBLE_EQ(sample.T_odom_body.translation.x, 2.5);
  EXPECT_EQ((*odometry)->at({1'000'000'000}, sample), Status::timeout) << "from before the jump";
}

TEST_F(LcmNetwork, OdometryOfTwoThreads) {
  auto odometry = open_lcm_odometry(kLcmDefaultUrl, plain_clock);
  ASSERT_TRUE(odometry) << odometry.error();
  std::jthread publisher([](const std::stop_token& stop) {
    Library library;
    for (int64_t i = 0; i < 20000 && !stop.stop_requested(); ++i) {
      library.publish(kOdometryChannel, body_at(i * 1000, 0.001 * static_cast<double>(i)));
      std::this_thread::sleep_for(std::chrono::microseconds(100));
    }
  });
  OdometrySample sample;
  int64_t newest_ns = 0;
  EXPECT_TRUE(eventually([&] {
    if ((*odometry)->at({1'000'000'000'000}, sample) == Status::ok) {
      EXPECT_GE(sample.stamp.ns, newest_ns);
      EXPECT_DOUBLE_EQ(sample.T_odom_body.translation.x, 1e-9 * static_cast<double>(sample.stamp.ns));
      newest_ns = sample.stamp.ns;
    }
    return newest_ns > 300'000'000;
  }));
  EXPECT_EQ((*odometry)->refused(), 0u);
}

}  // namespace
}  // namespace stillmap
