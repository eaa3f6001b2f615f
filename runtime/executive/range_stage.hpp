#pragma once

#include <atomic>
#include <cstdint>

#include "config/config.hpp"
#include "runtime/executive/counters.hpp"
#include "runtime/executive/run_item.hpp"
#include "runtime/ports/range_sensor.hpp"
#include "runtime/range/echo_ranger.hpp"

namespace stillmap {

using RangeQueue = BoundedQueue<RangeReading>;

/// Readings on their way from the sonar. A reader that is behind loses the newest, which is counted as
/// result_dropped.
struct RangeQueues {
  RangeQueue to_loop{64}, to_publish{64}, to_record{256};
  NoticeQueue notices{16};  ///< to the record thread
};

/// Asks the sonar, drives its stop line, says what is wrong with it, and opens it again when it is gone.
///
/// The stop line is high while something is near, and whenever nobody can say that nothing is: before the
/// first valid reading, while the sonar is lost, stuck or gone, and when the program ends. When the program
/// has let go of the line its level is up to the chip and the board: a pull-up keeps it high.
/// @thread run: sonar; but for opening it neither allocates, locks nor throws
class RangeStage {
 public:
  /// All outlive this. @param to_publish is woken when there is a reading
  RangeStage(RangeSensor& sensor, const SonarConfig& sonar, RangeQueues& queues, PublishQueue& to_publish,
             RunState& state);

  /// Until `state.stop`.
  void run();

 private:
  void open();
  void give_up_for_a_while(Stamp now);
  void work();
  Status listen(Stamp now);
  void take_a_rest(Stamp edge);
  void hand_on(const RangeReading& reading);
  void note_state(Stamp now);
  Status drive_stop_line(Stamp now);

  RangeSensor& sensor_;
  const SonarConfig sonar_;
  RangeQueues& queues_;
  PublishQueue& to_publish_;
  RunState& state_;
  EchoRanger ranger_;
  bool is_open_ = false, was_gone_ = false, told_ = false;
  bool line_high_ = true;
  int64_t open_at_ns_ = 0, next_wait_ns_ = 0;  ///< until it is opened again
  int64_t window_ns_ = 0;                      ///< that edges_ are counted in
  uint32_t edges_ = 0;
};

}  // namespace stillmap
