#!/usr/bin/env bash
# gpu_check.sh [OUT]: on a machine with an NVIDIA GPU, builds both engines, compares them, times the steps of a
# frame, and runs compute-sanitizer over them. Needs CMake, nvcc, g++ and nothing else; ends within eight minutes
# on 16 cores. Into OUT (build/gpu_check): summary.txt, and beside it all that was printed.
#   STILLMAP_NVCC, CUDA_HOME  where nvcc is not found by itself
#   STILLMAP_EIGEN            a copy of Eigen's headers, only when a source asks for them
# Exit 0: everything passed. 1: something failed. 3: there is no GPU here, or no nvcc; it says which.
set -uo pipefail
cd "$(dirname "$0")/.."
out=${1:-build/gpu_check}
mkdir -p "$out"
out=$(cd "$out" && pwd)
build=build/gpu
limit_s=480
: >"$out/summary.txt"
say() { echo "$*" | tee -a "$out/summary.txt"; }
left() { echo $((limit_s - SECONDS)); }

nvcc=${STILLMAP_NVCC:-$(command -v nvcc || ls "${CUDA_HOME:-/usr/local/cuda}/bin/nvcc" 2>/dev/null || true)}
if [[ -z "$nvcc" ]]; then
  say "skip: no nvcc; set STILLMAP_NVCC or CUDA_HOME"
  exit 3
fi
tools=$(dirname "$nvcc")

# The GPU at hand: only its code is made, which is faster.
capability=$(nvidia-smi --query-gpu=compute_cap --format=csv,noheader 2>/dev/null | head -1 | tr -d '. ' || true)
if [[ -z "$capability" && ! -e /dev/nvgpu && ! -e /dev/nvhost-gpu && ! -e /dev/nvidiactl ]]; then
  say "skip: no GPU answers"
  exit 3
fi
architecture=()
[[ -n "$capability" ]] && architecture=("-DSTILLMAP_CUDA_ARCHITECTURES=$capability")
{
  date -u
  git rev-parse HEAD 2>/dev/null
  "$nvcc" --version | tail -2
  nvidia-smi 2>/dev/null || cat /proc/device-tree/model 2>/dev/null
  nproc
} >"$out/machine.txt"

failed=0
# part NAME SECONDS COMMAND...: runs it with what time is left, at most SECONDS.
part() {
  local name=$1 most=$2 from=$SECONDS rc
  shift 2
  local time=$(($(left) < most ? $(left) : most))
  if ((time < 5)); then
    say "NOT RUN $name: out of time"
    failed=1
    return
  fi
  timeout "$time" "$@" >"$out/$name.txt" 2>&1
  rc=$?
  if ((rc == 0)); then
    say "ok $name ($((SECONDS - from)) s)"
  else
    say "FAIL $name: exit $rc ($((SECONDS - from)) s), see $name.txt"
    failed=1
  fi
}

part configure 60 cmake -S . -B "$build" -DSTILLMAP_PARITY_ONLY=ON -DSTILLMAP_CUDA=ON "-DSTILLMAP_NVCC=$nvcc" \
  ${STILLMAP_EIGEN:+"-DEIGEN3_INCLUDE_DIR=$STILLMAP_EIGEN"} "${architecture[@]}"
part build 240 cmake --build "$build" -j "$(nproc)"
if ((failed)); then
  say "nothing was run: it was not built"
  exit 1
fi

part parity 120 "$build/stillmap_parity"
if grep -q '^skip cuda' "$out/parity.txt"; then
  say "FAIL parity: $(grep '^skip cuda' "$out/parity.txt")"
  failed=1
fi
part times 90 "$build/stillmap_step_times" --engine cuda --frames 150 \
  --preset config/presets/default.toml --preset config/presets/paper.toml
part times_cpu 60 "$build/stillmap_step_times" --engine cpu --frames 40

if [[ -x "$tools/compute-sanitizer" ]]; then
  for scene in static crowd; do
    for tool in memcheck racecheck initcheck synccheck; do
      part "$tool-$scene" 60 "$tools/compute-sanitizer" --tool "$tool" --error-exitcode 9 \
        "$build/stillmap_step_times" --engine cuda --scene "$scene" --size 320x240 --frames 30 --warm 1
    done
  done
else
  say "NOT RUN compute-sanitizer: it is not beside nvcc"
  failed=1
fi

# What is launched in a frame, and what it moves, as far as the profilers are there and may read the counters.
if command -v nsys >/dev/null || [[ -x "$tools/nsys" ]]; then
  part launches 60 "$(command -v nsys || echo "$tools/nsys")" profile --stats=true --cuda-graph-trace=node \
    --force-overwrite=true -o "$out/launches" "$build/stillmap_step_times" --engine cuda --frames 30
else
  say "NOT RUN launches: no nsys"
fi
if command -v ncu >/dev/null || [[ -x "$tools/ncu" ]]; then
  part sectors 90 "$(command -v ncu || echo "$tools/ncu")" --csv --graph-profiling node \
    --metrics gpu__time_duration.sum,dram__bytes.sum,lts__t_sectors.sum,smsp__sass_thread_inst_executed_op_ffma_pred_on.sum \
    --launch-skip 400 --launch-count 120 "$build/stillmap_step_times" --engine cuda --frames 24 --warm 1
else
  say "NOT RUN sectors: no ncu"
fi

cat "$out/times.txt" "$out/times_cpu.txt" >>"$out/summary.txt" 2>/dev/null
if ((failed)); then say "FAILED after $SECONDS s, results in $out"; else say "passed in $SECONDS s, results in $out"; fi
exit "$failed"
