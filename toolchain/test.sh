#!/usr/bin/env bash
# Installs what is missing, builds, runs every test that this machine can run:
#   format, release build with all tests, unit tests under AddressSanitizer + UBSan, the thread pool's under
#   ThreadSanitizer, the kernels' for 64-bit ARM under emulation.  --tidy: clang-tidy over the whole tree as well (minutes).
#   --cross: all of the kernels' tests for 64-bit ARM, also the slow ones (minutes).
# A part that passed is not repeated until a source file changes.
set -euo pipefail
cd "$(dirname "$0")/.."

tidy=no
cross=no
for argument in "$@"; do
  case "$argument" in
    --tidy) tidy=yes ;;
    --cross) cross=yes ;;
    *) echo "test.sh: unknown argument '$argument'; only --tidy and --cross are known" >&2; exit 2 ;;
  esac
done

toolchain/setup.sh --lint
start=$SECONDS
parts=0
failed=()

# The state of every source file, and of the recordings that the system tests look at.
fingerprint() {
  {
    find . \( -path ./build -o -path ./out -o -path ./.git -o -name __pycache__ \) -prune -o -type f -print0 |
      sort -z | xargs -0 sha256sum
    ls -d ../shared/data/*/ 2>/dev/null || true
  } | sha256sum | cut -d' ' -f1
}
state=$(fingerprint)

# part NAME COMMAND...: runs it unless it passed for this very state of the files.
part() {
  local name=$1; shift
  parts=$((parts + 1))
  mkdir -p build/passed
  if [[ "$(cat "build/passed/$name" 2>/dev/null || true)" == "$state" ]]; then
    echo "== $name: passed before, nothing has changed"
    return
  fi
  echo "== $name"
  local from=$SECONDS
  local result=0
  "$@" || result=$?
  if [[ $result -eq 0 ]]; then
    echo "$state" >"build/passed/$name"
    echo "== $name: passed in $((SECONDS - from)) s"
  elif [[ $result -eq 77 ]]; then
    parts=$((parts - 1))
    echo "== $name: skipped"
  else
    rm -f "build/passed/$name"
    failed+=("$name")
    echo "== $name: FAILED"
  fi
}

jobs=$(nproc)
configure() { [[ -f build/$1/build.ninja ]] || cmake --preset "$1" >/dev/null; }
build() { configure "$1" && cmake --build "build/$1" -j "$jobs" ${2:+--target "$2"}; }

check_format() {
  find kernels config runtime drivers firmware-like tests \( -name '*.[ch]pp' -o -name '*.cu' -o -name '*.cuh' \) \
    -print0 | xargs -0 clang-format-14 --dry-run -Werror
}
# Tests that look at a clock come last, one at a time, and have three tries: a machine that is shared may stop for a tenth of
# a second in any of them. Under a sanitizer nothing is tried again: a race may show once in three runs.
release_tests() {
  build release || return 1
  local result=0
  ctest --test-dir build/release --output-on-failure -j "$jobs" -LE clock || result=1
  ctest --test-dir build/release --output-on-failure -L clock --repeat until-pass:3 || result=1
  return $result
}
asan_tests() {
  build asan unit_tests &&
    ASAN_OPTIONS=detect_stack_use_after_return=1:strict_string_checks=1 UBSAN_OPTIONS=print_stacktrace=1 \
      ctest --test-dir build/asan --output-on-failure -j "$jobs" -L unit
}
tsan_tests() {
  build tsan thread_tests &&
    TSAN_OPTIONS=halt_on_error=1 ctest --test-dir build/tsan --output-on-failure -L threads
}
tidy_tree() { configure tidy && cmake --build build/tidy -j "$jobs"; }

part format check_format
part release release_tests
part asan asan_tests
part tsan tsan_tests
[[ $tidy == no ]] || part tidy tidy_tree
if [[ $cross == yes ]]; then part cross toolchain/cross_build.sh --tests; else part cross toolchain/cross_build.sh --check; fi

echo
passed=$((parts - ${#failed[@]}))
echo "$((100 * passed / parts))% tests passed, ${#failed[@]} tests failed out of $parts${failed[*]:+: ${failed[*]}}"
echo "Total Test time (real) = $((SECONDS - start)) sec"
[[ ${#failed[@]} -eq 0 ]]
