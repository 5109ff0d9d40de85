# SPDX-License-Identifier: GPL-2.0-or-later
# incise capture, as a user meets it. The virtual rig in simulated time runs as fast as it
# goes; where a capture is to be caught in the act it runs in real time.

load cli

quick=sim:clock=simulated

teardown() {
	[ -z "$mounted" ] || umount "$mounted"
}

# Wait until a capture in the background has written something.
until_it_runs() {
	for _ in $(seq 600); do
		incise info "$1" --json >rows.json 2>/dev/null &&
			[ "$(key rows.json rows.force)" -gt "${2:-0}" ] && return
		sleep 0.1
	done
	echo "$1: no rows after 60 s; capture said: $(cat err)"
	false
}

# bats test_tags=check
@test "capture records a given time" {
	run -0 --separate-stderr incise capture -o a.rec --rig $quick --duration 1500ms
	[ -z "$stderr" ]
	[[ "${lines[0]}" == "a.rec: 1.5 s, "*" 0 lost"* ]]
	# a line per stream, below a heading
	[ "${lines[1]}" = "calibration nominal values" ]
	[[ "${lines[2]}" == "stream "*"drift ppm"* ]]
	[[ "${lines[3]}" == "force "* ]]
	[[ "${lines[4]}" == "tracker "* ]]
	[ "${lines[5]}" = "warning: no delay calibration for force, tracker (run 'incise calibrate delay')" ]
	[ "${lines[6]}" = "wrote a.rec" ]
	[ "${#lines[@]}" -eq 7 ]
	[ ! -e a.rec.part ]
	[ "$(ls a.rec)" = recording.db ]
	[ "$(ask a.rec "SELECT value FROM meta WHERE key='complete'")" = 1 ]
	# 10 kHz for 1.5 s, and one more at the very end of it
	n=$(ask a.rec 'SELECT count(*) FROM force')
	[ "$n" -ge 15000 ]
	[ "$n" -le 15001 ]
}

# bats test_tags=check
@test "capture reports as JSON" {
	incise capture -o a.rec --rig $quick --duration 2s --json >report.json
	[ "$(key report.json path)" = a.rec ]
	[ "$(key report.json seconds)" = 2.0 ]
	[ "$(key report.json force)" = "$(ask a.rec 'SELECT count(*) FROM force')" ]
	[ "$(key report.json tracker)" = "$(ask a.rec 'SELECT count(*) FROM tracker')" ]
	[ "$(key report.json depth)" = "$(ask a.rec 'SELECT count(*) FROM depth')" ]
	[ "$(key report.json lost)" = 0 ]
	[ "$(key report.json clipped)" = 0 ]
	[[ "$(key report.json zero_mV)" == 1[78]?.* ]]
}

# SIGHUP comes twice of a terminal that closes: the kernel's, and the shell's to its jobs.
# bats test_tags=check
@test "capture runs in real time, and ends at SIGINT, SIGTERM and SIGHUP with a whole recording" {
	for signal in INT TERM "HUP HUP HUP"; do
		incise capture -o a.rec --rig sim:clock=real >out 2>err 3>&- &
		pid=$!
		until_it_runs a.rec.part 2000
		for one in $signal; do
			kill -"$one" $pid 2>/dev/null || :
		done
		# a machine that stands still loses samples, which is another matter
		wait $pid || grep -q "samples were lost" err || complain "$signal: $(cat err)" || return
		# but for that, and the line of each second
		run ! grep -vE '^[0-9]+ s: |samples were lost' err
		grep -q '^a.rec: ' out
		[ ! -e a.rec.part ]
		[ "$(ask a.rec "SELECT value FROM meta WHERE key='complete'")" = 1 ]
		rm -r a.rec
	done
}

# bats test_tags=check
@test "capture killed in mid recording leaves a readable .part" {
	incise capture -o a.rec --rig sim:clock=real >out 2>err 3>&- &
	pid=$!
	until_it_runs a.rec.part 6000
	kill -KILL $pid
	wait $pid || true
	[ ! -e a.rec ]
	[ "$(ask a.rec.part 'PRAGMA integrity_check')" = ok ]
	[ "$(ask a.rec.part 'SELECT count(*) FROM force')" -gt 6000 ]
	[ "$(ask a.rec.part "SELECT value FROM meta WHERE key='force_rows'")" = \
		"$(ask a.rec.part 'SELECT count(*) FROM force')" ]

	# It is not lost by the next capture of that name, only by --overwrite.
	fails incise capture -o a.rec --rig $quick --duration 1s -- "a.rec.part:"
	[ -d a.rec.part ]
	incise capture -o a.rec --rig $quick --duration 1s --overwrite
	[ -d a.rec ]
	[ ! -e a.rec.part ]
}

@test "a log that is cut off while it is written ends the capture with one line" {
	for what in "truncate -s 0" rm; do
		incise capture -o a.rec --rig sim:clock=real --duration 1h >out 2>err 3>&- &
		pid=$!
		until_it_runs a.rec.part 6000
		[ ! -e a.rec.part/recording.db-shm ]
		$what a.rec.part/recording.db-wal
		status=0
		wait $pid || status=$?
		[ "$status" -eq 1 ]
		[ "$(grep -c "^incise" err)" -eq 1 ] # a busy machine also prints its progress
		grep -q "a.rec.part/recording.db-wal: was \(cut off\|removed\) by another program" err
		[ ! -e a.rec ]
		rm -r a.rec.part
	done
}

@test "capture --overwrite keeps its hands off a recording under way" {
	incise capture -o a.rec --rig sim:clock=real >out 2>err 3>&- &
	pid=$!
	until_it_runs a.rec.part
	run --separate-stderr incise capture -o a.rec --rig $quick --duration 1s --overwrite
	failed_with "another incise capture is writing it"
	kill -INT $pid
	wait $pid
	[ -d a.rec ]
}

# bats test_tags=check
@test "capture refuses an existing recording, --overwrite replaces it" {
	incise capture -o a.rec --rig $quick --duration 1s
	before=$(sha256sum <a.rec/recording.db)
	fails incise capture -o a.rec --rig $quick --duration 2s -- "a.rec: exists"
	[ "$(sha256sum <a.rec/recording.db)" = "$before" ]
	incise capture -o a.rec --rig $quick --duration 2s --overwrite
	[ "$(ask a.rec 'SELECT count(*) FROM force')" -ge 20000 ]
	[ "$(ls)" = a.rec ]
}

@test "capture --overwrite that fails leaves the old recording" {
	incise capture -o a.rec --rig $quick --duration 1s
	before=$(sha256sum <a.rec/recording.db)
	run --separate-stderr incise capture -o a.rec --rig $quick,cut_s=1,pause_s=0.1 --overwrite
	failed_with "deep while the zero"
	[ "$(sha256sum <a.rec/recording.db)" = "$before" ]
	run --separate-stderr incise capture -o a.rec --rig $quick,cut_s=1 --trigger 100N --overwrite
	failed_with "it was never triggered; nothing was recorded, and nothing was replaced"
	[ "$(sha256sum <a.rec/recording.db)" = "$before" ]
	[ "$(ls)" = a.rec ]
}

# bats test_tags=check
@test "capture with the blade in the tissue fails and leaves nothing" {
	run --separate-stderr incise capture -o a.rec --rig $quick,cut_s=1,pause_s=0.1
	failed_with "keep the tool free of contact for the first 0.5 s"
	[ -z "$(ls)" ]
}

@test "capture without a rig says how to get one" {
	[ ! -e /etc/incise/rig.conf ] || skip "this machine has /etc/incise/rig.conf"
	fails incise capture -o a.rec -- "--rig sim:"
	[ -z "$(ls)" ]
}

@test "capture takes ./rig.conf" {
	cat >rig.conf <<-'EOF'
		clock = "simulated";
		tracker = "sim:";
		force = "sim:";
		surface = { point_mm = [0.0, 0.0, -1.0]; normal = [0.0, 0.0, 1.0]; };
	EOF
	incise capture -o a.rec --duration 1s
	[ "$(ask a.rec "SELECT value FROM meta WHERE key='rig'")" = rig.conf ]
	[ "$(ask a.rec "SELECT value FROM meta WHERE key='surface_point_z_mm'")" = -1.0 ]
	# one below the default surface: one less of depth
	[ "$(ask a.rec 'SELECT max(abs(depth_mm + 1 + tracker.z_mm)) < 1e-12 FROM depth JOIN tracker
		USING(seq)')" = 1 ]
}

small_disk() {
	mkdir disk
	if mount -t tmpfs -o "size=$1" tmpfs disk 2>/dev/null; then
		mounted=$PWD/disk
	else
		skip "mounting a small tmpfs is not permitted"
	fi
}

@test "capture asks for room before it begins" {
	small_disk 40m
	# 16 MB and 5 s are kept back; an hour at 10 kHz takes some 140 MB
	fails incise capture -o disk/a.rec --rig $quick --duration 1h -- "enough for "
	[ -z "$(ls disk)" ]
	incise capture -o disk/a.rec --rig $quick --duration 5s
	small=$(stat -c %s disk/a.rec/recording.db)
	[ "$small" -lt 500000 ]
	head -c 25m /dev/zero >disk/more
	run --separate-stderr incise capture -o disk/b.rec --rig $quick --duration 1s
	failed_with "are reserved to end a recording"
	[ ! -e disk/b.rec.part ]
}

@test "capture ends while there is room to end in" {
	small_disk 40m
	incise capture -o disk/a.rec --rig sim: --duration 100s >out 2>err 3>&- &
	until_it_runs disk/a.rec.part 1000
	head -c 24m /dev/zero >disk/more # as another program does
	status=0
	wait $! || status=$?
	[ "$status" -eq 1 ]
	grep -q 'disk is nearly full (.* MB free); the recording was ended' err
	# and else a line for each second
	[ "$(grep -cv '^[0-9]* s: ' err)" -eq 1 ]
	incise verify disk/a.rec
	incise info disk/a.rec >/dev/null
}

@test "capture at the limit on the size of files" {
	run --separate-stderr bash -c "trap '' XFSZ; ulimit -f 1000
		incise capture -o a.rec --rig $quick"
	failed_with "a.rec:"
	[ ! -e a.rec ]
	[ "$(ask a.rec.part 'PRAGMA integrity_check')" = ok ]
	[ "$(ask a.rec.part 'SELECT count(*) FROM force')" -gt 1000 ]
}

@test "capture takes names with spaces and signs" {
	incise capture -o "my liver, 'old' 100% ?#.rec/" --rig $quick --duration 1s
	[ -f "my liver, 'old' 100% ?#.rec/recording.db" ]
}

@test "capture without descriptors names the reason and leaves no empty folder" {
	local n status seen=0
	for n in {3..12}; do
		status=0
		(exec 3>&- 4>&-
		exec timeout 60 prlimit --nofile="$n" "$INCISE_BUILD/bin/incise-capture" -o "$n.rec" \
			--rig sim: --duration 500ms </dev/null >/dev/null 2>err) || status=$?
		# too few for the program's libraries; or enough, also where a busy machine loses samples
		[ $status -eq 1 ] && ! grep -q "were lost" err || continue
		seen=1
		grep -q "Too many open files" err || { echo "$n: $(cat err)"; false; }
		if grep -q "the committed data" err; then
			incise info "$n.rec" >/dev/null
		else
			[ ! -e "$n.rec.part" ]
		fi
	done
	[ $seen = 1 ]
}

@test "capture whose folder is removed or moved says what is left of it" {
	local pid how
	for how in rm mv; do
		incise capture -o $how.rec --rig sim: --duration 1h </dev/null 2>err 3>&- &
		pid=$!
		# before rows are committed nothing is kept
		until_it_runs $how.rec.part
		# in one step for the program
		kill -STOP $pid
		mv $how.rec.part $how-away
		[ $how = mv ] || rm -r $how-away
		kill -CONT $pid
		wait $pid && false
		cat err
		case $how in
		rm) grep -q "rm.rec.part: was removed by another program .*no data remain" err ;;
		mv) grep -q "mv.rec.part: was moved by another program" err
			incise info mv-away >/dev/null ;;
		esac
	done
}

# bats test_tags=check
@test "a calibration that lies here is used and named, and nominal values of a real rig are warned of" {
	printf '%s\n' 'clock = "simulated";' 'tracker = "sim:";' 'force = "sim:";' >rig.conf
	run -0 --separate-stderr incise capture -o a.rec --duration 200ms
	[[ "$stderr" == *"warning: nominal values: not calibrated"* ]]
	run -0 --separate-stderr incise capture -o b.rec --duration 200ms -c none
	[ -z "$stderr" ]
	printf 'mass_g,reading_mV\n' >masses.csv
	for n in {0..14}; do echo "$((n % 5 * 100)),$((180 + n % 5 * 1250))"; done >>masses.csv
	incise calibrate force --from masses.csv >/dev/null
	# another new file of a similar name is no mistake
	incise calibrate force --from masses.csv -c calibration-b.conf >/dev/null
	run -0 --separate-stderr incise capture -o c.rec --duration 200ms
	[ -z "$stderr" ]
	[ "${lines[1]}" = "calibration calibration.conf of $(date -u +%F)" ]
	[[ "$(incise info c.rec)" == *"calibration  1274"* ]] || incise info c.rec
	[ "$(incise haptic liver --duration 200ms --rig sim:clock=simulated --json | jq -r .calibration.path)" = calibration.conf ]
	[ "$(incise capture -o d.rec --duration 200ms -c none --json | jq .calibration)" = null ]
}
