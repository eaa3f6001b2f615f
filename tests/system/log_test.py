#!/usr/bin/env python3
"""The event log as it is on a robot: killed, on a full disk, played by LCM's own program, replayed.

    log_test.py PROGRAM LOG_LOAD [--kills N]    N: random kill -9 (20; by hand 1000)
"""

import argparse
import json
import os
import random
import shutil
import signal
import subprocess
import sys
import tempfile
import time
from pathlib import Path

SCENE = "synthetic:loop,size=80x60,odometry=1"
SHORT = "synthetic:loop,size=80x60,odometry=1,seconds=4"
RESTART_S = 2.0


def call(*words, **more):
    done = subprocess.run([str(w) for w in words], capture_output=True, text=True, timeout=600, **more)
    assert done.returncode == 0, f"{' '.join(map(str, words))}: {done.returncode}\n{done.stdout}{done.stderr}"
    return done


def test_kills(load, folder, kills):
    """Whatever the moment: every event that was accepted is readable, and the next run starts at once."""
    seed = int(os.environ.get("STILLMAP_SEED", "1"))
    rng = random.Random(seed)
    log, counter = folder / "log", folder / "counter"
    slowest, events = 0.0, 0
    for kill in range(kills):
        began = time.monotonic()
        writer = subprocess.Popen([load, "write", log, counter], stdout=subprocess.PIPE, text=True)
        assert writer.stdout.readline() == "writing\n", f"seed {seed}, kill {kill}: does not start"
        slowest = max(slowest, time.monotonic() - began)
        time.sleep(rng.uniform(0, 0.08))
        writer.send_signal(signal.SIGKILL)
        writer.wait()
        writer.stdout.close()
        events += int(call(load, "check", log, counter).stdout.split()[0])
        open_files = list(log.glob("*.part"))
        assert len(open_files) <= 1, f"seed {seed}, kill {kill}: {open_files} were not taken over"
        held = sum(file.stat().st_size for file in log.iterdir())
        assert held <= 2000000, f"seed {seed}, kill {kill}: {held} bytes"
    assert slowest < RESTART_S, f"a restart took {slowest:.2f} s"
    assert events > 20 * kills, f"only {events} events were written"
    print(f"{kills} kills: {events} events, the slowest start took {slowest:.2f} s")


def test_full_disk(load, folder):
    """A disk of its own that is too small, in a name space of its own."""
    disk = folder / "disk"
    disk.mkdir()
    script = (f"mount -t tmpfs -o size=4m none '{disk}' && head -c 2000000 /dev/zero > '{disk}/ballast' && "
              f"'{load}' fill '{disk}/log' '{disk}/ballast'")
    unshare = ["unshare", "-m"] if os.geteuid() == 0 else ["unshare", "-rm"]
    probe = subprocess.run([*unshare, "mount", "-t", "tmpfs", "none", str(disk)], capture_output=True)
    if probe.returncode != 0:
        print("full disk: not run, this machine allows no mounts (a unit test has its own)")
        return
    done = call(*unshare, "sh", "-c", script)
    assert "No space left" in done.stdout, done.stdout
    print(f"full disk: {done.stdout.strip()}")


def test_logplayer(log, folder):
    """LCM's player reads every event: what it plays into another log is the same."""
    player = shutil.which("lcm-logplayer")
    if not player:
        print("lcm-logplayer: not run, it is not installed (liblcm-bin)")
        return
    played = folder / "played.lcm"
    call(player, "-s", "100", "-l", f"file://{played}?mode=w", log)
    ours, theirs = events_of(log), events_of(played)
    assert len(ours) > 20 and ours == theirs, f"{len(ours)} events, {len(theirs)} were played"
    print(f"lcm-logplayer: {len(ours)} events")


def events_of(path):
    """Channel and payload of each event, by the format's description."""
    content, events, at = path.read_bytes(), [], 0
    while at < len(content):
        assert content[at:at + 4] == b"\xed\xa1\xda\x01", f"{path}: no event at {at}"
        name = int.from_bytes(content[at + 20:at + 24], "big")
        data = int.from_bytes(content[at + 24:at + 28], "big")
        at += 28
        events.append((content[at:at + name], content[at + name:at + name + data]))
        at += name + data
    return events


def replayed(program, log, out):
    call(program, "replay", log, "--out", out, "--quiet")
    return (out / "trajectory.txt").read_bytes()


def test_replay(program, load, folder):
    """The live run's trajectory to the byte: with odometry, frames left out, work shed, a new map, an archive."""
    live = folder / "live"
    live.mkdir()
    about = json.loads(call(load, "run", live, SCENE, "lossless").stdout)
    print(f"live run: {about}")
    assert about["frames"] > 100 and about["with_odometry"] > 100 and about["files"] > 1, about
    assert about["stored"] > 0 and about["restored"] > 0, about
    expected = (live / "trajectory.txt").read_bytes()
    first = live / "log-000001.lcm"
    assert replayed(program, first, folder / "replay") == expected, "replay differs from the live run"

    # The same with a piece missing: it is said, and nothing hangs.
    content = bytearray(first.read_bytes())
    content[len(content) // 2] ^= 1
    first.write_bytes(content)
    done = call(program, "replay", live, "--out", folder / "damaged", "--quiet")
    assert "the poses may differ from those of the live run" in done.stderr, done.stderr
    return first


def test_jpeg(program, load, folder):
    live = folder / "jpeg"
    live.mkdir()
    call(load, "run", live, SHORT, "jpeg")
    once = replayed(program, live, folder / "jpeg1")
    assert once == replayed(program, live, folder / "jpeg2"), "two replays of the same log differ"


def test_source(program, folder):
    """A log is a source like others."""
    done = call(program, "run", "--source", f"log:{folder / 'jpeg' / 'log-000001.lcm'}", "--out", folder / "source",
                "--quiet", "--set", "map.voxel_m=0.03", "--set", "map.truncation_m=0.12")
    assert (folder / "source" / "trajectory.txt").read_text().count("\n") > 80, done.stdout


def main():
    parser = argparse.ArgumentParser()
    parser.add_argument("program")
    parser.add_argument("load")
    parser.add_argument("--kills", type=int, default=20)
    options = parser.parse_args()
    program, load = os.path.abspath(options.program), os.path.abspath(options.load)
    with tempfile.TemporaryDirectory(prefix="stillmap-log-") as name:
        folder = Path(name)
        test_kills(load, folder, options.kills)
        test_full_disk(load, folder)
        first = test_replay(program, load, folder)
        test_jpeg(program, load, folder)
        test_logplayer(folder / "jpeg" / first.name, folder)
        test_source(program, folder)


if __name__ == "__main__":
    sys.exit(main())
