# SPDX-License-Identifier: GPL-2.0-or-later
# Captures from real sources, as a user meets them: a FASTRAK that answers behind a pseudo
# terminal (tests/polhemus), beside the simulated force channel; and sources that are absent.
# Those that need a kernel with their drivers are in tests/vm/guest.

load cli
load fastrak

setup() {
	unset INCISE_MESSAGES # what the machine's kernel lacks is named
	work_folder
	cat >rig.conf <<-END
		clock = "real";
		tracker = "tty:$PWD/tracker:115200";
		force = "sim:";
		# far below where the emulator's sensor goes
		surface = { point_mm = [0.0, 0.0, -500.0]; normal = [0.0, 0.0, 1.0]; };
	END
}

teardown() {
	pull_away
}

# Until the capture in the background has more records of the tracker than that.
until_records() {
	for _ in $(seq 600); do
		incise info a.rec.part --json >rows.json 2>/dev/null &&
			[ "$(key rows.json rows.tracker)" -gt "$1" ] && return
		sleep 0.1
	done
	complain "no $1 records after 60 s; capture said: $(cat err)"
}

@test "a FASTRAK on a serial line is captured, by name, without loss" {
	local code
	plug_in
	# A terminal's buffer holds the records of half a second: a machine that stands still for longer
	# loses some, and it says so. A minute has three seconds without.
	for try in {1..20}; do
		code=0
		rm -rf a.rec
		incise capture -o a.rec --duration 3s --json >report.json || code=$?
		[ "$code" = "$(($(key report.json lost) > 0))" ]
		[ "$code" = 1 ] || break
	done
	[ "$code" = 0 ]
	[ "$(key report.json tracker_lost)" = 0 ]
	# 120 Hz for 3 s; a machine that is busy ends later, never earlier
	[ "$(key report.json tracker)" -ge 355 ]
	[[ "$(ask a.rec "SELECT value FROM meta WHERE key='tracker_name'")" == FASTRAK* ]]
	[ "$(ask a.rec "SELECT count(*) FROM tracker")" = "$(key report.json tracker)" ]
	# each record once, and later than the one before
	[ "$(ask a.rec "SELECT max(seq) - min(seq) + 1 - count(*) FROM tracker")" = 0 ]
	[ "$(ask a.rec "SELECT count(*) FROM (SELECT t_ns - lag(t_ns) OVER (ORDER BY seq) AS d
		FROM tracker) WHERE d <= 0")" = 0 ]
}

@test "a tip offset that another program left is a warning, and in the recording" {
	plug_in --tip 5.25
	incise capture -o a.rec --duration 1s >report 2>err || true # a busy machine loses some
	grep -q '^incise capture: warning: FASTRAK .*: settings of the tracker alter its poses: N1 5.25 0 0$' err
	grep -q '^warning: tracker: settings of the tracker alter its poses: N1 5.25 0 0$' report
	[ "$(ask a.rec "SELECT value FROM meta WHERE key='tracker_note'")" = \
		"settings of the tracker alter its poses: N1 5.25 0 0" ]
	incise info a.rec --json >info.json
	grep -q 'N1 5.25 0 0' info.json
	incise verify a.rec >verified || true
	! grep -q 'seal:' verified
}

# bats test_tags=check
@test "info asks a source that is named, of whatever kind" {
	plug_in
	incise info "tty:$PWD/tracker:115200" >told
	grep -q "^ *tracker *= \"tty:$PWD/tracker:115200\";" told
	grep -q "^ *family *FASTRAK" told
	grep -q "^ *firmware " told
	fails incise info "tty:$PWD/none:115200" -- "$PWD/none" "plug in the adapter"
	fails incise info v4l2:/dev/video99 -- "v4l2:/dev/video99: no answer" "cable"
	fails incise info nonsense:x -- 'no such backend "nonsense"' "tty" "can" "v4l2"
}

@test "a module that cannot be loaded is no device" {
	mkdir modules
	echo text >modules/tracker_broken.so
	INCISE_MODULE_PATH=$PWD/modules run -0 --separate-stderr incise info devices
	[[ "$output" == "no tracker, force channel"* ]]
	[[ "$stderr" == *"tracker_broken.so"* ]]
	[ "${#stderr_lines[@]}" = 1 ]
}

# The emulator's clock went on by so many records, which it drops while it is pulled out.
drops() {
	local before=
	until echo sent >&9 && now=$(sed -n 's/^sent \([0-9]*\) .*/\1/p' from | tail -n 1) && [ -n "$now" ] &&
		[ "$now" -ge $((${before:=$now} + $1)) ]; do
		sleep 0.05
	done
}

# The capture has counted so many as lost, of whatever stream, on its line of each second.
says_lost() {
	[ "$(sed -n 's/^[0-9]* s: .*, \([0-9]*\) lost.*/\1/p' err | tail -n 1)" -ge "$1" ]
}

@test "a tracker that is pulled out and plugged in: the rest is there, the gap is counted" {
	local code=0
	plug_in
	incise capture -o a.rec -c none --duration 1h >out 2>err 3>&- 9>&- &
	capture=$!
	until_records 120
	echo unplug >&9
	drops 120
	echo plug >&9
	until_records "$(($(key rows.json rows.tracker) + 120))"
	kill -INT $capture
	# samples are lost: it says so, and exits with 1
	wait $capture || code=$?
	[ "$code" = 1 ]
	grep -q "tracker samples were lost" err
	# but for the line of each second
	[ "$(grep -cv '^[0-9]* s: ' err)" = 1 ]
	lost=$(ask a.rec "SELECT value FROM meta WHERE key='tracker_lost'")
	[ "$lost" -ge 120 ]
	# every record has its number: what is missing between them is what was counted
	[ "$(ask a.rec "SELECT max(seq) - min(seq) + 1 - count(*) FROM tracker")" = "$lost" ]
	# and it went on behind the gap
	[ "$(ask a.rec "SELECT count(*) > 0 FROM tracker WHERE seq > (SELECT min(seq) FROM
		(SELECT seq, seq - lag(seq) OVER (ORDER BY seq) AS d FROM tracker) WHERE d > 100)")" = 1 ]
}

@test "a tracker that is pulled out and does not come back: what did not come is lost" {
	local code=0
	plug_in
	incise capture -o a.rec --duration 1h >out 2>err 3>&- 9>&- &
	capture=$!
	until_records 0
	echo unplug >&9
	await says_lost 60
	kill -INT $capture
	wait $capture || code=$?
	[ "$code" = 1 ]
	grep -q "tracker samples were lost" err
	lost=$(ask a.rec "SELECT value FROM meta WHERE key='tracker_lost'")
	[ "$lost" -gt 0 ]
	[ "$(ask a.rec "SELECT sum(value) FROM meta WHERE key IN ('tracker_lost', 'force_lost')")" -ge 60 ]
}

@test "records with flipped bytes: no capture is doubled, what is missing is counted" {
	plug_in --flip 10000 # 1 % of the bytes
	run --separate-stderr incise capture -o a.rec --duration 4s
	[ "$status" -le 1 ]
	[ "$(ask a.rec "SELECT max(seq) - min(seq) + 1 - count(*) FROM tracker")" = \
		"$(ask a.rec "SELECT value FROM meta WHERE key='tracker_lost'")" ]
	[ "$(ask a.rec "SELECT count(*) FROM tracker")" -gt 0 ]
}

@test "two sensors of a tracker make no recording of one" {
	plug_in --stations 12
	echo 'tracker_setup = { stations = [1, 2]; };' >>rig.conf
	fails incise capture -o a.rec -c none --duration 1s -- "a.rec:" "tracker_setup.stations"
	[ ! -e a.rec ]
	[ ! -e a.rec.part ]
	# either of them does
	sed -i 's/\[1, 2\]/[2]/' rig.conf
	captures -o a.rec --duration 1s
}

# bats test_tags=check
@test "a source that is absent is named, with what to do" {
	local case
	while IFS='|' read -r line text; do
		{
			echo 'clock = "real"; tracker = "sim:"; force = "sim:";'
		} | sed "s|${line%% =*} = \"sim:\"|$line|" >absent.conf
		run --separate-stderr incise capture -o a.rec --rig absent.conf --duration 1s
		failed_with "absent.conf:1: ${line%% =*}: " "$text"
		[ ! -e a.rec ]
		[ ! -e a.rec.part ]
	done <<-END
		tracker = "usb:0f44:9999"|is not a known Polhemus tracker
		tracker = "tty:$PWD/nothing:115200"|no such device $PWD/nothing; plug in the adapter
		tracker = "tty:/dev/null:115200"|/dev/null
		force = "iio:no-such-converter"|driver of your converter
		force = "comedi:/dev/comedi77"|/dev/comedi77: No such file
	END
}

@test "the example is read" {
	sed -E 's/^(tracker|force|camera) = "[^"]*"/\1 = "sim:"/' \
		"$root/doc/rig-sources.conf.example" >rig.conf
	[ "$(grep -c '"sim:"' rig.conf)" = 3 ]
	# the pictures too: a host that stands still loses none where time waits for it
	sed -i 's/^clock = "real"/clock = "simulated"/' rig.conf
	grep -q '^clock = ' rig.conf || echo 'clock = "simulated";' >>rig.conf
	incise capture -o a.rec --duration 600ms
	# and its settings with it: none that is wrong goes by
	sed -i 's/rate_hz = 10000.0/rate_hz = 0.5/' rig.conf
	fails incise capture -o b.rec --duration 600ms -- "rig.conf" "force_setup.rate_hz"
}

# A scene in which the emulator's sensor is always in the tissue, on a virtual actuator.
in_the_tissue() {
	printf 'tissue = { plane_N_mm = 0.1; };\nlimits = { start_N = 10.0; };\n' >a.scene
	sed 's/-500.0/0.0/; s/force = /stepper = "sim:"; force = /' rig.conf >felt.conf
}

# The emulator takes what it is told before what a program sends to it later.

@test "poses that the tracker flags render no force, and give no depth" {
	plug_in
	in_the_tissue
	echo "flag x" >&9
	run -0 --separate-stderr incise haptic a.scene --rig felt.conf --no-rt --overruns 0 --duration 1s --json
	echo "$output" >report.json
	[[ "$stderr" == *"the tracker flags poses 'x': the sensor is outside its motion box; they are not used"* ]]
	holds "$(key report.json poses.taken) > 0"
	[ "$(key report.json poses.unusable)" = "$(key report.json poses.taken)" ]
	[ "$(key report.json poses.flags.x)" = "$(key report.json poses.taken)" ]
	[ "$(key report.json stale)" = "$(key report.json ticks)" ]
	holds "$(key report.json force_max_N) == 0"
	incise haptic a.scene --rig felt.conf --no-rt --overruns 0 --duration 500ms >text
	grep -Eq "^poses +([0-9]+) of \1 poses were not used: \1 'x' \(" text
	run -1 --separate-stderr incise capture -o a.rec --duration 2s
	[[ "$stderr" == *"poses were not used: "*" 'x' (the sensor is outside its motion box)"* ]]
	[[ "$stderr" == *"a.rec: no depth: the tracker flagged every pose; see Tracker flags in 'incise help rig.conf'" ]]
	[ "$(ask a.rec "SELECT count(*) > 0 AND min(status) = 'x' AND max(status) = 'x'
		FROM tracker")" = 1 ]
	[ "$(ask a.rec "SELECT count(*) FROM depth")" = 0 ]
}

@test "a tracker that sends one pose again and again renders no force, unless it may" {
	plug_in
	in_the_tissue
	echo freeze >&9
	run -0 --separate-stderr incise haptic a.scene --rig felt.conf --no-rt --overruns 0 --duration 2s --json
	echo "$output" >report.json
	[[ "$stderr" == *"the tracker flags poses '=': the same pose for too long"*"they are not used"* ]]
	[ "$(key report.json 'poses.flags."="')" = "$(key report.json poses.unusable)" ]
	run --separate-stderr incise capture -o a.rec --duration 2s
	[ "$status" -le 1 ]
	[[ "$stderr" == *"a.rec: "*" poses were not used: "*" '=' (the same pose for too long"* ]]
	echo 'tracker_setup = { repeat_ms = 0; };' >>felt.conf
	run -0 --separate-stderr incise haptic a.scene --rig felt.conf -c none --no-rt --overruns 0 --duration 1s --json
	echo "$output" >report.json
	[ -z "$stderr" ]
	[ "$(key report.json poses.unusable)" = 0 ]
}

@test "a flag that only warns: poses are used, with a warning" {
	plug_in
	in_the_tissue
	echo "flag u" >&9
	run -0 --separate-stderr incise haptic a.scene --rig felt.conf --no-rt --overruns 0 --duration 1s --json
	echo "$output" >report.json
	[[ "$stderr" == *"the tracker flags poses 'u': "*"; they are used"* ]]
	[ "$(key report.json poses.unusable)" = 0 ]
	holds "$(key report.json poses.flags.u) > 0"
	holds "$(key report.json contact) > 0"
	run --separate-stderr incise capture -o a.rec --duration 2s
	[ "$status" -le 1 ]
	[[ "$stderr" == *"a.rec: "*" poses are doubtful: "*" 'u' (outside its map of the distortion by metal)"* ]]
	[ "$(ask a.rec "SELECT count(*) > 0 FROM depth")" = 1 ]
}
