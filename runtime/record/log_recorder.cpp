#include "runtime/record/log_recorder.hpp"

#include <utility>

namespace stillmap {
namespace {

/// Of a message around its images, strings or lists.
constexpr uint32_t kMessageBytes = 4 * kDatagramBytes;

ImageCoding coding_of(RecordColour colour) {
  return colour == RecordColour::jpeg ? ImageCoding::jpeg : ImageCoding::zstd_colour;
}

}  // namespace

LcmLogOptions log_options(const RecordConfig& record, const std::string& dir) {
  LcmLogOptions options;
  options.dir = dir;
  options.max_bytes = static_cast<uint64_t>(record.log_max_bytes);
  options.file_bytes = static_cast<uint64_t>(record.log_file_bytes);
  options.file_s = static_cast<double>(record.log_file_s);
  options.max_s = static_cast<double>(record.log_max_s);
  options.sync_s = static_cast<double>(record.log_sync_s);
  return options;
}

LogRecorder::LogRecorder(const MessageCodec& codec, std::unique_ptr<LcmLogWriter> writer)
    : codec_(codec), writer_(std::move(writer)) {}

LogRecorder::~LogRecorder() = default;

Result<std::unique_ptr<LogRecorder>> LogRecorder::create(const RecordConfig& record, const std::string& dir,
                                                         const SessionMessage& session,
                                                         const MessageCodec& codec, LogDisk& disk) {
  auto writer = LcmLogWriter::open(log_options(record, dir), disk);
  if (!writer) return Error{writer.error(), writer.error_kind()};
  std::unique_ptr<LogRecorder> recorder(new LogRecorder(codec, std::move(*writer)));
  uint32_t most = kMessageBytes;
  if (record.frames) {
    recorder->encoder_ =
        std::make_unique<FrameEncoder>(session.height, session.width, coding_of(record.colour));
    most += recorder->encoder_->most_bytes();
  }
  const size_t session_bytes =
      kMessageBytes + session.version.size() + session.source.size() + session.config_toml.size();
  std::vector<uint8_t> coded(session_bytes);
  const uint32_t bytes = codec.encode(session, {coded.data(), static_cast<uint32_t>(coded.size())});
  if (bytes == 0) return Error{dir + ": the session cannot be coded for the event log"};
  if (most + session_bytes > log_options(record, dir).file_bytes)
    return Error{"record.log_file_bytes = " + std::to_string(log_options(record, dir).file_bytes) +
                     ": a frame takes up to " + std::to_string(most + session_bytes) +
                     " bytes; a file has to hold at least one",
                 ErrorKind::bad_usage};
  recorder->writer_->begin_files_with(log_channel::kSession, session.utime, {coded.data(), bytes});
  recorder->coded_.resize(most);
  return recorder;
}

uint64_t LogRecorder::planned_bytes(const RecordConfig& record, int32_t rows, int32_t cols) {
  // What is coded is held once by the encoder and once more as a message.
  return record.frames ? 2 * FrameEncoder::planned_bytes(rows, cols) : kMessageBytes;
}

Status LogRecorder::write(const DecisionMessage& decision, const RgbdFrame* frame) {
  if (!encoder_) return Status::ok;
  if (const Status status = put(log_channel::kDecision, decision); status != Status::ok) return status;
  if (!frame) return Status::ok;
  FrameMessage message;
  message.utime = decision.utime;
  if (const Status status = encoder_->encode(*frame, message); status != Status::ok) return status;
  return put(log_channel::kFrame, message);
}

}  // namespace stillmap
