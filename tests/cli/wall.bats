# SPDX-License-Identifier: GPL-2.0-or-later
# Wall time on the command line: capture, info, export; starts by a time and by the SYNC line.

load cli

setup() {
	cd "$BATS_TEST_TMPDIR"
	quick="sim:clock=simulated,cut_s=1,pause_s=0.5"
	real="sim:clock=real"
}

# bats test_tags=check
@test "capture --clock-source, info and export have the time of a simulated clock" {
	incise capture -o a.rec --rig "$quick" --duration 5s --clock-source sim:1800000000,50,3
	run -0 --separate-stderr incise info a.rec
	[[ "$output" == *"wall time  2027-01-15T07:59:24."*"Z to 2027-01-15T07:59:29."*"bound) 0.003 ms"* ]]
	[[ "$output" == *"by simulated, time of TAI; TAI is UTC + 37 s (assumed)"* ]]
	# the first force sample is at t_ns 1e9 of the rig, on the mapping to 1 ns
	run -0 --separate-stderr incise info a.rec --json
	jq -e '.wall.start | (.tai_ns - 1800000000000000000 - .t_ns * 1.00005 | fabs) < 1000' <<<"$output"
	jq -e '.wall | .sources == ["simulated"] and .restarts == [] and .held == 0' <<<"$output"
	run -0 --separate-stderr incise export --no-lineage a.rec --resample --rate 10 --tai
	[[ "${lines[0]}" == *,tai_ns,tai_u_ns ]]
	[[ "${lines[1]}" == *,18000000???????????,300? ]]
	run -0 --separate-stderr incise export a.rec --rate 10 --tai
	[[ "$output" == *"# wall_start_utc: 2027-01-15T07:59:23."* || "$output" == *"# wall_start_utc: 2027-01-15T07:59:24."* ]]
	[[ "$output" == *"# wall_source: simulated, time of TAI"* ]]
	incise verify a.rec
}

@test "without wall time info says so, and export --tai is refused" {
	incise capture -o a.rec --rig "$quick" --duration 3s
	run -0 --separate-stderr incise info a.rec
	[[ "$output" == *"wall time  none"* ]]
	run -0 --separate-stderr incise info a.rec --json
	jq -e '.wall == null' <<<"$output"
	fails incise export a.rec --resample --tai -- "a.rec:"
}

@test "a recording of a real clock has the time of this computer" {
	# again, if the clock was set meanwhile
	set_s=
	until [ "$set_s" = 0 ]; do
		before=$(date +%s) from_ms=$(uptime_ms)
		captures -o a.rec --rig "$real" --duration 500ms --overwrite
		after=$(date +%s)
		set_s=$(((after - before - ($(uptime_ms) - from_ms) / 1000) / 2))
	done
	run -0 --separate-stderr incise info a.rec --json
	# a source may correct the clock; a second is more than any here does
	jq -e --argjson a "$before" --argjson b "$after" '.wall as $w |
		$w.start.tai_ns / 1e9 - $w.utc_offset_s |
		. >= $a - 2 and . <= $b + 2' <<<"$output"
	is_intact a.rec
}

# bats test_tags=check
@test "sources that are not there, or not of this clock" {
	for source in sim: sim:1; do
		run -1 --separate-stderr incise capture -o a.rec --rig "$real" --duration 100ms \
			--clock-source $source
		failed_with "clock source '$source': is for a simulated clock"
		[[ "${stderr_lines[0]}" == *"; use a rig sim:clock=simulated, or another source" ]]
		[ ! -e a.rec.part ]
	done
	run -1 --separate-stderr incise capture -o a.rec --rig "$quick" --clock-source ptp
	failed_with "is simulated and has no wall time"
	# no program behind it; port 1 of 127.0.0.1 is no one's
	for source in "ptp:$PWD/none" chrony:1; do
		run -1 --separate-stderr incise capture -o a.rec --rig "$real" --duration 100ms \
			--clock-source "$source"
		failed_with "clock source '$source': "
		[[ "${stderr_lines[0]}" == *"does not answer"*"; start it, or use auto" ]]
		[ ! -e a.rec ] && [ ! -e a.rec.part ]
	done
}

@test "the report of capture has the wall time, and a source that gives none is warned of" {
	incise capture -o a.rec --rig "$quick" --duration 2s --clock-source sim:1800000000,0,3 >text
	grep -q '^wall time  2027-01-15T07:59:2.*uncertainty (bound) 0.003 ms' text
	grep -q 'by simulated, time of TAI' text
	incise capture -o b.rec --rig "$quick" --duration 2s --clock-source sim: --json >b.json
	jq -e '.wall.sources == ["simulated"] and .wall.end.uncertainty_ns == 1000' b.json
	incise capture -o c.rec --rig "$quick" --duration 2s --json >c.json
	jq -e '.wall == null' c.json
	# the kernel of a test machine is synchronised or not, and the warnings say so
	captures -o k.rec --rig "$real" --duration 200ms --clock-source kernel --json >k.json
	grep -v "were lost" captures.err >err || :
	if jq -e '.wall.sources == ["kernel"]' k.json; then
		[ ! -s err ]
	else
		jq -e '.wall | .sources == ["plain"] and .start.uncertainty_ns == null' k.json
		grep -q 'warning: --clock-source kernel: not synchronised' err
		grep -q 'warning: k.rec: the wall time is not by kernel in' err
	fi
}

# bats test_tags=check
@test "capture --start-at starts then" {
	incise capture -o a.rec --rig "$quick" --clock-source sim:1800000000 --duration 1s \
		--start-at 2027-01-15T08:00:10.5TAI
	# the second before it is recorded too; a simulated clock waits exactly, a sample is 0.1 ms
	[ "$(ask a.rec "SELECT t_ns FROM events WHERE kind = 'trigger'")" = 10500000000 ]
	[ "$(ask a.rec "SELECT min(t_ns) BETWEEN 9500000000 AND 9500100000 FROM force")" = 1 ]
	[ "$(ask a.rec "SELECT max(t_ns) BETWEEN 11499900000 AND 11500100000 FROM force")" = 1 ]
	incise verify a.rec
	# the same time in UTC
	incise capture -o b.rec --rig "$quick" --clock-source sim:1800000000 --duration 1s \
		--start-at 2027-01-15T07:59:33.5Z
	[ "$(ask a.rec "SELECT min(t_ns) FROM force")" = "$(ask b.rec "SELECT min(t_ns) FROM force")" ]
}

@test "times that cannot be" {
	run -1 --separate-stderr incise capture -o a.rec --rig "$quick" --clock-source sim \
		--start-at 2020-01-01T00:00:00Z
	failed_with "this time is in the past; give one to come"
	run -1 --separate-stderr incise capture -o a.rec --rig "$quick" \
		--start-at 2027-01-15T08:00:10Z
	failed_with "has no wall time; give it one by --clock-source sim"
	# waiting ends by SIGINT, and leaves nothing
	incise capture -o a.rec --rig "$real" --start-at 2037-01-01T00:00:00Z 2>err 3>&- &
	until_it_catches $! incise-capture 2
	kill -INT $!
	status=0
	wait $! || status=$?
	stderr=$(cat err)
	mapfile -t stderr_lines <err
	failed_with "nothing was recorded"
	[ ! -e a.rec ] && [ ! -e a.rec.part ]
}

@test "capture --trigger sync starts at a pulse, whose edge is an event" {
	mkfifo events
	# an input, which is no pulse, and then pulses 7, 8, …; held open to the end
	python3 - <<-'END' &
		import struct, time
		with open("events", "wb", buffering=0) as pipe:
		    def event(kind, number):
		        pipe.write(struct.pack("<QqqHHI", 1, time.monotonic_ns(), number, kind, 0, 0))
		    event(3, 0)
		    time.sleep(0.5)
		    try:
		        for number in range(7, 1000):
		            event(4, number)
		            time.sleep(0.2)
		    except BrokenPipeError:
		        pass
	END
	captures -o a.rec --rig "$real" --trigger sync:events --duration 300ms
	wait $!
	[ "$(ask a.rec "SELECT text FROM events WHERE kind = 'sync' ORDER BY rowid LIMIT 1")" = "pulse 7" ]
	# noted at its edge, a poll or more before the trigger was seen
	[ "$(ask a.rec "SELECT (SELECT t_ns FROM events WHERE kind = 'trigger') >
		(SELECT min(t_ns) FROM events WHERE kind = 'sync')")" = 1 ]
	run -1 --separate-stderr incise capture -o b.rec --rig "$real" --trigger sync:/dev/null
	failed_with "not a controller of the stepper module"
	fails incise capture -o b.rec --rig "$real" --trigger sync:none -- "No such file"
}
