#!/usr/bin/env python3
"""How old poses are when their datagrams come, on a machine that does nothing else: the virtual machine, whose clock counts
instructions and knows nothing of what else this machine does.

    pose_age_test.py STILLMAP LCM_PROBE VIRTUAL_CAMERA_TOOL OPENNI2_FOLDER SOURCE_ROOT [FRAMES]

Exit: 0 good, 77 there is no virtual machine here, else failed.
"""

import os
import pathlib
import re
import subprocess
import sys
import tempfile

STILLMAP, PROBE, CAMERA_TOOL, OPENNI2, ROOT = (pathlib.Path(path).resolve() for path in sys.argv[1:6])
FRAMES = int(sys.argv[6]) if len(sys.argv) > 6 else 60
WARM_UP = 10             # lcm_probe leaves these out
MOST_BEYOND_WORK_MS = 2  # 99 % of the poses
MOST_SPREAD_MS = 0.5     # of that, 1 to 99 %


def main():
    with tempfile.TemporaryDirectory(prefix="stillmap-age-") as folder:
        images = pathlib.Path(folder) / "images"
        subprocess.run([CAMERA_TOOL, "render", f"static,size=64x48,seconds={FRAMES / 30 + 2}", images, str(FRAMES + 20)],
                       check=True, stdout=subprocess.DEVNULL)
        # An instruction takes a nanosecond: the fastest that this machine can be.
        done = subprocess.run([ROOT / "toolchain/vm/run.sh", ROOT / "tests/system/vm_pose_age.sh", STILLMAP, PROBE, OPENNI2, images,
                               str(FRAMES)], capture_output=True, text=True,
                              env={**os.environ, "STILLMAP_VM_SHIFT": "0", "STILLMAP_VM_TIMEOUT_S": "600"})
    print(done.stdout, done.stderr, sep="")
    if done.returncode:
        return done.returncode
    said = re.search(r"poses (\d+) age_ms (\S+) p99 (\S+) beyond_work_ms (\S+) p99 (\S+) spread_ms (\S+)", done.stdout)
    if not said:
        return 1
    poses, beyond_work_ms, spread_ms = int(said[1]), float(said[5]), float(said[6])
    good = poses >= FRAMES - WARM_UP - 1 and 0 < beyond_work_ms <= MOST_BEYOND_WORK_MS and spread_ms < MOST_SPREAD_MS
    if not good:
        print(f"expected {FRAMES - WARM_UP} poses, at most {MOST_BEYOND_WORK_MS} ms beyond work, a spread below {MOST_SPREAD_MS} ms")
    return 0 if good else 1


sys.exit(main())
