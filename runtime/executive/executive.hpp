#pragma once

// The threads of a run: capture, real-time, publish, record; and the caller's, which supervises.
//
//   source -> capture -> [mailbox] -> frame loop -> [queue] -> publish -> bus
//   sonar -> [queue] ---------------------^-------> [queue] -> record  -> files
//                ^                                                 |
//                +---- free slots ---------------------------------+

#include <atomic>
#include <cstdint>
#include <functional>
#include <optional>
#include <semaphore>
#include <string>
#include <string_view>
#include <thread>
#include <vector>

#include "runtime/executive/frame_loop.hpp"
#include "runtime/executive/publish_stage.hpp"
#include "runtime/executive/range_stage.hpp"
#include "runtime/executive/real_time.hpp"
#include "runtime/executive/record_stage.hpp"
#include "runtime/ports/service_manager.hpp"

namespace stillmap {

/// What a run is made of. All but the optional parts are there; all outlive the executive.
struct ExecutiveParts {
  FrameSource& source;
  Engine& engine;
  Pipeline& pipeline;
  RunRecorder& recorder;
  RunState& state;
  UtcClock& clock;
  BlockArchive* archive = nullptr;
  MapKeeper* map_keeper = nullptr;
  FrameOdometry* odometry = nullptr;
  const MessageCodec* codec = nullptr;
  MessageBus* bus = nullptr;
  CommandPort* commands = nullptr;
  ServiceManager* service = nullptr;
  RangeSensor* sonar = nullptr;
  std::vector<FrameObserver*> observers = {};
  std::function<bool()> stop_requested = {};  ///< a signal came
  /// Told of the newest status some times a second.  @thread supervisor
  std::function<void(const StatusMessage&)> on_status = {};
  /// save_mesh: a mesh from the map that was just saved. @return the error, or empty.  @thread its own
  std::function<std::string(const std::string& file)> make_mesh = {};
  /// save_map under another name. @return the error, or empty.  @thread supervisor
  std::function<std::string(const std::string& file)> keep_map = {};
};

struct ExecutiveOptions {
  Se3d T_map_cam;           ///< of the first frame
  uint32_t max_frames = 0;  ///< 0: no limit
  bool live = false;        ///< frames come at their own pace; else each is waited for
  bool keep_images = false;
};

/// How the frames of a run ended.
struct RunEnd {
  TrackingState state = TrackingState::good;  ///< after the last frame
  std::string error;  ///< the source broke off; empty when it ended or a stop was asked for
};

/// @thread construct: boot; run: supervisor
class Executive {
 public:
  Executive(ExecutiveParts parts, const Config& config, const ExecutiveOptions& options);

  /// Starts the threads, watches over them until the source ends, the limit is reached or a stop is asked
  /// for, and ends them. Bad frames are counted and passed over.
  RunEnd run();

  const FrameResult& last_result() const { return loop_.last_result(); }

 private:
  void start_thread(std::vector<std::jthread>& threads, const ThreadPlan& plan, std::function<void()> work);
  ThreadPlan plan(const char* name, int32_t priority, const std::string& cpus) const;
  void supervise();
  void watch_camera(int64_t now_ns);
  void watch_threads(int64_t now_ns);
  void watch_counters(int64_t now_ns);
  void watch_mode();
  void watch_faults();
  void follow_clock(int64_t now_ns);
  void obey(const CommandMessage& command);
  void end_command();
  void tell(Notice::Kind kind, std::string_view name, const std::string& text);

  ExecutiveParts p_;
  const Config config_;
  const ExecutiveOptions options_;
  FrameSlots slots_;
  FrameMailbox mailbox_;
  RangeQueues ranges_;
  PublishQueue to_publish_;
  RunQueue to_record_;
  NoticeQueue notices_;
  Capture capture_;
  FrameLoop loop_;
  PublishStage publish_;
  RecordStage record_;
  std::optional<RangeStage> sonar_;
  std::atomic<bool> loop_done_{false};

  // The supervisor's.
  struct Watched {
    Heartbeat* heart;
    const char* name;
    uint64_t beats = 0;
    int64_t since_ns = 0;
    bool stalled = false;
  };
  std::vector<Watched> watched_;
  Mode mode_ = Mode::boot;
  Shed shed_ = Shed::nothing;
  uint64_t faults_told_ = 0;
  uint32_t foreign_ = 0;  ///< messages, as counted
  uint64_t heap_ = 0;     ///< calls of armed threads, as counted
  int64_t clock_followed_ns_ = 0;
  std::optional<CommandMessage> command_;  ///< save_*: on its way
  std::thread mesh_thread_;
  std::atomic<bool> mesh_done_{false};
  std::string mesh_error_;
};

}  // namespace stillmap
