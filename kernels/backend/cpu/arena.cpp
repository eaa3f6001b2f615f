#include "kernels/backend/cpu/arena.hpp"

#include <fcntl.h>
#include <sys/mman.h>
#include <unistd.h>

#include <cassert>
#include <cstdio>
#include <cstdlib>

namespace stillmap {

Arena::Arena(uint64_t bytes) : size_(bytes) {
  map_memory(MAP_PRIVATE | MAP_ANONYMOUS | MAP_NORESERVE, -1);
}

Arena::Arena(uint64_t bytes, const char* dir) : size_(bytes) {
  // Not O_TMPFILE: not every file system has it.
  char name[1024];
  const int letters = std::snprintf(name, sizeof name, "%s/map-XXXXXX", dir);
  const bool fits = letters > 0 && static_cast<size_t>(letters) < sizeof name;
  const int file = fits ? mkostemp(name, O_CLOEXEC) : -1;
  if (file >= 0) unlink(name);
  failed_ = file < 0 || ftruncate(file, static_cast<off_t>(bytes)) != 0;
  if (!failed_) map_memory(MAP_SHARED, file);
  if (file >= 0) close(file);
}

Arena::Arena(void* memory, uint64_t bytes)
    : base_(static_cast<std::byte*>(memory)), owner_(false), size_(bytes) {}

void Arena::map_memory(int flags, int file) {
  void* memory = mmap(nullptr, size_, PROT_READ | PROT_WRITE, flags, file, 0);
  failed_ = memory == MAP_FAILED;
  if (!failed_) base_ = static_cast<std::byte*>(memory);
}

Arena::~Arena() {
  if (base_ && owner_) munmap(base_, size_);
}

namespace {

constexpr uint64_t kPage = 4096;

/// Of whole pages.
void touch(std::byte* begin, const std::byte* end) {
  if (begin >= end) return;
#ifdef MADV_POPULATE_WRITE
  if (madvise(begin, static_cast<size_t>(end - begin), MADV_POPULATE_WRITE) == 0) return;
#endif
  for (volatile std::byte* page = begin; page < end; page += kPage) *page = *page;  // an older kernel
}

}  // namespace

void Arena::touch_all_but(const void* begin, const void* end) {
  const auto page_at = [&](const void* at) {
    const auto offset = static_cast<uint64_t>(static_cast<const std::byte*>(at) - base_);
    return base_ + (offset + kPage - 1) / kPage * kPage;
  };
  touch(base_, page_at(begin));
  touch(page_at(end), base_ + used_);
}

void* Arena::take_bytes(const char* name, uint64_t bytes) {
  const uint64_t align = bytes >= 4096 ? 4096 : 64;
  const uint64_t begin = (used_ + align - 1) / align * align;
  note(name, begin + bytes - used_);
  used_ = begin + bytes;
  if (measuring()) return nullptr;
  assert(used_ <= size_);
  return base_ + begin;
}

void Arena::note(const char* name, uint64_t bytes) {
  items_.total_bytes += bytes;
  for (uint32_t i = 0; i < items_.count; ++i)
    if (std::strcmp(items_.item[i].name, name) == 0) {
      items_.item[i].bytes += bytes;
      return;
    }
  assert(items_.count < kMaxMemoryItems);
  items_.item[items_.count++] = {name, bytes};
}

}  // namespace stillmap
