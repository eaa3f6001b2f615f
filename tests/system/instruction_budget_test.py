#!/usr/bin/env python3
"""Instructions that the pipeline takes for a short fixed input, counted by callgrind: no noise, no quiet machine needed.

    instruction_budget_test.py PROGRAM SOURCE_ROOT COMPILER           fails above a stored budget by more than 3 %
    instruction_budget_test.py PROGRAM SOURCE_ROOT COMPILER --renew   writes what was counted as the new budget

COMPILER names what the counts depend on ("GNU-12 x86_64"); without a budget for it the test is skipped. One thread,
the AVX2 loops, reading and rendering of the pictures not counted.
"""

import json
import os
import re
import shutil
import subprocess
import sys
import tempfile
from pathlib import Path

PROGRAM, ROOT, COMPILER = sys.argv[1:4]
RENEW = "--renew" in sys.argv[4:]
BUDGETS = Path(ROOT) / "tests/system/instruction_budget.json"
FRAMES = 8
TOLERANCE = 0.03
SKIPPED = 77
PRESETS = ["default", "paper"]


def instructions_a_frame(preset):
    with tempfile.TemporaryDirectory() as folder:
        count = Path(folder) / "callgrind.out"
        command = ["valgrind", "--tool=callgrind", f"--callgrind-out-file={count}", "--collect-atstart=no",
                   "--toggle-collect=stillmap::Pipeline::process(*", PROGRAM, "run",
                   "--config", f"{ROOT}/config/presets/{preset}.toml", "--source", "synthetic:crowd,size=160x120",
                   "--max-frames", str(FRAMES), "--threads", "1", "--quiet", "--set", "map.voxel_m=0.02"]
        done = subprocess.run(command, capture_output=True, text=True, env={**os.environ, "STILLMAP_ISA": "avx2"})
        if done.returncode != 0:
            sys.exit(f"{' '.join(command)} ended with {done.returncode}\n{done.stdout}{done.stderr}")
        total = int(re.search(r"^(?:totals|summary): (\d+)", count.read_text(), re.MULTILINE).group(1))
    if total == 0:
        sys.exit("nothing was counted: is Pipeline::process still what handles a frame?")
    return total // FRAMES


def main():
    if not shutil.which("valgrind"):
        print("skipped: there is no valgrind here (toolchain/setup.sh installs it)")
        return SKIPPED
    budgets = json.loads(BUDGETS.read_text())
    if not RENEW and COMPILER not in budgets:
        print(f"skipped: no budget for {COMPILER}, only for {', '.join(budgets)}; --renew writes one")
        return SKIPPED
    counted = {preset: instructions_a_frame(preset) for preset in PRESETS}
    if RENEW:
        budgets[COMPILER] = counted
        BUDGETS.write_text(json.dumps(budgets, indent=2) + "\n")
    failed = False
    for preset, now in counted.items():
        budget = budgets[COMPILER][preset]
        too_many = now > (1 + TOLERANCE) * budget
        failed |= too_many
        print(f"{preset}: {now} instructions a frame, budget {budget} ({now / budget - 1:+.1%})"
              + (" TOO MANY; if that is meant: --renew" if too_many else ""))
    return 1 if failed else 0


if __name__ == "__main__":
    sys.exit(main())
