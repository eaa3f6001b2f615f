#!/usr/bin/env python3
"""Compares `stillmap evaluate ate|rpe` with evo (pip install evo) on generated trajectories.

usage: evo_cross_check.py PROGRAM
exit code: 0 all agree, 1 they differ, 77 evo is not installed (skipped)

ATE: SE(3) alignment without scale, all statistics, to 1e-6 m. RPE: evo counts in frames, so the trajectories have
a fixed rate, and Eq. 2 of Sturm et al. is compared, which evo uses (trans_eq2_* in our JSON); the pair that ends in
the last pose is left out, as in the benchmark's script.
"""
import json
import math
import os
import subprocess
import sys
import tempfile

try:
    import numpy as np
    from evo.core import metrics, sync
    from evo.core.units import Unit
    from evo.tools import file_interface
except ImportError as reason:
    print(f"skipped: evo cannot be imported ({reason})")
    sys.exit(77)

RATE_HZ = 30
TOLERANCE = 1e-6


def write_trajectory(path, stamps, positions, quaternions):
    with open(path, "w", encoding="ascii") as file:
        file.write("# stamp tx ty tz qx qy qz qw\n")
        for stamp, p, q in zip(stamps, positions, quaternions):
            file.write(f"{stamp:.6f} " + " ".join(f"{v:.12f}" for v in (*p, *q)) + "\n")


def quaternion(axis, angle):
    axis = np.asarray(axis) / np.linalg.norm(axis)
    return np.append(math.sin(angle / 2) * axis, math.cos(angle / 2))


def product(a, b):
    ax, ay, az, aw = a
    bx, by, bz, bw = b
    return np.array([aw * bx + ax * bw + ay * bz - az * by, aw * by - ax * bz + ay * bw + az * bx,
                     aw * bz + ax * by - ay * bx + az * bw, aw * bw - ax * bx - ay * by - az * bz])


def rotate(q, p):
    return product(product(q, np.append(p, 0)), np.array([-q[0], -q[1], -q[2], q[3]]))[:3]


def generate(folder, seed, start_s):
    """Truth and an estimate in another frame, with noise and drift; the estimate's stamps are off by some ms."""
    random = np.random.default_rng(seed)
    t = np.arange(300) / RATE_HZ
    positions = np.stack([1.5 * np.sin(0.5 * t), 0.2 * np.sin(1.7 * t), 0.9 * np.cos(0.4 * t)], axis=1)
    quaternions = [product(quaternion([0, 1, 0], 0.8 * math.sin(0.7 * s)), quaternion([1, 0, 0], 0.3 * math.cos(s)))
                   for s in t]
    write_trajectory(f"{folder}/truth.txt", start_s + t, positions, quaternions)
    frame_q, frame_t = quaternion(random.normal(size=3), 2.0), random.normal(size=3) * 5
    drift = np.cumsum(random.normal(size=(len(t), 3)) * 0.002, axis=0)
    noisy = [rotate(frame_q, p) + frame_t for p in positions + drift + random.normal(size=(len(t), 3)) * 0.005]
    turned = [product(product(frame_q, q), quaternion(random.normal(size=3), random.normal() * 0.01))
              for q in quaternions]
    write_trajectory(f"{folder}/estimate.txt", start_s + t + random.uniform(-0.004, 0.004), noisy, turned)


def ours(program, what, folder, *options):
    command = [program, "evaluate", what, "--truth", f"{folder}/truth.txt", "--estimate", f"{folder}/estimate.txt",
               "--json", *options]
    return json.loads(subprocess.run(command, check=True, capture_output=True, text=True).stdout)


def statistics(errors):
    return {"rmse": float(np.sqrt(np.mean(errors**2))), "mean": float(np.mean(errors)),
            "median": float(np.median(errors)), "std": float(np.std(errors)), "min": float(np.min(errors)),
            "max": float(np.max(errors))}


def compare(title, expected, got, prefix, unit, tolerance=TOLERANCE):
    worst = max(abs(expected[name] - got[f"{prefix}{name}_{unit}"]) for name in expected)
    agree = worst <= tolerance
    print(f"{title}: rmse evo {expected['rmse']:.9f}, ours {got[f'{prefix}rmse_{unit}']:.9f} {unit}; "
          f"largest difference {worst:.1e} {'ok' if agree else 'DIFFERS'}")
    return agree


def evo_rpe(truth, estimate, relation):
    metric = metrics.RPE(relation, delta=RATE_HZ, delta_unit=Unit.frames, all_pairs=True)
    metric.process_data((truth, estimate))
    return np.asarray(metric.error)[:-1]


def check(program, seed, start_s):
    with tempfile.TemporaryDirectory() as folder:
        generate(folder, seed, start_s)
        truth = file_interface.read_tum_trajectory_file(f"{folder}/truth.txt")
        estimate = file_interface.read_tum_trajectory_file(f"{folder}/estimate.txt")
        truth, estimate = sync.associate_trajectories(truth, estimate, max_diff=0.02)
        rpe = ours(program, "rpe", folder, "--delta-s", "1.0")
        good = compare(f"seed {seed} rpe translation", statistics(
            evo_rpe(truth, estimate, metrics.PoseRelation.translation_part)), rpe, "trans_eq2_", "m")
        good &= compare(f"seed {seed} rpe rotation", statistics(
            evo_rpe(truth, estimate, metrics.PoseRelation.rotation_angle_deg)), rpe, "rot_", "deg", 1e-5)
        estimate.align(truth, correct_scale=False)
        ate = metrics.APE(metrics.PoseRelation.translation_part)
        ate.process_data((truth, estimate))
        good &= compare(f"seed {seed} ate", statistics(np.asarray(ate.error)), ours(program, "ate", folder), "", "m")
        return good


def main():
    if len(sys.argv) != 2 or not os.access(sys.argv[1], os.X_OK):
        print(__doc__)
        return 2
    results = [check(sys.argv[1], seed, start_s) for seed, start_s in ((1, 0.0), (2, 1305031229.4331), (3, 1.5e9))]
    return 0 if all(results) else 1


if __name__ == "__main__":
    sys.exit(main())
