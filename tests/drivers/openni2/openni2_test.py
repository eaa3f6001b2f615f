#!/usr/bin/env python3
"""The program with a camera of OpenNI2 that is not there, and with recordings of it:

    openni2_test.py STILLMAP VIRTUAL_CAMERA_TOOL FOLDER_OF_THE_LIBRARY [TEST]...
"""

import json
import os
import pathlib
import shutil
import signal
import struct
import subprocess
import sys
import tempfile
import time
import unittest

STILLMAP = TOOL = LIBRARY = ""
PATIENCE_S = 60  # for what a busy machine may take
QUICK = ["--lcm", "off", "--set", "map.voxel_m=0.04", "--set", "map.truncation_m=0.16", "--set", "runtime.threads=1",
         "--set", "map.pool_blocks=20000", "--set", "record.mesh=false", "--set", "record.snapshots=0"]
# The recorder garbles the last pixels of some depth images: of this scene of none.
SCENE = "static,size=160x120,seconds=1,seed=4"
FRAMES = 30
SMALL = "static,size=160x120,seconds=2"
SMALL_CAMERA = [*QUICK, "--set", "source.cols=160", "--set", "source.rows=120"]
CONTROL = ["plugged", "stalled", "small_images", "no_colour", "stamp_shift_ms", "colour_shift_ms", "registration", "no_sync",
           "unpaced", "hold", "sent", "registered", "mirrored", "auto_exposure", "auto_white_balance", "opened"]


class Camera:
    """What the camera is told, in memory that it sees (virtual_camera.hpp)."""

    def __init__(self, path):
        self.path = path
        path.write_bytes(bytes(4 * len(CONTROL)))

    def __setitem__(self, name, value):
        with open(self.path, "r+b") as file:
            file.seek(4 * CONTROL.index(name))
            file.write(struct.pack("<i", value))

    def __getitem__(self, name):
        at = 4 * CONTROL.index(name)
        return struct.unpack("<i", self.path.read_bytes()[at:at + 4])[0]


class Case(unittest.TestCase):
    def setUp(self):
        self.folder = pathlib.Path(tempfile.mkdtemp())
        self.addCleanup(shutil.rmtree, self.folder, ignore_errors=True)
        self.out = self.folder / "run"
        self.camera = Camera(self.folder / "control")
        self.frames = self.folder / "frames.raw"
        self.environment = {**os.environ, "LD_LIBRARY_PATH": LIBRARY, "STILLMAP_VIRTUAL_FRAMES": str(self.frames),
                            "STILLMAP_VIRTUAL_CONTROL": str(self.camera.path)}

    def tool(self, *arguments):
        subprocess.run([TOOL, *map(str, arguments)], check=True, env=self.environment, timeout=PATIENCE_S,
                       stdout=subprocess.DEVNULL)

    def stillmap(self, *arguments, environment=None):
        return subprocess.run([STILLMAP, *map(str, arguments)], capture_output=True, text=True, timeout=PATIENCE_S,
                              env=environment or self.environment)

    def run_to_the_end(self, *arguments, environment=None):
        done = self.stillmap("run", "--quiet", *arguments, environment=environment)
        self.assertEqual(done.returncode, 0, done.stdout + done.stderr)
        self.assertEqual(done.stdout, "")  # nothing of the library's
        return done

    def wait_for(self, what, happened):
        end = time.monotonic() + PATIENCE_S
        while not happened():
            self.assertLess(time.monotonic(), end, f"did not happen: {what}")
            time.sleep(0.02)

    def report(self, out=None):
        return json.loads(((out or self.out) / "report.json").read_text())


class Recordings(Case):
    def setUp(self):
        super().setUp()
        self.tool("render", SCENE, self.frames, FRAMES, "raw")
        self.recording = self.folder / "recording.oni"
        self.tool("record", self.recording, FRAMES)
        # Raw values are the scene's, 1/5000 m; the field of view gives the focal length up to a rounding.
        self.as_scene = [*QUICK, "--camera", "131.25,131.25,79.5,59.5", "--depth-scale", "5000"]

    def trajectory(self, name, source, *arguments, environment=None):
        self.run_to_the_end("--source", source, "--out", self.folder / name, *self.as_scene, *arguments,
                            environment=environment)
        return (self.folder / name / "trajectory.txt").read_text()

    def test_gives_the_trajectory_of_what_was_recorded(self):
        # Where the last pose is the prior, stamps do not matter: they have microseconds in a recording.
        prior = ["--set", "track.prior=last_pose"]
        scene = self.trajectory("scene", "synthetic:" + SCENE, *prior)
        self.assertEqual(len(scene.splitlines()), FRAMES)
        self.assertEqual(self.trajectory("oni", f"oni:{self.recording}", *prior), scene)
        # And with the library and all drivers of the system: they are put away in good order as well.
        system = {name: value for name, value in self.environment.items() if name != "LD_LIBRARY_PATH"}
        self.assertEqual(self.trajectory("system", f"oni:{self.recording}", *prior, environment=system), scene)
        self.assertEqual(self.report(self.folder / "oni")["dropped"], 0)
        self.assertEqual(self.report(self.folder / "oni")["faults"], {})

    def test_gives_the_trajectory_of_the_same_images_with_the_same_stamps(self):
        # A rendered folder has its stamps in microseconds as well: they change what the motion predicts.
        done = self.stillmap("render", "--source", "synthetic:" + SCENE, "--out", self.folder / "scene")
        self.assertEqual(done.returncode, 0, done.stderr)
        expected = self.trajectory("tum", f"tum:{self.folder / 'scene'}")
        self.assertEqual(len(expected.splitlines()), FRAMES)
        self.assertEqual(self.trajectory("oni", f"oni:{self.recording}"), expected)

    def test_without_help_takes_size_and_focal_length_from_the_file(self):
        self.run_to_the_end("--source", f"oni:{self.recording}", "--out", self.out, "--max-frames", "10", *QUICK,
                            "--depth-scale", "5000", "--skip-frames", "5")
        self.assertEqual(self.report()["frames"], 10)
        self.assertEqual((self.out / "trajectory.txt").read_text().split()[0], "0.166667")

    def test_files_that_cannot_be_played_are_said_and_end_with_3(self):
        whole = self.recording.read_bytes()
        (self.folder / "cut.oni").write_bytes(whole[:len(whole) // 3])
        record = whole.index(b"NIR", len(whole) // 4)
        (self.folder / "damaged.oni").write_bytes(whole[:record] + bytes(100) + whole[record + 100:])
        (self.folder / "other.oni").write_text("no recording")
        for name, says in [("missing.oni", "no such file"), ("cut.oni", "is cut off"), ("damaged.oni", "is damaged"),
                           ("other.oni", "is no recording")]:
            done = self.stillmap("run", "--source", f"oni:{self.folder / name}", *QUICK)
            self.assertEqual(done.returncode, 3, done.stderr)
            self.assertIn(name, done.stderr)
            self.assertIn(says, done.stderr)


class Live(Case):
    def setUp(self):
        super().setUp()
        self.tool("render", SMALL, self.frames, 40)
        self.camera["plugged"] = 1

    def start(self, *arguments):
        self.process = subprocess.Popen([STILLMAP, "run", "--source", "xtion", "--quiet", "--out", self.out,
                                         *SMALL_CAMERA, *arguments], stdout=subprocess.PIPE, stderr=subprocess.STDOUT,
                                        text=True, env=self.environment)
        self.addCleanup(self.process.stdout.close)
        self.addCleanup(self.process.wait)
        self.addCleanup(self.process.kill)

    def frames_written(self):
        part = self.out / "trajectory.txt.part"
        return len(part.read_text().splitlines()) if part.exists() else 0

    def wait_for_event(self, what):
        log = [self.out / "events.log.part", self.out / "events.log"]
        self.wait_for(what, lambda: any(what in file.read_text() for file in log if file.exists()))

    def wait_for_frames(self, count):
        before = self.frames_written()
        self.wait_for(f"{count} more frames", lambda: self.frames_written() >= before + count)

    def stop(self):
        self.process.send_signal(signal.SIGTERM)
        output, _ = self.process.communicate(timeout=PATIENCE_S)
        self.assertEqual(self.process.returncode, 0, output)
        return self.report()

    def test_frames_come_at_the_pace_of_the_camera(self):
        self.run_to_the_end("--source", "xtion", "--out", self.out, "--max-frames", "45", *SMALL_CAMERA)
        stamps = [float(line.split()[0]) for line in (self.out / "trajectory.txt").read_text().splitlines()]
        report = self.report()
        self.assertGreaterEqual(len(stamps) + report["dropped"], 45)  # none is lost and not counted
        self.assertGreater(len(stamps), 30)
        self.assertEqual(stamps, sorted(set(stamps)))
        mean = (stamps[-1] - stamps[0]) / (len(stamps) + report["dropped"] - 1)
        self.assertAlmostEqual(mean, 1 / 30, delta=0.005)
        self.assertEqual(self.camera["registered"], 1)

    def test_faults_are_latched_and_survived(self):
        self.start("--set", "source.stall_s=0.3")
        self.wait_for_frames(5)
        self.camera["small_images"] = 1
        self.wait_for_frames(5)
        self.camera["stamp_shift_ms"] = 60000
        self.wait_for_frames(5)
        self.camera["stalled"] = 1
        self.wait_for_event("camera_stalled")
        self.camera["stalled"] = 0
        self.wait_for_frames(5)
        report = self.stop()
        self.assertGreaterEqual(report["faults"]["bad_frame"], 2)
        self.assertGreaterEqual(report["faults"]["camera_stalled"], 1)
        events = (self.out / "events.log").read_text()
        self.assertIn("a depth image has 80x120 pixels, expected 160x120", events)
        self.assertIn("clock jumped", events)

    def test_an_unplugged_camera_is_latched_and_taken_up_again(self):
        self.start()
        self.wait_for_frames(5)
        self.camera["plugged"] = 0
        self.wait_for_event("camera_gone")
        self.camera["plugged"] = 1
        self.wait_for_frames(5)
        self.assertIsNone(self.process.poll())
        self.assertGreaterEqual(self.camera["opened"], 2)
        report = self.stop()
        self.assertEqual(report["faults"]["camera_gone"], 1)
        stamps = [float(line.split()[0]) for line in (self.out / "trajectory.txt").read_text().splitlines()]
        self.assertEqual(stamps, sorted(set(stamps)))

    def test_a_camera_may_come_later(self):
        self.camera["plugged"] = 0
        self.start("--set", "source.wait_s=60")
        time.sleep(0.5)  # it is waited for, and no other condition tells that it is
        self.assertIsNone(self.process.poll())
        self.camera["plugged"] = 1
        self.wait_for_frames(3)
        self.stop()

    def test_refusals_end_with_3_and_say_what_to_do(self):
        for source, settings, says in [("xtion:OTHER", [], "VIRTUAL0001"),
                                       ("xtion", ["--set", "source.rate_hz=30", "--set", "source.cols=320"], "it has 160x120")]:
            done = self.stillmap("run", "--source", source, *SMALL_CAMERA, *settings)
            self.assertEqual(done.returncode, 3, done.stderr)
            self.assertIn(says, done.stderr)
        self.camera["plugged"] = 0
        done = self.stillmap("run", "--source", "xtion", *SMALL_CAMERA)
        self.assertEqual(done.returncode, 3, done.stderr)
        self.assertIn("sees no camera", done.stderr)

    def test_doctor_lists_it_and_opens_it(self):
        done = self.stillmap("doctor", "--source", "xtion", "--set", "source.cols=160", "--set", "source.rows=120")
        self.assertIn("sees Stillmap virtual camera (1d27:0601) at virtual:1", done.stdout, done.stderr)
        self.assertIn("xtion opens, 160x120", done.stdout)
        self.assertRegex(done.stdout, r"(?m)^WRONG +camera +no Xtion on USB")  # which it is not on
        self.camera["plugged"] = 0
        done = self.stillmap("doctor", "--source", "xtion")
        self.assertRegex(done.stdout, r"(?m)^WRONG +openni2 +sees no camera")
        self.assertEqual(done.returncode, 1)


if __name__ == "__main__":
    STILLMAP, TOOL, LIBRARY = sys.argv[1:4]
    unittest.main(argv=[sys.argv[0], *sys.argv[4:]])
