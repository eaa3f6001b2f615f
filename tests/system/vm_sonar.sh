# In the virtual machine (toolchain/vm/run.sh): the sonar's driver, and the program with it, on a simulated GPIO chip.
#   vm_sonar.sh SONAR_KERNEL_TEST STILLMAP
set -euo pipefail
test_program=$1 stillmap=$2
guest=$(realpath "$(dirname "$0")/../../toolchain/vm/guest")
source "$guest/in_memory.sh"
source "$guest/gpio_sim.sh"

expect() {  # TEXT FILE
  grep -qF -- "$1" "$2" || { echo "expected '$1' in:"; cat "$2"; exit 1; }
}

in_memory "$test_program" "$stillmap"
gpio_sim_make sonar TRIGGER ECHO STOP
chip=/dev/$GPIO_SIM_CHIP
sonar=(--set sonar.kind=hc_sr04 --set "sonar.chip=$chip" --set sonar.trigger_line=0 --set sonar.echo_line=1
  --set sonar.stop_line=2)

echo "== stillmap doctor"
"$stillmap" doctor "${sonar[@]}" >doctor.txt || true
expect "$chip, its lines are free" doctor.txt
"$stillmap" doctor "${sonar[@]}" --set sonar.stop_line=7 >doctor.txt || true
expect "has the lines 0 to 2, not 7" doctor.txt

echo "== stillmap run"
ip link set lo multicast on
ip route add 224.0.0.0/4 dev lo
# The tracker takes all of the guest's one slow processor: nobody could look for triggers all the time beside it (the
# driver's tests below do), but a sensor of pulses sleeps, and is woken in time.
chrt -f 50 "$test_program" --pulses "$GPIO_SIM_SYSFS" 5800 12 &
pulses=$!
"$stillmap" top --for 4 >top.txt &
top=$!
"$stillmap" run --source synthetic:crowd,size=80x60,seconds=4 --realtime "${sonar[@]}" \
  --set sonar.kind=pulse_width --set sonar.trigger_line=-1 --set map.pool_blocks=20000 \
  --set map.voxel_m=0.04 --set map.truncation_m=0.16 --set record.log=true --set record.frames=true --out out \
  --quiet || code=$?
# 4: lost. Two frames a second, as the guest manages, are too few to be sure to keep the camera.
[[ ${code:-0} == 0 || $code == 4 ]] || { cat out/events.log; exit 1; }
grep -q '"range_lost": [1-9]\|"range_stuck": [1-9]' out/report.json && { cat out/report.json out/events.log; exit 1; }
readings=$(grep -ao STILLMAP_RANGE out/*.lcm | wc -l)
echo "$readings readings in the log"
[[ $readings -ge 30 ]]
[[ $(cat "$GPIO_SIM_SYSFS/sim_gpio2/value") -eq 1 ]] || echo "the released stop line is low: only a pull-up keeps it"
wait "$pulses" "$top"
expect "range: 1.0" top.txt

echo "== the driver"
"$test_program" "$chip" "$GPIO_SIM_SYSFS" "$guest/gpio_sim.sh" --gtest_brief=1
