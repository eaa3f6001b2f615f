// What log_test.py needs of the runtime.
//
//   log_load write DIR COUNTER       events as fast as they go, for ever; COUNTER (8 bytes, shared) says how
//   many are
//                                    in the log
//   log_load check DIR COUNTER       0: all of them can be read
//   log_load fill DIR BALLAST        writes until the disk is full, removes BALLAST, writes on
//   log_load run DIR SOURCE COLOUR   a run that decides as a live one does, with log (DIR/log*.lcm) and
//   trajectory

#include <fcntl.h>
#include <sys/mman.h>
#include <unistd.h>

#include <atomic>
#include <chrono>
#include <cstdio>
#include <cstring>
#include <filesystem>
#include <string>
#include <thread>

#include "config/describe.hpp"
#include "config/engine_params.hpp"
#include "drivers/lcm/lcm.hpp"
#include "drivers/registry.hpp"
#include "runtime/archive/block_archive.hpp"
#include "runtime/core/version.hpp"
#include "runtime/pipeline/pipeline.hpp"
#include "runtime/ports/frame_odometry.hpp"
#include "runtime/record/lcm_log_files.hpp"
#include "runtime/record/lcm_log_reader.hpp"
#include "runtime/record/log_recorder.hpp"
#include "runtime/record/trajectory_writer.hpp"
#include "tests/support/frame_memory.hpp"

namespace stillmap {
namespace {

constexpr const char* kChannel = "LOAD";

LcmLogOptions small_files(const std::string& dir) {
  LcmLogOptions options;
  options.dir = dir;
  options.file_bytes = 400000;
  options.max_bytes = 2000000;
  options.sync_s = 0.01;
  return options;
}

/// Event `n`: known to the last byte. From a few bytes to a frame's.
std::string payload(uint64_t n) {
  return std::to_string(n) +
         std::string(n % 50 == 0 ? 150000 : n * 37 % 900, static_cast<char>('a' + n % 26));
}

View<const uint8_t> bytes_of(const std::string& text) {
  return {reinterpret_cast<const uint8_t*>(text.data()), static_cast<uint32_t>(text.size())};
}

int fail(const std::string& why) {
  std::fprintf(stderr, "log_load: %s\n", why.c_str());
  return 1;
}

/// Survives the program: it is a page of the file.
std::atomic<uint64_t>* shared_counter(const std::string& path) {
  const int file = ::open(path.c_str(), O_RDWR | O_CREAT, 0644);
  if (file < 0 || ::ftruncate(file, sizeof(uint64_t)) != 0) return nullptr;
  void* const page = ::mmap(nullptr, sizeof(uint64_t), PROT_READ | PROT_WRITE, MAP_SHARED, file, 0);
  ::close(file);
  return page == MAP_FAILED ? nullptr : static_cast<std::atomic<uint64_t>*>(page);
}

int write_for_ever(const std::string& dir, const std::string& counter_path) {
  auto* const counter = shared_counter(counter_path);
  auto writer = LcmLogWriter::open(small_files(dir));
  if (!writer || !counter) return fail(writer ? counter_path : writer.error());
  counter->store(0);
  for (uint64_t n = 0;; ++n) {
    if ((*writer)->write(kChannel, Utime{static_cast<int64_t>(n)}, bytes_of(payload(n))) != Status::ok)
      return fail((*writer)->error());
    counter->store(n + 1);
    if (n == 0) std::puts("writing"), std::fflush(stdout);
    (*writer)->step();
  }
}

/// Every event up to the last one that `write` accepted, as far back as the bytes reach.
int check(const std::string& dir, const std::string& counter_path) {
  auto* const counter = shared_counter(counter_path);
  const auto files = find_log_files(dir);
  if (!files || !counter) return fail(files ? counter_path : files.error());
  std::string last_run;
  uint64_t next = 0;
  for (const std::string& path : *files) {
    if (std::filesystem::file_size(path) == 0) continue;  // killed before its first event
    auto reader = LcmLogReader::open(path);
    if (!reader) return fail(reader.error());
    for (LogEvent event; reader->next(event); ++next) {
      if (event.number == 0 || next == 0)
        next = static_cast<uint64_t>(event.number);  // a run, or what is left of it
      const std::string expected = payload(next);
      if (static_cast<uint64_t>(event.number) != next || event.channel != kChannel ||
          std::string(event.payload.begin(), event.payload.end()) != expected)
        return fail(path + ": event " + std::to_string(next) + " is wrong");
    }
    if (reader->counters().damaged_bytes > 0) return fail(path + ": damaged");
  }
  if (next < counter->load())
    return fail(std::to_string(counter->load()) + " events were accepted, " + std::to_string(next) +
                " can be read");
  std::printf("%llu events\n", static_cast<unsigned long long>(next));
  return 0;
}

int fill(const std::string& dir, const std::string& ballast) {
  LcmLogOptions options = small_files(dir);
  options.max_bytes = 100000000;
  auto writer = LcmLogWriter::open(options);
  if (!writer) return fail(writer.error());
  uint64_t n = 0;
  while (n < 100000 && (*writer)->write(kChannel, Utime{}, bytes_of(payload(n))) == Status::ok) ++n;
  if ((*writer)->status() != Status::capacity_exhausted) return fail("the disk is not full");
  std::printf("%llu events; %s\n", static_cast<unsigned long long>(n), (*writer)->error());
  const uint64_t stopped_at = n;
  std::filesystem::remove(ballast);
  for (int tries = 0; tries < 100; ++tries) {
    if ((*writer)->write(kChannel, Utime{}, bytes_of(payload(++n))) == Status::ok) break;
    std::this_thread::sleep_for(std::chrono::milliseconds(50));
  }
  if ((*writer)->status() != Status::ok) return fail("does not go on although there is room");
  (*writer)->close();
  uint64_t read = 0, missing = 0;
  const auto files = find_log_files(dir);
  if (!files) return fail(files.error());
  for (const std::string& path : *files) {
    auto reader = LcmLogReader::open(path);
    if (!reader) return fail(reader.error());
    for (LogEvent event; reader->next(event); ++read)
      if (bytes_of(payload(static_cast<uint64_t>(event.number))).size != event.payload.size)
        return fail("wrong event");
    missing += reader->counters().missing;
    if (reader->counters().damaged_bytes + reader->counters().cut_bytes > 0)
      return fail(path + ": half an event");
  }
  if (read != stopped_at + 1 || missing > n - stopped_at) return fail("events are lost");
  return 0;
}

/// Leaves frames out, sheds work, gives the map up, and has a disk that answers when it likes, as a live run.
int run(const std::string& dir, const std::string& source_name, const std::string& colour) {
  SourceOptions source_options;
  auto source = open_source(source_name, source_options);
  if (!source) return fail(source.error());
  Config config;
  config.map.voxel_m = 0.03f;  // a coarse map: quick
  config.map.truncation_m = 0.12f;
  config.map.pool_blocks = 700;
  config.track.prior = MotionPrior::odometry;
  config.archive.dir = dir + "/archive";
  config.record.log = config.record.frames = true;
  config.record.colour = colour == "jpeg" ? RecordColour::jpeg : RecordColour::lossless;
  config.record.log_file_bytes = 6e6f;
  const SourceInfo& info = (*source)->info();
  const EngineParams params = engine_params(config, info.camera, info.depth_units_per_m);
  const auto engine = make_cpu_engine(params);
  BlockArchive::Options archive_options;
  archive_options.dir = config.archive.dir;
  archive_options.max_bytes = static_cast<uint64_t>(config.archive.max_bytes);
  archive_options.keep_below = 0.85f * config.map.high_water;
  archive_options.full = 0.95f * config.map.high_water;
  auto archive = BlockArchive::open(archive_options);
  if (!engine || !archive) return fail("no engine or archive");

  const auto codec = make_lcm_codec();
  const std::string config_toml = to_toml(config);
  SessionMessage session;
  session.utime.us = 1764000000000000;
  session.version = version(), session.source = info.name, session.config_toml = config_toml;
  const Intrinsics& k = info.camera.k;
  session.width = k.width, session.height = k.height;
  const float values[] = {k.fx, k.fy, k.cx, k.cy};
  for (int i = 0; i < 4; ++i) session.k[i] = static_cast<double>(values[i]);
  session.depth_units_per_m = static_cast<double>(info.depth_units_per_m);
  session.T_map_cam.translation = {0.1, 0.2, 0.3};
  auto recorder = LogRecorder::create(config.record, dir, session, *codec);
  auto trajectory = TrajectoryWriter::create(dir + "/trajectory.txt");
  if (!recorder || !trajectory) return fail(recorder ? trajectory.error() : recorder.error());

  FrameOdometry odometry((*source)->odometry());
  Pipeline pipeline(*engine, config, session.T_map_cam, &odometry);
  test::FrameMemory memory(info);
  uint32_t with_odometry = 0;
  while ((*source)->next(memory.frame, 1000) == Status::ok) {
    const uint32_t n = memory.frame.sequence;
    DecisionMessage decision;
    decision.utime.us = session.utime.us + memory.frame.depth_stamp.ns / 1000;
    decision.sequence = n;
    decision.used = n % 7 != 3;
    if (!decision.used) {
      (*recorder)->write(decision, nullptr);
      continue;
    }
    decision.shed = n % 30 > 20   ? Shed::finest_level
                    : n % 30 > 10 ? Shed::every_second_integration
                                  : Shed::nothing;
    decision.new_map = n == 60;
    if (decision.new_map) {
      pipeline.start_new_map();
      (*archive)->forget();
    }
    odometry.begin_frame();
    const FrameWork work = {decision.shed == Shed::nothing || n % 2 == 0,
                            decision.shed == Shed::finest_level ? 1 : 0};
    const FrameResult result = pipeline.process(memory.frame, work);
    decision.integrated = result.integrated;
    decision.archive_answers = (*archive)->step(*engine, pipeline.centre_map());
    odometry.log(decision);
    with_odometry += decision.odometry_answers > 0;
    trajectory->write(result.stamp, result.T_map_cam);
    if ((*recorder)->write(decision, &memory.frame) != Status::ok) return fail((*recorder)->error());
    (*recorder)->step();
  }
  const ArchiveCounters& counters = (*archive)->counters();
  std::printf(
      "{\"frames\": %u, \"with_odometry\": %u, \"stored\": %llu, \"restored\": %llu, \"files\": %u}\n",
      pipeline.counters().frames, with_odometry, static_cast<unsigned long long>(counters.stored),
      static_cast<unsigned long long>(counters.restored), (*recorder)->counters().files_begun);
  return (*recorder)->close() && trajectory->file().close() ? 0 : fail("cannot close");
}

int start(const std::vector<std::string>& words) {
  if (words.size() == 3 && words[0] == "write") return write_for_ever(words[1], words[2]);
  if (words.size() == 3 && words[0] == "check") return check(words[1], words[2]);
  if (words.size() == 3 && words[0] == "fill") return fill(words[1], words[2]);
  if (words.size() == 4 && words[0] == "run") return run(words[1], words[2], words[3]);
  return fail("see the head of log_load.cpp");
}

}  // namespace
}  // namespace stillmap

int main(int argc, char** argv) {
  return stillmap::start({argv + 1, argv + argc});
}
