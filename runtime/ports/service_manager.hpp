#pragma once

#include <string>

namespace stillmap {

/// Who started the program and watches it: systemd, or nobody.  @thread supervisor
class ServiceManager {
 public:
  virtual ~ServiceManager() = default;

  /// Frames can come.
  virtual void ready() = 0;
  virtual void stopping() = 0;
  /// The program is alive; to be called more often than it asks for.
  virtual void alive() = 0;
  /// One line for a person.
  virtual void say(const std::string& status) = 0;
};

}  // namespace stillmap
