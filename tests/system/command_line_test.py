#!/usr/bin/env python3
"""The program as its users call it: exit codes, messages, the files that a run leaves, stops and full disks.

    command_line_test.py PROGRAM SOURCE_ROOT VERSION
"""

import csv
import json
import math
import os
import pathlib
import re
import resource
import shutil
import signal
import struct
import subprocess
import sys
import tempfile
import time
import unittest

PROGRAM, ROOT = (pathlib.Path(argument).resolve() for argument in sys.argv[1:3])
VERSION = sys.argv[3]
DATA = ROOT.parent / "shared" / "data"
SMALL = "synthetic:crowd,size=160x120,seconds=1"
# A coarse map: small in memory and quick, and nothing here depends on its voxels.
LITTLE = ["--set", "map.pool_blocks=20000", "--set", "map.voxel_m=0.03", "--set", "map.truncation_m=0.12"]

STATES = ["stamp", "state", "p_good", "inlier_ratio", "masked_fraction"]
TIMING = ["stamp", "prepare_ms", "track_ms", "mask_ms", "refine_ms", "integrate_ms", "total_ms"]


def stillmap(*arguments, timeout=300, **options):
    return subprocess.run([str(PROGRAM), *map(str, arguments)], capture_output=True, text=True, timeout=timeout, **options)


def read_csv(path):
    with open(path, newline="") as file:
        return list(csv.reader(file))


def read_ply(path):
    """Vertices and triangles of a mesh as the contract describes it."""
    data = pathlib.Path(path).read_bytes()
    head, body = data.split(b"end_header\n", 1)
    lines = head.decode().splitlines()
    assert lines[:2] == ["ply", "format binary_little_endian 1.0"], lines[:2]
    counts = {line.split()[1]: int(line.split()[2]) for line in lines if line.startswith("element")}
    properties = [line for line in lines if line.startswith("property")]
    if "face" not in counts:
        assert properties == ["property float x", "property float y", "property float z"], properties
        assert len(body) == 12 * counts["vertex"]
        return counts["vertex"], 0
    assert properties == [
        "property float x", "property float y", "property float z",
        "property uchar red", "property uchar green", "property uchar blue",
        "property list uchar int vertex_indices"], properties
    assert len(body) == 15 * counts["vertex"] + 13 * counts["face"], "the body has another size than the header says"
    for face in range(counts["face"]):
        n, a, b, c = struct.unpack_from("<Biii", body, 15 * counts["vertex"] + 13 * face)
        assert n == 3 and 0 <= min(a, b, c) and max(a, b, c) < counts["vertex"]
    return counts["vertex"], counts["face"]


def read_trajectory(path):
    lines = pathlib.Path(path).read_text().splitlines()
    poses = [[float(x) for x in line.split()] for line in lines]
    for line, pose in zip(lines, poses):
        assert len(pose) == 8, line
        assert len(line.split()[0].split(".")[1]) == 6, f"stamp without six digits: {line}"
        assert abs(math.hypot(*pose[4:]) - 1) < 1e-6, f"no unit quaternion: {line}"
    return poses


class Case(unittest.TestCase):
    def setUp(self):
        self.folder = pathlib.Path(tempfile.mkdtemp(prefix="stillmap-system-"))
        self.addCleanup(shutil.rmtree, self.folder, ignore_errors=True)
        self.out = self.folder / "out"

    def refused(self, code, *arguments, says=(), **options):
        done = stillmap(*arguments, **options)
        self.assertEqual(done.returncode, code, done.stdout + done.stderr)
        for word in says:
            self.assertIn(word, done.stderr)
        self.assertNotIn("terminate called", done.stderr)
        return done

    def mapped(self, *arguments, code=0, **options):
        done = stillmap("run", *arguments, *LITTLE, **options)
        self.assertEqual(done.returncode, code, done.stdout + done.stderr)
        return done


class Usage(Case):
    def test_help_and_version(self):
        done = stillmap("--help")
        self.assertEqual(done.returncode, 0)
        for name in ["run", "evaluate", "bench", "render", "picture", "memory-plan", "check-config", "mesh", "replay",
                     "top", "doctor"]:
            self.assertIn(name, done.stdout)
            self.assertEqual(stillmap(name, "--help").returncode, 0, name)
        done = stillmap("--version")
        self.assertEqual((done.returncode, done.stdout.strip()), (0, f"stillmap {VERSION}"))

    def test_bad_usage_is_2(self):
        self.refused(2)
        self.refused(2, "fly", says=["fly"])
        self.refused(2, "run", says=["--source"])
        self.refused(2, "run", "--source", SMALL, "--frobnicate", says=["--frobnicate"])
        self.refused(2, "run", "--source", SMALL, "--max-frames", "many", says=["--max-frames"])
        self.refused(2, "run", "--source", SMALL, "--device", "tpu", says=["--device"])
        self.refused(2, "run", "--source", SMALL, "--threads", "0", says=["--threads"])
        self.refused(2, "run", "--source", SMALL, "--threads", "2.5", says=["--threads"])
        self.refused(2, "run", "--source", SMALL, "--depth-scale", "nan", says=["--depth-scale"])
        self.refused(2, "run", "--source", SMALL, "--depth-scale", "-5000", says=["--depth-scale"])
        self.refused(2, "run", "--source", SMALL, "--camera", "500,500,80", says=["--camera"])
        self.refused(2, "run", "--source", SMALL, "--camera", "nan,500,80,60", says=["--camera"])
        self.refused(2, "run", "--source", SMALL, "--camera", "0,500,80,60", says=["--camera"])
        self.refused(2, "run", "--source", SMALL, "--initial-pose", "0,0,0,0,0,0,0", says=["--initial-pose"])
        self.refused(2, "run", "--source", SMALL, "--initial-pose", "1,2,3", says=["--initial-pose"])
        self.refused(2, "run", "--source", "nothing", says=["nothing"])
        self.refused(2, "run", "--source", "synthetic:no_such_scene", says=["no_such_scene"])

    def test_a_camera_that_is_not_there(self):
        self.refused(2, "run", "--source", "v4l2:/dev/video98", says=["--camera"])
        self.refused(3, "run", "--source", "v4l2:/dev/video98", "--camera", "525,525,319.5,239.5",
                     says=["/dev/video98", "No such file"])

    def test_doctor(self):
        done = stillmap("doctor", "--source", SMALL, "--out", self.out)
        self.assertEqual(done.returncode, 0, done.stdout + done.stderr)
        for part in ["configuration", "source", "memory", "priority", "processors", "cuda", "lcm route", "lcm buffers",
                     "clock", "out"]:
            self.assertRegex(done.stdout, rf"(?m)^(OK|worse) +{part} ")
        self.assertNotIn("WRONG", done.stdout)
        self.assertFalse(self.out.exists(), "it only looks")
        file = self.folder / "file"
        file.touch()
        for arguments, part in [(["--source", "v4l2:/dev/video98,/dev/video99"], "camera"),
                                (["--source", f"tum:{self.folder}/none"], "source"),
                                (["--set", "track.levels=9"], "configuration"),
                                (["--out", file], "out")]:
            done = stillmap("doctor", *arguments)
            self.assertEqual(done.returncode, 1, done.stdout + done.stderr)
            self.assertRegex(done.stdout, rf"(?m)^WRONG +{part} .*\n(.*\n)* +mend: .")

    def test_a_gpu_that_is_not_there_is_said(self):
        if os.path.exists("/dev/nvidiactl") or os.path.exists("/dev/nvgpu"):
            self.skipTest("this machine may have one")
        self.refused(2, "run", "--source", SMALL, "--device", "cuda", says=["--device cuda", "--device auto"])
        done = stillmap("run", "--source", SMALL, "--device", "auto", "--max-frames", "2")
        self.assertEqual(done.returncode, 0, done.stderr)
        self.assertLessEqual(done.stderr.count("the CPU engine runs"), 1, done.stderr)

    def test_configuration(self):
        config = self.folder / "c.toml"
        config.write_text("[track]\ncolour_wait = 1\n[nowhere]\nx = 1\n")
        self.refused(2, "run", "--source", SMALL, "--config", config, says=["colour_wait", "nowhere"])
        self.refused(2, "check-config", config, says=["colour_wait", "nowhere", str(config)])
        config.write_text("[mask]\ngamma = 7\n[map]\nvoxel_m = 0.5\n")
        self.refused(2, "check-config", config, says=["mask.gamma", "7", "map.truncation_m"])
        config.write_text("[mask]\ngamma = 0.4\n")
        self.assertEqual(stillmap("check-config", config).returncode, 0)
        self.refused(2, "check-config", self.folder / "missing.toml", says=["missing.toml"])
        self.refused(2, "run", "--source", SMALL, "--set", "track.levels", says=["track.levels"])
        self.refused(2, "run", "--source", SMALL, "--set", "track.levels=9", "--set", "mask.gamma=2",
                     says=["track.levels", "mask.gamma"])
        for preset in sorted((ROOT / "config/presets").glob("*.toml")):
            done = stillmap("check-config", preset)
            self.assertEqual(done.returncode, 0, done.stderr)

    def test_memory_plan(self):
        done = stillmap("memory-plan")
        self.assertEqual(done.returncode, 0, done.stderr)
        self.assertIn("total", done.stdout)
        self.assertNotIn("archive", done.stdout)
        done = stillmap("memory-plan", "--set", f"archive.dir={self.folder}/a", "--set", "map.free_space=hierarchical")
        self.assertEqual(done.returncode, 0, done.stderr)
        self.assertIn("archive: groups on their way", done.stdout)
        done = stillmap("memory-plan", "--set", "depth.invalid=complete")  # fits without another key
        self.assertEqual(done.returncode, 0, done.stderr)
        self.assertIn("completed depth", done.stdout)
        unregistered = self.folder / "unregistered.toml"
        pinhole = "fx = 570.0\nfy = 570.0\ncx = 319.5\ncy = 239.5\n"
        unregistered.write_text(f"[colour]\n{pinhole}[depth]\n{pinhole}"
                                "T_colour_depth = [-0.025, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0]\n")
        self.assertNotIn("registration of depth", done.stdout)
        done = stillmap("memory-plan", "--set", f"camera.calibration={unregistered}")
        self.assertEqual(done.returncode, 0, done.stderr)
        self.assertIn("registration of depth to colour", done.stdout)
        self.refused(2, "memory-plan", "--set", "camera.calibration=missing.toml", says=["missing.toml"])
        paper = ROOT / "config/presets/paper.toml"
        done = stillmap("memory-plan", "--config", paper)
        self.assertEqual(done.returncode, 0, done.stderr)
        done = stillmap("memory-plan", "--config", ROOT / "config/presets/jetson.toml")
        self.assertEqual(done.returncode, 0, done.stderr)
        self.refused(2, "memory-plan", "--set", "memory.budget_mb=10", says=["memory.budget_mb"])
        done = self.refused(2, "run", "--source", SMALL, "--set", "memory.budget_mb=10", "--out", self.out,
                            says=["memory.budget_mb", "total"])
        self.assertFalse(self.out.exists())


class Sources(Case):
    def test_missing_source_is_3(self):
        self.refused(3, "run", "--source", f"tum:{self.folder}/none", "--out", self.out, says=["none"])
        self.refused(3, "run", "--source", f"sevenscenes:{self.folder}/none", says=["none"])
        self.assertFalse(self.out.exists(), "nothing may be made for a source that is not there")

    def test_waits_for_the_source(self):
        start = time.monotonic()
        self.refused(3, "run", "--source", f"tum:{self.folder}/none", "--set", "source.wait_s=1")
        self.assertGreater(time.monotonic() - start, 0.9)

    def test_render_then_map_with_a_bad_frame_in_the_middle(self):
        clip = self.folder / "clip"
        done = stillmap("render", "--source", SMALL, "--out", clip)
        self.assertEqual(done.returncode, 0, done.stderr)
        for name in ["rgb.txt", "depth.txt", "associated.txt", "groundtruth.txt", "camera.toml", "truth_cloud.ply"]:
            self.assertTrue((clip / name).stat().st_size > 0, name)
        depth = sorted((clip / "depth").glob("*.png"))
        self.assertEqual(len(depth), 30)
        self.assertEqual(len(list((clip / "rgb").glob("*.png"))), 30)
        self.assertEqual(len(list((clip / "masks_truth").glob("*.png"))), 30)

        self.mapped("--source", f"tum:{clip}", "--out", self.out)
        whole = read_trajectory(self.out / "trajectory.txt")
        self.assertEqual(len(whole), 30)
        # The folder and the scene itself are the same frames; only the stamps are rounded, and with them where
        # the registration of a frame starts. At this size a cell is one pixel, and whether its noisy depth makes a
        # normal or an edge decides what it weighs: they agree within a tenth of a voxel.
        self.mapped("--source", SMALL, "--out", self.folder / "direct")
        for one, other in zip(whole, read_trajectory(self.folder / "direct/trajectory.txt"), strict=True):
            for a, b in zip(one, other, strict=True):
                self.assertAlmostEqual(a, b, delta=3e-3)

        depth[10].write_bytes(depth[10].read_bytes()[:200])
        depth[15].unlink()
        done = self.mapped("--source", f"tum:{clip}", "--out", self.out)
        self.assertIn(depth[10].name, done.stderr)
        self.assertEqual(len(read_trajectory(self.out / "trajectory.txt")), 28)
        report = json.loads((self.out / "report.json").read_text())
        self.assertEqual((report["frames"], report["faults"]["bad_frame"]), (28, 2))
        events = (self.out / "events.log").read_text()
        self.assertIn(depth[10].name, events)
        self.assertIn(depth[15].name, events)

        (clip / "camera.toml").unlink()
        self.refused(2, "run", "--source", f"tum:{clip}", says=["camera"])
        self.mapped("--source", f"tum:{clip}", "--camera", "131.25,131.25,79.75,59.75", "--max-frames", "3")

        for name in ["associated.txt", "rgb.txt", "depth.txt"]:
            (clip / name).write_text("# nothing\n")
        self.refused(3, "run", "--source", f"tum:{clip}", "--camera", "131,131,80,60")

    def test_calibration_files(self):
        clip = self.folder / "clip"
        done = stillmap("render", "--source", SMALL, "--out", clip)
        self.assertEqual(done.returncode, 0, done.stderr)

        def trajectory(*settings, log=False):
            kept = ["--set", "record.log=true", "--set", "record.frames=true"] if log else []
            self.mapped("--source", f"tum:{clip}", "--out", self.out, "--max-frames", 12, *settings, *kept)
            return (self.out / "trajectory.txt").read_bytes()

        plain = trajectory()
        lens = (clip / "camera.toml").read_text()
        calibration = self.folder / "my.toml"
        use = ["--set", f"camera.calibration={calibration}"]
        calibration.write_text(lens)
        self.assertEqual(trajectory(*use), plain, "the same camera")
        # A bias changes the poses; a replay takes out the same one, also when the file is there no more.
        calibration.write_text("depth_bias = [0.0, 1.05]\n" + lens)
        biased = trajectory(*use, log=True)
        self.assertNotEqual(biased, plain)
        calibration.unlink()
        done = stillmap("replay", self.out, "--out", self.folder / "again")
        self.assertEqual(done.returncode, 0, done.stderr)
        self.assertEqual((self.folder / "again/trajectory.txt").read_bytes(), biased)
        (clip / "camera.toml").write_text("depth_bias = [0.0, 1.05]\n" + lens)
        self.assertEqual(trajectory(), biased, "camera.toml is read by the same code")

        run = ["run", "--source", f"tum:{clip}", "--quiet", *use]
        self.refused(2, *run, says=["my.toml"])
        calibration.write_text("focal = 3\n")
        self.refused(2, *run, says=["my.toml:1: focal: unknown key; did you mean"])
        vga = "[colour]\nwidth = 640\nheight = 480\nfx = 525\nfy = 525\ncx = {}\ncy = {}\n"
        calibration.write_text(vga.format(80, 60))
        self.refused(2, *run, says=["is for 640x480 pixels", "160x120"])
        calibration.write_text(vga.format(320, 240))
        self.refused(2, *run, says=["my.toml: centre cx = 320.0, cy = 240.0 lies outside"])
        self.refused(2, "run", "--source", f"tum:{clip}", "--set", "camera.calibration=xtoin", says=["xtoin"])

        config = self.folder / "c.toml"
        config.write_text('[camera]\ncalibration = "xtion"\n')
        self.assertEqual(stillmap("check-config", config).returncode, 0)
        config.write_text(f'[camera]\ncalibration = "{calibration}"\n')
        self.assertEqual(stillmap("check-config", config).returncode, 0)
        calibration.write_text("depth_bias = [0.0, 1.2]\n[colour]\nfx = 100\nfy = 525\ncx = 320\ncy = 10\n")
        self.refused(2, "check-config", config,
                     says=["my.toml: colour.fx = 100.0", "expected 20 to 120", "colour.cy = 10.0", "depth_bias"])
        calibration.write_text("[color]\n")
        self.refused(2, "check-config", config, says=["my.toml:1: color: unknown key; did you mean colour?"])
        config.write_text("[camera]\nfx = 5000\nfy = 525\ncx = 320\ncy = 240\n")
        self.refused(2, "check-config", config, says=["camera.fx = 5000.0", "7 degrees"])

    def test_render_refuses(self):
        self.refused(2, "render", "--source", "tum:x", "--out", self.out, says=["synthetic"])
        self.refused(1, "render", "--source", SMALL, "--out", "/proc/no", says=["/proc/no"])

    @unittest.skipUnless(DATA.is_dir(), "no recordings here")
    def test_real_recordings(self):
        for source, truth in [(f"sevenscenes:{DATA}/kitchen_clip", DATA / "kitchen_clip/groundtruth.txt"),
                              (f"tum:{DATA}/rpy_clip", DATA / "rpy_clip/groundtruth.txt"),
                              (f"tum:{DATA}/kitchen_walkers", DATA / "kitchen_walkers/groundtruth.txt")]:
            with self.subTest(source):
                done = stillmap("run", "--source", source, "--out", self.out, "--max-frames", 12)
                self.assertEqual(done.returncode, 0, done.stderr)
                self.assertEqual(len(read_trajectory(self.out / "trajectory.txt")), 12)
                done = stillmap("evaluate", "ate", "--truth", truth, "--estimate", self.out / "trajectory.txt", "--json")
                self.assertEqual(done.returncode, 0, done.stderr)
                vertices, triangles = read_ply(self.out / "mesh.ply")
                self.assertGreater(triangles, 1000)


class Outputs(Case):
    def test_every_file_of_the_contract(self):
        done = self.mapped("--source", SMALL, "--out", self.out, "--set", "record.masks=true", "--threads", "2")
        self.assertEqual(list(self.out.glob("**/*.part")), [])
        poses = read_trajectory(self.out / "trajectory.txt")
        self.assertEqual(len(poses), 30)
        self.assertEqual(poses[0][1:], [0, 0, 0, 0, 0, 0, 1])
        truth = read_trajectory(self.out / "truth.txt")
        self.assertEqual([p[0] for p in truth], [p[0] for p in poses])
        self.assertTrue(all(abs(a - b) < 1e-6 for a, b in zip(truth[0], poses[0])))
        for pose, true_pose in zip(poses, truth):
            self.assertLess(math.dist(pose[1:4], true_pose[1:4]), 0.1)

        states = read_csv(self.out / "states.csv")
        self.assertEqual(states[0][:5], STATES)
        self.assertEqual({len(row) for row in states}, {5 + 21})
        self.assertEqual(len(states), 31)
        self.assertTrue({row[1] for row in states[1:]} <= {"good", "poor", "lost"})
        timing = read_csv(self.out / "timing.csv")
        self.assertEqual((timing[0], len(timing)), (TIMING, 31))

        vertices, triangles = read_ply(self.out / "mesh.ply")
        self.assertGreater(min(vertices, triangles), 100)
        self.assertGreater(read_ply(self.out / "truth_cloud.ply")[0], 1000)
        self.assertEqual(len(list((self.out / "masks").glob("*.png"))), 29 + 1)
        self.assertEqual(len(list((self.out / "masks_truth").glob("*.png"))), 30)
        stamp = f"{poses[-1][0]:.6f}"
        self.assertTrue((self.out / "masks" / f"{stamp}.png").exists())
        for kind in ["colour", "mask", "map"]:
            self.assertEqual(len(list((self.out / "snapshots").glob(f"*_{kind}.png"))), 8)
            self.assertTrue((self.out / "snapshots" / f"{stamp}_{kind}.png").exists())
        self.assertIn("start", (self.out / "events.log").read_text())
        self.assertEqual(stillmap("check-config", self.out / "config.toml").returncode, 0)

        report = json.loads((self.out / "report.json").read_text())
        self.assertEqual(list(report), ["version", "device", "threads", "frames", "dropped", "lost_frames", "relocalised",
                                        "ms", "map", "memory", "heap_allocations_in_loop", "deadline_misses",
                                        "masked_fraction_mean", "faults"])
        self.assertEqual((report["version"], report["device"], report["threads"]), (VERSION, "cpu", 2))
        self.assertEqual((report["frames"], report["dropped"], report["heap_allocations_in_loop"]), (30, 0, 0))
        for step in ["prepare", "track", "mask", "refine", "integrate", "total"]:
            self.assertEqual(list(report["ms"][step]), ["mean", "p50", "p95", "p99", "max"])
        self.assertGreater(report["ms"]["total"]["p50"], 0)
        self.assertEqual(list(report["map"]), ["blocks", "free_blocks", "capacity", "bytes", "archived"])
        self.assertEqual(report["map"]["blocks"] + report["map"]["free_blocks"], report["map"]["capacity"])
        self.assertGreater(report["memory"]["peak_rss_bytes"], 1 << 20)

        self.assertIn("30 frames", done.stdout)
        done = stillmap("evaluate", "ate", "--truth", self.out / "truth.txt", "--estimate", self.out / "trajectory.txt")
        self.assertEqual(done.returncode, 0, done.stderr)
        done = stillmap("evaluate", "model", "--truth", self.out / "truth_cloud.ply", "--mesh", self.out / "mesh.ply")
        self.assertEqual(done.returncode, 0, done.stderr)
        done = stillmap("picture", self.out)
        self.assertEqual(done.returncode, 0, done.stderr)

    def test_same_input_same_bytes_with_any_number_of_threads(self):
        for threads in ["1", "3"]:
            self.mapped("--source", SMALL, "--out", self.folder / threads, "--threads", threads, "--max-frames", "15")
        for name in ["trajectory.txt", "states.csv", "mesh.ply", "truth.txt"]:
            self.assertEqual((self.folder / "1" / name).read_bytes(), (self.folder / "3" / name).read_bytes(), name)

    def test_earlier_runs_move_away(self):
        for frames in [2, 3, 4]:
            self.mapped("--source", SMALL, "--out", self.out, "--max-frames", frames, "--set", "record.keep_previous=2")
        count = lambda folder: len(read_trajectory(self.out / folder / "trajectory.txt"))
        self.assertEqual((count("."), count("previous-1"), count("previous-2")), (4, 3, 2))
        self.assertTrue((self.out / "previous-1/report.json").exists())

    def test_flags(self):
        self.mapped("--source", SMALL, "--out", self.out, "--skip-frames", "5", "--max-frames", "4", "--lcm", "off",
                    "--device", "auto", "--initial-pose", "-1,2,3,0,0,1,1", "--set", "record.mesh=false", "--set",
                    "record.snapshots=0")
        poses = read_trajectory(self.out / "trajectory.txt")
        self.assertEqual(len(poses), 4)
        self.assertAlmostEqual(poses[0][0], 5 / 30, places=5)
        for value, expected in zip(poses[0][1:], [-1, 2, 3, 0, 0, 2**-0.5, 2**-0.5]):
            self.assertAlmostEqual(value, expected, places=6)
        truth = read_trajectory(self.out / "truth.txt")
        self.assertAlmostEqual(truth[0][1], -1, places=6)
        self.assertFalse((self.out / "mesh.ply").exists())
        self.assertFalse((self.out / "snapshots").exists())

    def test_quiet_says_nothing(self):
        done = self.mapped("--source", SMALL, "--max-frames", "3", "--quiet")
        self.assertEqual(done.stdout + done.stderr, "")

    def test_without_out_nothing_is_written(self):
        done = stillmap("run", "--source", SMALL, "--max-frames", "3", *LITTLE, cwd=self.folder)
        self.assertEqual(done.returncode, 0, done.stderr)
        self.assertEqual(list(self.folder.iterdir()), [])


class BoundedMap(Case):
    def test_a_pool_of_one_and_a_half_views_is_enough_with_an_archive(self):
        source = "synthetic:loop,size=160x120,seconds=10"
        always = ["--set", "map.voxel_m=0.02", "--set", "map.free_space=hierarchical", "--set", "record.snapshots=0"]
        whole, small = self.folder / "whole", self.folder / "small"
        stillmap("run", "--source", source, *always, "--out", whole)
        stop = re.search(r"at most (\d+) blocks with voxels in one view", (whole / "events.log").read_text())
        pool = int(stop[1]) * 3 // 2
        blocks = json.loads((whole / "report.json").read_text())["map"]["blocks"]
        self.assertLess(pool, 0.6 * blocks)
        done = stillmap("run", "--source", source, *always, "--out", small, "--set", f"map.pool_blocks={pool}",
                        "--set", f"archive.dir={self.folder / 'archive'}")
        self.assertEqual(done.returncode, 0, done.stderr)
        report = json.loads((small / "report.json").read_text())
        self.assertEqual((report["lost_frames"], report["heap_allocations_in_loop"]), (0, 0))
        self.assertGreater(report["map"]["archived"], 0)
        # When a group comes back depends on the disk, so that the runs need not be the same to the bit.
        for a, b in zip(read_trajectory(whole / "trajectory.txt"), read_trajectory(small / "trajectory.txt")):
            self.assertLess(math.dist(a[1:4], b[1:4]), 0.01)
        curve = self.folder / "curve.csv"
        done = stillmap("evaluate", "model", "--truth", whole / "mesh.ply", "--mesh", small / "mesh.ply", "--csv", curve)
        self.assertEqual(done.returncode, 0, done.stderr)
        self.assertGreater(float(read_csv(curve)[6][1]), 0.97)  # within 1 cm


class SavedMaps(Case):
    SCENE = "synthetic:static,size=160x120,seconds=4"
    MAP = ["--set", "map.pool_blocks=20000", "--set", "map.voxel_m=0.02", "--set", "record.snapshots=0"]

    def run_map(self, out, source, *arguments):
        done = stillmap("run", "--source", source, *self.MAP, "--out", out, *arguments)
        self.assertEqual(done.returncode, 0, done.stdout + done.stderr)
        return done

    def clip(self, name, times):
        """A folder that shows frames of the rendered scene one after the other: (first, last) again and again."""
        scene, folder = self.folder / "scene", self.folder / name
        if not scene.exists():
            done = stillmap("render", "--source", self.SCENE.replace("160x120", "320x240"), "--out", scene)
            self.assertEqual(done.returncode, 0, done.stderr)
        folder.mkdir()
        for part in ["rgb", "depth"]:
            (folder / part).symlink_to(scene / part)
        shutil.copy(scene / "camera.toml", folder)
        lines = [line.split() for line in (scene / "associated.txt").read_text().splitlines() if not line.startswith("#")]
        with open(folder / "associated.txt", "w") as file:
            for turn, (first, last) in enumerate(times):
                for a, one, b, other in lines[first:last]:
                    file.write(f"{float(a) + 100 * turn:.6f} {one} {float(b) + 100 * turn:.6f} {other}\n")
        return f"tum:{folder}"

    def near(self, truth, mesh):
        """Share of the vertices of one mesh within 4 mm (a step of the curve) of the surface of the other."""
        curve = self.folder / "curve.csv"
        done = stillmap("evaluate", "model", "--truth", truth, "--mesh", mesh, "--csv", curve)
        self.assertEqual(done.returncode, 0, done.stderr)
        return next(float(row[1]) for row in read_csv(curve)[1:] if abs(float(row[0]) - 0.004) < 1e-9)

    def test_going_on_gives_the_mesh_of_one_uninterrupted_run(self):
        half, whole, both = (self.clip(name, times) for name, times in
                             [("half", [(0, 60)]), ("whole", [(0, 120)]), ("both", [(0, 60), (0, 120)])])
        begun, gone_on, one_run = (self.folder / name for name in ["begun", "gone_on", "one_run"])
        done = self.run_map(begun, half, "--set", "record.map=true")
        self.assertIn("map.smap", done.stdout)
        self.assertEqual(list(begun.glob("*.part")), [])
        self.assertIn("map_save", (begun / "events.log").read_text())
        self.run_map(gone_on, whole, "--map", begun / "map.smap", "--set", "record.map=true")
        self.assertIn("map_load", (gone_on / "events.log").read_text())
        self.run_map(one_run, both)

        states = [row[1] for row in read_csv(gone_on / "states.csv")[1:]]
        self.assertEqual(len(states), 120)
        self.assertEqual(states[0], "lost")  # it looks before it maps
        self.assertLess(states.index("good"), 30, "it took more than a second to find the camera")
        self.assertNotIn("lost", states[30:])
        report = json.loads((gone_on / "report.json").read_text())
        self.assertEqual((report["relocalised"], report["heap_allocations_in_loop"]), (1, 0))
        self.assertGreater(self.near(one_run / "mesh.ply", gone_on / "mesh.ply"), 0.99)
        self.assertGreater(self.near(gone_on / "mesh.ply", one_run / "mesh.ply"), 0.99)

        # In the same folder: the map is read before the earlier run is moved away.
        self.run_map(gone_on, whole, "--map", gone_on / "map.smap", "--max-frames", "20")
        # A map frame of its own: the poses are those of the map, not of the first frame.
        self.run_map(gone_on, self.clip("later", [(40, 70)]), "--map", begun / "map.smap")
        later = read_trajectory(gone_on / "trajectory.txt")
        for a, b in zip(later[15:20], read_trajectory(begun / "trajectory.txt")[55:60]):
            self.assertLess(math.dist(a[1:4], b[1:4]), 0.01)

    def test_long_lost_it_starts_a_new_map_and_keeps_the_old_one(self):
        folder, frames = self.folder / "two_rooms", []
        for room, name in enumerate(["static", "corridor"]):
            source = f"synthetic:{name},size=160x120,seconds=2"
            done = stillmap("render", "--source", source, "--out", self.folder / name)
            self.assertEqual(done.returncode, 0, done.stderr)
            lines = (self.folder / name / "associated.txt").read_text().splitlines()
            for line in [line.split() for line in lines if not line.startswith("#")]:
                stamps = [f"{float(line[i]) + 3 * room:.6f}" for i in (0, 2)]
                frames.append(f"{stamps[0]} ../{name}/{line[1]} {stamps[1]} ../{name}/{line[3]}\n")
        folder.mkdir()
        shutil.copy(self.folder / "static" / "camera.toml", folder)
        (folder / "associated.txt").write_text("".join(frames))
        self.run_map(self.out, f"tum:{folder}", "--set", "record.map=true", "--set", "lost.new_map_after_s=0.7",
                     "--set", "track.prior=last_pose")
        events = (self.out / "events.log").read_text()
        self.assertIn("new_map: lost for ", events)
        self.assertIn("map_lost-1.smap", events)
        states = [row[1] for row in read_csv(self.out / "states.csv")[1:]]
        self.assertIn("lost", states[60:65])
        self.assertEqual(states[-1], "good")
        meshes = [self.folder / "old.ply", self.folder / "new.ply"]
        for smap, mesh in zip(["map_lost-1.smap", "map.smap"], meshes):
            done = stillmap("mesh", self.out / smap, "--out", mesh)
            self.assertEqual(done.returncode, 0, done.stderr)
            self.assertIn("triangles", done.stdout)
        self.assertEqual(meshes[1].read_bytes(), (self.out / "mesh.ply").read_bytes())
        self.run_map(self.folder / "first", "synthetic:static,size=160x120,seconds=2")
        self.assertGreater(self.near(self.folder / "first" / "mesh.ply", meshes[0]), 0.95)

    def test_mesh_of_what_is_no_map_is_refused(self):
        no_map = self.folder / "no.smap"
        no_map.write_text("a text that is none\n" * 9)
        done = stillmap("mesh", no_map, "--out", self.folder / "mesh.ply")
        self.assertEqual(done.returncode, 2)
        self.assertIn("no.smap", done.stderr)
        self.assertFalse((self.folder / "mesh.ply").exists())

    def test_where_the_map_is_not_known_the_camera_stays_lost(self):
        self.run_map(self.out, self.SCENE, "--max-frames", "20", "--set", "record.map=true")
        done = stillmap("run", "--source", "synthetic:loop,size=160x120,seconds=1", *self.MAP, "--map",
                        self.out / "map.smap", "--out", self.folder / "lost", "--max-frames", "15")
        self.assertEqual(done.returncode, 4, done.stdout + done.stderr)
        self.assertEqual({row[1] for row in read_csv(self.folder / "lost/states.csv")[1:]}, {"lost"})

    def test_what_cannot_be_gone_on_with_is_refused(self):
        self.mapped("--source", SMALL, "--max-frames", "5", "--out", self.out, "--set", "record.map=true")
        whole = (self.out / "map.smap").read_bytes()
        flipped = bytearray(whole)
        flipped[len(whole) // 2] ^= 4
        tried = self.folder / "tried.smap"
        run = ["run", "--source", SMALL, *LITTLE, "--max-frames", "3", "--out", self.folder / "none", "--map"]
        for code, content, says in [(1, whole[:-1], "cut off"), (1, whole[: len(whole) // 3], "cut off"),
                                    (1, bytes(flipped), "damaged"), (1, whole + b"x", "damaged"), (1, b"", "cut off"),
                                    (2, b"some other file of sixteen bytes and more", "not a map")]:
            tried.write_bytes(content)
            self.refused(code, *run, tried, says=[str(tried), says])
        self.refused(2, *run, self.folder / "missing.smap", says=["missing.smap"])
        self.refused(2, *run, self.out / "map.smap", "--set", "map.voxel_m=0.02",
                     says=["map.voxel_m is 0.03 in the map and 0.02 in the configuration"])
        self.refused(2, *run, self.out / "map.smap", "--set", "map.pool_blocks=5", says=["map.pool_blocks is 5"])
        self.assertFalse((self.folder / "none").exists(), "nothing may be made for a map that is refused")
        tried.write_bytes(whole)
        self.mapped("--source", SMALL, "--max-frames", "5", "--map", tried)

    def test_disk_that_is_too_small_for_the_map(self):
        def limit():
            resource.setrlimit(resource.RLIMIT_FSIZE, (100000, 100000))

        done = stillmap("run", "--source", SMALL, *self.MAP, "--set", "record.map=true", "--set", "record.mesh=false",
                        "--out", self.out, preexec_fn=limit)
        self.assertEqual(done.returncode, 1, done.stdout + done.stderr)
        self.assertEqual(done.stderr.count(f"{self.out}/map.smap: cannot be written: File too large"), 1, done.stderr)
        self.assertEqual(list(self.out.glob("map.smap*")), [])

    def test_kill_during_a_save_leaves_the_last_good_map(self):
        during = 0
        for attempt in range(6):
            out = self.folder / f"killed-{attempt}"
            run = subprocess.Popen([str(PROGRAM), "run", "--source", "synthetic:crowd,size=160x120,seconds=10000",
                                    *self.MAP, "--set", "record.map=true", "--set", "record.map_every_s=0.1", "--quiet",
                                    "--out", out])
            self.addCleanup(run.kill)
            deadline = time.monotonic() + 60
            while not (out / "map.smap").exists() and time.monotonic() < deadline:
                time.sleep(0.01)
            while not (out / "map.smap.part").exists() and time.monotonic() < deadline:
                time.sleep(0.0005)
            time.sleep(0.002 * attempt)
            run.kill()
            self.assertEqual(run.wait(timeout=60), -signal.SIGKILL)
            during += (out / "map.smap.part").exists()
            done = stillmap("run", "--source", "synthetic:crowd,size=160x120,seconds=1", *self.MAP, "--max-frames", "10",
                            "--map", out / "map.smap")
            self.assertEqual(done.returncode, 0, done.stdout + done.stderr)
        self.assertGreater(during, 0, "no kill fell into a save")


class Trouble(Case):
    def test_folder_that_cannot_be_written(self):
        self.refused(1, "run", "--source", SMALL, *LITTLE, "--out", "/proc/no/such", says=["/proc/no"])
        blocked = self.folder / "file"
        blocked.write_text("x")
        self.refused(1, "run", "--source", SMALL, *LITTLE, "--out", blocked, says=[str(blocked)])
        if os.geteuid() != 0:
            closed = self.folder / "closed"
            closed.mkdir(mode=0o500)
            self.refused(1, "run", "--source", SMALL, *LITTLE, "--out", closed, says=[str(closed), "ermission"])

    def test_full_disk_keeps_what_is_whole(self):
        def limit():
            resource.setrlimit(resource.RLIMIT_FSIZE, (2000, 2000))

        # The folder itself takes a few small files, then every file ends at 2000 bytes.
        done = stillmap("run", "--source", SMALL, *LITTLE, "--out", self.out, "--set", "record.snapshots=0",
                        preexec_fn=limit)
        self.assertEqual(done.returncode, 1, done.stdout + done.stderr)
        self.assertIn("File too large", done.stderr)
        self.assertNotIn("terminate", done.stderr)

    def test_disk_that_fills_up_during_the_run(self):
        # The configuration still fits, the trajectory of twelve seconds does not.
        most = (ROOT / "config/presets/default.toml").stat().st_size + 500

        def limit():
            resource.setrlimit(resource.RLIMIT_FSIZE, (most, most))

        done = stillmap("run", "--source", "synthetic:crowd,size=160x120,seconds=12", *LITTLE, "--out", self.out,
                        preexec_fn=limit)
        self.assertEqual(done.returncode, 1, done.stdout + done.stderr)
        for name in ["trajectory.txt", "states.csv", "mesh.ply"]:
            self.assertEqual(done.stderr.count(f"{self.out}/{name}:"), 1, f"{name} is not reported once: {done.stderr}")
        self.assertFalse((self.out / "mesh.ply").exists())
        self.assertEqual(list(self.out.glob("*.part")), [])
        text = (self.out / "trajectory.txt").read_text()
        self.assertTrue(text.endswith("\n"))
        self.assertGreater(len(read_trajectory(self.out / "trajectory.txt")), 50)
        rows = read_csv(self.out / "states.csv")
        self.assertEqual({len(row) for row in rows}, {26})
        report = json.loads((self.out / "report.json").read_text())
        self.assertEqual(report["frames"], 360)
        self.assertGreaterEqual(report["faults"]["record_failed"], 3)

    def stop(self, number):
        run = subprocess.Popen([str(PROGRAM), "run", "--source", "synthetic:crowd,size=160x120,seconds=10000", *LITTLE,
                                "--out", self.out], stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
        self.addCleanup(run.kill)
        part = self.out / "trajectory.txt.part"
        deadline = time.monotonic() + 60
        while not (part.exists() and part.stat().st_size > 2000) and time.monotonic() < deadline:
            time.sleep(0.02)
        run.send_signal(number)
        out, err = run.communicate(timeout=60)
        self.assertEqual(run.returncode, 0, out + err)
        self.assertEqual(list(self.out.glob("*.part")), [])
        frames = len(read_trajectory(self.out / "trajectory.txt"))
        self.assertGreater(frames, 5)
        self.assertEqual(json.loads((self.out / "report.json").read_text())["frames"], frames)
        self.assertGreater(read_ply(self.out / "mesh.ply")[1], 100)

    def test_interrupt_finishes_everything(self):
        self.stop(signal.SIGINT)

    def test_terminate_finishes_everything(self):
        self.stop(signal.SIGTERM)

    def test_second_interrupt_stops_at_once(self):
        # While it waits for a source it cannot finish anything: the first one ends it with 0.
        run = subprocess.Popen([str(PROGRAM), "run", "--source", f"tum:{self.folder}/none", "--set", "source.wait_s=-1"],
                               stderr=subprocess.PIPE)
        self.addCleanup(run.kill)
        time.sleep(0.5)
        run.send_signal(signal.SIGINT)
        self.assertEqual(run.wait(timeout=10), 0)
        run.stderr.close()

    def test_progress_goes_into_a_pipe_line_by_line(self):
        done = self.mapped("--source", "synthetic:crowd,size=320x240,seconds=4")
        lines = [line for line in done.stdout.splitlines() if line.startswith("frame ")]
        self.assertGreater(len(lines), 0)
        self.assertNotIn("\r", done.stdout)
        for word in ["/120", "frames/s", "tracking", "map"]:
            self.assertIn(word, lines[0])

    def test_reader_that_went_away_does_not_end_the_run(self):
        run = subprocess.Popen([str(PROGRAM), "run", "--source", SMALL, *LITTLE, "--out", self.out], stdout=subprocess.PIPE)
        run.stdout.close()
        self.assertEqual(run.wait(timeout=120), 0)
        self.assertEqual(len(read_trajectory(self.out / "trajectory.txt")), 30)


class Bench(Case):
    def test_steps(self):
        done = stillmap("bench", "steps", "--source", SMALL, "--frames", "10", "--json", *LITTLE)
        self.assertEqual(done.returncode, 0, done.stderr)
        report = json.loads(done.stdout)
        self.assertEqual(report["frames"], 10)
        self.assertGreater(report["ms"]["total"]["p50"], 0)

    def test_scale(self):
        done = stillmap("bench", "scale", "--source", "synthetic:crowd,size=160x120,seconds=1", "--frames", "8", "--json",
                        *LITTLE, "--set", "map.free_space=hierarchical")
        self.assertIn(done.returncode, [0, 1], done.stderr)  # 1: this machine was too busy for the bar
        maps = json.loads(done.stdout)["maps"]
        self.assertEqual([m["copies"] for m in maps], [1, 10, 50])
        self.assertGreater(maps[0]["blocks"], 100)
        self.assertEqual([m["blocks"] for m in maps], [n * maps[0]["blocks"] for n in (1, 10, 50)])

    def test_free_space(self):
        done = stillmap("bench", "free_space", "--source", "crowd", "--seconds", "2", "--json", *LITTLE)
        self.assertEqual(done.returncode, 0, done.stdout + done.stderr)
        [row] = json.loads(done.stdout)
        self.assertGreater(row["equal"], 0.999 * row["points"])
        for known in ["unknown", "free", "occupied"]:
            self.assertGreater(row[known], 0.02 * row["points"], known)
        self.assertLess(row["hierarchical_bytes"], 0.9 * row["dense_bytes"])

    def test_archive(self):
        """A map that does not fit leaves the mesh of one that does."""
        meshes = []
        for name, more in [("whole", []), ("archived", ["--set", "map.pool_blocks=1300", "--set",
                                                        f"archive.dir={self.folder}/archive"])]:
            out = self.folder / name
            done = stillmap("run", "--source", "synthetic:loop,size=160x120", "--quiet", *LITTLE, "--set",
                            "map.free_space=hierarchical", "--set", "record.snapshots=0", "--out", out, *more)
            self.assertEqual(done.returncode, 0, done.stderr)
            report = json.loads((out / "report.json").read_text())
            self.assertEqual((report["heap_allocations_in_loop"], report["faults"]), (0, {}))
            meshes.append((out / "mesh.ply").stat().st_size)
        self.assertGreater(report["map"]["archived"], 10)
        self.assertLess(abs(meshes[0] - meshes[1]), 0.01 * meshes[0])
        self.assertEqual(list((self.folder / "archive").iterdir()), [])

    def test_accuracy(self):
        done = stillmap("bench", "accuracy", "--source", "synthetic:static,size=160x120,seconds=1", "--json", *LITTLE,
                        "--out", self.out)
        self.assertEqual(done.returncode, 0, done.stderr)
        rows = json.loads(done.stdout)["runs"]
        self.assertEqual([row["preset"] for row in rows], ["default", "paper"])
        for row in rows:
            self.assertEqual((row["frames"], row["exit_code"]), (30, 0))
            self.assertLess(row["ate_rmse_m"], 0.05)
        for name in ["accuracy.csv", "accuracy.json", "accuracy.md", "calibration.csv", "ate.png"]:
            self.assertTrue((self.out / name).is_file(), name)
        self.assertEqual(len(read_csv(self.out / "calibration.csv")), 1 + 2 * 30)


if __name__ == "__main__":
    unittest.main(argv=sys.argv[:1] + sys.argv[4:], verbosity=2)
