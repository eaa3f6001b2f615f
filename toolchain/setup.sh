#!/usr/bin/env bash
# Installs what Stillmap needs from the distribution's packages (Debian 12, Ubuntu 22.04 and 24.04).
# Does nothing, in well under a second, when all of it is there.
#   setup.sh           what building, testing and running need
#   setup.sh --cross   also compiler and emulator for 64-bit ARM (toolchain/cross_build.sh)
#   setup.sh --lint    also clang, clang-format and clang-tidy, in the version that all three distributions have
set -euo pipefail

packages=(
  build-essential ca-certificates cmake git ninja-build pkg-config python3
  libeigen3-dev libfmt-dev libcli11-dev nlohmann-json3-dev libtomlplusplus-dev libnanoflann-dev
  libspng-dev libsystemd-dev libturbojpeg0-dev libzstd-dev libcairo2-dev fonts-dejavu-core
  liblcm-dev liblcm-bin libglib2.0-dev iproute2 libopenni2-dev libgpiod-dev
  libgtest-dev libbenchmark-dev systemd valgrind
)
# the virtual machine for tests of drivers (toolchain/vm)
if [[ "$(uname -m)" == x86_64 ]]; then
  packages+=(qemu-system-x86 seabios busybox-static cpio kmod xz-utils gpiod)
fi
if [[ "${1:-}" == --lint ]]; then
  packages+=(clang-14 clang-format-14 clang-tidy-14)
elif [[ "${1:-}" == --cross ]]; then
  packages+=(g++-aarch64-linux-gnu qemu-user-static)
elif [[ $# -gt 0 ]]; then
  echo "setup.sh: unknown argument '$1'; only --lint and --cross are known" >&2
  exit 2
fi

installed() { dpkg-query -W -f='${db:Status-Abbrev}\n' "$@" 2>/dev/null | grep -c '^ii' || true; }

if [[ "$(installed "${packages[@]}")" -ge ${#packages[@]} ]]; then
  exit 0
fi
if ! command -v apt-get >/dev/null; then
  echo "setup.sh: there is no apt-get here; install these packages' counterparts by hand: ${packages[*]}" >&2
  exit 1
fi
as_root=()
if [[ "$(id -u)" -ne 0 ]]; then
  if ! command -v sudo >/dev/null; then
    echo "setup.sh: packages are missing; run it as root, or install sudo" >&2
    exit 1
  fi
  as_root=(sudo)
fi
export DEBIAN_FRONTEND=noninteractive
echo "setup.sh: installing what is missing"
"${as_root[@]}" apt-get update -qq
"${as_root[@]}" env DEBIAN_FRONTEND=noninteractive apt-get install -y -qq --no-install-recommends "${packages[@]}" >/dev/null
