#pragma once

#include <cstdint>
#include <memory>
#include <string>
#include <vector>

#include "config/config.hpp"
#include "config/result.hpp"
#include "runtime/ports/message_codec.hpp"
#include "runtime/ports/messages.hpp"
#include "runtime/record/frame_coder.hpp"
#include "runtime/record/lcm_log_writer.hpp"

namespace stillmap {

/// The channels of an event log; those of CONTRACT and, for the log alone, session, frame, decision and
/// event.
namespace log_channel {
inline constexpr const char* kPose = "STILLMAP_POSE";
inline constexpr const char* kStatus = "STILLMAP_STATUS";
inline constexpr const char* kRange = "STILLMAP_RANGE";
inline constexpr const char* kOdometry = "ODOMETRY";
inline constexpr const char* kCommand = "STILLMAP_COMMAND";
inline constexpr const char* kSession = "STILLMAP_SESSION";
inline constexpr const char* kFrame = "STILLMAP_FRAME";
inline constexpr const char* kDecision = "STILLMAP_DECISION";
inline constexpr const char* kEvent = "STILLMAP_EVENT";
}  // namespace log_channel

/// The files of the log in `dir`, as record.* says.
LcmLogOptions log_options(const RecordConfig& record, const std::string& dir);

/// The headless log of a run: encodes messages and frames and writes them as an LCM event log. Every file
/// begins with the session.
///
/// A call answers ok, or why the event is not in the log: capacity_exhausted, the disk is full (the caller
/// holds Fault::log_full until a call answers ok again); unavailable, it fails (Fault::record_failed),
/// error() says why; out_of_range, it is too long; bad_data, the frame cannot be coded. The log goes on by
/// itself when it can.
/// @thread one, that of recording. Calls may wait for the disk. After boot nothing allocates (with JPEG the
/// library does, see FrameEncoder).
class LogRecorder {
 public:
  /// @param session written at the start of each file; its strings are copied. Its width and height are the
  /// frames'
  /// @param codec, disk outlive the recorder
  /// @return an error that names the folder.  @thread boot; makes the folder
  static Result<std::unique_ptr<LogRecorder>> create(const RecordConfig& record, const std::string& dir,
                                                     const SessionMessage& session, const MessageCodec& codec,
                                                     LogDisk& disk = system_disk());
  /// Closes.
  ~LogRecorder();

  /// Memory that it takes at boot, for the plan. @param rows, cols of the frames
  static uint64_t planned_bytes(const RecordConfig& record, int32_t rows, int32_t cols);

  Status write(const PoseMessage& message) { return put(log_channel::kPose, message); }
  Status write(const StatusMessage& message) { return put(log_channel::kStatus, message); }
  Status write(const RangeMessage& message) { return put(log_channel::kRange, message); }
  Status write(const CommandMessage& message) { return put(log_channel::kCommand, message); }
  Status write(const EventMessage& message) { return put(log_channel::kEvent, message); }
  Status write_odometry(const PoseMessage& message) { return put(log_channel::kOdometry, message); }

  /// What was decided about a frame, in the order of the frames; with record.frames alone, else nothing is
  /// written.
  /// @param frame the images of a used frame, as they came from the source (before anything was done to
  /// them); null when the frame was not used
  Status write(const DecisionMessage& decision, const RgbdFrame* frame);

  /// Syncs when it is due: at least some times a second, also while nothing is written.
  Status step() { return writer_->step(); }
  /// The next event begins another file (SIGHUP).
  void rotate() { writer_->rotate(); }
  /// Syncs and closes. @return false: something could not be written, ever; see error()
  bool close() { return writer_->close(); }

  const LcmLogCounters& counters() const { return writer_->counters(); }
  Status status() const { return writer_->status(); }
  /// One line on the last failure; empty while there was none.
  const char* error() const { return writer_->error(); }

 private:
  LogRecorder(const MessageCodec& codec, std::unique_ptr<LcmLogWriter> writer);

  template <class Message>
  Status put(const char* channel, const Message& message) {
    const uint32_t bytes = codec_.encode(message, {coded_.data(), static_cast<uint32_t>(coded_.size())});
    if (bytes == 0) return Status::out_of_range;
    return writer_->write(channel, message.utime, {coded_.data(), bytes});
  }

  const MessageCodec& codec_;
  std::unique_ptr<LcmLogWriter> writer_;
  std::unique_ptr<FrameEncoder> encoder_;  ///< null: no frames
  std::vector<uint8_t> coded_;
};

}  // namespace stillmap
