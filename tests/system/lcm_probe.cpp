// The other ends of the network for lcm_test.py. Says "ready" once it listens or is about to publish, and
// what it saw when it is done.
//
//   lcm_probe publish URL COUNT HZ    our codec and bus: a status and a pose each; pose n is at x = n
//   lcm_probe bot-core URL            LCM's library and bot_core.pose_t alone
//   lcm_probe commands URL            our subscriber
//   lcm_probe odometry URL            our subscriber
//   lcm_probe answers URL             LCM's library: what became of commands, as the status says
//   lcm_probe ages URL                LCM's library: how old poses are when their datagrams come
//
// Listeners end when their standard input does and nothing has come for a while.

#include <lcm/lcm.h>
#include <poll.h>

#include <algorithm>
#include <bot_core/pose_t.hpp>
#include <chrono>
#include <cstdio>
#include <cstdlib>
#include <initializer_list>
#include <memory>
#include <set>
#include <string>
#include <thread>
#include <vector>

#include "drivers/lcm/lcm.hpp"
#include "tests/support/sample_messages.hpp"

namespace stillmap {
namespace {

using Clock = std::chrono::steady_clock;

double seconds_since(Clock::time_point start) {
  return std::chrono::duration<double>(Clock::now() - start).count();
}

void say_ready() {
  std::puts("ready");
  std::fflush(stdout);
}

/// Goes on as long as standard input is open, and then until nothing came for a while.
class Patience {
 public:
  bool goes_on() {
    pollfd input{0, POLLIN, 0};
    if (poll(&input, 1, 0) == 0) something_came();
    return seconds_since(last_) < kWhileS;
  }
  void something_came() { last_ = Clock::now(); }

 private:
  static constexpr double kWhileS = 0.3;
  Clock::time_point last_ = Clock::now();
};

int publish(const std::string& url, int count, double hz) {
  const auto bus = open_lcm_bus(url);
  if (!bus) return std::fprintf(stderr, "%s\n", bus.error().c_str()), 1;
  const auto codec = make_lcm_codec();
  uint8_t bytes[kDatagramBytes];
  int sent = 0, unavailable = 0;
  double longest_s = 0;
  const auto send = [&](const char* channel, const auto& message) {
    const auto start = Clock::now();
    const Status status = (*bus)->publish(channel, {bytes, codec->encode(message, {bytes, kDatagramBytes})});
    longest_s = std::max(longest_s, seconds_since(start));
    ++(status == Status::ok ? sent : unavailable);
  };
  say_ready();
  const auto start = Clock::now();
  for (int i = 0; i < count; ++i) {
    PoseMessage pose = samples::pose();
    pose.pos_m[0] = i;
    send(kPoseChannel, pose);
    send(kStatusChannel, samples::status());
    std::this_thread::sleep_until(start + std::chrono::duration<double>((i + 1) / hz));
  }
  std::printf("sent %d unavailable %d longest_ms %.0f\n", sent, unavailable, 1e3 * longest_s);
  return 0;
}

struct Subscription {
  const char* channel;
  lcm_msg_handler_t hear;
};

/// By LCM's library. @return false: it cannot
bool listen(const std::string& url, std::initializer_list<Subscription> subscriptions, void* self) {
  lcm_t* lcm = lcm_create(url.c_str());
  if (!lcm) return false;
  for (const Subscription& each : subscriptions) lcm_subscribe(lcm, each.channel, each.hear, self);
  say_ready();
  for (Patience patience; patience.goes_on();)
    if (lcm_handle_timeout(lcm, 50) > 0) patience.something_came();
  lcm_destroy(lcm);
  return true;
}

View<const uint8_t> payload(const lcm_recv_buf_t* buffer) {
  return {static_cast<const uint8_t*>(buffer->data), static_cast<uint32_t>(buffer->data_size)};
}

/// Poses that LCM's library delivered.
struct Poses {
  std::set<int> places;
  int wrong = 0;

  static void hear(const lcm_recv_buf_t* buffer, const char*, void* self) {
    auto& poses = *static_cast<Poses*>(self);
    bot_core::pose_t pose{};
    const bool read = pose.decode(buffer->data, 0, static_cast<int>(buffer->data_size)) ==
                      static_cast<int>(buffer->data_size);
    const PoseMessage sent = samples::pose();
    if (read && pose.utime == sent.utime.us &&
        std::equal(pose.orientation, pose.orientation + 4, sent.orientation_wxyz))
      poses.places.insert(static_cast<int>(pose.pos[0]));
    else
      ++poses.wrong;
  }
};

int hear_bot_core(const std::string& url) {
  Poses poses;
  if (!listen(url, {{kPoseChannel, Poses::hear}}, &poses)) return 1;
  std::printf("poses %zu first %d last %d wrong %d\n", poses.places.size(),
              poses.places.empty() ? -1 : *poses.places.begin(),
              poses.places.empty() ? -1 : *poses.places.rbegin(), poses.wrong);
  return 0;
}

int hear_commands(const std::string& url) {
  const auto commands = open_lcm_commands(url);
  if (!commands) return std::fprintf(stderr, "%s\n", commands.error().c_str()), 1;
  say_ready();
  for (Patience patience; patience.goes_on(); std::this_thread::sleep_for(std::chrono::milliseconds(5))) {
    CommandMessage command;
    while ((*commands)->next(command) == Status::ok) {
      std::printf("command %u kind %d file '%s'\n", command.id, static_cast<int>(command.command),
                  command.file.data());
      std::fflush(stdout);
      patience.something_came();
    }
  }
  std::printf("refused %u\n", (*commands)->refused());
  return 0;
}

int hear_odometry(const std::string& url) {
  const auto odometry = open_lcm_odometry(url, [](Utime utime) { return Stamp{1000 * utime.us}; });
  if (!odometry) return std::fprintf(stderr, "%s\n", odometry.error().c_str()), 1;
  say_ready();
  OdometrySample sample;
  const Stamp far_ahead{int64_t{1} << 62};
  bool any = false;
  for (Patience patience; patience.goes_on(); std::this_thread::sleep_for(std::chrono::milliseconds(5)))
    any = (*odometry)->at(far_ahead, sample) == Status::ok || any;
  std::printf("%s x %.3f refused %u\n", any ? "odometry" : "none", sample.T_odom_body.translation.x,
              (*odometry)->refused());
  return 0;
}

/// A line for every command, and for every change of what became of it.
struct Answers {
  std::unique_ptr<MessageCodec> codec = make_lcm_codec();
  uint32_t id = UINT32_MAX;  ///< that nobody uses: the first status is a change
  CommandResult result = CommandResult::none;

  static void hear(const lcm_recv_buf_t* buffer, const char*, void* self) {
    StatusMessage s;
    auto& answers = *static_cast<Answers*>(self);
    if (answers.codec->decode(payload(buffer), s) != Status::ok) return;
    if (s.command_id == answers.id && s.command_result == answers.result) return;
    answers.id = s.command_id, answers.result = s.command_result;
    std::printf("command %u result %d epoch %u\n", s.command_id, static_cast<int>(s.command_result),
                s.pose_epoch);
    std::fflush(stdout);
  }
};

int hear_answers(const std::string& url) {
  Answers answers;
  return listen(url, {{kStatusChannel, Answers::hear}}, &answers) ? 0 : 1;
}

/// How long after its capture the datagram of each pose came, and how much of that was not work on its frame.
class Ages {
 public:
  Ages() { late_ms_.reserve(kMost), ages_ms_.reserve(kMost); }

  static void hear_pose(const lcm_recv_buf_t* buffer, const char*, void* self) {
    PoseMessage pose;
    auto& ages = *static_cast<Ages*>(self);
    if (ages.codec_->decode(payload(buffer), pose) != Status::ok) return;
    ages.utime_ = pose.utime;
    ages.age_ms_ = 1e-3 * static_cast<double>(buffer->recv_utime - pose.utime.us);
  }
  static void hear_status(const lcm_recv_buf_t* buffer, const char*, void* self) {
    StatusMessage s;
    auto& ages = *static_cast<Ages*>(self);
    if (ages.codec_->decode(payload(buffer), s) != Status::ok || s.utime.us != ages.utime_.us) return;
    if (s.frame < kWarmUp || ages.ages_ms_.size() == kMost) return;
    const auto work_ms = static_cast<double>(s.prepare_ms + s.track_ms + s.mask_ms + s.refine_ms);
    ages.ages_ms_.push_back(ages.age_ms_);
    ages.late_ms_.push_back(ages.age_ms_ - work_ms);
  }
  void print() {
    const auto at = [](std::vector<double>& of, double share) {
      std::sort(of.begin(), of.end());
      return of.empty() ? -1 : of[static_cast<size_t>(share * static_cast<double>(of.size() - 1))];
    };
    std::printf("poses %zu age_ms %.2f p99 %.2f beyond_work_ms %.2f p99 %.2f spread_ms %.2f\n",
                ages_ms_.size(), at(ages_ms_, 0.5), at(ages_ms_, 0.99), at(late_ms_, 0.5), at(late_ms_, 0.99),
                at(late_ms_, 0.99) - at(late_ms_, 0.01));
  }

 private:
  static constexpr uint32_t kWarmUp = 10;  ///< the first frame makes the map
  static constexpr size_t kMost = 100000;

  std::unique_ptr<MessageCodec> codec_ = make_lcm_codec();
  Utime utime_;
  double age_ms_ = 0;
  std::vector<double> ages_ms_, late_ms_;
};

int hear_ages(const std::string& url) {
  Ages ages;
  if (!listen(url, {{kPoseChannel, Ages::hear_pose}, {kStatusChannel, Ages::hear_status}}, &ages)) return 1;
  ages.print();
  return 0;
}

int probe(int argc, char** argv) {
  const std::string mode = argc > 1 ? argv[1] : "";
  if (argc == 5 && mode == "publish") return publish(argv[2], std::atoi(argv[3]), std::atof(argv[4]));
  if (argc == 3 && mode == "bot-core") return hear_bot_core(argv[2]);
  if (argc == 3 && mode == "commands") return hear_commands(argv[2]);
  if (argc == 3 && mode == "odometry") return hear_odometry(argv[2]);
  if (argc == 3 && mode == "answers") return hear_answers(argv[2]);
  if (argc == 3 && mode == "ages") return hear_ages(argv[2]);
  std::fputs("lcm_probe publish|bot-core|commands|odometry|answers|ages URL ...\n", stderr);
  return 2;
}

}  // namespace
}  // namespace stillmap

int main(int argc, char** argv) {
  return stillmap::probe(argc, argv);
}
