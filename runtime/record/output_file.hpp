#pragma once

#include <cstddef>
#include <cstdint>
#include <string>
#include <string_view>
#include <vector>

#include "config/result.hpp"

namespace stillmap {

/// A file that is written as PATH.part and renamed to PATH when it is closed, so that PATH is always whole.
/// The first failure is kept in `error()`; what comes after it is refused.
/// @thread one
class OutputFile {
 public:
  enum class Kind : uint8_t {
    whole,  ///< worth something only when complete: a failure removes it
    stream  ///< a log: a failure keeps every record that was written before it
  };

  /// @return the open file, or one line with the path and the system's reason
  static Result<OutputFile> create(const std::string& path, Kind kind);

  OutputFile(OutputFile&& other) noexcept;
  OutputFile& operator=(OutputFile&& other) noexcept;
  OutputFile(const OutputFile&) = delete;
  OutputFile& operator=(const OutputFile&) = delete;
  /// Closes a stream; throws away a whole file that `close` never finished.
  ~OutputFile();

  /// A stream that would grow beyond `bytes` goes on in a new file: PATH becomes PATH.1, that PATH.2 and so
  /// on, at most `kept` of them. Each begins with `header`, which the first one has already.
  void rotate_at(uint64_t bytes, int32_t kept, std::string header = {});

  /// Writes one record: all of it is in the file, or none. Unbuffered for streams.
  bool write(std::string_view record);
  bool write(const void* bytes, size_t count);
  /// Writes out what is buffered, syncs whole files, renames. @return false when anything failed; see error()
  bool close();

  bool failed() const { return !error_.empty(); }
  /// One line naming file and reason; empty while all is well.
  const std::string& error() const { return error_; }
  const std::string& path() const { return path_; }

 private:
  OutputFile(std::string path, Kind kind, int fd);
  bool rotate();
  bool put(const char* bytes, size_t count);
  bool flush();
  void fail(int error_number);
  void discard();

  std::string path_, error_;
  Kind kind_ = Kind::whole;
  int fd_ = -1;
  uint64_t good_bytes_ = 0;  ///< end of the last record that is wholly in the file
  std::vector<char> buffer_;
  uint64_t rotate_at_ = 0;  ///< bytes; 0: never
  int32_t kept_ = 0;
  std::string header_;
};

/// Writes `content` as the whole file `path`. @return empty, or the error
std::string write_whole_file(const std::string& path, std::string_view content);

}  // namespace stillmap
