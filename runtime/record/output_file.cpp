#include "runtime/record/output_file.hpp"

#include <fcntl.h>
#include <unistd.h>

#include <cerrno>
#include <cstdio>
#include <cstring>
#include <utility>

namespace stillmap {
namespace {

constexpr size_t kBufferBytes = 256 * 1024;

std::string reason(const std::string& path, const char* what, int error_number) {
  return path + ": cannot " + what + ": " + std::strerror(error_number);
}

}  // namespace

Result<OutputFile> OutputFile::create(const std::string& path, Kind kind) {
  const int fd = ::open((path + ".part").c_str(), O_WRONLY | O_CREAT | O_TRUNC | O_CLOEXEC, 0644);
  if (fd < 0) return Error{reason(path, "be written", errno)};
  return OutputFile(path, kind, fd);
}

OutputFile::OutputFile(std::string path, Kind kind, int fd) : path_(std::move(path)), kind_(kind), fd_(fd) {
  if (kind_ == Kind::whole) buffer_.reserve(kBufferBytes);
}

OutputFile::OutputFile(OutputFile&& other) noexcept
    : path_(std::move(other.path_)),
      error_(std::move(other.error_)),
      kind_(other.kind_),
      fd_(std::exchange(other.fd_, -1)),
      good_bytes_(other.good_bytes_),
      buffer_(std::move(other.buffer_)),
      rotate_at_(other.rotate_at_),
      kept_(other.kept_),
      header_(std::move(other.header_)) {}

OutputFile& OutputFile::operator=(OutputFile&& other) noexcept {
  std::swap(path_, other.path_);
  std::swap(error_, other.error_);
  std::swap(kind_, other.kind_);
  std::swap(fd_, other.fd_);
  std::swap(good_bytes_, other.good_bytes_);
  std::swap(buffer_, other.buffer_);
  std::swap(rotate_at_, other.rotate_at_);
  std::swap(kept_, other.kept_);
  std::swap(header_, other.header_);
  return *this;
}

OutputFile::~OutputFile() {
  if (fd_ < 0) return;
  if (kind_ == Kind::stream)
    close();
  else
    discard();
}

bool OutputFile::write(std::string_view record) {
  return write(record.data(), record.size());
}

bool OutputFile::write(const void* bytes, size_t count) {
  if (failed() || fd_ < 0) return false;
  const bool full = rotate_at_ > 0 && good_bytes_ + count > rotate_at_ && good_bytes_ > header_.size();
  if (full && !rotate()) return false;
  const char* from = static_cast<const char*>(bytes);
  if (kind_ == Kind::stream || count >= kBufferBytes) return flush() && put(from, count);
  if (buffer_.size() + count > kBufferBytes && !flush()) return false;
  buffer_.insert(buffer_.end(), from, from + count);
  return true;
}

void OutputFile::rotate_at(uint64_t bytes, int32_t kept, std::string header) {
  rotate_at_ = bytes;
  kept_ = kept;
  header_ = std::move(header);
}

bool OutputFile::rotate() {
  if (!close()) return false;
  const auto older = [&](int32_t n) { return path_ + "." + std::to_string(n); };
  for (int32_t n = kept_ - 1; n >= 1; --n)
    std::rename(older(n).c_str(), older(n + 1).c_str());  // may not be there
  if (kept_ > 0) std::rename(path_.c_str(), older(1).c_str());
  fd_ = ::open((path_ + ".part").c_str(), O_WRONLY | O_CREAT | O_TRUNC | O_CLOEXEC, 0644);
  if (fd_ < 0) {
    error_ = reason(path_, "be written", errno);
    return false;
  }
  good_bytes_ = 0;
  return put(header_.data(), header_.size());
}

bool OutputFile::put(const char* bytes, size_t count) {
  for (size_t done = 0; done < count;) {
    const ssize_t n = ::write(fd_, bytes + done, count - done);
    if (n < 0 && errno == EINTR) continue;
    if (n <= 0) {
      fail(n < 0 ? errno : ENOSPC);
      return false;
    }
    done += static_cast<size_t>(n);
  }
  good_bytes_ += count;
  return true;
}

bool OutputFile::flush() {
  if (buffer_.empty()) return true;
  const bool ok = put(buffer_.data(), buffer_.size());
  buffer_.clear();
  return ok;
}

void OutputFile::fail(int error_number) {
  error_ = reason(path_, "be written", error_number);
  if (kind_ == Kind::whole) {
    discard();
    return;
  }
  // Half a record is cut off again; cutting needs no space.
  if (::ftruncate(fd_, static_cast<off_t>(good_bytes_)) == 0) error_ += " (the records before it are kept)";
}

void OutputFile::discard() {
  ::close(std::exchange(fd_, -1));
  ::unlink((path_ + ".part").c_str());
}

bool OutputFile::close() {
  if (fd_ < 0) return !failed();
  if (kind_ == Kind::whole) {
    if (!flush()) return false;
    // A rename may reach the disk before the data does; after a power cut the file must not be empty.
    if (::fsync(fd_) != 0 && errno != EINVAL && errno != EROFS) {
      fail(errno);
      return false;
    }
  }
  const bool closed = ::close(std::exchange(fd_, -1)) == 0;
  const int close_error = errno;
  if (!closed && kind_ == Kind::whole) {
    error_ = reason(path_, "be written", close_error);
    ::unlink((path_ + ".part").c_str());
    return false;
  }
  if (std::rename((path_ + ".part").c_str(), path_.c_str()) != 0) {
    error_ = reason(path_, "be put in place", errno);
    return false;
  }
  return !failed();
}

std::string write_whole_file(const std::string& path, std::string_view content) {
  auto file = OutputFile::create(path, OutputFile::Kind::whole);
  if (!file) return file.error();
  file->write(content);
  file->close();
  return file->error();
}

}  // namespace stillmap
