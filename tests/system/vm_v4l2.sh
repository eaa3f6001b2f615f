# In the virtual machine (toolchain/vm/run.sh): the V4L2 driver, and the program with it, on the kernel's virtual cameras.
#   vm_v4l2.sh V4L2_KERNEL_TEST STILLMAP
set -euo pipefail
test_program=$1 stillmap=$2
guest=$(dirname "$0")/../../toolchain/vm/guest
source "$guest/in_memory.sh"
source "$guest/vivid.sh"

expect() {  # TEXT FILE
  grep -qF -- "$1" "$2" || { echo "expected '$1' in:"; cat "$2"; exit 1; }
}

in_memory "$test_program" "$stillmap"
vivid_load 2
"$test_program" --gtest_brief=1

# At a rate that the guest's processor keeps up with; the two cameras do not begin at the same time.
echo "== stillmap run"
nodes=v4l2:/dev/video0,/dev/video1
lens=(--set camera.fx=260 --set camera.fy=260 --set camera.cx=159.5 --set camera.cy=89.5)
size=(--set source.cols=320 --set source.rows=180)
"$stillmap" run --source $nodes "${lens[@]}" "${size[@]}" --depth-scale 20000 --set map.pool_blocks=4000 --set map.voxel_m=0.03 \
  --set map.truncation_m=0.12 --set source.rate_hz=2 --set source.max_pair_ms=250 --lcm off --max-frames 4 --out out >run.txt 2>&1 || { cat run.txt; cat out/events.log out/states.csv out/report.json; exit 1; }
expect '"frames": 4,' out/report.json
expect '"dropped": 0,' out/report.json
expect '"lost_frames": 0,' out/report.json
expect '"heap_allocations_in_loop": 0,' out/report.json

echo "== stillmap run on cameras that are not there, or unfit"
code=0; "$stillmap" run --source v4l2:/dev/video7 "${lens[@]}" --lcm off >refused.txt 2>&1 || code=$?
[[ $code -eq 3 ]]
expect "/dev/video7: No such file" refused.txt
code=0; "$stillmap" run --source $nodes --lcm off >refused.txt 2>&1 || code=$?
[[ $code -eq 2 ]]
expect "--camera" refused.txt

echo "== stillmap doctor"
"$stillmap" doctor --source $nodes "${lens[@]}" "${size[@]}" >doctor.txt || true  # the guest lacks a network
expect "/dev/video0: vivid; depth Y16; colour YUYV RGB3 GREY" doctor.txt
expect "$nodes opens, 320x180" doctor.txt
