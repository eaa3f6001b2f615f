#include "runtime/record/states_writer.hpp"

#include <fmt/format.h>

#include <iterator>
#include <utility>

#include "runtime/record/trajectory_writer.hpp"

namespace stillmap {
namespace {

constexpr const char* kAxes[6] = {"x", "y", "z", "rx", "ry", "rz"};

std::string states_header() {
  std::string header = "stamp,state,p_good,inlier_ratio,masked_fraction";
  for (int row = 0; row < 6; ++row)
    for (int col = row; col < 6; ++col)
      fmt::format_to(std::back_inserter(header), ",cov_{}_{}", kAxes[row], kAxes[col]);
  return header + "\n";
}

constexpr const char* kTimingHeader = "stamp,prepare_ms,track_ms,mask_ms,refine_ms,integrate_ms,total_ms\n";

}  // namespace

Result<StatesWriter> StatesWriter::create(const std::string& path) {
  auto file = OutputFile::create(path, OutputFile::Kind::stream);
  if (!file) return Error{file.error()};
  if (!file->write(states_header())) return Error{file->error()};
  return StatesWriter(std::move(*file));
}

StatesWriter::StatesWriter(OutputFile file) : file_(std::move(file)) {}

void StatesWriter::rotate_at(uint64_t bytes, int32_t kept) {
  file_.rotate_at(bytes, kept, states_header());
}

bool StatesWriter::write(const FrameResult& r) {
  std::string line = fmt::format("{},{},{:.4f},{:.4f},{:.4f}", file_stamp(r.stamp), to_string(r.state),
                                 r.p_good, r.inlier_ratio, r.masked_fraction);
  for (const float c : r.covariance) fmt::format_to(std::back_inserter(line), ",{:.6g}", c);
  return file_.write(line + "\n");
}

Result<TimingWriter> TimingWriter::create(const std::string& path) {
  auto file = OutputFile::create(path, OutputFile::Kind::stream);
  if (!file) return Error{file.error()};
  if (!file->write(kTimingHeader)) return Error{file->error()};
  return TimingWriter(std::move(*file));
}

TimingWriter::TimingWriter(OutputFile file) : file_(std::move(file)) {}

void TimingWriter::rotate_at(uint64_t bytes, int32_t kept) {
  file_.rotate_at(bytes, kept, kTimingHeader);
}

bool TimingWriter::write(const FrameResult& r) {
  const StageTimes& ms = r.ms;
  return file_.write(fmt::format("{},{:.4f},{:.4f},{:.4f},{:.4f},{:.4f},{:.4f}\n", file_stamp(r.stamp),
                                 ms.prepare_ms, ms.track_ms, ms.mask_ms, ms.refine_ms, ms.integrate_ms,
                                 ms.total_ms));
}

}  // namespace stillmap
