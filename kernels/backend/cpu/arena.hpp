#pragma once

#include <cstddef>
#include <cstdint>
#include <cstring>

#include "kernels/base/view.hpp"
#include "kernels/engine.hpp"

namespace stillmap {

/// One piece of memory carved into views at boot. The same carving code runs twice: first without memory, to
/// add up the plan, then with it; so the printed plan is what is taken.
class Arena {
 public:
  /// Only adds up.
  Arena() = default;
  /// Maps `bytes`; pages come from the system when first touched.
  explicit Arena(uint64_t bytes);
  /// The same in a file of its own in `dir`, already without a name: the system may move its pages there.
  Arena(uint64_t bytes, const char* dir);
  /// Carves memory that belongs to somebody else, zeroed or of no meaning yet.
  Arena(void* memory, uint64_t bytes);
  ~Arena();
  Arena(const Arena&) = delete;
  Arena& operator=(const Arena&) = delete;

  bool measuring() const { return base_ == nullptr; }
  bool failed() const { return failed_; }

  /// Asks the system for the pages of all that was carved, but of what lies between: those come when first
  /// touched.
  /// @param begin, end within what was carved
  void touch_all_but(const void* begin, const void* end);

  /// The lines of the plan that carving produces.
  const MemoryItems& items() const { return items_; }

  /// @return `count` elements, zeroed, at a multiple of 64 bytes (4096 from a page up).
  template <class T>
  View<T> take(const char* name, uint64_t count) {
    return {static_cast<T*>(take_bytes(name, count * sizeof(T))), static_cast<uint32_t>(count)};
  }
  template <class T>
  ImageView<T> take_image(const char* name, int32_t rows, int32_t cols) {
    const uint64_t count = static_cast<uint64_t>(rows) * static_cast<uint64_t>(cols);
    return {static_cast<T*>(take_bytes(name, count * sizeof(T))), rows, cols, cols};
  }

 private:
  void map_memory(int flags, int file);
  void* take_bytes(const char* name, uint64_t bytes);
  void note(const char* name, uint64_t bytes);

  std::byte* base_ = nullptr;
  bool owner_ = true;
  uint64_t size_ = 0;
  uint64_t used_ = 0;
  bool failed_ = false;
  MemoryItems items_;
};

}  // namespace stillmap
