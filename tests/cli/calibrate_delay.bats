# SPDX-License-Identifier: GPL-2.0-or-later
# incise calibrate delay: delays of the virtual rig are found, and refused where the motion
# cannot tell them.

load cli

rig=sim:clock=simulated,motion=2

@test "a tracker's delay that is wrong by 4 ms is found" {
	for latency in 4.2 11; do
		echo 'tracker_delay_ms = 1.5;' >calibration.conf
		incise calibrate delay --rig $rig,tracker_latency_ms=$latency --duration 15s \
			-o rep --overwrite --json >r.json </dev/null
		left=$(key r.json 'values[0].left')
		u=$(key r.json 'values[0].u')
		[ "$(key r.json 'values[0].key')" = tracker_delay_ms ]
		# 3.5 sd, and what is asked
		holds "($left - $latency)^2 < (3.5 * $u)^2 && ($left - $latency)^2 < 0.3^2"
		holds "$(key r.json 'values[0].found') == 1.5"
		grep -q '^tracker_delay_ms = ' calibration.conf
		grep -q '^tracker_delay_sd_ms = ' calibration.conf
		grep -q 'fit of the motion A' rep/report.txt
	done
	# no folder is left behind
	[ -z "$(find "${TMPDIR:-/tmp}" -maxdepth 1 -name 'incise-??????' -user "$(id -u)" -newer rep 2>/dev/null)" ]
}

# bats test_tags=slow
@test "the camera too, and any of them is the reference" {
	incise calibrate delay --rig $rig --duration 12s --camera frames -o k.rec --json --dry-run >r.json </dev/null
	[ ! -e calibration.conf ]
	holds "($(key r.json 'values[2].left'))^2 < 0.3^2"
	[ "$(key r.json 'values[2].key')" = camera_delay_ms ]
	incise calibrate delay --from k.rec --reference-stream camera --dry-run --json >c.json
	[ "$(key c.json 'values[0].key')" = force_delay_ms ]
	[ "$(key c.json 'values[2].key')" = tracker_delay_ms ]
	holds "($(key c.json 'values[0].left'))^2 < 0.3^2"
	holds "($(key c.json 'values[2].left') - 4.2)^2 < 0.3^2"
}

@test "what cannot tell a delay is refused, and nothing is changed" {
	run --separate-stderr incise calibrate delay --rig sim:clock=simulated --duration 20s </dev/null
	failed_with "correlate too little"
	run --separate-stderr incise calibrate delay --rig $rig,tracker_latency_ms=250 \
		--max-delay 50 --duration 12s -c late.conf </dev/null
	[ "$status" -eq 0 ] # the device says itself that it is late
	echo 'tracker_delay_ms = 0.0;' >zero.conf
	run --separate-stderr incise calibrate delay --rig $rig,tracker_latency_ms=70 \
		--max-delay 50 --duration 12s -c zero.conf </dev/null
	[ "$status" -eq 1 ]
	[ "$(cat zero.conf)" = 'tracker_delay_ms = 0.0;' ]
	incise capture -o short.rec --rig $rig --duration 5s
	fails incise calibrate delay --from short.rec -- "in common"
	fails incise calibrate delay --from none.rec -- "none.rec"
	[ ! -e calibration.conf ]
}
