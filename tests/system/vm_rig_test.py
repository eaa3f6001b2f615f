#!/usr/bin/env python3
"""What toolchain/vm/run.sh makes of the answers of a guest, and of machines that cannot have one. A script stands in for QEMU.

    vm_rig_test.py SOURCE_ROOT
"""

import hashlib
import os
import pathlib
import shutil
import subprocess
import sys
import tempfile
import unittest

VM = pathlib.Path(sys.argv[1]).resolve() / "toolchain" / "vm"
TOOLS = ["bash", "cat", "cut", "dirname", "df", "flock", "mkdir", "mktemp", "realpath", "rm", "sed", "sha256sum", "sleep", "tail",
         "tee", "timeout", "tr"]


class Rig(unittest.TestCase):
    def setUp(self):
        self.folder = pathlib.Path(tempfile.mkdtemp(prefix="stillmap-rig-"))
        self.addCleanup(shutil.rmtree, self.folder, ignore_errors=True)
        self.tools = self.folder / "bin"
        self.tools.mkdir()
        for tool in TOOLS:
            (self.tools / tool).symlink_to(shutil.which(tool))
        self.tool("uname", "echo x86_64")
        self.cache = self.folder / "cache"
        self.script = self.folder / "script.sh"
        self.script.touch()

    def fill_cache(self):
        self.cache.mkdir()
        for name in ["vmlinuz", "initrd.gz"]:
            (self.cache / name).write_text("something")
        made_from = (VM / "build.sh").read_bytes() + (VM / "init.sh").read_bytes()
        (self.cache / "stamp").write_text(hashlib.sha256(made_from).hexdigest() + "\n")

    def tool(self, name, body):
        program = self.tools / name
        program.write_text(f"#!{self.tools}/bash\n{body}\n")
        program.chmod(0o755)

    def qemu(self, body):
        self.tool("qemu-system-x86_64", body)

    def run_script(self, *arguments, seconds="100"):
        environment = {"PATH": str(self.tools), "STILLMAP_VM_CACHE": str(self.cache), "STILLMAP_VM_TIMEOUT_S": seconds,
                       "HOME": str(self.folder)}
        return subprocess.run([str(self.tools / "bash"), str(VM / "run.sh"), str(self.script), *arguments],
                              capture_output=True, text=True, env=environment, timeout=200)

    def test_the_guests_answer_is_passed_on(self):
        self.fill_cache()
        for code in [0, 7, 77]:
            self.qemu(f'printf "VM-UP\\r\\nhello\\r\\nVM-EXIT {code}\\r\\n"; exit 3')
            done = self.run_script()
            self.assertEqual((done.returncode, done.stdout), (code, "hello\n"), done.stderr)

    def test_script_and_arguments_arrive(self):
        self.fill_cache()
        self.qemu('echo "$@"; echo VM-EXIT 0')
        done = self.run_script("one", "two")
        self.assertIn(f"stillmap.script={self.script} stillmap.arguments=one%20two", done.stdout)
        self.assertIn("-icount shift=3,sleep=off", done.stdout)
        self.assertIn("readonly=on", done.stdout)

    def test_a_guest_that_says_nothing_has_failed(self):
        self.fill_cache()
        self.qemu("echo Kernel panic")
        done = self.run_script()
        self.assertEqual(done.returncode, 125)
        self.assertIn("without an answer", done.stderr)
        self.qemu("exec sleep 30")
        done = self.run_script(seconds="1")
        self.assertEqual(done.returncode, 124)
        self.assertIn("not done after 1 s", done.stderr)

    def test_where_it_cannot_run_it_is_skipped(self):
        done = self.run_script()
        self.assertEqual(done.returncode, 77)
        self.assertIn("there is no qemu-system-x86_64", done.stderr)
        self.qemu("exit 0")
        done = self.run_script()  # nothing to make the kernel with
        self.assertEqual(done.returncode, 77, done.stderr)
        self.assertIn("skipped: ", done.stderr)
        self.tool("uname", "echo riscv64")
        done = self.run_script()
        self.assertEqual(done.returncode, 77)
        self.assertIn("this machine is riscv64", done.stderr)

    def test_a_cache_of_other_scripts_is_none(self):
        self.fill_cache()
        self.qemu("echo VM-EXIT 0")
        self.assertEqual(self.run_script().returncode, 0)
        (self.cache / "stamp").write_text("of something else\n")
        self.assertEqual(self.run_script().returncode, 77)

    def test_bad_usage(self):
        self.script.unlink()
        self.assertEqual(self.run_script().returncode, 2)


if __name__ == "__main__":
    unittest.main(argv=sys.argv[:1], verbosity=1)
