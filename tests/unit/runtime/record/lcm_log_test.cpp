// The event log's files: framing, rotation, full disks, power cuts, damage.

#include <gtest/gtest.h>

#include <algorithm>
#include <cstdlib>
#include <filesystem>
#include <random>

#include "runtime/record/lcm_log_files.hpp"
#include "runtime/record/lcm_log_format.hpp"
#include "runtime/record/lcm_log_reader.hpp"
#include "runtime/record/lcm_log_writer.hpp"
#include "tests/support/contains.hpp"
#include "tests/support/fake_disk.hpp"
#include "tests/support/temp_dir.hpp"
#include "tests/unit/runtime/record/file_size_limit.hpp"

namespace stillmap {
namespace {

using test::contains;
using test::FakeDisk;

constexpr int64_t kSecond = 1'000'000'000;

View<const uint8_t> bytes_of(const std::string& text) {
  return {reinterpret_cast<const uint8_t*>(text.data()), static_cast<uint32_t>(text.size())};
}

/// The payload of event `n`: all differ in length and content.
std::string payload(int64_t n) {
  return std::to_string(n) +
         std::string(static_cast<size_t>(50 + n * 37 % 400), static_cast<char>('a' + n % 26));
}

struct Read {
  std::vector<int64_t> numbers;
  std::vector<std::string> payloads;
  LogReadCounters counters;
};

Read read_all(const std::string& path) {
  Read read;
  auto reader = LcmLogReader::open(path);
  EXPECT_TRUE(reader) << reader.error();
  if (!reader) return read;
  for (LogEvent event; reader->next(event);) {
    read.numbers.push_back(event.number);
    read.payloads.emplace_back(event.payload.begin(), event.payload.end());
  }
  EXPECT_EQ(reader->error(), "");
  read.counters = reader->counters();
  return read;
}

std::unique_ptr<LcmLogWriter> open(const LcmLogOptions& options, LogDisk& disk = system_disk()) {
  auto writer = LcmLogWriter::open(options, disk);
  EXPECT_TRUE(writer) << writer.error();
  return writer ? std::move(*writer) : nullptr;
}

LcmLogOptions small(const std::string& dir) {
  LcmLogOptions options;
  options.dir = dir;
  options.file_bytes = 20000;
  options.max_bytes = 100000;
  return options;
}

Status write(LcmLogWriter& writer, int64_t n) {
  return writer.write("CHANNEL", Utime{1000 * n}, bytes_of(payload(n)));
}

TEST(LcmLog, HasTheFramingOfLcm) {
  const test::TempDir dir;
  auto writer = open(small(dir.path()));
  ASSERT_EQ(writer->write("POSE", Utime{0x0102030405060708}, bytes_of("ab")), Status::ok);
  ASSERT_EQ(writer->write("POSE", Utime{-1}, bytes_of("")), Status::ok);
  EXPECT_TRUE(test::exists(dir.path("log-000001.lcm.part")));
  ASSERT_TRUE(writer->close());
  const std::string expected(
      "\xed\xa1\xda\x01\0\0\0\0\0\0\0\0\x01\x02\x03\x04\x05\x06\x07\x08\0\0\0\x04\0\0\0\x02POSEab"
      "\xed\xa1\xda\x01\0\0\0\0\0\0\0\x01\xff\xff\xff\xff\xff\xff\xff\xff\0\0\0\x04\0\0\0\0POSE",
      34 + 32);
  EXPECT_EQ(test::read_text(dir.path("log-000001.lcm")), expected);
}

TEST(LcmLog, RotatesBySizeAndStaysWithinItsBytes) {
  FakeDisk disk;
  auto writer = open(small("d"), disk);
  writer->begin_files_with("SESSION", Utime{7}, bytes_of("session"));
  constexpr int64_t kEvents = 5000;
  for (int64_t n = 0; n < kEvents; ++n) {
    ASSERT_EQ(write(*writer, n), Status::ok);
    ASSERT_LE(disk.bytes(), 100000u);
    ASSERT_EQ(disk.bytes(), writer->counters().bytes);
  }
  ASSERT_TRUE(writer->close());
  EXPECT_GE(disk.bytes(), 60000u) << "more was deleted than had to be";
  EXPECT_GT(writer->counters().files_deleted, 20u);
  EXPECT_EQ(writer->counters().dropped, 0u);

  const test::TempDir dir;
  int64_t last = -1;
  for (const std::string& path : test::put_into(dir, disk.files())) {
    EXPECT_FALSE(path.ends_with(".part"));
    const Read read = read_all(path);
    ASSERT_FALSE(read.payloads.empty());
    EXPECT_EQ(read.payloads.front(), "session");
    if (last >= 0) {
      EXPECT_EQ(read.numbers.front(), last + 1) << "nothing is missing between files";
    }
    EXPECT_EQ(read.counters.missing, 0u);
    last = read.numbers.back();
  }
  EXPECT_EQ(static_cast<uint64_t>(last + 1), writer->counters().events);
}

TEST(LcmLog, RotatesByTimeAndWhenItIsTold) {
  FakeDisk disk;
  LcmLogOptions options = small("d");
  options.file_s = 60;
  options.max_s = 600;
  auto writer = open(options, disk);
  for (int64_t minute = 0; minute < 60; ++minute) {
    disk.time_ns = minute * 61 * kSecond;
    ASSERT_EQ(write(*writer, minute), Status::ok);
  }
  EXPECT_EQ(writer->counters().files_begun, 60u);
  EXPECT_GE(disk.files().size(), 9u);
  EXPECT_LE(disk.files().size(), 11u) << "files older than ten minutes are gone";
  writer->rotate();
  ASSERT_EQ(write(*writer, 60), Status::ok);
  EXPECT_EQ(writer->counters().files_begun, 61u);
}

TEST(LcmLog, GoesOnWithTheNumbersOfAnEarlierRunAndTakesItsOpenFileOver) {
  const test::TempDir dir;
  {
    auto first = open(small(dir.path()));
    ASSERT_EQ(write(*first, 1), Status::ok);
    ASSERT_TRUE(first->close());
  }
  std::filesystem::rename(dir.path("log-000001.lcm"), dir.path("log-000001.lcm.part"));
  test::write_text(dir.path("log-7.txt"), "not of the log");
  auto writer = open(small(dir.path()));
  EXPECT_EQ(writer->counters().taken_over, 1u);
  EXPECT_TRUE(test::exists(dir.path("log-000001.lcm")));
  ASSERT_EQ(write(*writer, 2), Status::ok);
  EXPECT_TRUE(test::exists(dir.path("log-000002.lcm.part")));
  EXPECT_EQ(writer->counters().bytes,
            std::filesystem::file_size(dir.path("log-000001.lcm")) + 28 + 7 + payload(2).size());
}

TEST(LcmLog, WhatEarlierRunsLeftCountsAndGoesFirst) {
  FakeDisk disk;
  for (int64_t run = 0; run < 40; ++run) {
    auto writer = open(small("d"), disk);
    for (int64_t n = 0; n < 90; ++n) {
      ASSERT_EQ(write(*writer, n), Status::ok);
      ASSERT_LE(disk.bytes(), 100000u) << run;
    }
  }
}

TEST(LcmLog, AFullDiskStopsItAndRoomLetsItGoOn) {
  FakeDisk disk;
  auto writer = open(small("d"), disk);
  disk.room = 1000;
  int64_t n = 0;
  while (write(*writer, n) == Status::ok) ++n;
  const uint64_t events = writer->counters().events;
  EXPECT_EQ(writer->status(), Status::capacity_exhausted);
  EXPECT_EQ(writer->counters().stops, 1u);
  EXPECT_TRUE(contains(writer->error(), "d/log-000001.lcm.part: cannot be written: No space left"))
      << writer->error();
  for (int i = 0; i < 9; ++i) EXPECT_EQ(write(*writer, ++n), Status::capacity_exhausted);
  disk.room = UINT64_MAX;
  EXPECT_EQ(write(*writer, ++n), Status::capacity_exhausted) << "one try a second is enough";
  disk.time_ns += LcmLogWriter::kRetryNs;
  EXPECT_EQ(write(*writer, ++n), Status::ok);
  EXPECT_EQ(writer->status(), Status::ok);
  EXPECT_EQ(writer->counters().dropped, 11u);
  EXPECT_EQ(writer->counters().stops, 1u);
  writer->close();

  const test::TempDir dir;
  const Read read = read_all(test::put_into(dir, disk.files()).at(0));
  EXPECT_EQ(read.numbers.size(), events + 1);
  EXPECT_EQ(read.payloads.back(), payload(n));
  EXPECT_EQ(read.counters.missing, 11u) << "the gap shows in the numbers";
  EXPECT_EQ(read.counters.damaged_bytes + read.counters.cut_bytes, 0u) << "no half event is left";
}

/// Wherever the disk fills up: at the head, in the payload, when a file begins.
TEST(LcmLog, LeavesWholeFilesWhereverTheDiskFillsUp) {
  for (uint64_t room = 19000; room < 21500; room += 29) {
    FakeDisk disk;
    auto writer = open(small("d"), disk);
    writer->begin_files_with("SESSION", Utime{7}, bytes_of("session"));
    disk.room = room;
    for (int64_t n = 0; n < 100; ++n) write(*writer, n);
    EXPECT_NE(writer->status(), Status::ok);
    disk.room = UINT64_MAX;
    disk.time_ns += LcmLogWriter::kRetryNs;
    ASSERT_EQ(write(*writer, 100), Status::ok) << room;
    writer->close();
    const test::TempDir dir;
    uint64_t events = 0;
    for (const std::string& path : test::put_into(dir, disk.files())) {
      const Read read = read_all(path);
      ASSERT_FALSE(read.payloads.empty()) << room;
      ASSERT_EQ(read.payloads.front(), "session") << room;
      ASSERT_EQ(read.counters.damaged_bytes + read.counters.cut_bytes, 0u) << room;
      events += read.numbers.size();
    }
    ASSERT_EQ(events, writer->counters().events) << room;
  }
}

TEST(LcmLog, ALimitOnTheSizeOfFilesIsAFullDisk) {
  const test::TempDir dir;
  auto writer = open(small(dir.path()));
  int64_t n = 0;
  {
    const test::FileSizeLimit limit(5000);
    while (n < 100 && write(*writer, n) == Status::ok) ++n;
  }
  EXPECT_EQ(writer->status(), Status::capacity_exhausted);
  writer->close();
  const Read read = read_all(dir.path("log-000001.lcm"));
  EXPECT_EQ(read.numbers.size(), static_cast<size_t>(n));
  EXPECT_EQ(read.counters.cut_bytes, 0u);
}

TEST(LcmLog, ADiskThatFailsIsSaidAndTriedAgainInANewFile) {
  FakeDisk disk;
  auto writer = open(small("d"), disk);
  ASSERT_EQ(write(*writer, 1), Status::ok);
  disk.fail_sync = EIO;
  disk.time_ns += 2 * kSecond;
  EXPECT_EQ(writer->step(), Status::unavailable);
  EXPECT_TRUE(contains(writer->error(), "cannot be synced: Input/output error")) << writer->error();
  disk.fail_sync = 0;
  disk.time_ns += 2 * kSecond;
  EXPECT_EQ(write(*writer, 2), Status::ok);
  EXPECT_EQ(writer->counters().files_begun, 2u);
  EXPECT_FALSE(writer->close()) << "what failed once is not forgotten";
}

TEST(LcmLog, NothingIsWrittenBeyondItsBytesWhenTheOldestFileCannotGo) {
  FakeDisk disk;
  auto writer = open(small("d"), disk);
  disk.fail_remove = EACCES;
  for (int64_t n = 0; n < 1000; ++n) write(*writer, n);
  EXPECT_EQ(writer->status(), Status::unavailable);
  EXPECT_TRUE(contains(writer->error(), "log-000001.lcm: cannot be deleted to make room")) << writer->error();
  EXPECT_LE(disk.most_bytes, 100000u);
}

TEST(LcmLog, EventsThatNoFileCanHoldAreRefused) {
  FakeDisk disk;
  auto writer = open(small("d"), disk);
  EXPECT_EQ(writer->write("CHANNEL", Utime{}, bytes_of(std::string(20000, 'x'))), Status::out_of_range);
  EXPECT_EQ(writer->write("", Utime{}, bytes_of("x")), Status::out_of_range);
  EXPECT_EQ(writer->write(std::string(64, 'C').c_str(), Utime{}, bytes_of("x")), Status::out_of_range);
  EXPECT_EQ(writer->counters().dropped, 3u);
  EXPECT_EQ(writer->status(), Status::ok);
  EXPECT_EQ(write(*writer, 1), Status::ok);
}

TEST(LcmLog, CannotBeOpenedWhereNothingCanBeWritten) {
  const test::TempDir dir;
  const auto in_a_file = LcmLogWriter::open(small(dir.write("file", "")));
  ASSERT_FALSE(in_a_file);
  EXPECT_TRUE(contains(in_a_file.error(), "cannot be used for the event log")) << in_a_file.error();
  LcmLogOptions options = small(dir.path());
  options.max_bytes = options.file_bytes;
  EXPECT_FALSE(LcmLogWriter::open(options));
}

/// The bound of loss: a second, here in events. Power is cut at moments that the seed chooses.
TEST(LcmLog, AfterAPowerCutEverySyncedEventIsThereAndNoMoreThanASecondIsLost) {
  const char* const seed = std::getenv("STILLMAP_SEED");
  std::mt19937 random(seed ? static_cast<uint32_t>(std::atoi(seed)) : 1);
  for (int cut = 0; cut < 60; ++cut) {
    FakeDisk disk;
    auto writer = open(small("d"), disk);
    const int64_t events = std::uniform_int_distribution<int64_t>(1, 600)(random);
    for (int64_t n = 0; n < events; ++n) {
      disk.time_ns = n * kSecond / 30;
      ASSERT_EQ(write(*writer, n), Status::ok);
      writer->step();
    }
    const test::TempDir dir;
    int64_t last = -1;
    for (const std::string& path : test::put_into(dir, disk.after_power_cut())) {
      if (std::filesystem::file_size(path) == 0) continue;  // was made, never synced
      const Read read = read_all(path);
      ASSERT_EQ(read.counters.damaged_bytes + read.counters.cut_bytes, 0u);
      for (size_t i = 0; i < read.numbers.size(); ++i) {
        if (last >= 0) {
          ASSERT_EQ(read.numbers[i], last + 1) << "cut after " << events;
        }
        last = read.numbers[i];
        ASSERT_EQ(read.payloads[i], payload(last));
      }
    }
    ASSERT_GE(last, events - 1 - 31) << "cut after " << events << " events";
  }
}

TEST(LcmLogReader, AFileCutAnywhereIsReadUpToItsLastWholeEvent) {
  const test::TempDir dir;
  auto writer = open(small(dir.path()));
  std::vector<size_t> ends;
  size_t end = 0;
  for (int64_t n = 0; n < 8; ++n) {
    ASSERT_EQ(write(*writer, n), Status::ok);
    ends.push_back(end += 28 + 7 + payload(n).size());
  }
  ASSERT_TRUE(writer->close());
  const std::string whole = test::read_text(dir.path("log-000001.lcm"));
  for (size_t cut = 4; cut <= whole.size(); cut += 5) {
    const Read read = read_all(dir.write("cut.lcm", whole.substr(0, cut)));
    const auto expected = static_cast<size_t>(std::upper_bound(ends.begin(), ends.end(), cut) - ends.begin());
    ASSERT_EQ(read.numbers.size(), expected) << cut;
    const size_t whole_bytes = expected == 0 ? 0 : ends[expected - 1];
    ASSERT_EQ(read.counters.cut_bytes + read.counters.damaged_bytes, cut - whole_bytes) << cut;
  }
}

TEST(LcmLogReader, GoesOnBehindDamage) {
  const test::TempDir dir;
  auto writer = open(small(dir.path()));
  size_t bytes = 0, second = 0;
  for (int64_t n = 0; n < 6; ++n) {
    if (n == 1) second = bytes;
    ASSERT_EQ(write(*writer, n), Status::ok);
    bytes += 28 + 7 + payload(n).size();
  }
  ASSERT_TRUE(writer->close());
  const std::string whole = test::read_text(dir.path("log-000001.lcm"));
  struct Case {
    const char* what;
    size_t offset;
    std::string bytes;
  };
  const Case cases[] = {{"sync", 0, "x"},
                        {"channel length", 20, std::string("\0\0\0\x08", 4)},
                        {"channel length beyond its range", 20, "\x7f"},
                        {"payload length, longer", 24, std::string("\0\0\x10\0", 4)},
                        {"payload length, beyond the file", 24, std::string("\x03\0\0\0", 4)},
                        {"payload length, shorter", 24, std::string("\0\0\0\x01", 4)},
                        {"payload length beyond its range", 24, "\xff"},
                        {"channel", 28, std::string("\0\x80", 2)}};
  for (const Case& damage : cases) {
    std::string content = whole;
    content.replace(second + damage.offset, damage.bytes.size(), damage.bytes);
    const Read read = read_all(dir.write("damaged.lcm", content));
    std::vector<int64_t> others;
    for (const int64_t n : read.numbers)
      if (n != 1) others.push_back(n);
    EXPECT_EQ(others, (std::vector<int64_t>{0, 2, 3, 4, 5})) << damage.what;
    EXPECT_LE(read.counters.damaged_places, 1u) << damage.what;
  }
  // An event whose follower is damaged is good all the same.
  std::string content = whole;
  content[second] = 'x';
  EXPECT_EQ(read_all(dir.write("damaged.lcm", content)).payloads.front(), payload(0));
}

TEST(LcmLogReader, NoBytesMakeItCrashOrGoOnForEver) {
  const test::TempDir dir;
  auto writer = open(small(dir.path()));
  for (int64_t n = 0; n < 12; ++n) ASSERT_EQ(write(*writer, n), Status::ok);
  ASSERT_TRUE(writer->close());
  const std::string whole = test::read_text(dir.path("log-000001.lcm"));
  std::mt19937 random(3);
  uint64_t events = 0;
  for (int round = 0; round < 200; ++round) {
    std::string content = whole;
    for (int flip = 0; flip < 1 + round % 40; ++flip)
      content[4 + random() % (content.size() - 4)] = static_cast<char>(random());
    const Read read = read_all(dir.write("fuzzed.lcm", content));
    events += read.numbers.size();
    ASSERT_LE(read.counters.damaged_bytes + read.counters.cut_bytes, content.size());
  }
  EXPECT_GT(events, 200u * 3);
}

TEST(LcmLogReader, SaysWhatIsNoLog) {
  const test::TempDir dir;
  for (const std::string& path :
       {dir.path("missing"), dir.path(), dir.write("text", "no log"), dir.write("empty", "")}) {
    const auto reader = LcmLogReader::open(path);
    ASSERT_FALSE(reader) << path;
    EXPECT_EQ(reader.error_kind(), ErrorKind::cannot_open);
    EXPECT_TRUE(contains(reader.error(), path)) << reader.error();
  }
}

TEST(LcmLogReader, ReadsEventsThatAreLongerThanItsBuffer) {
  const test::TempDir dir;
  LcmLogOptions options = small(dir.path());
  options.file_bytes = 30000000;
  options.max_bytes = 60000000;
  auto writer = open(options);
  const std::string longer(9000000, 'x');
  ASSERT_EQ(write(*writer, 0), Status::ok);
  ASSERT_EQ(writer->write("FRAME", Utime{}, bytes_of(longer)), Status::ok);
  ASSERT_EQ(write(*writer, 2), Status::ok);
  ASSERT_TRUE(writer->close());
  EXPECT_EQ(read_all(dir.path("log-000001.lcm")).payloads,
            (std::vector<std::string>{payload(0), longer, payload(2)}));
}

TEST(LogFiles, AreFoundInTheirOrder) {
  const test::TempDir dir;
  for (const char* name :
       {"log-000002.lcm", "log-000010.lcm.part", "log-000001.lcm", "other-000003.lcm", "mine.lcm"})
    dir.write(name, "");
  const auto names = [&](const std::string& path) {
    const auto found = find_log_files(path);
    EXPECT_TRUE(found) << found.error();
    std::vector<std::string> all;
    for (const std::string& file : *found) all.push_back(std::filesystem::path(file).filename().string());
    return all;
  };
  using Names = std::vector<std::string>;
  EXPECT_EQ(names(dir.path()), (Names{"log-000001.lcm", "log-000002.lcm", "log-000010.lcm.part"}));
  EXPECT_EQ(names(dir.path("log-000002.lcm")), (Names{"log-000002.lcm", "log-000010.lcm.part"}));
  EXPECT_EQ(names(dir.path("other-000003.lcm")), (Names{"other-000003.lcm"}));
  EXPECT_EQ(names(dir.path("mine.lcm")), (Names{"mine.lcm"}));
  EXPECT_FALSE(find_log_files(dir.path("log-000003.lcm")));
  EXPECT_FALSE(find_log_files(dir / "empty/"));
}

}  // namespace
}  // namespace stillmap
