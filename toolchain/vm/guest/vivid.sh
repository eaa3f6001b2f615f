# Sourced by scripts in the virtual machine: the kernel's virtual cameras (vivid).
#   vivid_load [COUNT]   that many (default 1) web cameras with a capture node each: /dev/video0, /dev/video1, ...
#   vivid_unload         takes them all away; fails while a program has one open
vivid_load() {
  local count=${1:-1}
  insmod "$STILLMAP_VM_MODULES/vivid.ko" n_devs="$count" no_error_inj=0 \
    node_types="$(vivid_list "$count" 0x1)" num_inputs="$(vivid_list "$count" 1)" input_types="$(vivid_list "$count" 0)" ||
    return 1
  [[ -c /dev/video$((count - 1)) ]]
}

vivid_list() {  # COUNT VALUE: VALUE,VALUE,...
  local list=$2 index
  for ((index = 1; index < $1; index++)); do list+=,$2; done
  echo "$list"
}

vivid_unload() { rmmod vivid; }
