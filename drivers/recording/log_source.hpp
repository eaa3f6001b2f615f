#pragma once

#include <memory>
#include <string>
#include <vector>

#include "config/result.hpp"
#include "drivers/dataset/dataset_options.hpp"
#include "runtime/ports/frame_odometry.hpp"
#include "runtime/ports/frame_source.hpp"
#include "runtime/ports/message_codec.hpp"
#include "runtime/record/frame_coder.hpp"
#include "runtime/record/lcm_log_reader.hpp"

namespace stillmap {

/// The frames that a live run used, from its event log (record.log and record.frames), and what it decided
/// about each. A frame that is damaged, or that the run used and the log lacks, is bad_data, and said.
class LogSource final : public FrameSource {
 public:
  const SourceInfo& info() const override { return info_; }
  Status next(RgbdFrame& frame, int32_t timeout_ms) override;
  void skip(uint32_t count) override;
  const std::string& error() const override { return error_; }
  /// As it was used; asked about the frame that `next` gave out last.
  OdometryPort* odometry() override { return &odometry_; }

  /// How the run began. Its strings live as long as the source.
  const SessionMessage& session() const { return session_; }
  /// About the frame that `next` gave out last; new_map also when it was decided about a frame before it
  /// that the log lacks.
  const DecisionMessage& decision() const { return decision_; }
  /// False: the beginning of the log was deleted to make room.
  bool from_the_beginning() const { return from_the_beginning_; }
  /// One line on what was damaged or is missing so far; empty: nothing.
  std::string damage() const;

  /// @param path a file, followed by those that rotation made after it, or the folder of a log
  /// @param options camera and depth_units_per_m win over those of the log
  /// @return kind cannot_open: not there, no log of this program, no frames in it
  static Result<std::unique_ptr<LogSource>> open(const std::string& path, const DatasetOptions& options);

 private:
  LogSource(std::string path, std::vector<std::string> files);
  std::string find_session();
  std::string start(const DatasetOptions& options);
  bool next_event(LogEvent& event);
  bool of_another_session(const LogEvent& event) const;
  Status next_frame(FrameMessage& message);
  Status passed_over(std::string why);

  const std::string path_;
  const std::vector<std::string> files_;
  std::unique_ptr<MessageCodec> codec_;
  SourceInfo info_;
  std::vector<uint8_t> session_payload_;
  SessionMessage session_;

  size_t next_file_ = 0;
  std::unique_ptr<LcmLogReader> reader_;  ///< of file next_file_ - 1; null: none yet
  LogReadCounters read_before_;           ///< of the files before it, together
  bool from_the_beginning_ = true;

  DecisionMessage decision_, pending_;
  bool frame_pending_ = false;  ///< `pending_` is about a used frame that did not come yet
  bool new_map_due_ = false;    ///< decided, and no frame came since
  FrameDecoder decoder_;
  LoggedOdometry odometry_;
  std::string error_;
};

}  // namespace stillmap
