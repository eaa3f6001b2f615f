#pragma once

#include <string>

#include "runtime/pipeline/pipeline.hpp"
#include "runtime/record/output_file.hpp"

namespace stillmap {

/// Streams states.csv: a line for every processed frame, `stamp,state,p_good,inlier_ratio,masked_fraction`
/// and the upper triangle of the covariance (m^2, m rad, rad^2). @thread one
class StatesWriter {
 public:
  static Result<StatesWriter> create(const std::string& path);

  bool write(const FrameResult& result);
  OutputFile& file() { return file_; }
  /// As OutputFile::rotate_at.
  void rotate_at(uint64_t bytes, int32_t kept);

 private:
  explicit StatesWriter(OutputFile file);

  OutputFile file_;
};

/// Streams timing.csv: milliseconds of every step of every processed frame. @thread one
class TimingWriter {
 public:
  static Result<TimingWriter> create(const std::string& path);

  bool write(const FrameResult& result);
  OutputFile& file() { return file_; }
  /// As OutputFile::rotate_at.
  void rotate_at(uint64_t bytes, int32_t kept);

 private:
  explicit TimingWriter(OutputFile file);

  OutputFile file_;
};

}  // namespace stillmap
