"""What tests of the finished map share: a synthetic scene is run, and its mesh is read and judged.

The test is called with the program and the root of the sources: TEST PROGRAM SOURCE_ROOT.
"""

import json
import struct
import subprocess
import sys

PROGRAM, ROOT = sys.argv[1:3]
SETTINGS = ["--set", "map.voxel_m=0.02", "--set", "record.snapshots=0", "--quiet"]
NEAR_M = 0.03  # a voxel and a half


def stillmap(*arguments):
    done = subprocess.run([PROGRAM, *map(str, arguments)], capture_output=True, text=True, cwd=ROOT)
    if done.returncode != 0:
        sys.exit(f"{' '.join(map(str, arguments))} ended with {done.returncode}\n{done.stdout}{done.stderr}")
    return done.stdout


def run(out, scene, *more):
    stillmap("run", "--source", f"synthetic:{scene}", *SETTINGS, "--out", out, *more)
    return out


def ghosts(out):
    """Share of mesh.ply that lies far from what stands there at the end."""
    answer = stillmap("evaluate", "model", "--truth", out / "truth_cloud.ply", "--mesh", out / "mesh.ply", "--json")
    return json.loads(answer)["ghosts"]


def points_of(path):
    """Vertices of a binary PLY, metres."""
    data = path.read_bytes()
    start = data.index(b"end_header\n") + len(b"end_header\n")
    head = data[:start].decode()
    count = int(head.split("element vertex ")[1].split()[0])
    step = 15 if "uchar red" in head else 12
    return [struct.unpack_from("<fff", data, start + step * i) for i in range(count)]
