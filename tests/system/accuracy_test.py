#!/usr/bin/env python3
"""A small form of `stillmap bench accuracy`: short, small scenes with both presets, against loose bars.

    accuracy_test.py PROGRAM SOURCE_ROOT

The bars are loose since a view of 160x120 has a sixteenth of the pixels and a scene of seconds has no time to settle;
what they catch is a tracker or a mask that broke. A bar is NAME: (smallest, largest).
"""

import json
import subprocess
import sys
import tempfile

PROGRAM, ROOT = sys.argv[1:3]
EVERYWHERE = {"declared_loss": (0, 0), "static_masked": (0, 0.03), "ghosts": (0, 0.01), "completeness": (0.85, 1)}
SCENES = {
    "static,seconds=1.5": {"ate_rmse_m": (0, 0.008), "undeclared_loss": (0, 0), "frames": (45, 45)},
    "crowd,seconds=2.5": {"ate_rmse_m": (0, 0.035), "undeclared_loss": (0, 5), "mask_iou": (0.75, 1), "frames": (75, 75)},
}


def run():
    sources = [word for scene in SCENES for word in ("--source", "synthetic:" + scene)]
    with tempfile.TemporaryDirectory(prefix="stillmap-accuracy-") as out:
        done = subprocess.run([PROGRAM, "bench", "accuracy", *sources, "--size", "160x120", "--json", "--out", out],
                              capture_output=True, text=True, cwd=ROOT)
    if done.returncode != 0:
        sys.exit(f"bench accuracy ended with {done.returncode}\n{done.stdout}{done.stderr}")
    return json.loads(done.stdout)["runs"]


def main():
    runs = run()
    misses = []
    expected = [(scene, preset) for scene in SCENES for preset in ("default", "paper")]
    if [(row["scene"], row["preset"]) for row in runs] != expected:
        misses.append(f"expected the runs {expected}")
    for row in runs:
        for name, (low, high) in {**EVERYWHERE, **SCENES[row["scene"]]}.items():
            value = row[name]
            held = value is not None and low <= value <= high
            print(f"{'held  ' if held else 'MISSED'} {row['scene']:<20} {row['preset']:<8} {name:<16} {value} in {low}..{high}")
            if not held:
                misses.append(f"{row['scene']}, {row['preset']}: {name} is {value}, expected {low} to {high}")
    if misses:
        sys.exit("\n".join(misses))


if __name__ == "__main__":
    main()
