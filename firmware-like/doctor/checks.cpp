#include "firmware-like/doctor/checks.hpp"

#include <algorithm>
#include <charconv>
#include <filesystem>
#include <optional>
#include <sstream>
#include <string_view>
#include <utility>

#include <fmt/format.h>

namespace stillmap {
namespace {

constexpr const char* kPrimeSense = "1d27";
constexpr const char* kXtions[] = {"0600", "0601"};
constexpr const char* kUsbDevices = "/sys/bus/usb/devices";
constexpr const char* kRuleFolders[] = {"/etc/udev/rules.d", "/run/udev/rules.d",
                                        "/usr/local/lib/udev/rules.d", "/usr/lib/udev/rules.d",
                                        "/lib/udev/rules.d"};
constexpr const char* kReloadRules =
    "sudo cp toolchain/udev/60-stillmap.rules /etc/udev/rules.d/ && sudo udevadm control --reload && "
    "sudo udevadm trigger";
constexpr const char* kJoinVideo = "sudo usermod -aG video $USER   (and log in again)";

Finding ok(std::string part, std::string text) {
  return {Verdict::ok, std::move(part), std::move(text), {}};
}
Finding worse(std::string part, std::string text, std::string mend) {
  return {Verdict::worse, std::move(part), std::move(text), std::move(mend)};
}
Finding wrong(std::string part, std::string text, std::string mend) {
  return {Verdict::wrong, std::move(part), std::move(text), std::move(mend)};
}

/// Zero where the text is no number.
uint64_t number(const std::string& text, int base = 10) {
  uint64_t value = 0;
  std::from_chars(text.data(), text.data() + text.size(), value, base);
  return value;
}

double megabytes(uint64_t bytes) {
  return static_cast<double>(bytes) * 1e-6;
}

// Cameras.

struct UsbDevice {
  std::string folder;   ///< in /sys
  std::string product;  ///< four hexadecimal digits
};

std::vector<UsbDevice> primesense_devices(const Machine& machine) {
  std::vector<UsbDevice> found;
  for (const std::string& folder : machine.list(kUsbDevices))
    if (machine.line(folder + "/idVendor") == kPrimeSense)
      found.push_back({folder, machine.line(folder + "/idProduct")});
  return found;
}

/// /dev/bus/usb/001/004
std::string node_of(const Machine& machine, const UsbDevice& device) {
  return fmt::format("/dev/bus/usb/{:03}/{:03}", number(machine.line(device.folder + "/busnum")),
                     number(machine.line(device.folder + "/devnum")));
}

bool has_udev_rule(const Machine& machine) {
  for (const char* folder : kRuleFolders)
    for (const std::string& file : machine.list(folder))
      if (file.ends_with(".rules") && machine.text(file).find(kPrimeSense) != std::string::npos) return true;
  return false;
}

Finding check_usb_speed(const Machine& machine, const UsbDevice& device) {
  constexpr uint64_t kHighSpeed = 480;  // Mbit/s; depth and colour at 30 Hz fill more than half of it
  const uint64_t speed = number(machine.line(device.folder + "/speed"));
  if (speed < kHighSpeed)
    return wrong("usb speed", fmt::format("the camera runs at {} Mbit/s, it needs 480", speed),
                 "plug it into another port, without a hub or a long cable; lsusb -t shows the speed");
  if (machine.line(device.folder + "/power/control") == "auto")
    return worse("usb power", "the camera may be put to sleep between frames", kReloadRules);
  return ok("usb speed", fmt::format("{} Mbit/s, never put to sleep", speed));
}

bool is_xtion(const std::string& source) {
  return source == "xtion" || source.starts_with("xtion:");
}

Findings check_xtion(const Machine& machine) {
  const std::vector<UsbDevice> devices = primesense_devices(machine);
  if (devices.empty())
    return {wrong("camera", "no Xtion on USB (1d27:0600 or 1d27:0601)",
                  "plug it in; lsusb -d 1d27: must list it, else try another port or cable")};
  Findings found;
  const bool rule = has_udev_rule(machine);
  for (const UsbDevice& device : devices) {
    const std::string name = fmt::format("{}:{}", kPrimeSense, device.product);
    if (std::find(std::begin(kXtions), std::end(kXtions), device.product) == std::end(kXtions)) {
      found.push_back(
          worse("camera", name + " is no Xtion that Stillmap was made for", "stillmap run --source xtion"));
      continue;
    }
    const std::string node = node_of(machine, device);
    if (machine.may_use(machine.root + node))
      found.push_back(ok("camera", name + " at " + node));
    else
      found.push_back(wrong("camera", name + ": " + node + " cannot be opened by this user",
                            rule ? kJoinVideo : kReloadRules));
    found.push_back(check_usb_speed(machine, device));
  }
  if (rule)
    found.push_back(ok("udev", "there is a rule for the Xtion"));
  else
    found.push_back(worse("udev", "no rule for the Xtion: who may open it is left to chance", kReloadRules));
  return found;
}

std::string video_node_text(const Machine& machine, const std::string& node) {
  const std::string said = machine.video_node ? machine.video_node(machine.root + node) : std::string();
  return said.empty() ? node : fmt::format("{}: {}", node, said);
}

bool is_video_node(const std::string& path) {
  constexpr std::string_view kVideo = "/dev/video";
  return path.size() > kVideo.size() && path.starts_with(kVideo) &&
         path.find_first_not_of("0123456789", kVideo.size()) == std::string::npos;
}

/// Video nodes that nobody asked for: what there is to choose from.
Findings other_video_nodes(const Machine& machine, const std::vector<std::string>& asked) {
  Findings found;
  for (const std::string& node : machine.list("/dev")) {
    if (!is_video_node(node) || std::find(asked.begin(), asked.end(), node) != asked.end()) continue;
    if (machine.may_use(machine.root + node))
      found.push_back(ok("video node", video_node_text(machine, node)));
    else
      found.push_back(ok("video node", node + ": not for this user; " + kJoinVideo));
  }
  return found;
}

/// An Xtion hangs on a controller of USB 3, whatever the port's colour.
bool on_usb3(const Machine& machine) {
  for (const UsbDevice& device : primesense_devices(machine)) {
    const std::string bus = machine.line(device.folder + "/busnum");
    if (machine.line(std::string(kUsbDevices) + "/usb" + bus + "/product").find("xHCI") != std::string::npos)
      return true;
  }
  return false;
}

Findings check_v4l2(const Machine& machine, const std::string& nodes) {
  Findings found;
  std::vector<std::string> asked;
  std::istringstream in(nodes);
  for (std::string node; std::getline(in, node, ',');) {
    asked.push_back(node);
    if (is_xtion(node))  // depth of an Xtion, colour of a video node
      for (Finding& finding : check_xtion(machine)) found.push_back(std::move(finding));
    else if (!machine.exists(node))
      found.push_back(wrong("camera", node + " is not there", "v4l2-ctl --list-devices"));
    else if (!machine.may_use(machine.root + node))
      found.push_back(wrong("camera", node + " cannot be opened by this user", kJoinVideo));
    else
      found.push_back(ok("camera", video_node_text(machine, node)));
  }
  for (Finding& other : other_video_nodes(machine, asked)) found.push_back(std::move(other));
  return found;
}

// Network.

/// One line of /proc/net/route; addresses as they lie in memory on a little-endian machine.
struct Route {
  std::string device;
  uint32_t to = 0, mask = 0;
};

constexpr uint32_t kLcmGroup = 0x434CFFEF;  // 239.255.76.67

/// "0x1003" of /sys
uint64_t net_flags(const Machine& machine, const std::string& device) {
  const std::string text = machine.line("/sys/class/net/" + device + "/flags");
  return text.starts_with("0x") ? number(text.substr(2), 16) : 0;
}

std::optional<Route> route_of_lcm(const Machine& machine) {
  std::istringstream in(machine.text("/proc/net/route"));
  std::string heading;
  std::getline(in, heading);
  std::optional<Route> best;
  const auto bits = [](uint32_t mask) { return __builtin_popcount(mask); };
  for (std::string text; std::getline(in, text);) {
    std::istringstream fields(text);
    std::string device, to, gateway, flags, references, use, metric, mask;
    fields >> device >> to >> gateway >> flags >> references >> use >> metric >> mask;
    const Route route{device, static_cast<uint32_t>(number(to, 16)), static_cast<uint32_t>(number(mask, 16))};
    const bool leads_there = !mask.empty() && (kLcmGroup & route.mask) == route.to;
    if (leads_there && (!best || bits(route.mask) > bits(best->mask))) best = route;
  }
  return best;
}

// Disks and memory.

/// The folder itself, or what of its path is there already.
std::string existing_part(const Machine& machine, const std::string& folder) {
  std::error_code error;
  std::filesystem::path path = std::filesystem::absolute(folder, error);
  while (path.has_relative_path() && !machine.exists(path.string())) path = path.parent_path();
  return path.string();
}

Finding check_folder(const Machine& machine, const char* part, const std::string& folder,
                     uint64_t wanted_bytes) {
  const std::string there = existing_part(machine, folder);
  if (!machine.is_folder(there))
    return wrong(part, there + " is no folder", "remove it, or choose another folder than " + folder);
  if (!machine.may_use(machine.root + there))
    return wrong(part, there + " cannot be written by this user",
                 fmt::format("sudo mkdir -p {0} && sudo chown $USER {0}", folder));
  const std::optional<uint64_t> free = machine.free_bytes(machine.root + there);
  if (!free) return worse(part, "the free space of " + there + " is not known", "df " + there);
  if (*free < wanted_bytes)
    return worse(part,
                 fmt::format("{}: {:.0f} MB free, {:.0f} MB may be wanted", folder, megabytes(*free),
                             megabytes(wanted_bytes)),
                 fmt::format("df {0}; remove what is old (du -sh {0}/*), or choose another folder", there));
  return ok(part, fmt::format("{}: {:.0f} MB free", folder, megabytes(*free)));
}

/// The number in "MemAvailable:   123 kB", bytes.
uint64_t meminfo_bytes(const Machine& machine, const std::string& name) {
  std::istringstream in(machine.text("/proc/meminfo"));
  std::string key;
  uint64_t kilobytes = 0;
  for (std::string text; std::getline(in, text);)
    if (std::istringstream fields(text); fields >> key >> kilobytes && key == name + ":")
      return kilobytes * 1024;
  return 0;
}

bool is_jetson(const Machine& machine) {
  return machine.exists("/etc/nv_tegra_release");
}

}  // namespace

Findings check_cameras(const Machine& machine, const RunIntent& intent) {
  constexpr std::string_view kV4l2 = "v4l2:";
  if (is_xtion(intent.source)) return check_xtion(machine);
  if (intent.source.starts_with(kV4l2)) return check_v4l2(machine, intent.source.substr(kV4l2.size()));
  if (intent.source.empty()) return other_video_nodes(machine, {});
  return {};
}

Findings check_sonar(const Machine& machine, const RunIntent& intent) {
  const SonarConfig& sonar = intent.config.sonar;
  if (sonar.kind == SonarKind::none) return {};
  constexpr const char* kMend = "ls -l /dev/gpiochip*; gpiodetect; gpioinfo";
  // A run goes on without its sonar and says so; where one is configured that is no run as it was meant.
  const auto without = [&](const std::string& why) {
    return Findings{worse("sonar", why + "; a run says range_lost and looks for it", kMend)};
  };
  if (!machine.gpio_problem)
    return {wrong("sonar", "this build has no libgpiod", "install libgpiod-dev and build again")};
  if (!machine.exists(sonar.chip)) return without(sonar.chip + " is not there");
  if (!machine.may_use(machine.root + sonar.chip))
    return {worse("sonar", sonar.chip + " cannot be opened by this user; a run says range_lost",
                  "sudo usermod -aG gpio $USER   (and log in again), with toolchain/udev/60-stillmap.rules "
                  "in /etc/udev/rules.d")};
  for (const int32_t line : {sonar.trigger_line, sonar.echo_line, sonar.stop_line}) {
    if (line < 0) continue;
    if (const std::string problem = machine.gpio_problem(sonar.chip, line); !problem.empty())
      return without(problem);
  }
  return {ok("sonar", sonar.chip + ", its lines are free")};
}

Findings check_openni2(const Machine& machine, const RunIntent& intent,
                       const Result<std::vector<OpenNi2Camera>>& cameras) {
  const bool needed = is_xtion(intent.source);
  if (!cameras) {
    if (!needed) return {};
    return {wrong("openni2", cameras.error(),
                  cameras.error_kind() == ErrorKind::bad_usage
                      ? "sudo apt-get install libopenni2-dev, then build again"
                      : "sudo apt-get install --reinstall libopenni2-0")};
  }
  Findings found;
  for (const OpenNi2Camera& camera : *cameras)
    found.push_back(ok("openni2", fmt::format("sees {} ({:04x}:{:04x}) at {}", camera.name, camera.usb_vendor,
                                              camera.usb_product, camera.uri)));
  if (!found.empty() || !needed) return found;
  if (on_usb3(machine))
    return {wrong(
        "openni2", "sees no camera, though one is plugged into a USB 3 controller",
        "unplug it and plug it in again; Xtions with old firmware may not start on USB 3: put a USB 2 hub "
        "between, or update the firmware")};
  return {
      wrong("openni2", "sees no camera",
            "unplug it and plug it in again; is another program using it? sudo fuser -v /dev/bus/usb/*/*")};
}

Findings check_memory(const Machine& machine, const RunIntent& intent) {
  constexpr double kShare = 0.6;  // the rest is the system's, the camera's, and on a Jetson the GPU's
  const uint64_t available = meminfo_bytes(machine, "MemAvailable"),
                 total = meminfo_bytes(machine, "MemTotal");
  const std::string plan = fmt::format("the plan takes {:.0f} MB, {:.0f} MB are available",
                                       megabytes(intent.planned_bytes), megabytes(available));
  constexpr const char* kMend = "lower map.pool_blocks; stillmap memory-plan shows where the memory goes";
  if (intent.planned_bytes > available) return {wrong("memory", plan, kMend)};
  if (static_cast<double>(intent.planned_bytes) > kShare * static_cast<double>(total))
    return {worse("memory", plan + ", more than 60 % of all there is", kMend)};
  return {ok("memory", plan)};
}

Findings check_real_time(const Machine& machine, const RunIntent& intent) {
  constexpr const char* kMend =
      "printf '@video - rtprio 95\\n@video - memlock unlimited\\n' | sudo tee "
      "/etc/security/limits.d/stillmap.conf"
      "   (and log in again; the systemd unit has both)";
  const RuntimeConfig& runtime = intent.config.runtime;
  const auto asked = static_cast<uint64_t>(
      std::max({runtime.capture_priority, runtime.realtime_priority, runtime.publish_priority, 0}));
  Findings found;
  if (const uint64_t allowed = machine.realtime_limit(); allowed < asked)
    found.push_back(
        worse("priority",
              fmt::format("FIFO priority {} is asked for, {} is allowed: frames come late under load", asked,
                          allowed),
              kMend));
  else
    found.push_back(ok("priority", fmt::format("FIFO priority {} is allowed", asked)));
  if (!runtime.lock_memory) return found;
  if (const uint64_t allowed = machine.locked_limit_bytes(); allowed < intent.planned_bytes)
    found.push_back(worse("locked memory",
                          fmt::format("{:.1f} MB are allowed, runtime.lock_memory wants {:.0f} MB and more",
                                      megabytes(allowed), megabytes(intent.planned_bytes)),
                          kMend));
  else
    found.push_back(ok("locked memory", "as much as is asked for"));
  return found;
}

Findings check_processors(const Machine& machine, const RunIntent& intent) {
  Findings found;
  int32_t count = 0;
  std::string slow;
  for (const std::string& folder : machine.list("/sys/devices/system/cpu")) {
    const std::string name = folder.substr(folder.rfind('/') + 1);
    if (!name.starts_with("cpu") || name.size() < 4 ||
        name.find_first_not_of("0123456789", 3) != std::string::npos)
      continue;
    if (machine.line(folder + "/online") == "0") continue;
    ++count;
    const std::string governor = machine.line(folder + "/cpufreq/scaling_governor");
    if (slow.empty() && !governor.empty() && governor != "performance")
      slow = name + " is governed by " + governor;
  }
  const int32_t threads = intent.config.runtime.threads;
  if (count < threads)
    found.push_back(worse("processors",
                          fmt::format("runtime.threads = {}, but {} are online", threads, count),
                          is_jetson(machine) ? "sudo nvpmodel -m 0" : "lower runtime.threads"));
  else
    found.push_back(ok("processors", fmt::format("{} online", count)));
  if (!slow.empty())
    found.push_back(
        worse("governor", slow + ": the first frames after a pause come late",
              is_jetson(machine)
                  ? "sudo nvpmodel -m 0 && sudo jetson_clocks"
                  : "echo performance | sudo tee /sys/devices/system/cpu/cpu*/cpufreq/scaling_governor"));
  else
    found.push_back(ok("governor", "nothing slows the processors down"));
  return found;
}

Findings check_cuda(const Machine& machine) {
  if (const std::string driver = machine.line("/proc/driver/nvidia/version"); !driver.empty())
    return {ok("cuda", driver)};
  if (is_jetson(machine))
    return {machine.may_use(machine.root + "/dev/nvmap")
                ? ok("cuda", "Jetson: " + machine.line("/etc/nv_tegra_release"))
                : worse("cuda", "/dev/nvmap cannot be opened: the CPU engine is used", kJoinVideo)};
  return {worse("cuda", "no NVIDIA driver: the CPU engine is used",
                "sudo apt-get install nvidia-driver   (where there is such a GPU)")};
}

Findings check_lcm(const Machine& machine) {
  constexpr uint64_t kWantedBytes = 2 << 20;  // a second of a busy subscriber, lcm-logger for one
  constexpr uint64_t kMulticast = 0x1000;     // IFF_MULTICAST
  Findings found;
  const std::optional<Route> route = route_of_lcm(machine);
  constexpr const char* kOwnHost = "sudo ip link set lo multicast on && sudo ip route add 224.0.0.0/4 dev lo";
  if (!route)
    found.push_back(worse("lcm route", "no route to 239.255.76.67: no poses leave over LCM", kOwnHost));
  else if ((net_flags(machine, route->device) & kMulticast) == 0)
    found.push_back(worse("lcm route",
                          route->device + " leads to 239.255.76.67 but has multicast switched off",
                          "sudo ip link set " + route->device + " multicast on"));
  else
    found.push_back(ok("lcm route", "239.255.76.67 by " + route->device));
  const uint64_t buffer = number(machine.line("/proc/sys/net/core/rmem_max"));
  if (buffer < kWantedBytes)
    found.push_back(worse(
        "lcm buffers", fmt::format("net.core.rmem_max is {}: subscribers lose messages in bursts", buffer),
        "echo net.core.rmem_max=8388608 | sudo tee /etc/sysctl.d/60-stillmap.conf && sudo sysctl --system"));
  else
    found.push_back(ok("lcm buffers", fmt::format("net.core.rmem_max is {}", buffer)));
  return found;
}

Findings check_clock(const Machine& machine) {
  if (machine.clock_synchronised()) return {ok("clock", "synchronised")};
  return {worse("clock", "not synchronised: stamps mean nothing on another computer",
                "sudo timedatectl set-ntp true")};
}

Findings check_disks(const Machine& machine, const RunIntent& intent) {
  constexpr uint64_t kOutBytes = 1'000'000'000;
  Findings found;
  if (!intent.out.empty()) found.push_back(check_folder(machine, "out", intent.out, kOutBytes));
  const ArchiveConfig& archive = intent.config.archive;
  if (!archive.dir.empty())
    found.push_back(
        check_folder(machine, "archive.dir", archive.dir, static_cast<uint64_t>(archive.max_bytes)));
  return found;
}

Findings check_system(const Machine& machine, const RunIntent& intent) {
  Findings all;
  const auto add = [&all](Findings some) {
    all.insert(all.end(), std::move_iterator(some.begin()), std::move_iterator(some.end()));
  };
  add(check_memory(machine, intent));
  add(check_sonar(machine, intent));
  add(check_real_time(machine, intent));
  add(check_processors(machine, intent));
  add(check_cuda(machine));
  add(check_lcm(machine));
  add(check_clock(machine));
  add(check_disks(machine, intent));
  return all;
}

std::string to_text(const Findings& findings) {
  constexpr const char* kLabels[] = {"OK", "worse", "WRONG"};
  std::string text;
  for (const Finding& finding : findings) {
    text += fmt::format("{:<6} {:<14} {}\n", kLabels[static_cast<size_t>(finding.verdict)], finding.part,
                        finding.text);
    if (!finding.mend.empty()) text += fmt::format("{:<6} {:<14} mend: {}\n", "", "", finding.mend);
  }
  return text;
}

bool would_run(const Findings& findings) {
  return std::none_of(findings.begin(), findings.end(),
                      [](const Finding& f) { return f.verdict == Verdict::wrong; });
}

}  // namespace stillmap
