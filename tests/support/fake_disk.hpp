#pragma once

#include <algorithm>
#include <cerrno>
#include <map>
#include <string>
#include <vector>

#include "runtime/record/log_disk.hpp"
#include "tests/support/temp_dir.hpp"

namespace stillmap::test {

/// A disk in memory, and its clock: it can be full, fail, and forgets at a power cut what was not synced.
class FakeDisk final : public LogDisk {
 public:
  uint64_t room = UINT64_MAX;  ///< bytes of all files together
  int fail_sync = 0, fail_remove = 0, fail_rename = 0;
  int64_t time_ns = 0;
  uint64_t syncs = 0, most_bytes = 0;

  /// Files by their whole path, as a program sees them.
  std::map<std::string, std::string> files() const { return contents(names_, false); }
  /// What is left of them after a power cut, in the worst case.
  std::map<std::string, std::string> after_power_cut() const { return contents(durable_names_, true); }
  uint64_t bytes() const { return bytes_; }

  int list(const std::string& folder, std::vector<Entry>& entries) override {
    for (const auto& [path, file] : names_)
      if (path.starts_with(folder + "/"))
        entries.push_back({path.substr(folder.size() + 1), files_[file].content.size()});
    return 0;
  }
  int create(const char* path) override {
    if (bytes() >= room) return -ENOSPC;
    files_.push_back({});
    names_[path] = files_.size() - 1;
    return static_cast<int>(files_.size() - 1);
  }
  int append(int file, View<iovec> pieces) override {
    for (const iovec& piece : pieces) {
      const uint64_t left = bytes_ < room ? room - bytes_ : 0;
      const size_t taken = std::min<uint64_t>(piece.iov_len, left);
      bytes_ += taken;
      at(file).content.append(static_cast<const char*>(piece.iov_base), taken);
      most_bytes = std::max(most_bytes, bytes_);
      if (taken < piece.iov_len) return ENOSPC;
    }
    return 0;
  }
  int cut(int file, uint64_t bytes) override {
    bytes_ -= at(file).content.size() - bytes;
    at(file).content.resize(bytes);
    at(file).synced = std::min<size_t>(at(file).synced, bytes);
    return 0;
  }
  int sync(int file) override {
    if (fail_sync != 0) return fail_sync;
    ++syncs;
    at(file).synced = at(file).content.size();
    return 0;
  }
  int close(int) override { return 0; }
  int rename(const char* from, const char* to) override {
    if (fail_rename != 0) return fail_rename;
    const auto it = names_.find(from);
    if (it == names_.end()) return ENOENT;
    names_[to] = it->second;
    names_.erase(from);
    return 0;
  }
  int remove(const char* path) override {
    if (fail_remove != 0) return fail_remove;
    const auto it = names_.find(path);
    if (it == names_.end()) return ENOENT;
    bytes_ -= files_[it->second].content.size();
    std::string().swap(files_[it->second].content);  // a day's files do not fit into memory
    files_[it->second].synced = 0;
    names_.erase(it);
    return 0;
  }
  int sync_folder(const char*) override {
    durable_names_ = names_;
    return 0;
  }
  int64_t now_ns() override { return time_ns; }

 private:
  struct File {
    std::string content;
    size_t synced = 0;
  };
  using Names = std::map<std::string, size_t>;

  File& at(int file) { return files_.at(static_cast<size_t>(file)); }
  std::map<std::string, std::string> contents(const Names& names, bool synced) const {
    std::map<std::string, std::string> all;
    for (const auto& [name, file] : names)
      all[name] = files_[file].content.substr(0, synced ? files_[file].synced : std::string::npos);
    return all;
  }

  std::vector<File> files_;
  uint64_t bytes_ = 0;
  Names names_, durable_names_;
};

/// Puts files of a FakeDisk into a real folder. @return their paths in order
inline std::vector<std::string> put_into(const TempDir& dir,
                                         const std::map<std::string, std::string>& files) {
  std::vector<std::string> paths;
  for (const auto& [path, content] : files) paths.push_back(dir.write(path, content));
  return paths;
}

}  // namespace stillmap::test
