#include "drivers/openni2/library.hpp"

#include <OpenNI.h>
#include <unistd.h>

#include <cstdio>
#include <mutex>

#include "drivers/openni2/openni2_source.hpp"

namespace stillmap {
namespace openni2 {
namespace {

void keep_log_quiet() {
  ::openni::OpenNI::setLogConsoleOutput(false);
  ::openni::OpenNI::setLogFileOutput(false);
}

/// Ends the library with the program. Made after it was started: what its drivers keep in statics then goes
/// later than this, though earlier than what was made before they were loaded.
struct EndWithProgram {
  ~EndWithProgram() { ::openni::OpenNI::shutdown(); }
};

}  // namespace

Result<Done> start_library() {
  static std::mutex mutex;
  static bool started = false;
  const std::lock_guard<std::mutex> lock(mutex);
  if (started) return Done{};
  const StdoutAside aside;
  keep_log_quiet();
  if (::openni::OpenNI::initialize() != ::openni::STATUS_OK)
    return Error{"OpenNI2 does not start: " + library_error() + "; are its drivers installed (libopenni2-0)?",
                 ErrorKind::cannot_open};
  keep_log_quiet();  // /etc/openni2/OpenNI.ini may have asked for it
  static const EndWithProgram end_with_program;
  started = true;
  return Done{};
}

StdoutAside::StdoutAside() : stdout_(::dup(STDOUT_FILENO)) {
  std::fflush(stdout);
  if (stdout_ >= 0) ::dup2(STDERR_FILENO, STDOUT_FILENO);
}
StdoutAside::~StdoutAside() {
  if (stdout_ < 0) return;
  std::fflush(stdout);
  ::dup2(stdout_, STDOUT_FILENO);
  ::close(stdout_);
}

std::string library_error() {
  std::string text = ::openni::OpenNI::getExtendedError();
  while (!text.empty() && (text.back() == '\n' || text.back() == '\t' || text.back() == ' ')) text.pop_back();
  for (char& c : text)
    if (c == '\n' || c == '\t') c = ' ';
  return text.empty() ? "it does not say why" : text;
}

}  // namespace openni2

Result<std::vector<OpenNi2Camera>> openni2_cameras() {
  if (const auto started = openni2::start_library(); !started)
    return Error{started.error(), started.error_kind()};
  openni::Array<openni::DeviceInfo> devices;
  openni::OpenNI::enumerateDevices(&devices);
  std::vector<OpenNi2Camera> cameras;
  for (int i = 0; i < devices.getSize(); ++i) {
    const openni::DeviceInfo& device = devices[i];
    if (device.getUsbVendorId() == 0) continue;  // a recording that was opened stays in the list
    cameras.push_back({std::string(device.getVendor()) + " " + device.getName(), device.getUri(),
                       device.getUsbVendorId(), device.getUsbProductId()});
  }
  return cameras;
}

}  // namespace stillmap
