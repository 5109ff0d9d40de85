# SPDX-License-Identifier: GPL-2.0-or-later
# Captures whose disk or whole process stands still, whose tracker goes and comes back, that
# others read or would replace meanwhile, and that are suspended at a terminal. What is lost
# is counted, the same by everyone; times go on. CLOCK_REALTIME that is set, and cameras that
# go, are in tests/vm/guest/capture_time.sh.

load ../cli/cli
load ../cli/fastrak

setup() {
	! judged || watch_machine
	memory_folder
	export INCISE_MODULE_PATH=$INCISE_BUILD/lib/incise
	cat >rig.conf <<-END
		clock = "real";
		tracker = "tty:$PWD/tracker:115200";
		force = "sim:";
		camera = "sim:";
		# far below where the emulator's sensor goes
		surface = { point_mm = [0.0, 0.0, -500.0]; normal = [0.0, 0.0, 1.0]; };
	END
}

# Buffers hold a second more than the stalls here. A machine that lets others wait for long has no time
# to compress what they hold, and arrivals are late: a full attack alone judges that nothing is lost and
# times are straight, and repeats a test during which the machine stood still.
judged() {
	[ "$ATTACK" = full ]
}

teardown() {
	pull_away
	left_memory
	machine_watched 100
}

ask() {
	sqlite3 -readonly "$1/recording.db" "$2"
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

# The times of records, those of table tracker and those of table knots, lie on a line of
# the emulator's rate, which is by this clock. Once it has settled the live one is as good
# as its jitter; a stall that bends it does so by many periods of 8.3 ms. Knots are to be
# within the 0.5 ms that are promised without stamps.
straight() {
	judged || return 0
	local period_ns="(1e9 / $1)"
	holds "$(ask a.rec "SELECT max(abs(t_ns - seq * $period_ns - (SELECT avg(t_ns - seq *
		$period_ns) FROM tracker))) FROM tracker WHERE seq > 120") < 2e6"
	holds "$(ask a.rec "SELECT max(abs(t_ns - seq * $period_ns - (SELECT avg(t_ns - seq *
		$period_ns) FROM knots))) FROM knots") < 0.5e6"
}

pictures_can_be_recorded() {
	[ -e "$INCISE_MODULE_PATH/frames_mkv.so" ]
}

# stalled_capture CAMERA_HZ: a capture whose disk does not answer now and then: STALL_… of stall.c.
stalled_capture() {
	local camera=off
	echo "sim = { camera_hz = $1; };" >>rig.conf
	! pictures_can_be_recorded || camera=frames
	LD_PRELOAD=$INCISE_BUILD/tests/attack/stall.so run --separate-stderr incise capture \
		-o a.rec --camera $camera --duration 6s --json
	echo "$output" >report.json
}

nothing_lost() {
	! judged || [ "$(key report.json lost)" = 0 ] || complain "$(cat report.json)"
}

# Capture's report, verify and the tables of the recording agree on the samples lost.
agreed() {
	local code=0 stream
	incise verify --json a.rec >verify.json || code=$?
	[ "$(key verify.json intact)" = 1 ] || complain "$(cat verify.json)"
	[ "$code" -eq "$(($(key report.json lost) > 0))" ]
	for stream in 0 1; do
		name=$(key verify.json "streams[$stream].name")
		[ "$(key verify.json "streams[$stream].lost")" = "$(key report.json "${name}_lost")" ]
		[ "$(key verify.json "streams[$stream].present")" = "$(key report.json "$name")" ]
	done
	[ "$(ask a.rec 'SELECT sum(lost) FROM streams')" = "$(key report.json lost)" ]
	[ "$(ask a.rec 'SELECT count(*) FROM frames')" = "$(key report.json frames)" ]
}

@test "a disk that does not answer for 1.5 s, twice: nothing is lost" {
	plug_in
	export STALL_FIRST_MS=1000 STALL_EVERY_MS=3500 STALL_MS=1500
	# Pictures that waited are compressed before the next stall, 25 ms of a processor each. At 20 Hz
	# that took half of one all the time, which a machine that does other things does not have. At
	# 6 Hz a stall leaves 9 of them for a buffer of 16, one for 2.6 s.
	stalled_capture 6.0
	nothing_lost
	agreed
	straight 120
	# it has stood still: so long nothing was committed
	holds "$(ask a.rec "SELECT max(last_ns - first_ns) FROM blocks WHERE
		stream = 'force'") > 1.3e9"
}

@test "a disk that does not answer for 4 s: what had no room is counted" {
	plug_in
	export STALL_FIRST_MS=1000 STALL_MS=4000
	# more in these 4 s than there is room for; a machine that is busy loses more
	stalled_capture 20.0
	[ "$status" = 1 ]
	[[ "$stderr" == *"force samples"*"were lost"* ]] || complain "$stderr"
	agreed
	! judged || [ "$(key report.json tracker_lost)" = 0 ]
	straight 120
	# 10 kHz, and room for 2.5 s of them; a machine that is late adds to it. Numbers show what is
	# between.
	holds "$(key report.json force_lost) > 14000"
	[ "$(ask a.rec 'SELECT max(seq) - min(seq) + 1 - count(*) FROM force')" = \
		"$(key report.json force_lost)" ]
	! pictures_can_be_recorded || holds "$(key report.json frames_lost) > 20"
}

# stopped_for PID S: the capture stands still for so long, goes on for two seconds of its tracker, and ends.
stopped_for() {
	kill -STOP "$1"
	sleep "$2"
	kill -CONT "$1"
	until_records "$(($(key rows.json rows.tracker) + 480))"
	kill -INT "$1"
	wait "$1" || [ $? = 1 ]
}

@test "a process that is stopped for 1.5 s: nothing is lost" {
	plug_in
	incise capture -o a.rec --camera off --duration 1h --json >report.json 2>err 3>&- 9>&- &
	until_records 180
	stopped_for $! 1.5
	nothing_lost
	agreed
	straight 120
}

@test "a process that is stopped until the terminal's buffer is full" {
	# 240 Hz; the kernel keeps some 64 kB, 5 s of them
	plug_in --kind liberty
	incise capture -o a.rec --camera off --duration 1h --json >report.json 2>err 3>&- 9>&- &
	until_records 240
	stopped_for $! 6.5
	agreed
	holds "$(key report.json tracker_lost) > 100"
	[ "$(ask a.rec 'SELECT max(seq) - min(seq) + 1 - count(*) FROM tracker')" = \
		"$(key report.json tracker_lost)" ]
	# 240 of them a second, there or lost; at either end an arrival is late by less than 0.1 s.
	# straight() finds a number that is wrong by one.
	! judged || holds "$(ask a.rec 'SELECT abs((max(arrival_ns) - min(arrival_ns)) * 240e-9 -
		max(seq) + min(seq)) FROM tracker') < 24"
	straight 240
}

@test "a tracker that comes back with another phase: its times are right at once" {
	local code=0
	plug_in
	incise capture -o a.rec --camera off --duration 1h --json >report.json 2>err 3>&- 9>&- &
	until_records 240
	echo unplug >&9
	sleep 0.5
	# what is most, less than half a period, that rounding would move it by
	echo late 3000 >&9
	echo plug >&9
	# where the line begins anew, and two seconds from there, however long that takes
	until_records "$(($(key rows.json rows.tracker) + 480))"
	kill -INT $!
	wait $! || code=$?
	[ "$code" = 1 ]
	agreed
	# where the line begins anew is where records are missing
	[ "$(ask a.rec 'SELECT count(*) FROM knots WHERE begins')" = 2 ] ||
		complain "$(ask a.rec "SELECT * FROM knots WHERE begins; SELECT * FROM events")"
	first=$(ask a.rec 'SELECT max(seq) FROM knots WHERE begins')
	holds "$(ask a.rec "SELECT $first - max(seq) - 1 FROM tracker WHERE seq < $first") > 0"
	# A busy machine may lose some elsewhere, which are counted as well.
	[ "$(ask a.rec 'SELECT max(seq) - min(seq) + 1 - count(*) FROM tracker')" = \
		"$(key report.json tracker_lost)" ]
	# The least delay of a second is the line's to its jitter, and a few lowest of 120
	# come within 1 ms: right after it came back as before and as much later.
	delay_ns=$(ask a.rec "SELECT delay_ns FROM streams WHERE name = 'tracker'")
	for from in 120 "$first" $((first + 120)); do
		least=$(ask a.rec "SELECT min(arrival_ns - t_ns) - $delay_ns FROM tracker
			WHERE seq BETWEEN $from AND $from + 119")
		! judged || holds "$least >= -0.5e6 && $least < 1e6"
	done
}

@test "two captures of one name at once: one is told so" {
	local first second
	for _ in 1 2 3; do
		rm -rf a.rec
		incise capture -o a.rec --rig sim:clock=simulated --duration 10s >out1 2>err1 3>&- &
		first=$!
		incise capture -o a.rec --rig sim:clock=simulated --duration 10s >out2 2>err2 3>&- &
		second=$!
		wait $first && first=0 || first=$?
		wait $second && second=0 || second=$?
		[ $((first + second)) = 1 ] || complain "$first $second: $(cat err1 err2)"
		[ "$(cat err1 err2 | wc -l)" = 1 ]
		[ ! -e a.rec.part ]
		incise verify a.rec
	done
}

# reads NAME CODE COMMAND…: again and again until the file `end` is there; each time with that
# exit code. The file NAME has a line for each.
reads() {
	local name=$1 code=$2 got
	shift 2
	until [ -e end ]; do
		got=0
		rm -f part.csv
		"$@" >"said.$name" 2>&1 || got=$?
		# it ends, and its name changes, before the file is there
		[ -d a.rec.part ] || break
		[ $got = "$code" ] || complain "$name: $got: $(cat "said.$name")" >>wrong || true
		echo >>"$name"
	done
}

@test "a capture that others read all the time loses nothing" {
	incise capture -o a.rec --rig sim:clock=real --duration 1h --json >report.json 2>err 3>&- &
	capture=$!
	readers=()
	until_records 60
	reads info 0 incise info a.rec.part 3>&- &
	readers+=($!)
	reads export 0 incise export a.rec.part --resample --rate 100 -o part.csv 3>&- &
	readers+=($!)
	# which is not complete
	reads verify 1 incise verify a.rec.part 3>&- &
	readers+=($!)
	for name in info export verify; do
		has_read() { [ "$(wc -l <$name)" -ge 3 ]; }
		await has_read
	done
	kill -INT $capture
	wait $capture || [ $? = 1 ]
	touch end
	wait "${readers[@]}"
	nothing_lost
	agreed
	[ ! -e wrong ] || complain "$(cat wrong)"
}

@test "at a terminal: suspended, in the background, ended, failed" {
	local scene pids=()
	for scene in suspend background terminate quit full; do
		timeout 900 "$root/tests/attack/terminal" $scene incise capture -o $scene.rec \
			--rig sim:force_hz=1000 --duration 1h >$scene.out 2>$scene.err 3>&- &
		pids+=($!)
	done
	for scene in 0:suspend 0:background 0:terminate 131:quit 1:full; do
		status=0
		wait "${pids[0]}" || status=$?
		pids=("${pids[@]:1}")
		# of a machine that stands still samples are lost
		[ $status = ${scene%:*} ] || { [ $status = 1 ] && grep -q "were lost" ${scene#*:}.out; } || complain "${scene#*:}: $status $(cat ${scene#*:}.err)"
	done
	for scene in suspend background terminate; do
		is_intact $scene.rec
	done
	[ "$(ask suspend.rec "SELECT count(*) FROM events WHERE kind = 'marker'")" = 1 ]
	grep -q 'full.rec: disk full' full.out
	# What is shown while it runs fits 40 columns.
	sed 's/\x1b\[[0-9]*[AJ]/\n/g; s/\r//g; /\.rec: /,$d' suspend.out >shown
	grep -q force shown
	! grep -E '^.{41}' shown
}
