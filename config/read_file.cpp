#include "config/read_file.hpp"

#include <fcntl.h>
#include <sys/stat.h>
#include <unistd.h>

#include <cerrno>
#include <system_error>

namespace stillmap {
namespace {

Error cannot_read(const std::string& path, int error_number) {
  return {path + ": cannot be read: " + std::generic_category().message(error_number)};
}

/// Closes the file when the function that opened it returns.
struct OpenFile {
  int fd;
  explicit OpenFile(const std::string& path) : fd(::open(path.c_str(), O_RDONLY | O_CLOEXEC | O_NONBLOCK)) {}
  ~OpenFile() {
    if (fd >= 0) ::close(fd);
  }
  OpenFile(const OpenFile&) = delete;
  OpenFile& operator=(const OpenFile&) = delete;
};

}  // namespace

Result<std::string> read_file(const std::string& path, uint64_t max_bytes) {
  const OpenFile file(path);
  if (file.fd < 0) return cannot_read(path, errno);
  struct stat about {};
  if (::fstat(file.fd, &about) != 0) return cannot_read(path, errno);
  if (!S_ISREG(about.st_mode)) return Error{path + ": expected a file, found a folder or a device"};
  const uint64_t bytes = static_cast<uint64_t>(about.st_size);
  if (bytes > max_bytes)
    return Error{path + ": " + std::to_string(bytes) + " bytes; at most " + std::to_string(max_bytes) +
                 " are read"};

  std::string content(bytes, '\0');
  size_t have = 0;
  while (have < content.size()) {
    const ssize_t got = ::read(file.fd, content.data() + have, content.size() - have);
    if (got < 0 && errno == EINTR) continue;
    if (got < 0) return cannot_read(path, errno);
    if (got == 0) break;  // the file became shorter meanwhile
    have += static_cast<size_t>(got);
  }
  content.resize(have);
  return content;
}

}  // namespace stillmap
