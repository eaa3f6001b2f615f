#!/usr/bin/env bash
# Installs what is missing, builds, maps the built-in synthetic room with people in it, shows the result.
set -euo pipefail
cd "$(dirname "$0")/.."

toolchain/setup.sh
[[ -f build/release/build.ninja ]] || cmake --preset release >/dev/null
cmake --build build/release --target stillmap

stillmap=build/release/stillmap
out=out/demo
source=synthetic:crowd
if [[ ! -f $out/demo-done || $stillmap -nt $out/demo-done ]]; then
  $stillmap run --source "$source" --out "$out"
  $stillmap picture "$out"
  touch "$out/demo-done"
fi

echo
echo "== trajectory against the truth"
$stillmap evaluate ate --truth "$out/truth.txt" --estimate "$out/trajectory.txt"
echo
echo "== mesh against the room without the people"
$stillmap evaluate model --truth "$out/truth_cloud.ply" --mesh "$out/mesh.ply"
echo
echo "mesh:     $PWD/$out/mesh.ply"
find "$PWD/$out" -maxdepth 2 -name '*.png' -not -path '*/previous-*' -not -path '*/snapshots/*' -not -path '*/masks*' |
  sort | sed 's/^/picture:  /'
if [[ -n "${DISPLAY:-}${WAYLAND_DISPLAY:-}" ]] && command -v xdg-open >/dev/null; then
  first=$(find "$out" -maxdepth 2 -name '*trajectory*.png' -not -path '*/previous-*' | head -n 1)
  [[ -z "$first" ]] || (xdg-open "$first" >/dev/null 2>&1 &)
fi
