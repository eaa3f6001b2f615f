#pragma once

#include <string>
#include <utility>
#include <variant>

namespace stillmap {

/// Who has to act, and so which exit code of the program it is.
enum class ErrorKind {
  failed,       ///< exit 1: went wrong while running
  bad_usage,    ///< exit 2: bad command line, bad configuration, missing part or missing intrinsics
  cannot_open,  ///< exit 3: the source cannot be opened
};

/// One line for the person who called: which file or key, what was expected, what to do.
struct Error {
  std::string message;
  ErrorKind kind = ErrorKind::failed;
};

/// The value of a call that only succeeds or fails: `Result<Done>`.
struct Done {};

/// A value, or why there is none. For boot, files and commands; never in the real-time loop.
template <class T>
class [[nodiscard]] Result {
 public:
  Result(T value) : state_(std::move(value)) {}      // NOLINT(google-explicit-constructor)
  Result(Error error) : state_(std::move(error)) {}  // NOLINT(google-explicit-constructor)

  explicit operator bool() const { return state_.index() == 0; }
  T& value() { return std::get<0>(state_); }
  const T& value() const { return std::get<0>(state_); }
  T& operator*() { return value(); }
  const T& operator*() const { return value(); }
  T* operator->() { return &value(); }
  const T* operator->() const { return &value(); }
  /// Only when there is no value.
  const std::string& error() const { return std::get<1>(state_).message; }
  /// Only when there is no value.
  ErrorKind error_kind() const { return std::get<1>(state_).kind; }

 private:
  std::variant<T, Error> state_;
};

}  // namespace stillmap
