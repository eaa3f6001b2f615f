#!/bin/busybox sh
# First process of the virtual machine (run.sh): the host's file system, read-only, becomes the root of a script, which
# finds the modules in $STILLMAP_VM_MODULES and starts in an empty folder in memory, $TMPDIR, where alone it can write.
box=/bin/busybox
$box mount -t proc proc /proc; $box mount -t sysfs sys /sys; $box mount -t devtmpfs dev /dev
for module in $($box cat /modules/order); do $box insmod /modules/$module.ko || echo "vm: insmod $module failed"; done
$box mount -t 9p -o trans=virtio,version=9p2000.L,ro,msize=512000,cache=loose host /host || echo "vm: no host file system"
for folder in proc sys dev; do $box mount --move /$folder /host/$folder; done
$box mount -t tmpfs tmp /host/run
$box mkdir -p /host/dev/shm /host/run/modules /host/run/work
$box mount -t tmpfs tmp /host/dev/shm
$box ln -s /proc/self/fd /host/dev/fd
$box mount --bind /modules /host/run/modules
$box mount -t configfs none /host/sys/kernel/config 2>/dev/null
$box mount -t debugfs none /host/sys/kernel/debug 2>/dev/null
$box ip link set lo up
export PATH=/usr/local/sbin:/usr/local/bin:/usr/sbin:/usr/bin:/sbin:/bin HOME=/run/work LC_ALL=C.UTF-8
export TMPDIR=/run/work STILLMAP_VM_MODULES=/run/modules
read_option() { $box sed -n "s/.*$1=\([^ ]*\).*/\1/p" /host/proc/cmdline | $box sed 's/%20/ /g'; }
script=$(read_option stillmap.script)
arguments=$(read_option stillmap.arguments)
echo "VM-UP"
# shellcheck disable=SC2086
$box chroot /host /bin/bash -c 'cd /run/work && exec /bin/bash "$@"' bash "$script" $arguments
echo "VM-EXIT $?"
$box poweroff -f
