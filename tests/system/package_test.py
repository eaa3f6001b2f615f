#!/usr/bin/env python3
"""The service and the package: what systemd says of the unit, what is in the .deb, and that it can be installed, run and removed.

    package_test.py PROGRAM SOURCE_ROOT BUILD_FOLDER VERSION

The package is installed by the real dpkg into a throw-away copy of this machine's root (an overlay in its own mount namespace),
as root or where users may make namespaces; elsewhere that part is skipped.
"""

import os
import pathlib
import re
import shutil
import subprocess
import sys
import tempfile
import unittest

PROGRAM, ROOT, BUILD = (pathlib.Path(argument).resolve() for argument in sys.argv[1:4])
VERSION = sys.argv[4]
UNIT = ROOT / "toolchain/systemd/stillmap.service"
SETTINGS = ["/etc/default/stillmap", "/etc/stillmap/stillmap.toml"]
WORST_EXPOSURE = 25  # tenths; a service without any hardening has 96

OVERLAY = """
set -e
mount -t tmpfs none {work}
mkdir {work}/upper {work}/work {work}/root
mount -t overlay none -o lowerdir=/,upperdir={work}/upper,workdir={work}/work {work}/root
mount -t tmpfs none {work}/root/run
mount -t tmpfs none {work}/root/tmp
cp {package} {work}/root/tmp/stillmap.deb
cat >{work}/root/tmp/inside.sh
exec chroot {work}/root bash -e /tmp/inside.sh
"""
INSIDE = """
export DEBIAN_FRONTEND=noninteractive PATH=/usr/sbin:/usr/bin:/sbin:/bin
dpkg -i /tmp/stillmap.deb
/usr/bin/stillmap --version
/usr/bin/stillmap check-config /etc/stillmap/stillmap.toml
id stillmap
test -L /etc/systemd/system/multi-user.target.wants/stillmap.service
echo 'STILLMAP_SOURCE=v4l2:/dev/video0' >/etc/default/stillmap
dpkg -i --force-confold /tmp/stillmap.deb
grep v4l2 /etc/default/stillmap
test -L /etc/systemd/system/multi-user.target.wants/stillmap.service
dpkg -r stillmap
test ! -e /usr/bin/stillmap
test -e /etc/default/stillmap
dpkg -P stillmap
test ! -e /etc/default/stillmap
test ! -e /etc/systemd/system/multi-user.target.wants/stillmap.service
echo EVERYTHING DONE
"""


def call(*command, **options):
    return subprocess.run([*map(str, command)], capture_output=True, text=True, timeout=300, **options)


class Unit(unittest.TestCase):
    @unittest.skipUnless(shutil.which("systemd-analyze"), "no systemd-analyze here")
    def test_systemd_accepts_it(self):
        with tempfile.TemporaryDirectory() as folder:
            unit = pathlib.Path(folder) / UNIT.name
            # Not installed here: the program of the build instead of the one of that name in the path.
            unit.write_text(UNIT.read_text().replace("ExecStart=stillmap ", f"ExecStart={PROGRAM} "))
            done = call("systemd-analyze", "verify", unit)
            self.assertEqual((done.returncode, done.stderr), (0, ""))
            done = call("systemd-analyze", "security", "--offline=true", f"--threshold={WORST_EXPOSURE}", unit)
            if "unrecognized option" in done.stderr:
                self.skipTest("this systemd-analyze does not judge units that are not installed")
            self.assertEqual(done.returncode, 0, done.stdout[-500:] + done.stderr)

    def test_its_flags_and_settings_are_the_programs(self):
        """What the unit starts, with a scene in place of the camera."""
        command = re.search(r"(?m)^ExecStart=stillmap (.*)$", UNIT.read_text())[1]
        with tempfile.TemporaryDirectory() as folder:
            values = {"${STILLMAP_SOURCE}": "synthetic:static,size=160x120", "${STILLMAP_OUT}": f"{folder}/run",
                      "$STILLMAP_OPTIONS": "--lcm off --max-frames 3 --set metrics.port=0",
                      "/etc/stillmap": f"{ROOT}/toolchain/systemd/etc/stillmap"}
            for name, value in values.items():
                self.assertIn(name, command)
                command = command.replace(name, value)
            done = call(PROGRAM, *command.split())
            self.assertEqual(done.returncode, 0, done.stdout + done.stderr)
            self.assertTrue((pathlib.Path(folder) / "run/map.smap").exists())

    def test_settings_name_only_what_the_unit_reads(self):
        names = set(re.findall(r"(?m)^(\w+)=", (ROOT / "toolchain/systemd/etc/default/stillmap").read_text()))
        self.assertEqual(names, set(re.findall(r"\$\{?(STILLMAP_\w+)", UNIT.read_text())))


@unittest.skipUnless(shutil.which("cpack") and shutil.which("dpkg-shlibdeps"), "no cpack or dpkg-shlibdeps here")
class Package(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        cls.folder = pathlib.Path(tempfile.mkdtemp(prefix="stillmap-package-"))
        done = call("cpack", "-G", "DEB", "--config", BUILD / "CPackConfig.cmake", "-B", cls.folder)
        found = list(cls.folder.glob("*.deb"))
        assert done.returncode == 0 and len(found) == 1, done.stdout + done.stderr
        cls.package = found[0]

    @classmethod
    def tearDownClass(cls):
        shutil.rmtree(cls.folder, ignore_errors=True)

    def field(self, name):
        return call("dpkg-deb", "-f", self.package, name).stdout.strip()

    def test_what_it_says_of_itself(self):
        self.assertEqual((self.field("Package"), self.field("Version")), ("stillmap", VERSION))
        self.assertEqual(self.field("Architecture"), call("dpkg", "--print-architecture").stdout.strip())
        depends = self.field("Depends")
        for library in ["libc6", "libstdc++6", "libcairo2", "libzstd1", "libsystemd0", "systemd", "init-system-helpers"]:
            self.assertRegex(depends, rf"(^|, ){re.escape(library)}\b")

    def test_what_is_in_it(self):
        listed = call("dpkg-deb", "-c", self.package).stdout.splitlines()
        files = {line.split()[5].lstrip("."): line for line in listed if not line.startswith("d")}
        expected = ["/usr/bin/stillmap", "/usr/lib/systemd/system/stillmap.service", "/usr/lib/udev/rules.d/60-stillmap.rules",
                    "/usr/lib/sysusers.d/stillmap.conf", "/usr/share/stillmap/presets/default.toml", "/usr/share/stillmap/calibrations/xtion.toml",
                    "/usr/share/stillmap/lcm/pose_t.lcm", "/usr/share/doc/stillmap/DEPLOY.md",
                    "/usr/share/doc/stillmap/copyright", *SETTINGS]
        for path in expected:
            self.assertIn(path, files)
        for path, line in files.items():
            self.assertIn("root/root", line)
            self.assertTrue(path.startswith(("/usr/", "/etc/")), path)
        self.assertTrue(files["/usr/bin/stillmap"].startswith("-rwxr-xr-x"))
        control = call("dpkg-deb", "-I", self.package, "conffiles").stdout.split()
        self.assertEqual(control, SETTINGS)

    def test_installs_runs_and_goes(self):
        work = self.folder / "work"
        work.mkdir()
        with_map = [] if os.geteuid() == 0 else ["--map-root-user"]
        if call("unshare", *with_map, "--mount", "bash", "-c",
                f"mount -t tmpfs n {work} && mkdir {work}/u {work}/w {work}/m && "
                f"mount -t overlay n -o lowerdir=/,upperdir={work}/u,workdir={work}/w {work}/m && "
                f"test -w {work}/m/var/lib/dpkg").returncode != 0:
            self.skipTest("no overlay of the root can be mounted here")
        done = call("unshare", *with_map, "--mount", "bash", "-c", OVERLAY.format(work=work, package=self.package),
                    input=INSIDE)
        self.assertEqual(done.returncode, 0, done.stdout + done.stderr)
        self.assertIn(f"stillmap {VERSION}\n", done.stdout)
        self.assertIn("EVERYTHING DONE", done.stdout)
        groups = re.search(r"uid=.*", done.stdout)[0]
        for group in ["video", "dialout", "gpio"]:
            self.assertIn(f"({group})", groups)
        self.assertFalse(os.path.exists("/etc/stillmap"), "this machine itself was changed")


if __name__ == "__main__":
    unittest.main(argv=sys.argv[:1], verbosity=2)
