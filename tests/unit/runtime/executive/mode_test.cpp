#include "runtime/executive/mode.hpp"

#include <gtest/gtest.h>

namespace stillmap {
namespace {

constexpr uint8_t kGood = 0, kPoor = 1, kLost = 2;

uint64_t bit(Fault fault) {
  return uint64_t{1} << static_cast<uint32_t>(fault);
}

ModeInputs good() {
  ModeInputs in;
  in.source_open = in.frames = true;
  in.state = kGood;
  return in;
}

TEST(Mode, GoesFromBootOverReadyToRunning) {
  ModeInputs in;
  EXPECT_EQ(mode_of(in), Mode::boot);
  in.source_open = true;
  EXPECT_EQ(mode_of(in), Mode::ready);
  EXPECT_EQ(mode_of(good()), Mode::running);
}

TEST(Mode, FollowsTheTrackingState) {
  ModeInputs in = good();
  in.state = kPoor;
  EXPECT_EQ(mode_of(in), Mode::degraded);
  in.state = kLost;
  EXPECT_EQ(mode_of(in), Mode::lost);
}

TEST(Mode, FollowsTheWorstFaultThatHolds) {
  ModeInputs in = good();
  in.faults_active = bit(Fault::clock_jump);
  EXPECT_EQ(mode_of(in), Mode::running);
  in.faults_active |= bit(Fault::work_shed);
  EXPECT_EQ(mode_of(in), Mode::degraded);
  in.faults_active |= bit(Fault::camera_stalled);
  EXPECT_EQ(mode_of(in), Mode::lost);
}

TEST(Mode, AStopComesBeforeEverything) {
  ModeInputs in = good();
  in.faults_active = bit(Fault::camera_gone);
  in.stopping = true;
  EXPECT_EQ(mode_of(in), Mode::safe_stop);
}

TEST(FaultBoard, LatchesCountsAndRemembersWhen) {
  FaultBoard board;
  EXPECT_EQ(board.latched(), 0u);
  board.raise(Fault::map_full, 100);
  board.raise(Fault::map_full, 250, 3);
  const FaultBoard::Entry entry = board.entry(Fault::map_full);
  EXPECT_EQ(entry.count, 4u);
  EXPECT_EQ(entry.first_ns, 100);
  EXPECT_EQ(entry.last_ns, 250);
  EXPECT_EQ(board.latched(), bit(Fault::map_full));
  EXPECT_EQ(board.active(), 0u);
}

TEST(FaultBoard, AFaultThatHoldsIsCountedOnceUntilItIsCleared) {
  FaultBoard board;
  for (int i = 0; i < 5; ++i) board.hold(Fault::camera_stalled, i);
  EXPECT_EQ(board.entry(Fault::camera_stalled).count, 1u);
  EXPECT_EQ(board.active(), bit(Fault::camera_stalled));
  board.clear(Fault::camera_stalled);
  EXPECT_EQ(board.active(), 0u);
  EXPECT_EQ(board.latched(), bit(Fault::camera_stalled));
  board.hold(Fault::camera_stalled, 9);
  EXPECT_EQ(board.entry(Fault::camera_stalled).count, 2u);
}

TEST(FaultBoard, EveryFaultHasANameOfItsOwn) {
  for (uint32_t i = 0; i < kFaults; ++i)
    for (uint32_t j = 0; j < i; ++j)
      EXPECT_NE(name_of(static_cast<Fault>(i)), name_of(static_cast<Fault>(j)));
}

}  // namespace
}  // namespace stillmap
