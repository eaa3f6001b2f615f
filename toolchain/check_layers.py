#!/usr/bin/env python3
"""Checks the order of the folders and what may stand in them. Exit 0: all well; 1: every violation, one a line.

    check_layers.py [ROOT]       the tree (default: the one this file is in)
    check_layers.py --self-test  a tree with every kind of violation has to be refused, a good one accepted
"""

import pathlib
import re
import sys
import tempfile

# A folder includes itself and what stands to its left.
LAYERS = ["kernels", "config", "runtime", "drivers", "firmware-like"]
SUFFIXES = {".hpp", ".cpp", ".cu", ".cuh", ".h", ".inc"}

# Header of the hardware's library: the folder whose .cpp files alone may include it.
HARDWARE = [
    (re.compile(r"OpenNI|Driver/OniDriver|openni2/"), "drivers/openni2"),
    (re.compile(r"linux/videodev2\.h|libv4l2"), "drivers/v4l2"),
    (re.compile(r"gpiod\.h|linux/gpio\.h"), "drivers/gpio"),
    (re.compile(r"lcm/|lcm-cpp|lcm\.h"), "drivers/lcm"),
]

# Words that allocate, refused in kernels/ outside backend/.
ALLOCATING = [
    (re.compile(r"\bnew\b(?!\s*\()"), "new"),
    (re.compile(r"\b(?:malloc|calloc|realloc|aligned_alloc|posix_memalign|cudaMalloc\w*)\s*\("), "malloc family"),
    (re.compile(r"\bstd::(?:vector|string|map|unordered_map|deque|list|function)\b"), "allocating container"),
    (re.compile(r"\bstd::make_(?:unique|shared)\b"), "make_unique"),
]
# Files that may allocate all the same, with the reason.
MAY_ALLOCATE: dict[str, str] = {}

INCLUDE = re.compile(r'^\s*#\s*include\s*([<"])([^>"]+)[>"]', re.MULTILINE)


def without_comments_and_strings(text: str) -> str:
    """Keeps the line count."""
    pattern = re.compile(r'//[^\n]*|/\*.*?\*/|"(?:\\.|[^"\\\n])*"|\'(?:\\.|[^\'\\\n])+\'', re.DOTALL)
    return pattern.sub(lambda m: "\n" * m.group(0).count("\n"), text)


def check_include(path: str, layer: str, header: str, quoted: bool) -> list[str]:
    problems = []
    target = header.split("/")[0]
    if quoted and target in LAYERS and LAYERS.index(target) > LAYERS.index(layer):
        problems.append(f"{layer} must not include {target}: {header}")
    if quoted and target == "tests":
        problems.append(f"product code must not include tests: {header}")
    if quoted and (header.startswith(".") or "/" not in header):
        problems.append(f"include from the repository root, not '{header}'")
    if header.startswith("Eigen/") and layer == "kernels" and not path.endswith(".cpp"):
        problems.append("Eigen belongs into host .cpp files only: the header is shared by both engines")
    for pattern, home in HARDWARE:
        if target not in LAYERS and pattern.search(header) and not (path.startswith(home + "/") and path.endswith(".cpp")):
            problems.append(f"{header} may be included in the .cpp files of {home}/ only")
    return problems


def check_file(root: pathlib.Path, file: pathlib.Path) -> list[str]:
    path = file.relative_to(root).as_posix()
    layer = path.split("/")[0]
    text = file.read_text(encoding="utf-8")
    problems = []

    def add(position: int, what: str) -> None:
        problems.append(f"{path}:{text.count(chr(10), 0, position) + 1}: {what}")

    for match in INCLUDE.finditer(text):
        for what in check_include(path, layer, match.group(2), match.group(1) == '"'):
            add(match.start(2), what)
    if file.suffix in {".hpp", ".h", ".cuh"} and "#pragma once" not in text:
        add(0, "a header starts with #pragma once")
    if "__CUDACC__" in text and path != "kernels/base/hd.hpp":
        add(text.index("__CUDACC__"), "only kernels/base/hd.hpp looks at __CUDACC__")
    if layer == "kernels" and not path.startswith("kernels/backend/") and path not in MAY_ALLOCATE:
        bare = without_comments_and_strings(text)
        for pattern, name in ALLOCATING:
            for match in pattern.finditer(bare):
                line = bare.count("\n", 0, match.start()) + 1
                problems.append(f"{path}:{line}: {name} in kernels/ belongs into backend/*/ (arena or buffer)")
    return problems


def check_tree(root: pathlib.Path) -> list[str]:
    problems = []
    for layer in LAYERS:
        for file in sorted((root / layer).rglob("*")):
            if file.suffix in SUFFIXES and file.is_file():
                problems += check_file(root, file)
    return problems


BAD = {
    "kernels/a.hpp": ('#pragma once\n#include "config/config.hpp"\n', "kernels must not include config"),
    "kernels/b.hpp": ("#pragma once\n#include <Eigen/Core>\n", "Eigen belongs"),
    "kernels/c.cpp": ("int* f() { return new int; }\n", "new in kernels/"),
    "kernels/d.cpp": ("#include <vector>\nstd::vector<int> v;\n", "allocating container"),
    "kernels/e.cpp": ("#include <cstdlib>\nvoid* f() { return std::malloc(1); }\n", "malloc family"),
    "kernels/f.cpp": ("#ifdef __CUDACC__\n#endif\n", "__CUDACC__"),
    "config/a.cpp": ('#include "runtime/core/version.hpp"\n', "config must not include runtime"),
    "runtime/a.cpp": ('#include "drivers/registry.hpp"\n', "runtime must not include drivers"),
    "runtime/b.cpp": ("#include <lcm/lcm-cpp.hpp>\n", "drivers/lcm/ only"),
    "runtime/d.cpp": ('#include "lcm/lcm.h"\n', "drivers/lcm/ only"),
    "runtime/c.hpp": ("int x;\n", "#pragma once"),
    "drivers/a.cpp": ('#include "firmware-like/boot.hpp"\n', "drivers must not include firmware-like"),
    "drivers/v4l2/a.hpp": ("#pragma once\n#include <linux/videodev2.h>\n", "drivers/v4l2/ only"),
    "drivers/v4l2/b.cpp": ("#include <gpiod.h>\n", "drivers/gpio/ only"),
    "drivers/v4l2/c.cpp": ("#include <OpenNI.h>\n", "drivers/openni2/ only"),
    "firmware-like/a.cpp": ('#include "command.hpp"\n', "from the repository root"),
    "firmware-like/b.cpp": ('#include "tests/x.hpp"\n', "must not include tests"),
}
GOOD = {
    "kernels/a.hpp": '#pragma once\n// a new block, std::vector\n#include "kernels/base/hd.hpp"\n',
    "kernels/base/hd.hpp": "#pragma once\n#if defined(__CUDACC__)\n#endif\n",
    "kernels/solve.cpp": '#include <Eigen/Core>\n',
    "kernels/backend/cpu/arena.cpp": "char* f() { return new char[9]; }\n",
    "runtime/a.cpp": '#include <vector>\n#include "config/config.hpp"\nstd::vector<int> v;\n',
    "drivers/v4l2/a.cpp": '#include <linux/videodev2.h>\n#include "runtime/ports/frame_source.hpp"\n',
    "drivers/v4l2/b.cpp": '#include "drivers/lcm/sink.hpp"\n',
    "firmware-like/a.cpp": '#include "drivers/registry.hpp"\n',
}


def self_test() -> int:
    failures = 0
    with tempfile.TemporaryDirectory() as folder:
        for name, (text, expected) in BAD.items():
            root = pathlib.Path(folder) / name.replace("/", "_")
            (root / name).parent.mkdir(parents=True)
            (root / name).write_text(text)
            found = check_tree(root)
            if len(found) != 1 or expected not in found[0] or not found[0].startswith(name + ":"):
                print(f"self-test: {name}: expected one violation with '{expected}', found {found}")
                failures += 1
        root = pathlib.Path(folder) / "good"
        for name, text in GOOD.items():
            (root / name).parent.mkdir(parents=True, exist_ok=True)
            (root / name).write_text(text)
        if found := check_tree(root):
            print(f"self-test: the good tree is refused: {found}")
            failures += 1
    print(f"self-test: {len(BAD) + 1 - failures} of {len(BAD) + 1} trees judged right")
    return 1 if failures else 0


def main() -> int:
    if sys.argv[1:] == ["--self-test"]:
        return self_test()
    root = pathlib.Path(sys.argv[1]) if len(sys.argv) > 1 else pathlib.Path(__file__).resolve().parent.parent
    problems = check_tree(root)
    for problem in problems:
        print(problem)
    print(f"layers: {len(problems)} violations" if problems else "layers: good")
    return 1 if problems else 0


if __name__ == "__main__":
    sys.exit(main())
