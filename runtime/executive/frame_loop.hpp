#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "runtime/archive/block_archive.hpp"
#include "runtime/executive/capture.hpp"
#include "runtime/executive/counters.hpp"
#include "runtime/executive/frame_slots.hpp"
#include "runtime/executive/load.hpp"
#include "runtime/executive/map_keeper.hpp"
#include "runtime/executive/range_stage.hpp"
#include "runtime/executive/run_item.hpp"
#include "runtime/ports/frame_observer.hpp"
#include "runtime/ports/frame_odometry.hpp"
#include "runtime/range/range_history.hpp"

namespace stillmap {

/// What the frame loop is made of. All outlive it.
struct FrameLoopParts {
  Engine& engine;
  Pipeline& pipeline;
  const Capture& capture;
  FrameSlots& slots;
  FrameMailbox& mailbox;
  RunState& state;
  PublishQueue& to_publish;
  RunQueue& to_record;
  BlockArchive* archive = nullptr;        ///< null: far parts of a full map are dropped
  MapKeeper* map_keeper = nullptr;        ///< null: the map is not saved on the way
  FrameOdometry* odometry = nullptr;      ///< that the pipeline asks; null: there is none
  std::vector<FrameObserver*> observers;  ///< measuring; they are outside of what real time is asked for
  RangeQueue* ranges = nullptr;           ///< readings of the sonar; null: there is none
};

struct FrameLoopLimits {
  double new_map_after_s = 0;  ///< lost for so long, the map is given up (lost.new_map_after_s); 0: never
  double period_ms = 0;        ///< of the camera, the deadline; 0: by the stamps
  bool live = false;           ///< frames come at their own pace: what is late is counted, and work is shed
  double range_max_age_s = 0;  ///< sonar.max_age_s
  bool keep_images = false;    ///< the record thread wants them; live, as long as there are slots
};

/// Takes frame after frame to its pose and into the map.
/// @thread run: real-time; it does not allocate, lock, touch files, format text or throw (observers aside)
class FrameLoop final : public PoseListener {
 public:
  FrameLoop(const FrameLoopParts& parts, const FrameLoopLimits& limits)
      : p_(parts), limits_(limits), ranges_(limits.range_max_age_s) {}

  /// Until the capture has ended and its last frame is done, or a stop is asked for.
  void run();

  /// After `run`.
  TrackingState last_state() const { return last_.state; }
  const FrameResult& last_result() const { return last_; }

  void pose_known(const FrameResult& result) override;

 private:
  void work_on(uint32_t slot);
  void take_ranges();
  float finish(RgbdFrame& frame) const;
  FrameWork work_for(const RgbdFrame& frame);
  void decide(const RgbdFrame& frame, const FrameWork& work);
  void count_lateness(const FrameResult& result, const FrameWork& work);
  void note_faults(const FrameResult& result);
  void note_discontinuity();
  void keep_map(const FrameResult& result);
  void give_up_map(Stamp stamp);
  void start_new_map(const RunEvent& why);
  void publish(const FrameResult& result, bool whole, uint32_t pose_epoch);
  void count_dropped_result();
  void obey_requests(Stamp stamp);
  void hand_on(uint32_t slot, const FrameResult& result);
  void tell(const RunEvent& event);
  double period_ms(Stamp stamp);

  FrameLoopParts p_;
  const FrameLoopLimits limits_;
  LoadShedder load_;
  RangeHistory ranges_;
  FrameResult last_;
  uint32_t frames_ = 0;
  uint32_t relocalised_ = 0;
  DecisionMessage decision_;  ///< about this frame; new_map: about the next one
  double shortest_ms_ = 0;
};

}  // namespace stillmap
