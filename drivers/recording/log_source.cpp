#include "drivers/recording/log_source.hpp"

#include <algorithm>
#include <cmath>
#include <utility>

#include "config/validate.hpp"
#include "drivers/lcm/lcm.hpp"
#include "runtime/image/image_file.hpp"
#include "runtime/record/lcm_log_files.hpp"
#include "runtime/record/log_recorder.hpp"

namespace stillmap {
namespace {

Error cannot_open(std::string message) {
  return {std::move(message), ErrorKind::cannot_open};
}

CameraModel camera_of(const SessionMessage& session) {
  const auto f = [](double value) { return static_cast<float>(value); };
  const double *k = session.k, *d = session.distortion;
  return {{f(k[0]), f(k[1]), f(k[2]), f(k[3]), session.width, session.height},
          {f(d[0]), f(d[1]), f(d[2]), f(d[3]), f(d[4])}};
}

void add(const LogReadCounters& from, LogReadCounters& to) {
  to.events += from.events;
  to.missing += from.missing;
  to.damaged_bytes += from.damaged_bytes;
  to.damaged_places += from.damaged_places;
  to.cut_bytes += from.cut_bytes;
}

}  // namespace

LogSource::LogSource(std::string path, std::vector<std::string> files)
    : path_(std::move(path)), files_(std::move(files)), codec_(make_lcm_codec()) {}

Result<std::unique_ptr<LogSource>> LogSource::open(const std::string& path, const DatasetOptions& options) {
  auto files = find_log_files(path);
  if (!files) return Error{files.error(), files.error_kind()};
  std::unique_ptr<LogSource> source(new LogSource(path, std::move(*files)));
  if (std::string error = source->find_session(); !error.empty()) return cannot_open(std::move(error));
  if (std::string error = source->start(options); !error.empty()) return cannot_open(std::move(error));
  return source;
}

/// Looks for the session, and whether there is a frame at all; then goes back to the beginning.
std::string LogSource::find_session() {
  LogEvent event;
  bool first = true, has_frame = false;
  while (!has_frame && next_event(event)) {
    if (std::exchange(first, false)) from_the_beginning_ = event.number == 0;
    if (event.channel == log_channel::kSession && session_payload_.empty() &&
        codec_->decode(event.payload, session_) == Status::ok) {
      session_payload_.assign(event.payload.begin(), event.payload.end());
      codec_->decode({session_payload_.data(), static_cast<uint32_t>(session_payload_.size())}, session_);
    }
    has_frame = event.channel == log_channel::kFrame;
  }
  if (!error_.empty()) return error_;
  if (session_payload_.empty())
    return path_ + ": is no log of this program: it has no session (" + log_channel::kSession + ")";
  if (!has_frame) return path_ + ": holds no frames; they are in the log of a run with record.frames = true";
  next_file_ = 0;
  reader_.reset();
  read_before_ = {};
  return {};
}

std::string LogSource::start(const DatasetOptions& options) {
  info_.name = "log:" + path_;
  info_.camera = camera_of(session_);
  info_.depth_units_per_m = static_cast<float>(session_.depth_units_per_m);
  std::transform(std::begin(session_.depth_bias), std::end(session_.depth_bias), info_.depth_bias.c,
                 [](double c) { return static_cast<float>(c); });
  const Intrinsics k = info_.camera.k;
  if (options.camera) {
    info_.camera = *options.camera;
    info_.camera.k.width = k.width;
    info_.camera.k.height = k.height;
  }
  if (options.depth_units_per_m > 0) info_.depth_units_per_m = options.depth_units_per_m;
  const auto side = [](int32_t pixels) { return pixels >= 1 && pixels <= kMaxImageSide; };
  if (!side(k.width) || !side(k.height))
    return path_ + ": the session's images have " + std::to_string(k.width) + "x" + std::to_string(k.height) +
           " pixels; 1 to " + std::to_string(kMaxImageSide) + " each way can be read";
  if (!(info_.depth_units_per_m > 0) || !std::isfinite(info_.depth_units_per_m))
    return path_ + ": the session's depth units in a metre must be above 0";
  for (const float c : info_.depth_bias.c)
    if (!std::isfinite(c)) return path_ + ": the session's bias of the depth must be finite numbers";
  const std::string problem = camera_problem(info_.camera);
  return problem.empty() ? problem : path_ + ": " + problem;
}

/// The next event of whichever file. @return false: there is none, or the system cannot read on (see error_)
bool LogSource::next_event(LogEvent& event) {
  while (true) {
    if (reader_ && reader_->next(event)) {
      if (!of_another_session(event)) return true;
      next_file_ = files_.size();  // another run's files follow
    }
    if (reader_) {
      add(reader_->counters(), read_before_);
      error_ = reader_->error();
      reader_.reset();
      if (!error_.empty()) return false;
    }
    if (next_file_ == files_.size()) return false;
    auto reader = LcmLogReader::open(files_[next_file_++]);
    if (reader) {
      reader_ = std::make_unique<LcmLogReader>(std::move(*reader));
    } else if (next_file_ ==
               1) {  // later ones may be empty: the program was stopped before their first event
      error_ = reader.error();
      return false;
    }
  }
}

/// Every file of a run begins with the same session.
bool LogSource::of_another_session(const LogEvent& event) const {
  return event.channel == log_channel::kSession && !session_payload_.empty() &&
         !std::equal(event.payload.begin(), event.payload.end(), session_payload_.begin(),
                     session_payload_.end());
}

Status LogSource::passed_over(std::string why) {
  error_ = path_ + ": " + std::move(why);
  return Status::bad_data;
}

/// The next frame that the run used, its images still coded; `decision_` is about it.
Status LogSource::next_frame(FrameMessage& message) {
  error_.clear();
  LogEvent event;
  while (next_event(event)) {
    if (event.channel == log_channel::kDecision) {
      const bool lacking = std::exchange(frame_pending_, false);
      const uint32_t sequence_before = pending_.sequence;
      if (codec_->decode(event.payload, pending_) != Status::ok)
        return passed_over("event " + std::to_string(event.number) +
                           ": is no decision of this program's version");
      frame_pending_ = pending_.used;
      new_map_due_ |= pending_.new_map;
      if (!lacking) continue;
      return passed_over("frame " + std::to_string(sequence_before) + ": was used, but is not in the log");
    }
    if (event.channel != log_channel::kFrame) continue;
    if (codec_->decode(event.payload, message) != Status::ok)
      return passed_over("event " + std::to_string(event.number) + ": is no frame of this program's version");
    if (!frame_pending_ || pending_.sequence != message.sequence)
      return passed_over("frame " + std::to_string(message.sequence) +
                         ": what was decided about it is not in the log");
    frame_pending_ = false;
    decision_ = pending_;
    decision_.new_map = std::exchange(new_map_due_, false);
    return Status::ok;
  }
  if (!error_.empty()) return Status::unavailable;
  if (!std::exchange(frame_pending_, false)) return Status::end;
  return passed_over("frame " + std::to_string(pending_.sequence) + ": was used, but the log ends before it");
}

Status LogSource::next(RgbdFrame& frame, int32_t /*timeout_ms*/) {
  FrameMessage message;
  if (const Status status = next_frame(message); status != Status::ok) return status;
  if (decoder_.decode(message, frame) != Status::ok) {
    new_map_due_ = decision_.new_map;
    return passed_over("frame " + std::to_string(message.sequence) + ": " + decoder_.error());
  }
  frame.truth_T_world_cam.reset();
  frame.sonar_m = decision_.sonar_m;
  odometry_.begin_frame(decision_);
  return Status::ok;
}

void LogSource::skip(uint32_t count) {
  FrameMessage message;
  for (uint32_t i = 0; i < count; ++i) {
    const Status status = next_frame(message);
    if (status != Status::ok && status != Status::bad_data) return;
  }
}

std::string LogSource::damage() const {
  LogReadCounters all = read_before_;
  if (reader_) add(reader_->counters(), all);
  std::string text;
  const auto say = [&](const std::string& what) { text += (text.empty() ? path_ + ": " : "; ") + what; };
  if (!from_the_beginning_) say("its beginning was deleted to make room");
  if (all.damaged_places > 0)
    say(std::to_string(all.damaged_places) + " damaged places, " + std::to_string(all.damaged_bytes) +
        " bytes were passed over");
  if (all.missing > 0) say(std::to_string(all.missing) + " events are missing");
  if (all.cut_bytes > 0)
    say("half an event at the end of a file: the program was stopped hard, or is still writing");
  return text;
}

}  // namespace stillmap
