#!/usr/bin/env bash
# Makes the kernel and the initramfs in which drivers are tested (run.sh boots them), from the distribution's packages,
# which are downloaded and unpacked, never installed. Kept in a folder outside the source tree, 15 MB; made again only
# when these scripts change or the folder is removed. About a minute, 265 MB downloaded, 1 GB of disk while it works.
#   build.sh            prints the folder that holds vmlinuz and initrd.gz
#   build.sh --check    only says whether it would have to be made: 0 it is there, 1 not
# STILLMAP_VM_CACHE names another folder. Exit: 0 it is there, 77 this machine cannot make it (why: stderr), 1 failed.
set -euo pipefail
here=$(cd "$(dirname "${BASH_SOURCE[0]}")" && pwd)
cache=${STILLMAP_VM_CACHE:-${XDG_CACHE_HOME:-${HOME:-/var/tmp}/.cache}/stillmap-vm}

cannot() { echo "vm: skipped: $*" >&2; exit 77; }
fail() { echo "vm: $*" >&2; exit 1; }

# What the result was made from: it names the scripts, not the kernel on offer, so that a warm cache needs no network.
stamp=$(cat "$here/build.sh" "$here/init.sh" | sha256sum | cut -d' ' -f1)
is_there() { [[ -s $cache/vmlinuz && -s $cache/initrd.gz && "$(cat "$cache/stamp" 2>/dev/null)" == "$stamp" ]]; }

if [[ ${1:-} == --check ]]; then
  is_there && exit 0
  exit 1
fi
[[ $# -eq 0 ]] || fail "unknown argument '$1'; only --check is known"
[[ $(uname -m) == x86_64 ]] || cannot "the test kernel is for x86_64, this machine is $(uname -m)"
if is_there; then echo "$cache"; exit 0; fi

for tool in apt-get apt-cache dpkg-deb make gcc xz cpio busybox modinfo strip flock; do
  command -v $tool >/dev/null || cannot "there is no '$tool' to make the test kernel with (toolchain/setup.sh installs it)"
done
mkdir -p "$cache"
exec 9>"$cache/lock"
flock -w 600 9 || fail "another build.sh has held $cache/lock for ten minutes"
if is_there; then echo "$cache"; exit 0; fi
[[ $(df --output=avail -k "$cache" | tail -1) -gt 1500000 ]] || cannot "less than 1.5 GB free in $cache"

rm -rf "$cache"/work.*   # what a killed run left; the lock says that nobody works in it
work=$(mktemp -d "$cache/work.XXXXXX")
trap 'rm -rf "$work"' EXIT

mkdir "$work/debs" "$work/root" "$work/gpio-sim"

# Kernel 6.12 has virtio built in and is on offer for every Debian 12, beside its own.
kernel_on_offer() {
  apt-cache depends linux-image-6.12-amd64 2>/dev/null |
    sed -n 's/.*Depends: linux-image-\(6\.12[^ ]*-amd64\)$/\1/p' | head -1
}
download() {  # sets version, base and packages
  version=$(kernel_on_offer)
  [[ -n $version ]] || { echo "E: the package lists have no linux-image-6.12-amd64, which Debian 12 offers"; return 1; }
  base=${version%-amd64}
  packages=("linux-image-$version" "linux-headers-$version" "linux-headers-$base-common" "linux-kbuild-$base" linux-source-6.12)
  (cd "$work/debs" &&
    timeout 300 apt-get -qq -o APT::Sandbox::User=root -o Acquire::Retries=3 download "${packages[@]}")
}
if ! download >"$work/download.log" 2>&1; then
  # Lists that are missing or older than what the archive holds are renewed, where we may.
  [[ $(id -u) -ne 0 ]] || timeout 120 apt-get update -qq >/dev/null 2>&1 || true
  download >"$work/download.log" 2>&1 ||
    cannot "no kernel to test with: $(grep -m1 '^E:' "$work/download.log" || echo 'apt-get download took too long')"
fi
for package in "${packages[@]:0:4}"; do dpkg-deb -x "$work/debs/$package"_*.deb "$work/root"; done

# gpio-sim is in no kernel of the distribution: built from its source, with irq_sim, in one module. Its one call of a
# symbol that modules cannot see is replaced by the exported function that does the same for a simulated line.
# tar stops reading behind its second file, which ends the programs before it with a broken pipe.
(set +o pipefail
 dpkg-deb --fsys-tarfile "$work"/debs/linux-source-6.12_*.deb | tar -xO ./usr/src/linux-source-6.12.tar.xz |
   xz -dc -T2 | tar -x -C "$work/gpio-sim" --strip-components=3 --occurrence=1 \
     linux-source-6.12/drivers/gpio/gpio-sim.c linux-source-6.12/kernel/irq/irq_sim.c) 2>/dev/null || true
cd "$work/gpio-sim"
[[ -s gpio-sim.c && -s irq_sim.c ]] || fail "gpio-sim.c or irq_sim.c is not in linux-source-6.12"
mv gpio-sim.c gpio-sim-main.c
sed -i 's/handle_simple_irq(irq_to_desc(irqnum))/generic_handle_irq(irqnum)/' irq_sim.c
printf 'obj-m := gpio-sim.o\ngpio-sim-y := gpio-sim-main.o irq_sim.o\n' >Makefile

# The header packages name the absolute paths of an installed system.
headers=$work/root/usr/src/linux-headers-$version
grep -lE '/usr/(src/linux-headers|lib/linux-kbuild)' "$headers/Makefile" "$headers/.kernelvariables" \
  "$work/root/usr/src/linux-headers-$base-common/Makefile" 2>/dev/null | xargs -r sed -i \
  "s#/usr/src/linux-headers#$work/root/usr/src/linux-headers#g; s#/usr/lib/linux-kbuild#$work/root/usr/lib/linux-kbuild#g"
while IFS= read -r link; do
  target=$(readlink "$link")
  [[ $target != /usr/* ]] || ln -sfn "$work/root$target" "$link"
done < <(find "$work/root/usr/src" -maxdepth 2 -type l)
make -s -C "$headers" M="$PWD" CONFIG_DEBUG_INFO_BTF_MODULES= modules >"$work/make.log" 2>&1 ||
  { tail -20 "$work/make.log" >&2; fail "gpio-sim does not build against $version"; }

# The initramfs: busybox, init, the modules in the order in which they load.
ram=$work/initramfs
mkdir -p "$ram"/{bin,modules,proc,sys,dev,host}
cp -L "$(command -v busybox)" "$ram/bin/busybox"
"$ram/bin/busybox" --list | grep -qx insmod || fail "busybox has no insmod; busybox-static is needed"
install -m 755 "$here/init.sh" "$ram/init"
find "$work/root/lib/modules/$version/kernel" -name '*.ko*' >"$work/modules"
declare -A packed=()
pack() {  # NAME: the module and, before it, what it depends on; nothing where it is built in
  local name=${1//-/_} file dependency
  [[ -z ${packed[$name]:-} ]] || return 0
  packed[$name]=1
  file=$(grep -E "/${name//_/[-_]}\.ko(\.xz)?$" "$work/modules" | head -1 || true)
  [[ -n $file ]] || return 0
  for dependency in $(modinfo -F depends "$file" | tr ',' ' '); do pack "$dependency"; done
  case $file in *.xz) xz -dc "$file" >"$ram/modules/$name.ko" ;; *) cp "$file" "$ram/modules/$name.ko" ;; esac
  [[ $name == vivid ]] || echo "$name" >>"$ram/modules/order"
}
for module in virtio_pci virtio_console 9pnet_virtio 9p vivid configfs; do pack "$module"; done
strip -g -o "$ram/modules/gpio_sim.ko" gpio-sim.ko
[[ -s $ram/modules/9p.ko && -s $ram/modules/vivid.ko ]] || fail "$version has no 9p or no vivid module"
(cd "$ram" && find . | cpio -o -H newc --quiet | gzip -1) >"$work/initrd.gz"

rm -f "$cache/stamp"   # written last: a half-made result is none
mv "$work/initrd.gz" "$cache/initrd.gz"
cp "$work/root/boot/vmlinuz-$version" "$cache/vmlinuz"
echo "$version" >"$cache/kernel"
echo "$stamp" >"$cache/stamp"
echo "$cache"
