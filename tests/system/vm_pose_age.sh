# In the virtual machine (toolchain/vm/run.sh): how old poses are when their datagrams come, on a machine that does nothing
# else. A camera of ten images a second, for a processor that works on one in forty milliseconds.
#   vm_pose_age.sh STILLMAP LCM_PROBE OPENNI2_FOLDER IMAGES FRAMES
set -euo pipefail
stillmap=$1 probe=$2 openni2=$3 images=$4 frames=$5
source "$(dirname "$0")/../../toolchain/vm/guest/in_memory.sh"

cp -r "$openni2" openni2
cp "$images" images
printf '\1\0\0\0' >control   # plugged in
truncate -s 64 control
export LD_LIBRARY_PATH=$PWD/openni2 STILLMAP_VIRTUAL_FRAMES=$PWD/images STILLMAP_VIRTUAL_CONTROL=$PWD/control
in_memory "$stillmap" "$probe"
ip link set lo multicast on
ip route add 224.0.0.0/4 dev lo
url='udpm://239.255.76.67:7667?ttl=0'

# Above the thread whose poses it waits for, below the one that sends them.
mkfifo held
chrt -f 54 "$probe" ages "$url" <held >ages.txt &
listener=$!
exec 3>held
until grep -q ready ages.txt; do kill -0 "$listener"; sleep 0.1; done
"$stillmap" run --source xtion --set source.cols=64 --set source.rows=48 --set source.rate_hz=10 --lcm "$url" --quiet \
  --set runtime.threads=1 --set map.voxel_m=0.04 --set map.truncation_m=0.16 --set map.pool_blocks=8000 --max-frames "$frames" \
  --out out || { cat out/events.log; exit 1; }
exec 3>&-
wait "$listener"
grep -o '"\(frames\|dropped\|lost_frames\|heap_allocations_in_loop\)": [0-9]*' out/report.json | tr '\n' ' '
echo
head -1 out/timing.csv
tail -2 out/timing.csv
cat ages.txt
