#!/usr/bin/env bash
# Builds Stillmap for 64-bit ARM (Jetson and the like) on this machine.
#   cross_build.sh            build/aarch64/stillmap and the .deb for arm64
#   cross_build.sh --tests    the kernels' unit tests and the parity checks, run under emulation
# The system root is unpacked from the distribution's arm64 packages into build/sysroot-arm64; nothing of this system changes but
# that the compiler and the emulator are installed.
set -euo pipefail
cd "$(dirname "$0")/.."
toolchain/setup.sh --cross

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

make_sysroot
case "${1:-}" in
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
  *) echo "cross_build.sh: unknown argument '$1'; only --tests is known" >&2; exit 2 ;;
esac
