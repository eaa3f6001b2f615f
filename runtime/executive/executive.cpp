#include "runtime/executive/executive.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <chrono>
#include <string_view>
#include <utility>

#include "runtime/core/heap_guard.hpp"
#include "runtime/executive/mode.hpp"
#include "runtime/executive/real_time.hpp"

namespace stillmap {
namespace {

constexpr std::chrono::milliseconds kTick{50};
constexpr int64_t kSecond_ns = 1'000'000'000;
constexpr int64_t kStalled_ns = 10 * kSecond_ns;  ///< a thread that gives no sign of life for so long
constexpr uint32_t kPublishItems = 64, kRecordItems = 256, kNotices = 64;
/// Faults that are lines of their own where they come up; the others are told by the supervisor.
constexpr Fault kToldElsewhere[] = {
    Fault::bad_frame, Fault::camera_gone,   Fault::tracking_lost,   Fault::new_map,
    Fault::map_full,  Fault::archive_full,  Fault::archive_failed,  Fault::record_failed,
    Fault::log_full,  Fault::frame_dropped, Fault::deadline_missed, Fault::result_dropped,
    Fault::work_shed, Fault::clock_jump,    Fault::thread_stalled,  Fault::realtime_refused};

/// Names stay inside the folder of the run.
bool good_name(std::string_view name) {
  constexpr std::string_view kAllowed = "abcdefghijklmnopqrstuvwxyzABCDEFGHIJKLMNOPQRSTUVWXYZ0123456789._-";
  return name.find_first_not_of(kAllowed) == std::string_view::npos && (name.empty() || name.front() != '.');
}

std::string_view file_of(const CommandMessage& command) {
  const auto end = std::find(command.file.begin(), command.file.end(), '\0');
  return {command.file.data(), static_cast<size_t>(end - command.file.begin())};
}

const char* text_of(Shed shed) {
  switch (shed) {
    case Shed::nothing:
      return "all work is done again";
    case Shed::every_second_integration:
      return "every second frame is not mapped";
    case Shed::finest_level:
      return "every second frame is not mapped, and none is tracked at the finest level";
  }
  return "";
}

}  // namespace

Executive::Executive(ExecutiveParts parts, const Config& config, const ExecutiveOptions& options)
    : p_(std::move(parts)),
      config_(config),
      options_(options),
      slots_(p_.source.info(), options.live ? static_cast<uint32_t>(config.runtime.frame_slots) : 1),
      to_publish_(kPublishItems),
      to_record_(kRecordItems),
      notices_(kNotices),
      capture_(
          p_.source, slots_, mailbox_, p_.state,
          {options.max_frames, static_cast<double>(config.source.gone_s),
           static_cast<double>(config.source.reopen_s), static_cast<double>(config.source.reopen_max_s)}),
      loop_({p_.engine, p_.pipeline, capture_, slots_, mailbox_, p_.state, to_publish_, to_record_,
             p_.archive, p_.map_keeper, p_.odometry, p_.observers, &ranges_.to_loop},
            {static_cast<double>(config.lost.new_map_after_s), static_cast<double>(config.runtime.period_ms),
             options.live, static_cast<double>(config.sonar.max_age_s), options.keep_images}),
      publish_(MessageMaker(config, p_.clock, p_.state, options.T_map_cam), to_publish_, ranges_.to_publish,
               p_.state, p_.codec, p_.bus),
      record_(to_record_, capture_.notices(), notices_, ranges_, slots_, p_.state, p_.recorder),
      watched_{{&p_.state.capture, "capture"},
               {&p_.state.real_time, "real-time"},
               {&p_.state.publish, "publish"},
               {&p_.state.record, "record"}} {
  if (p_.sonar == nullptr) return;
  sonar_.emplace(*p_.sonar, config.sonar, ranges_, to_publish_, p_.state);
  watched_.push_back({&p_.state.sonar, "sonar"});
}

ThreadPlan Executive::plan(const char* name, int32_t priority, const std::string& cpus) const {
  // On a single CPU a FIFO thread that is never done would keep everybody else from it.
  const bool alone = std::thread::hardware_concurrency() < 2;
  return options_.live ? ThreadPlan{name, alone ? 0 : priority, cpus} : ThreadPlan{name, 0, {}};
}

void Executive::start_thread(std::vector<std::jthread>& threads, const ThreadPlan& plan,
                             std::function<void()> work) {
  std::binary_semaphore started{0};
  std::vector<std::string> refused;
  threads.emplace_back([&refused, &started, plan, work = std::move(work)] {
    refused = apply_to_this_thread(plan);
    started.release();
    work();
  });
  started.acquire();
  for (const std::string& what : refused) {
    p_.state.faults.raise(Fault::realtime_refused, monotonic_ns());
    tell(Notice::Kind::warning, name_of(Fault::realtime_refused),
         what + "; `stillmap doctor` says what to allow");
  }
}

RunEnd Executive::run() {
  if (options_.live && config_.runtime.lock_memory)
    if (const std::string refused = lock_memory(); !refused.empty()) {
      p_.state.faults.raise(Fault::realtime_refused, monotonic_ns());
      tell(Notice::Kind::warning, name_of(Fault::realtime_refused), refused);
    }
  if (p_.service) p_.service->ready();
  heap_ = heap_guard::allocations();
  const RuntimeConfig& r = config_.runtime;
  std::vector<std::jthread> recording, publishing, working, capturing, ranging;
  start_thread(recording, plan("record", 0, r.other_cpus), [this] { record_.run(); });
  start_thread(publishing, plan("publish", r.publish_priority, r.other_cpus), [this] { publish_.run(); });
  start_thread(working, plan("real-time", r.realtime_priority, r.realtime_cpus), [this] {
    loop_.run();
    loop_done_.store(true, std::memory_order_release);
  });
  if (sonar_)
    start_thread(ranging, plan("sonar", r.publish_priority, r.other_cpus), [this] { sonar_->run(); });
  start_thread(capturing, plan("capture", r.capture_priority, r.other_cpus), [this] { capture_.run(); });

  while (!loop_done_.load(std::memory_order_acquire)) {
    supervise();
    std::this_thread::sleep_for(kTick);
  }
  if (p_.service) p_.service->stopping();
  p_.state.stop.store(true, std::memory_order_relaxed);  // the capture waits for nobody any more
  working.clear();
  capturing.clear();
  ranging.clear();
  supervise();
  publish_.finish();
  publishing.clear();
  record_.finish();
  recording.clear();
  if (mesh_thread_.joinable()) mesh_thread_.join();
  return {loop_.last_state(), capture_.error()};
}

void Executive::supervise() {
  const int64_t now_ns = monotonic_ns();
  if (p_.stop_requested && p_.stop_requested()) p_.state.stop.store(true, std::memory_order_relaxed);
  watch_camera(now_ns);
  watch_threads(now_ns);
  watch_counters(now_ns);
  watch_faults();
  watch_mode();
  follow_clock(now_ns);
  for (CommandMessage command; p_.commands && p_.commands->next(command) == Status::ok;) obey(command);
  end_command();
  if (p_.on_status) p_.on_status(publish_.latest());
}

void Executive::watch_camera(int64_t now_ns) {
  if (!options_.live || capture_.ended()) return;
  const int64_t last_ns = p_.state.last_frame_ns.load(std::memory_order_relaxed);
  const bool stalled = last_ns > 0 && static_cast<double>(now_ns - last_ns) * 1e-9 >
                                          static_cast<double>(config_.source.stall_s);
  if (stalled)
    p_.state.faults.hold(Fault::camera_stalled, now_ns);
  else
    p_.state.faults.clear(Fault::camera_stalled);
}

void Executive::watch_threads(int64_t now_ns) {
  bool all_well = true;
  for (Watched& w : watched_) {
    const uint64_t beats = w.heart->beats.load(std::memory_order_relaxed);
    if (beats != w.beats || w.since_ns == 0) {
      w.beats = beats;
      w.since_ns = now_ns;
    }
    const bool ended =
        loop_done_.load(std::memory_order_relaxed) || (capture_.ended() && w.heart == &p_.state.capture);
    const bool stalled = !ended && now_ns - w.since_ns > kStalled_ns;
    if (stalled && !w.stalled) {
      p_.state.faults.raise(Fault::thread_stalled, now_ns);
      tell(Notice::Kind::fault, name_of(Fault::thread_stalled),
           fmt::format("{}: no sign of life for {} s", w.name, kStalled_ns / kSecond_ns));
    }
    w.stalled = stalled;
    all_well = all_well && !stalled;
  }
  // Who watches over the program restarts it when a thread hangs.
  if (all_well && p_.service) p_.service->alive();
}

/// What others only count becomes a fault here.
void Executive::watch_counters(int64_t now_ns) {
  const uint32_t foreign =
      (p_.commands ? p_.commands->refused() : 0) + (p_.odometry ? p_.odometry->refused() : 0);
  if (foreign != foreign_) p_.state.faults.raise(Fault::foreign_message, now_ns, foreign - foreign_);
  foreign_ = foreign;
  const uint64_t heap = heap_guard::allocations();
  if (heap != heap_) p_.state.faults.raise(Fault::heap_used, now_ns, static_cast<uint32_t>(heap - heap_));
  heap_ = heap;
}

void Executive::watch_mode() {
  const uint64_t active = p_.state.faults.active();
  const StatusMessage& status = publish_.latest();
  const Mode mode = mode_of({true, status.rate_hz > 0 || status.total_ms > 0,
                             p_.state.stop.load(std::memory_order_relaxed), status.state, active});
  p_.state.mode.store(static_cast<uint8_t>(mode), std::memory_order_relaxed);
  if (mode != mode_) {
    tell(Notice::Kind::info, "mode", to_string(mode));
    if (p_.service) p_.service->say(to_string(mode));
  }
  mode_ = mode;
  const auto shed = static_cast<Shed>(p_.state.shed.load(std::memory_order_relaxed));
  if (shed != shed_)
    tell(shed > shed_ ? Notice::Kind::fault : Notice::Kind::info, name_of(Fault::work_shed), text_of(shed));
  shed_ = shed;
}

/// A line for each fault when it comes up first; the counts are in the report.
void Executive::watch_faults() {
  uint64_t fresh = p_.state.faults.latched() & ~faults_told_;
  faults_told_ |= fresh;
  for (const Fault fault : kToldElsewhere) fresh &= ~(uint64_t{1} << static_cast<uint32_t>(fault));
  for (uint32_t i = 0; i < kFaults; ++i)
    if ((fresh >> i & 1) != 0)
      tell(Notice::Kind::fault, name_of(static_cast<Fault>(i)), "first time; it is counted from here on");
}

void Executive::follow_clock(int64_t now_ns) {
  if (now_ns - clock_followed_ns_ < kSecond_ns) return;
  clock_followed_ns_ = now_ns;
  if (!p_.clock.follow()) return;
  p_.state.faults.raise(Fault::clock_jump, now_ns);
  tell(Notice::Kind::fault, name_of(Fault::clock_jump), "the wall clock was set; stamps follow it");
}

void Executive::obey(const CommandMessage& command) {
  const auto answer = [&](CommandResult result) {
    p_.state.command_result.store(static_cast<uint8_t>(result), std::memory_order_relaxed);
    p_.state.command_id.store(command.id, std::memory_order_relaxed);
  };
  const std::string_view file = file_of(command);
  tell(Notice::Kind::info, "command",
       fmt::format("{}: {} {}", command.id, static_cast<int>(command.command), file));
  switch (command.command) {
    case Command::stop:
      answer(CommandResult::accepted);
      p_.state.stop.store(true, std::memory_order_relaxed);
      return;
    case Command::reset:
      p_.state.requests.fetch_or(kResetRequest, std::memory_order_acq_rel);
      return answer(CommandResult::done);
    case Command::save_map:
    case Command::save_mesh:
      if (p_.map_keeper == nullptr || command_ || !good_name(file)) return answer(CommandResult::refused);
      command_ = command;
      p_.state.saves.store(0, std::memory_order_relaxed);
      p_.state.requests.fetch_or(kSaveMapRequest, std::memory_order_acq_rel);
      return answer(CommandResult::accepted);
  }
  answer(CommandResult::refused);
}

/// A command that takes its time: the map is saved by the frame loop, a mesh is made from that file.
void Executive::end_command() {
  if (!command_) return;
  const auto answer = [&](const std::string& error) {
    if (!error.empty()) tell(Notice::Kind::warning, "command", error);
    p_.state.command_result.store(
        static_cast<uint8_t>(error.empty() ? CommandResult::done : CommandResult::failed),
        std::memory_order_relaxed);
    command_.reset();
  };
  if (mesh_thread_.joinable()) {
    if (!mesh_done_.load(std::memory_order_acquire)) return;
    mesh_thread_.join();
    return answer(mesh_error_);
  }
  const uint32_t saves = p_.state.saves.load(std::memory_order_acquire);
  if (saves == 0) return;
  const std::string file(file_of(*command_));
  if (saves == kSaveFailed) return answer("the map could not be saved");
  if (command_->command == Command::save_map)
    return answer(p_.keep_map && !file.empty() ? p_.keep_map(file) : std::string());
  mesh_done_ = false;
  mesh_thread_ = std::thread([this, file] {
    mesh_error_ = p_.make_mesh ? p_.make_mesh(file) : "no mesh can be made";
    mesh_done_.store(true, std::memory_order_release);
  });
}

void Executive::tell(Notice::Kind kind, std::string_view name, const std::string& text) {
  notices_.push(
      Notice::make(kind, Stamp{p_.state.last_stamp_ns.load(std::memory_order_relaxed)}, name, text));
}

}  // namespace stillmap
