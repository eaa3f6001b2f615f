#include "runtime/record/log_disk.hpp"

#include <dirent.h>
#include <fcntl.h>
#include <sys/stat.h>
#include <time.h>
#include <unistd.h>

#include <cerrno>
#include <cstdio>
#include <filesystem>
#include <system_error>

namespace stillmap {
namespace {

int answer(int result) {
  return result == 0 ? 0 : errno;
}

/// Leaves out the first `done` bytes.
void pass(View<iovec>& pieces, size_t done) {
  while (pieces.size > 0 && done >= pieces[0].iov_len) {
    done -= pieces[0].iov_len;
    ++pieces.data;
    --pieces.size;
  }
  if (pieces.size == 0) return;
  pieces[0].iov_base = static_cast<char*>(pieces[0].iov_base) + done;
  pieces[0].iov_len -= done;
}

class SystemDisk final : public LogDisk {
 public:
  int list(const std::string& folder, std::vector<Entry>& entries) override {
    namespace fs = std::filesystem;
    std::error_code code;
    fs::create_directories(folder, code);
    for (fs::directory_iterator it(folder, code), end; !code && it != end; it.increment(code)) {
      std::error_code gone;
      if (!it->is_regular_file(gone)) continue;
      const uint64_t bytes = it->file_size(gone);
      if (!gone) entries.push_back({it->path().filename().string(), bytes});
    }
    return code.value();
  }

  int create(const char* path) override {
    const int file = ::open(path, O_WRONLY | O_CREAT | O_TRUNC | O_APPEND | O_CLOEXEC, 0644);
    return file < 0 ? -errno : file;
  }

  int append(int file, View<iovec> pieces) override {
    while (pieces.size > 0) {
      const ssize_t done = ::writev(file, pieces.data, static_cast<int>(pieces.size));
      if (done < 0 && errno == EINTR) continue;
      if (done < 0) return errno;
      if (done == 0) return ENOSPC;
      pass(pieces, static_cast<size_t>(done));
    }
    return 0;
  }

  int cut(int file, uint64_t bytes) override { return answer(::ftruncate(file, static_cast<off_t>(bytes))); }

  int sync(int file) override {
    const int error = answer(::fdatasync(file));
    return error == EINVAL || error == EROFS ? 0 : error;  // nothing that could be synced
  }

  int close(int file) override { return answer(::close(file)); }
  int rename(const char* from, const char* to) override { return answer(std::rename(from, to)); }
  int remove(const char* path) override { return answer(::unlink(path)); }

  int sync_folder(const char* folder) override {
    const int file = ::open(folder, O_RDONLY | O_DIRECTORY | O_CLOEXEC);
    if (file < 0) return errno;
    const int error = answer(::fsync(file));
    ::close(file);
    return error == EINVAL || error == EROFS ? 0 : error;
  }

  int64_t now_ns() override {
    timespec t{};
    ::clock_gettime(CLOCK_MONOTONIC, &t);
    return int64_t{t.tv_sec} * 1'000'000'000 + t.tv_nsec;
  }
};

}  // namespace

LogDisk& system_disk() {
  static SystemDisk disk;
  return disk;
}

}  // namespace stillmap
