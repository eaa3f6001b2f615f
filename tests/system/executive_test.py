#!/usr/bin/env python3
"""The running program as a service manager, a dashboard and an operator see it: executive_test.py STILLMAP"""

import json
import os
import pathlib
import shutil
import signal
import socket
import subprocess
import sys
import tempfile
import time
import unittest
import urllib.error
import urllib.request

STILLMAP = sys.argv[1]
SCENE = "synthetic:crowd,size=80x60,seconds=60"
QUICK = ["--set", "map.voxel_m=0.04", "--set", "map.truncation_m=0.16", "--set", "runtime.threads=1", "--set",
         "map.pool_blocks=20000"]
PATIENCE_S = 60  # for what a busy machine may take


def free_port():
    with socket.socket() as s:
        s.bind(("127.0.0.1", 0))
        return s.getsockname()[1]


def namespace():
    """A network of its own, where nothing leaves the host; empty where that is not permitted."""
    wrap = ["unshare", "-rn", "sh", "-c",
            'ip link set lo up multicast on && ip route add 224.0.0.0/4 dev lo && exec "$@"', "sh"]
    try:
        return wrap if subprocess.run(wrap + ["true"], capture_output=True).returncode == 0 else []
    except FileNotFoundError:
        return []


class Case(unittest.TestCase):
    def setUp(self):
        self.folder = pathlib.Path(tempfile.mkdtemp())
        self.addCleanup(shutil.rmtree, self.folder, ignore_errors=True)
        self.out = self.folder / "run"

    def start(self, *arguments, environment=None, wrap=()):
        process = subprocess.Popen([*wrap, STILLMAP, "run", "--lcm", "off", *map(str, arguments)], stdout=subprocess.PIPE,
                                   stderr=subprocess.STDOUT, text=True, env={**os.environ, **(environment or {})})
        self.addCleanup(process.stdout.close)
        self.addCleanup(process.wait)
        self.addCleanup(process.kill)
        return process

    def wait_for(self, what, happened):
        end = time.monotonic() + PATIENCE_S
        while not happened():
            self.assertLess(time.monotonic(), end, f"did not happen: {what}")
            time.sleep(0.02)

    def frames_written(self):
        part = self.out / "trajectory.txt.part"
        return len(part.read_text().splitlines()) if part.exists() else 0

    def report(self):
        return json.loads((self.out / "report.json").read_text())


class Signals(Case):
    def test_sigterm_leaves_a_whole_run(self):
        process = self.start("--source", SCENE, "--realtime", "--out", self.out, *QUICK, "--set", "record.map=true")
        self.wait_for("30 frames", lambda: self.frames_written() >= 30)
        process.send_signal(signal.SIGTERM)
        output, _ = process.communicate(timeout=PATIENCE_S)
        self.assertEqual(process.returncode, 0, output)
        lines = (self.out / "trajectory.txt").read_text().splitlines()
        self.assertEqual(len(lines), self.report()["frames"])
        for name in ["states.csv", "timing.csv", "events.log", "mesh.ply", "map.smap"]:
            self.assertTrue((self.out / name).exists(), name)
        self.assertEqual([p.name for p in self.out.iterdir() if p.name.endswith(".part")], [])
        self.assertIn("mode: safe_stop", (self.out / "events.log").read_text())

    def test_what_does_not_fit_into_the_time_is_said(self):
        process = self.start("--source", SCENE, "--realtime", "--out", self.out, *QUICK, "--set", "stop.timeout_s=0")
        self.wait_for("30 frames", lambda: self.frames_written() >= 30)
        process.send_signal(signal.SIGINT)
        output, _ = process.communicate(timeout=PATIENCE_S)
        self.assertEqual(process.returncode, 0, output)
        self.assertFalse((self.out / "mesh.ply").exists())
        self.assertIn("stop.timeout_s", (self.out / "events.log").read_text())
        self.assertTrue((self.out / "trajectory.txt").exists())

    def test_sighup_begins_another_file_of_the_log(self):
        process = self.start("--source", SCENE, "--realtime", "--out", self.out, *QUICK, "--set", "record.log=true")
        self.wait_for("10 frames", lambda: self.frames_written() >= 10)
        process.send_signal(signal.SIGHUP)
        self.wait_for("a second file", lambda: len(list(self.out.glob("log-*"))) == 2)
        process.send_signal(signal.SIGTERM)
        process.communicate(timeout=PATIENCE_S)
        self.assertEqual(process.returncode, 0)
        self.assertEqual(len(list(self.out.glob("log-*.lcm"))), 2)


class Service(Case):
    def setUp(self):
        super().setUp()
        self.notify = socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM)
        self.addCleanup(self.notify.close)
        self.notify.bind(str(self.folder / "notify"))
        self.notify.settimeout(PATIENCE_S)
        self.heard = []
        self.environment = {"NOTIFY_SOCKET": str(self.folder / "notify"), "WATCHDOG_USEC": "600000"}

    def hear(self, *messages, times=1):
        """One of them, so often since the start."""
        end = time.monotonic() + PATIENCE_S
        while sum(self.heard.count(m) for m in messages) < times:
            self.assertLess(time.monotonic(), end, f"not heard: {messages}; but {self.heard}")
            self.heard += self.notify.recv(4096).decode().splitlines()

    def test_readiness_watchdog_and_stop(self):
        process = self.start("--source", SCENE, "--realtime", *QUICK, environment=self.environment)
        self.hear("READY=1")
        self.hear("WATCHDOG=1", times=3)
        self.hear("STATUS=running", "STATUS=degraded", "STATUS=lost")  # a busy machine may be late
        process.send_signal(signal.SIGTERM)
        self.hear("STOPPING=1")
        process.communicate(timeout=PATIENCE_S)
        self.assertEqual(process.returncode, 0)

    def test_the_journal_gets_events_with_their_priority_and_no_progress(self):
        journal = self.folder / "journal"
        with journal.open("w") as stream:
            file = os.fstat(stream.fileno())
            run = subprocess.run(
                [STILLMAP, "run", "--lcm", "off", "--source", SCENE, "--max-frames", "40", "--out", str(self.out), *QUICK],
                stdout=subprocess.PIPE, stderr=stream, text=True, timeout=PATIENCE_S,
                env={**os.environ, "JOURNAL_STREAM": f"{file.st_dev}:{file.st_ino}"})
        lines = journal.read_text().splitlines()
        self.assertEqual(run.returncode, 0, lines)
        self.assertNotIn("frames/s", run.stdout)
        self.assertTrue(any(line.startswith("<6>mode: running") for line in lines), lines)
        self.assertTrue(all(line[:3] in ("<3>", "<4>", "<6>") for line in lines), lines)

    def test_without_a_camera_it_is_ready_and_waits_in_mode_boot(self):
        process = self.start("--source", f"tum:{self.folder}/later", "--set", "source.wait_s=-1", *QUICK,
                             environment=self.environment)
        self.hear("READY=1")
        self.hear("WATCHDOG=1")
        process.send_signal(signal.SIGTERM)
        output, _ = process.communicate(timeout=PATIENCE_S)
        self.assertEqual(process.returncode, 0, output)


class Numbers(Case):
    def test_metrics_for_dashboards(self):
        port = free_port()
        process = self.start("--source", SCENE, "--realtime", *QUICK, "--set", f"metrics.port={port}")

        def metrics():
            try:
                return urllib.request.urlopen(f"http://127.0.0.1:{port}/metrics", timeout=5).read().decode()
            except OSError:
                return ""

        self.wait_for("mode running", lambda: 'stillmap_mode{mode="running"} 1' in metrics())
        text = metrics()
        for line in text.splitlines():
            self.assertRegex(line, r'^(# (HELP|TYPE) stillmap_\w+ .+|stillmap_\w+(\{\w+="\w+"\})? [-+.\deE]+)$')
        self.assertIn('stillmap_stage_seconds{stage="track"}', text)
        self.assertIn('stillmap_faults_total{fault="tracking_lost"} 0', text)
        with self.assertRaises(urllib.error.HTTPError):
            urllib.request.urlopen(f"http://127.0.0.1:{port}/elsewhere", timeout=5)
        # A caller that says nothing does not keep others from their numbers for long.
        with socket.create_connection(("127.0.0.1", port)):
            self.assertIn("stillmap_mode", metrics())
        process.send_signal(signal.SIGTERM)
        process.communicate(timeout=PATIENCE_S)
        self.assertEqual(process.returncode, 0)

    def test_a_port_that_is_taken_is_said(self):
        with socket.socket() as taken:
            taken.bind(("127.0.0.1", 0))
            taken.listen()
            port = taken.getsockname()[1]
            process = self.start("--source", SCENE, *QUICK, "--set", f"metrics.port={port}")
            output, _ = process.communicate(timeout=PATIENCE_S)
        self.assertEqual(process.returncode, 2, output)
        self.assertIn("metrics.port", output)


class RealTime(Case):
    def test_it_plays_at_the_pace_of_the_stamps(self):
        start = time.monotonic()
        process = self.start("--source", "synthetic:crowd,size=80x60,seconds=3", "--realtime", "--out", self.out, *QUICK)
        process.communicate(timeout=PATIENCE_S)
        self.assertEqual(process.returncode, 0)
        self.assertGreaterEqual(time.monotonic() - start, 2.9)
        report = self.report()
        self.assertEqual(report["frames"] + report["dropped"], 90)

    def test_no_heap_on_real_time_threads_with_every_output_on(self):
        network = namespace()
        lcm = ["--lcm", "udpm://239.255.76.67:7667?ttl=0"] if network else []
        if not network:
            print("LCM is left out: no network namespace here")
        process = subprocess.run(
            [*network, STILLMAP, "bench", "soak", "--max-frames", "400", "--size", "80x60", "--out", str(self.folder),
             *lcm, "--set", "map.voxel_m=0.04", "--set", "map.truncation_m=0.16", "--set", "map.pool_blocks=20000",
             "--json"], capture_output=True, text=True, env={**os.environ, "STILLMAP_HEAP_FATAL": "1"})
        self.assertTrue(process.stdout, process.stderr)
        result = json.loads(process.stdout)
        self.assertEqual(result["frames"], 400, process.stderr)
        self.assertEqual(result["heap_calls"], 0, process.stderr)

    def test_poses_reach_another_program(self):
        network = namespace()
        if not network:
            self.skipTest("no network namespace here")
        script = (f"{STILLMAP} run --source synthetic:crowd,size=80x60,seconds=6 --realtime --quiet {' '.join(QUICK)} & "
                  f"{STILLMAP} top --for 4; wait")
        done = subprocess.run([*network, "sh", "-c", script], capture_output=True, text=True, timeout=PATIENCE_S)
        self.assertIn("running", done.stdout, done.stderr)
        self.assertIn("good", done.stdout)


if __name__ == "__main__":
    unittest.main(argv=[sys.argv[0], *sys.argv[2:]])
