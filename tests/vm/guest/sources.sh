#!/bin/sh
# SPDX-License-Identifier: GPL-2.0-or-later
# A rig of real sources as its user sets it up: info devices tells the lines of rig.conf, and
# with these lines incise capture records.
. tests/vm/tap

[ -e "$INCISE_BUILD/lib/incise/force_iio.so" ] || skip "a rig of real sources" "libiio was not there to build with"
with_modules "a rig of real sources" incise_sim
modprobe -a industrialio kfifo_buf industrialio-triggered-buffer
check "the simulated converter loads" insmod "$module" || exit 0
modprobe vivid n_devs=1 node_types=1 num_inputs=1 input_types=0 2>/dev/null || echo "# no vivid"
modprobe comedi_test 2>/dev/null || echo "# no comedi_test"
i=0
until [ -e /dev/comedi0 ] || [ $i = 50 ]; do
	sleep 0.1
	i=$((i + 1))
done
PATH=$INCISE_BUILD/bin:$PATH
mkdir -p /run/rig
cd /run/rig || exit 1

incise info devices >found
check "info devices lists the converter" grep -x ' *force *= "iio:incise-sim-adc";' found
[ ! -d /sys/module/comedi_test ] || [ ! -e "$INCISE_BUILD/lib/incise/force_comedi.so" ] ||
	check "and the DAQ card" grep -x ' *force *= "comedi:/dev/comedi0:0";' found
[ ! -d /sys/module/vivid ] ||
	check "and the camera" grep -x ' *camera *= "v4l2:/dev/video[0-9]*";' found
sed 's/^/# /' found
incise info devices --json >found.json
check "as JSON too" grep -q '"device": "iio:incise-sim-adc"' found.json

mkfifo to
"$INCISE_BUILD/tests/polhemus/fastrak" --link /run/rig/tracker <to >from 2>&1 &
fastrak=$!
exec 9>to
i=0
until grep -q ready from || [ $i = 50 ]; do
	sleep 0.1
	i=$((i + 1))
done

# record FORCE: a second through that line
record()
{
	{
		echo 'clock = "real";'
		echo 'tracker = "tty:/run/rig/tracker:115200";'
		echo "force = \"$1\";"
		echo "$2"
		echo 'surface = { point_mm = [0.0, 0.0, -500.0]; normal = [0.0, 0.0, 1.0]; };'
	} >rig.conf
	rm -rf a.rec
	# a sawtooth is never at rest, so that its zero is given
	echo 'force_mV_N = 1240.0; force_zero_mV = 180.0; depth_mm_px = 0.11875;' >calibration.conf
	code=0
	incise capture -o a.rec -c calibration.conf --duration 1500ms --json >report.json || code=$?
	cat report.json
	force=$(count force) force_lost=$(count force_lost)
	tracker=$(count tracker) tracker_lost=$(count tracker_lost)
	# In real time an emulated machine loses some: it says so, and how many.
	if [ "$INCISE_VM_PROFILE" = deterministic ] || [ $code = 0 ]; then
		[ $code = 0 ] && [ "$force_lost" = 0 ] && [ "$tracker_lost" = 0 ] || return
	else
		[ $code = 1 ] && [ $((force_lost + tracker_lost)) -gt 0 ] || return
	fi
	[ $((force + force_lost)) -ge "$3" ] && [ $((tracker + tracker_lost)) -ge 170 ]
}

count()
{
	sed -n 's/.*"'"$1"'": \([0-9]*\).*/\1/p' report.json
}
# 10 kHz and 120 Hz for 1.5 s, less what is on its way when it ends
check "FASTRAK and converter are captured" record "iio:incise-sim-adc" "" 14500
[ ! -e /dev/comedi0 ] || check "FASTRAK and DAQ card are captured" record "comedi:/dev/comedi0:0" \
	"force_setup = { rate_hz = 1000.0; };" 1200

kill $fastrak
exec 9>&-
cd / || exit 1
rm -r /run/rig
modprobe -r vivid 2>/dev/null
modprobe -r comedi_test comedi 2>/dev/null
check "the simulated converter goes" rmmod incise_sim
