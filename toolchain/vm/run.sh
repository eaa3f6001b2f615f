#!/usr/bin/env bash
# Runs a bash script in a virtual machine with a kernel of its own (build.sh), whose virtual cameras and GPIO chips it can
# load and take away. The guest sees the host's files, read-only, but for /run; it starts in an empty folder in memory.
#   run.sh SCRIPT [ARGUMENT]...     no spaces in them
# The guest's clock counts instructions and skips idle time, so that what is measured there does not depend on the load
# of this machine; it says nothing of real hardware. Waiting for the host's files skips time as well: what measures time
# reads them before (guest/in_memory.sh). Exit: that of the script; 77 where it cannot run here (why: stderr);
# 124 after STILLMAP_VM_TIMEOUT_S (180) seconds of this machine's time; 125 the guest ended without an answer.
# STILLMAP_VM_SHIFT (3): an instruction takes 2^SHIFT ns of the guest's time.
set -euo pipefail
here=$(cd "$(dirname "${BASH_SOURCE[0]}")" && pwd)
[[ $# -ge 1 && -f $1 ]] || { echo "run.sh: expected SCRIPT [ARGUMENT]..., SCRIPT a file" >&2; exit 2; }
script=$(realpath "$1"); shift
case "$script$*" in *%*) echo "run.sh: a script and arguments without '%'" >&2; exit 2 ;; esac
case "$script" in *" "*) echo "run.sh: a script without spaces in its path" >&2; exit 2 ;; esac
case "$script" in /run/*) echo "vm: skipped: the guest has a /run of its own, $script is not in it" >&2; exit 77 ;; esac
command -v qemu-system-x86_64 >/dev/null ||
  { echo "vm: skipped: there is no qemu-system-x86_64 (toolchain/setup.sh installs it)" >&2; exit 77; }
status=0
folder=$("$here/build.sh") || status=$?
[[ $status -eq 0 ]] || exit "$status"

output=$(mktemp)
trap 'rm -f "$output"' EXIT
arguments=$*
timeout -k 5 "${STILLMAP_VM_TIMEOUT_S:-180}" qemu-system-x86_64 -M q35 -accel tcg,thread=single \
  -icount "shift=${STILLMAP_VM_SHIFT:-3},sleep=off" -cpu max -smp 1 -m 1024 -nodefaults -no-reboot -display none \
  -serial stdio -kernel "$folder/vmlinuz" -initrd "$folder/initrd.gz" \
  -append "console=ttyS0 quiet loglevel=3 panic=-1 mitigations=off nokaslr stillmap.script=$script stillmap.arguments=${arguments// /%20}" \
  -virtfs local,path=/,mount_tag=host,security_model=none,readonly=on,multidevs=remap \
  </dev/null 2>&1 | tr -d '\r' | tee "$output" | sed '/^VM-EXIT /d; /VM-UP$/d' || status=$?
code=$(sed -n 's/^VM-EXIT \([0-9]*\)$/\1/p' "$output" | tail -1)
[[ -z $code ]] || exit "$code"
[[ $status -ne 124 && $status -ne 137 ]] || { echo "vm: not done after ${STILLMAP_VM_TIMEOUT_S:-180} s" >&2; exit 124; }
echo "vm: the guest ended without an answer" >&2
exit 125
