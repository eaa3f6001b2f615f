#!/usr/bin/env python3
"""What is in the map at the end: the box that was put down and stays, not the box that was carried off, nobody of a crowd.

    what_stays_test.py PROGRAM SOURCE_ROOT
"""

import math
import sys
import tempfile
from pathlib import Path

from map_scenes import NEAR_M, ghosts, points_of, run

SIZE = ",size=160x120"


class Grid:
    """Points by the cell of `edge_m` that they lie in."""

    def __init__(self, points, edge_m):
        self.edge_m, self.cells = edge_m, {}
        for p in points:
            self.cells.setdefault(self.cell(p), []).append(p)

    def cell(self, p):
        return tuple(math.floor(x / self.edge_m) for x in p)

    def has_near(self, p):
        """Whether a point lies within `edge_m`."""
        x, y, z = self.cell(p)
        return any(math.dist(p, q) < self.edge_m
                   for i in (-1, 0, 1) for j in (-1, 0, 1) for k in (-1, 0, 1)
                   for q in self.cells.get((x + i, y + j, z + k), ()))


def share_of_put_down_box(folder):
    """Of the side of the box that faces the camera: how much is in the mesh."""
    with_box = run(folder / "placing", "placing_box" + SIZE)
    without = run(folder / "without", "placing_box-static" + SIZE, "--max-frames", "2")
    before = Grid(points_of(without / "truth_cloud.ply"), 0.05)
    nearest_first = sorted(points_of(with_box / "truth_cloud.ply"), key=lambda p: p[2])
    box = [p for p in nearest_first if p[2] < 2.2 and abs(p[0]) < 0.6 and not before.has_near(p)]
    front = [p for p in box if p[2] < box[0][2] + 0.08]
    mesh = Grid(points_of(with_box / "mesh.ply"), NEAR_M)
    return sum(mesh.has_near(p) for p in front) / len(front), len(front)


def main():
    misses = []
    with tempfile.TemporaryDirectory(prefix="stillmap-what-stays-") as name:
        share, count = share_of_put_down_box(Path(name))
        print(f"placing_box: {share:.3f} of {count} points of the box's front are in the mesh")
        if count < 500 or share < 0.95:
            misses.append(f"placing_box: {share:.3f} of {count} points, expected 0.95 of 500 or more")
        for scene in ["removing_box", "crowd"]:
            share = ghosts(run(Path(name) / scene, scene + SIZE))
            print(f"{scene}: {100 * share:.3f} % of the mesh is far from what stands there at the end")
            if share > 0.0005:
                misses.append(f"{scene}: {100 * share:.3f} % of the mesh, expected 0.05 % or less")
    if misses:
        sys.exit("\n".join(misses))


if __name__ == "__main__":
    main()
