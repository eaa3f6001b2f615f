#include "firmware-like/doctor/checks.hpp"

#include <filesystem>

#include <gtest/gtest.h>

#include "tests/support/temp_dir.hpp"

namespace stillmap {
namespace {

constexpr uint64_t kMegabyte = 1'000'000;

/// A machine with an Xtion at which nothing is wrong; tests then spoil one thing of it.
class Doctor : public testing::Test {
 protected:
  Doctor() {
    machine.root = dir_.path();
    machine.may_use = [this](const std::string& path) { return path != forbidden; };
    machine.realtime_limit = [this] { return priority_limit; };
    machine.locked_limit_bytes = [this] { return locked_limit; };
    machine.clock_synchronised = [this] { return clock_synchronised; };
    machine.free_bytes = [this](const std::string&) { return free_bytes; };
    machine.gpio_problem = [this](const std::string&, int32_t line) {
      return line == taken_line ? "line is in use" : "";
    };
    intent.source = "xtion";
    intent.planned_bytes = 400 * kMegabyte;

    write(kUsb + "/idVendor", "1d27\n");
    write(kUsb + "/idProduct", "0601\n");
    write(kUsb + "/busnum", "3\n");
    write(kUsb + "/devnum", "14\n");
    write(kUsb + "/speed", "480\n");
    write(kUsb + "/power/control", "on\n");
    write("/sys/bus/usb/devices/usb3/idVendor", "1d6b\n");
    write(kRule, R"(SUBSYSTEM=="usb", ATTR{idVendor}=="1d27", MODE="0660", GROUP="video")");
    write("/proc/meminfo", "MemTotal:  4000000 kB\nMemFree:  1 kB\nMemAvailable:  3000000 kB\n");
    for (const char* cpu : {"cpu0", "cpu1", "cpu2", "cpu3"})
      write(std::string("/sys/devices/system/cpu/") + cpu + "/cpufreq/scaling_governor", "performance\n");
    write("/sys/devices/system/cpu/cpufreq/nothing", "");
    write("/proc/driver/nvidia/version", "NVRM version: 570\n");
    write("/proc/net/route", kRouteHeading + kDefaultByEth0);
    write("/sys/class/net/eth0/flags", "0x1003\n");
    write("/sys/class/net/lo/flags", "0x9\n");
    write("/proc/sys/net/core/rmem_max", "8388608\n");
  }

  void write(const std::string& path, const std::string& text) {
    const std::filesystem::path file = dir_.path() + path;
    std::filesystem::create_directories(file.parent_path());
    test::write_text(file.string(), text);
  }
  void remove(const std::string& path) { std::filesystem::remove_all(dir_.path() + path); }

  Findings all() const {
    Findings found = check_cameras(machine, intent);
    for (const Finding& finding : check_system(machine, intent)) found.push_back(finding);
    return found;
  }
  /// Exactly one thing is not as it should be: `part`, and its text and mend hold these words.
  void expect_only(Verdict verdict, const std::string& part, const std::string& text,
                   const std::string& mend) {
    int bad = 0;
    for (const Finding& finding : all()) {
      if (finding.verdict == Verdict::ok) continue;
      ++bad;
      EXPECT_EQ(finding.verdict, verdict) << finding.part;
      EXPECT_EQ(finding.part, part);
      EXPECT_NE(finding.text.find(text), std::string::npos) << finding.text;
      EXPECT_NE(finding.mend.find(mend), std::string::npos) << finding.mend;
    }
    EXPECT_EQ(bad, 1) << to_text(all());
    EXPECT_EQ(would_run(all()), verdict != Verdict::wrong);
  }

  const std::string kUsb = "/sys/bus/usb/devices/3-1.2";
  const std::string kRule = "/usr/lib/udev/rules.d/60-stillmap.rules";
  const std::string kRouteHeading =
      "Iface Destination Gateway Flags RefCnt Use Metric Mask MTU Window IRTT\n";
  const std::string kDefaultByEth0 = "eth0 00000000 0101A8C0 0003 0 0 100 00000000 0 0 0\n";
  const std::string kMulticastByLo = "lo 000000E0 00000000 0001 0 0 0 000000F0 0 0 0\n";

  Machine machine;
  RunIntent intent;
  std::string forbidden;
  int32_t taken_line = -1;
  uint64_t priority_limit = 95, locked_limit = Machine::kUnlimited;
  bool clock_synchronised = true;
  std::optional<uint64_t> free_bytes = 100'000 * kMegabyte;

 private:
  test::TempDir dir_;
};

TEST_F(Doctor, FindsNothingWhereNothingIsWrong) {
  intent.out = "/var/lib/stillmap/run";
  intent.config.archive.dir = "/var/lib/stillmap/archive";
  intent.config.runtime.lock_memory = true;
  const Findings found = all();
  EXPECT_TRUE(would_run(found));
  for (const Finding& finding : found)
    EXPECT_EQ(finding.verdict, Verdict::ok) << finding.part << finding.text;
  EXPECT_GE(found.size(), 13u);
  EXPECT_EQ(to_text(found).find("mend:"), std::string::npos);
}

TEST_F(Doctor, TheSonarsLines) {
  intent.config.sonar.kind = SonarKind::hc_sr04;
  intent.config.sonar.trigger_line = 5;
  intent.config.sonar.echo_line = 6;
  expect_only(Verdict::worse, "sonar", "/dev/gpiochip0 is not there", "gpiodetect");
  write("/dev/gpiochip0", "");
  EXPECT_NE(to_text(all()).find("its lines are free"), std::string::npos);
  taken_line = 6;
  expect_only(Verdict::worse, "sonar", "line is in use", "gpioinfo");
  forbidden = machine.root + "/dev/gpiochip0";
  expect_only(Verdict::worse, "sonar", "cannot be opened by this user", "usermod -aG gpio");
  machine.gpio_problem = nullptr;
  expect_only(Verdict::wrong, "sonar", "no libgpiod", "libgpiod-dev");
}

TEST_F(Doctor, CameraThatIsNotThere) {
  remove(kUsb);
  expect_only(Verdict::wrong, "camera", "no Xtion", "lsusb");
}

TEST_F(Doctor, CameraThatIsNotAskedForIsNotLookedFor) {
  remove(kUsb);
  intent.source = "tum:somewhere";
  EXPECT_TRUE(would_run(all()));
}

TEST_F(Doctor, CameraThatIsNotPermitted) {
  forbidden = machine.root + "/dev/bus/usb/003/014";
  expect_only(Verdict::wrong, "camera", "/dev/bus/usb/003/014", "usermod -aG video");
}

TEST_F(Doctor, CameraThatIsNotPermittedForWantOfARule) {
  forbidden = machine.root + "/dev/bus/usb/003/014";
  remove(kRule);
  const Findings found = check_cameras(machine, intent);
  EXPECT_FALSE(would_run(found));
  EXPECT_NE(found[0].mend.find("60-stillmap.rules"), std::string::npos);
}

TEST_F(Doctor, NoUdevRule) {
  remove(kRule);
  expect_only(Verdict::worse, "udev", "no rule", "udevadm control --reload");
}

TEST_F(Doctor, CameraOnASlowPort) {
  write(kUsb + "/speed", "12\n");
  expect_only(Verdict::wrong, "usb speed", "12 Mbit/s", "another port");
}

TEST_F(Doctor, CameraThatMaySleep) {
  write(kUsb + "/power/control", "auto\n");
  expect_only(Verdict::worse, "usb power", "sleep", "60-stillmap.rules");
}

TEST_F(Doctor, OtherPrimeSenseDevice) {
  write(kUsb + "/idProduct", "0609\n");
  expect_only(Verdict::worse, "camera", "1d27:0609", "xtion");
}

/// What OpenNI2 finds, or why it cannot look.
using OpenNi2Cameras = Result<std::vector<OpenNi2Camera>>;

TEST_F(Doctor, CamerasThatOpenNi2Sees) {
  const std::vector<OpenNi2Camera> cameras = {{"PrimeSense PS1080", "1d27/0601@3/14", 0x1d27, 0x0601}};
  for (const char* source : {"xtion", "xtion:1234", ""}) {
    intent.source = source;
    const Findings found = check_openni2(machine, intent, cameras);
    ASSERT_EQ(found.size(), 1u);
    EXPECT_EQ(found[0].verdict, Verdict::ok);
    EXPECT_EQ(found[0].text, "sees PrimeSense PS1080 (1d27:0601) at 1d27/0601@3/14");
  }
}

TEST_F(Doctor, CameraThatOpenNi2DoesNotSee) {
  Findings found = check_openni2(machine, intent, std::vector<OpenNi2Camera>());
  ASSERT_EQ(found.size(), 1u);
  EXPECT_EQ(found[0].verdict, Verdict::wrong);
  EXPECT_NE(found[0].mend.find("another program"), std::string::npos) << found[0].mend;
  write("/sys/bus/usb/devices/usb3/product", "xHCI Host Controller\n");
  found = check_openni2(machine, intent, std::vector<OpenNi2Camera>());
  ASSERT_EQ(found.size(), 1u);
  EXPECT_EQ(found[0].verdict, Verdict::wrong);
  EXPECT_NE(found[0].mend.find("USB 2 hub"), std::string::npos) << found[0].mend;
  intent.source = "";
  EXPECT_TRUE(check_openni2(machine, intent, std::vector<OpenNi2Camera>()).empty());
}

TEST_F(Doctor, OpenNi2ThatIsNotThere) {
  const OpenNi2Cameras lacking = Error{"this build has no OpenNI2", ErrorKind::bad_usage};
  const OpenNi2Cameras broken = Error{"OpenNI2 does not start", ErrorKind::cannot_open};
  EXPECT_NE(check_openni2(machine, intent, lacking)[0].mend.find("libopenni2-dev"), std::string::npos);
  EXPECT_NE(check_openni2(machine, intent, broken)[0].mend.find("libopenni2-0"), std::string::npos);
  EXPECT_FALSE(would_run(check_openni2(machine, intent, broken)));
  intent.source = "v4l2:/dev/video0";
  EXPECT_TRUE(check_openni2(machine, intent, broken).empty());
}

TEST_F(Doctor, VideoNodes) {
  intent.source = "v4l2:/dev/video0,/dev/video1";
  write("/dev/video0", "");
  write("/dev/video1", "");
  EXPECT_TRUE(would_run(all()));
  forbidden = machine.root + "/dev/video1";
  expect_only(Verdict::wrong, "camera", "/dev/video1 cannot be opened", "usermod -aG video");
  remove("/dev/video1");
  expect_only(Verdict::wrong, "camera", "/dev/video1 is not there", "v4l2-ctl");
}

TEST_F(Doctor, DepthOfAnXtionWithTheColourOfAVideoNode) {
  intent.source = "v4l2:xtion,/dev/video0";
  write("/dev/video0", "");
  EXPECT_TRUE(would_run(all())) << to_text(all());
  remove(kUsb);
  expect_only(Verdict::wrong, "camera", "no Xtion", "lsusb");
}

TEST_F(Doctor, VideoNodesToChooseFrom) {
  machine.video_node = [this](const std::string& path) {
    return path == machine.root + "/dev/video0" ? "a camera; depth Z16" : "";
  };
  for (const char* node :
       {"/dev/video0", "/dev/video2", "/dev/video10", "/dev/videoX", "/dev/video", "/dev/null"})
    write(node, "");
  forbidden = machine.root + "/dev/video10";
  intent.source = "v4l2:/dev/video0";
  const auto texts = [&] {
    std::string text;
    for (const Finding& finding : check_cameras(machine, intent)) {
      EXPECT_EQ(finding.verdict, Verdict::ok);
      text += finding.part + "=" + finding.text.substr(0, finding.text.find("; sudo")) + "|";
    }
    return text;
  };
  const std::string others = "video node=/dev/video10: not for this user|video node=/dev/video2|";
  EXPECT_EQ(texts(), "camera=/dev/video0: a camera; depth Z16|" + others);
  intent.source.clear();
  EXPECT_EQ(texts(), "video node=/dev/video0: a camera; depth Z16|" + others);
  intent.source = "tum:somewhere";
  EXPECT_EQ(texts(), "");
}

TEST_F(Doctor, MemoryOfThePlan) {
  intent.planned_bytes = 2600 * kMegabyte;
  expect_only(Verdict::worse, "memory", "60 %", "map.pool_blocks");
  intent.planned_bytes = 3200 * kMegabyte;
  expect_only(Verdict::wrong, "memory", "3200 MB", "map.pool_blocks");
}

TEST_F(Doctor, RealTimeLimits) {
  priority_limit = 0;
  expect_only(Verdict::worse, "priority", "60 is asked for, 0 is allowed", "limits.d");
  intent.config.runtime.capture_priority = intent.config.runtime.realtime_priority =
      intent.config.runtime.publish_priority = 0;
  locked_limit = 8 * kMegabyte;
  EXPECT_TRUE(would_run(all()));
  intent.config.runtime.lock_memory = true;
  expect_only(Verdict::worse, "locked memory", "8.0 MB are allowed", "memlock unlimited");
}

TEST_F(Doctor, Processors) {
  write("/sys/devices/system/cpu/cpu2/cpufreq/scaling_governor", "powersave\n");
  expect_only(Verdict::worse, "governor", "cpu2 is governed by powersave", "scaling_governor");
  write("/etc/nv_tegra_release", "# R36\n");
  expect_only(Verdict::worse, "governor", "powersave", "jetson_clocks");
  write("/sys/devices/system/cpu/cpu2/cpufreq/scaling_governor", "performance\n");
  write("/sys/devices/system/cpu/cpu3/online", "0\n");
  intent.config.runtime.threads = 4;
  expect_only(Verdict::worse, "processors", "3 are online", "nvpmodel");
}

TEST_F(Doctor, GraphicsDriver) {
  remove("/proc/driver");
  expect_only(Verdict::worse, "cuda", "the CPU engine is used", "nvidia-driver");
  write("/etc/nv_tegra_release", "# R36\n");
  EXPECT_EQ(check_cuda(machine)[0].verdict, Verdict::ok);
  forbidden = machine.root + "/dev/nvmap";
  expect_only(Verdict::worse, "cuda", "/dev/nvmap", "usermod -aG video");
}

TEST_F(Doctor, WayOfMulticast) {
  write("/proc/net/route", kRouteHeading);
  expect_only(Verdict::worse, "lcm route", "no route", "ip route add 224.0.0.0/4 dev lo");
  write("/proc/net/route", kRouteHeading + "eth0 0000A8C0 00000000 0001 0 0 100 0000FFFF 0 0 0\n");
  expect_only(Verdict::worse, "lcm route", "no route", "ip route");
  write("/proc/net/route", kRouteHeading + kDefaultByEth0 + kMulticastByLo);  // the narrower one counts
  expect_only(Verdict::worse, "lcm route", "lo leads to", "ip link set lo multicast on");
  remove("/proc/net/route");
  expect_only(Verdict::worse, "lcm route", "no route", "ip route");
}

TEST_F(Doctor, SocketBuffers) {
  write("/proc/sys/net/core/rmem_max", "212992\n");
  expect_only(Verdict::worse, "lcm buffers", "212992", "net.core.rmem_max=8388608");
}

TEST_F(Doctor, Clock) {
  clock_synchronised = false;
  expect_only(Verdict::worse, "clock", "not synchronised", "timedatectl set-ntp true");
}

TEST_F(Doctor, Disks) {
  intent.out = "/var/lib/stillmap/run";
  free_bytes = 999 * kMegabyte;
  expect_only(Verdict::worse, "out", "999 MB free", "df /");
  free_bytes = 1001 * kMegabyte;
  intent.config.archive.dir = "/var/lib/stillmap/archive";
  expect_only(Verdict::worse, "archive.dir", "4000 MB may be wanted", "df /");
  free_bytes = 100'000 * kMegabyte;
  write("/var", "");
  intent.config.archive.dir.clear();
  expect_only(Verdict::wrong, "out", "/var is no folder", "remove it");
  remove("/var");
  std::filesystem::create_directories(machine.root + "/var/lib");
  forbidden = machine.root + "/var/lib";
  expect_only(Verdict::wrong, "out", "/var/lib cannot be written", "sudo mkdir -p /var/lib/stillmap/run");
}

TEST_F(Doctor, OneLineForEachAndOneForWhatMendsIt) {
  clock_synchronised = false;
  const std::string text = to_text(check_clock(machine));
  EXPECT_EQ(text.find("worse  clock"), 0u) << text;
  EXPECT_NE(text.find("\n                      mend: sudo timedatectl"), std::string::npos) << text;
}

/// Files of the system may hold anything.
TEST_F(Doctor, StrangeFilesDoNoHarm) {
  const std::string rubbish("\xff\0 1d27 99999999999999999999 \n\n", 32);
  for (const char* file :
       {"/proc/meminfo", "/proc/net/route", "/sys/class/net/eth0/flags", "/proc/sys/net/core/rmem_max"})
    write(file, rubbish);
  EXPECT_TRUE(would_run(check_lcm(machine)));
  write("/proc/net/route", kRouteHeading + kDefaultByEth0);
  write("/sys/class/net/eth0/flags", "");
  EXPECT_EQ(check_lcm(machine)[0].verdict, Verdict::worse);
  for (const char* file : {"/busnum", "/devnum", "/speed", "/power/control"}) write(kUsb + file, rubbish);
  EXPECT_FALSE(would_run(all()));
}

}  // namespace
}  // namespace stillmap
