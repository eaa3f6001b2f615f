#!/usr/bin/env bash
# Builds Stillmap for 64-bit ARM (Jetson and the like) on this machine.
#   cross_build.sh            build/aarch64/stillmap and the .deb for arm64
#   cross_build.sh --tests    the kernels' unit tests and the parity checks, run under emulation (ten minutes)
#   cross_build.sh --check    the kernels' unit tests but for the longest, and those of runtime/core and drivers/camera (three
#                             minutes); 77: not possible here
# The system root is unpacked from the distribution's arm64 packages into build/sysroot-arm64; nothing of this system changes but
# that the compiler and the emulator are installed.
set -euo pipefail
cd "$(dirname "$0")/.."

libraries=(
  libc6-dev libstdc++6 libeigen3-dev libfmt-dev libcli11-dev nlohmann-json3-dev libtomlplusplus-dev libnanoflann-dev
  libspng-dev libsystemd-dev libturbojpeg0-dev libzstd-dev libcairo2-dev libgpiod-dev libopenni2-dev liblcm-dev libgtest-dev
)
sysroot=$PWD/build/sysroot-arm64
apt=$PWD/build/apt-arm64

# apt with sources, lists and packages of its own: as on an empty ARM machine of this distribution.
apt_arm64() {
  apt-get -qq -o APT::Architecture=arm64 -o APT::Architectures::=arm64 -o Dir::State="$apt/state" -o Dir::Cache="$apt/cache" \
    -o Dir::State::status="$apt/state/status" -o Dir::Etc::sourcelist="$apt/sources.list" -o Dir::Etc::sourceparts=- \
    -o APT::Install-Recommends=false -o APT::Sandbox::User=root -o Debug::NoLocking=1 "$@"
}
write_sources() {
  . /etc/os-release
  if [[ $ID == ubuntu ]]; then
    local mirror=http://ports.ubuntu.com/ubuntu-ports
    for pocket in "" -updates; do echo "deb [signed-by=/usr/share/keyrings/ubuntu-archive-keyring.gpg] $mirror $VERSION_CODENAME$pocket main universe"; done
  else
    local mirror=http://deb.debian.org/debian
    for pocket in "" -updates; do echo "deb [signed-by=/usr/share/keyrings/debian-archive-keyring.gpg] $mirror $VERSION_CODENAME$pocket main"; done
  fi
}
make_sysroot() {
  local wanted
  wanted=$(printf '%s\n' "${libraries[@]}" | sha256sum)
  [[ "$(cat "$sysroot/made-of" 2>/dev/null || true)" == "$wanted" ]] && return
  echo "cross_build.sh: unpacking the libraries for arm64"
  rm -rf "$sysroot" "$apt"
  mkdir -p "$sysroot" "$apt"/state/lists/partial "$apt"/cache/archives/partial
  touch "$apt/state/status"
  write_sources >"$apt/sources.list"
  apt_arm64 update
  # What these need in turn; programs among it (Python, Perl for scripts of -dev packages) are not unpacked.
  apt_arm64 -s install "${libraries[@]}" | awk '/^Inst/ {print $2}' | sed 's/:.*//' | sort -u |
    grep -E '^lib|-dev$|^zlib|^linux-libc-dev$|^x11proto|^uuid-dev$|^xtrans' |
    grep -vE '^libpython|^libperl|^libdpkg|-perl$|-common$|^libicu|^libxml2' >"$apt/names"
  (cd "$apt/cache/archives" && apt_arm64 download $(cat "$apt/names"))
  for package in "$apt"/cache/archives/*.deb; do dpkg-deb -x "$package" "$sysroot"; done
  # Absolute links (libz.so and the like) lead into the root, not out of it.
  find "$sysroot" -type l -lname '/*' | while read -r link; do
    ln -sfn "$sysroot$(readlink "$link")" "$link"
  done
  echo "$wanted" >"$sysroot/made-of"
}
configure() { cmake --preset aarch64 -DSTILLMAP_BUILD_TESTS="$1" >/dev/null; }

# Unit tests that take ten seconds and more under emulation.
slow=(
  CpuEngine.BothFormsOfFreeSpaceKnowTheSameAndOneTakesAFractionOfTheMemory CpuEngine.WhatHasToLastIsCountedInSeconds
  CpuEngine.TheSameBitsWithOneTwoAndFourThreads CpuEngine.WhatWasStaticAndIsTakenAwayIsCarved
  CpuEngine.TheWallStaysWhenTheBoxHasGoneThrough CpuEngine.ABoxThatCameAndStaysIsStaticAndMapped
  VisibleBlocks.EveryVoxelThatIsSeenLiesInAListedBlockAndFreeBlocksAreFree RayRanges.SkippingFreeSpaceDoesNotChangeThePicture
)
# The quick ones, one part for each processor.
run_quick_tests() {
  local shards index failed=0 parts=()
  shards=$(nproc)
  for ((index = 0; index < shards; ++index)); do
    GTEST_TOTAL_SHARDS=$shards GTEST_SHARD_INDEX=$index GTEST_BRIEF=1 GTEST_FILTER=-$(IFS=:; echo "${slow[*]}") \
      timeout 600 qemu-aarch64-static -L "$sysroot" build/aarch64/test_kernels &
    parts+=($!)
  done
  for part in "${parts[@]}"; do wait "$part" || failed=1; done
  for program in test_core test_camera; do  # one of them holds its time against a bound
    GTEST_BRIEF=1 GTEST_FILTER=-*TakesASmallShare* timeout 600 qemu-aarch64-static -L "$sysroot" build/aarch64/$program || failed=1
  done
  return $failed
}
prepare() {
  toolchain/setup.sh --cross
  make_sysroot
}

if [[ ${1:-} == --check ]]; then
  prepare & wait $! ||
    { echo "cross_build.sh: skipped: the compiler or the libraries for arm64 are not to be had here" >&2; exit 77; }
else
  prepare
fi
case "${1:-}" in
  --check)
    configure ON
    cmake --build build/aarch64 -j "$(nproc)" --target test_kernels test_core test_camera
    run_quick_tests
    ;;
  '')
    configure OFF
    cmake --build build/aarch64 -j "$(nproc)" --target stillmap
    qemu-aarch64-static -L "$sysroot" build/aarch64/stillmap --version
    (cd build/aarch64 && cpack -G DEB)
    ;;
  --tests)
    configure ON
    cmake --build build/aarch64 -j "$(nproc)" --target test_kernels test_extract stillmap_parity
    ctest --test-dir build/aarch64 --output-on-failure -j "$(nproc)" -R '^test_(kernels|extract)$'
    qemu-aarch64-static -L "$sysroot" build/aarch64/stillmap_parity --frames 12  # emulated it is slow
    ;;
  *) echo "cross_build.sh: unknown argument '$1'; only --tests and --check are known" >&2; exit 2 ;;
esac
