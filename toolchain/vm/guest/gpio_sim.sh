# Sourced by scripts in the virtual machine: simulated GPIO chips (the kernel's gpio-sim).
#   gpio_sim_make NAME LINE_NAME...   a chip with that many lines; sets
#       GPIO_SIM_CHIP=gpiochipN  GPIO_SIM_SYSFS=/sys/devices/platform/.../gpiochipN, which holds for line I
#       sim_gpioI/value (what the chip's user drives) and sim_gpioI/pull (write pull-up, pull-down: what its user reads)
#   gpio_sim_remove NAME              the chip is unplugged, also while its lines are in use; gpio_sim_make brings it back
gpio_sim_make() {
  local name=$1 folder=/sys/kernel/config/gpio-sim/$1 device index=0
  shift
  [[ -d /sys/kernel/config/gpio-sim ]] || insmod "$STILLMAP_VM_MODULES/gpio_sim.ko" || return 1
  mkdir -p "$folder/bank0" || return 1
  echo $# >"$folder/bank0/num_lines"
  echo "$name" >"$folder/bank0/label"
  for line in "$@"; do
    mkdir -p "$folder/bank0/line$index"
    echo "$line" >"$folder/bank0/line$index/name"
    index=$((index + 1))
  done
  echo 1 >"$folder/live" || return 1
  GPIO_SIM_CHIP=$(cat "$folder/bank0/chip_name")
  device=$(cat "$folder/dev_name")
  GPIO_SIM_SYSFS=/sys/devices/platform/$device/$GPIO_SIM_CHIP
  [[ -d $GPIO_SIM_SYSFS ]]
}

gpio_sim_remove() {
  local folder=/sys/kernel/config/gpio-sim/$1
  echo 0 >"$folder/live" && rmdir "$folder"/bank0/line* "$folder/bank0" "$folder"
}
