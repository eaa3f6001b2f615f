#pragma once

#include <cstdint>
#include <string>
#include <string_view>

#include "config/result.hpp"

namespace stillmap {

/// The folder of one run. Files of an earlier run there move to `previous-1`, the one before to `previous-2`
/// and so on. Only names that a run or `stillmap picture` writes are moved; a user's own files stay where
/// they are.
class RunFolder {
 public:
  /// Makes `dir` (and its parents) where missing and clears it for a new run.
  /// @param keep_previous earlier runs kept, 0..100; the oldest above it are removed
  /// @return the folder, or one line with path and reason: not a folder, no permission, disk full
  static Result<RunFolder> open(const std::string& dir, int32_t keep_previous);

  /// Makes a folder inside. @return empty, or the error
  std::string make(const std::string& name) const;
  std::string path(std::string_view name) const { return dir_ + "/" + std::string(name); }
  const std::string& dir() const { return dir_; }
  /// Files of the event log that the earlier run did not close: it was stopped hard. They lost their `.part`.
  uint32_t unclosed_logs() const { return unclosed_logs_; }

 private:
  explicit RunFolder(std::string dir);

  std::string dir_;
  uint32_t unclosed_logs_ = 0;
};

}  // namespace stillmap
