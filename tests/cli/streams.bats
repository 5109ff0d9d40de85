# SPDX-License-Identifier: GPL-2.0-or-later
# Sources from the network, sent by the libraries that others use (tests/streams): pylsl with its
# liblsl, and pyigtl.

load cli

setup() {
	work_folder
	peers="$INCISE_BUILD/tests/streams"
}

teardown() {
	for one in $sender $capture; do
		kill -KILL "$one" 2>/dev/null || :
	done
}

# A session of the test's own on this machine alone: others send, too, and of several streams
# only one may be found (liblsl#92).
lsl() {
	[ -e "$peers/ready" ] || skip "pylsl is not there; see build/tests/streams/venv.log"
	PYLSL_LIB=$(echo "$peers"/venv/lib/python3*/site-packages/pylsl/lib/liblsl.so)
	[ -e "$PYLSL_LIB" ] || skip "this pylsl brings no liblsl for this machine"
	name=incise-$$-$BATS_TEST_NUMBER
	cat >lsl.cfg <<-END
		[multicast]
		ResolveScope = machine
		[lab]
		KnownPeers = {127.0.0.1}
		SessionID = $name
		[log]
		level = -2
	END
	export PYLSL_LIB LSLAPICFG=$PWD/lsl.cfg
	rig "sim:" "lsl:$name:Fz"
}

rig() {
	cat >rig.conf <<-END
		clock = "real";
		tracker = "$1";
		force = "$2";
		surface = { point_mm = [0.0, 0.0, 0.0]; normal = [0.0, 0.0, 1.0]; };
		# in the air while the zero of the force is measured, however late that is
		sim = { pause_s = 3600.0; };
	END
}

# Start a program of tests/streams in the background; its first line is in the file began.
send() {
	rm -f began
	"$peers/$1" "${@:2}" >began 2>send.err 3>&- &
	sender=$!
	await test -s began || complain "$1 does not start: $(cat send.err)"
}

# The program before is gone.
no_more() {
	kill "$sender"
	wait "$sender" || true
}

# begin_capture NAME: in the background as $capture, into NAME.rec.
begin_capture() {
	recording=$1
	rm -rf "$1.rec"
	incise capture -o "$1.rec" --duration 1h >out 2>err 3>&- &
	capture=$!
}

# Until it has more rows of a stream than that.
until_rows() {
	has_rows() {
		kill -0 $capture || return 0
		incise info "$recording.rec.part" --json >rows.json && [ "$(key rows.json "rows.$1")" -gt "$2" ]
	}
	await has_rows "$1" "$2"
	kill -0 $capture || complain "$(cat err)"
}

# fails TEXT: one of its streams ends, and this is said of it at its own end.
fails() {
	has_failed() {
		rm -rf seen
		cp -r "$recording.rec.part" seen
		[ "$(sqlite3 seen/recording.db "SELECT count(*) FROM events WHERE kind = 'failed'")" = 1 ]
	}
	await has_failed
	kill -INT $capture
	ends_with 1 || return
	grep -qF "$1" err || complain "$(cat err)"
}

# ends_with CODE: its exit code at its end.
ends_with() {
	local status=0
	wait $capture || status=$?
	[ "$status" = "$1" ] || complain "$status: $(cat err)"
}

ask() {
	sqlite3 a.rec/recording.db "$1"
}

@test "an LSL stream in newtons is captured: values, times and losses are those sent" {
	lsl
	# 3 s are enough to begin
	send lsl_send "$name" --wait --hole 3500:5 --nan 3000 --ahead 3200
	begin_capture a
	until_rows force 4500
	kill -INT $capture
	# some samples are missing on purpose
	ends_with 1
	grep -q "force samples were lost" err
	# Exact in steps of 2^-17 N; times to the sender's clock within the uncertainty that LSL states,
	# and a tenth of the period.
	ask "SELECT seq, t_ns, code FROM force ORDER BY seq" >rows
	python3 - "$(tail -n 1 began)" <<-'END'
		import sqlite3, sys
		start = int(sys.argv[1])
		db = sqlite3.connect("a.rec/recording.db")
		rows = [tuple(map(int, line.split("|"))) for line in open("rows")]
		sd, = db.execute("SELECT delay_sd_ns FROM streams WHERE name = 'force'").fetchone()
		assert sd > 0, sd
		sent = []
		for seq, t_ns, code in rows:
		    value = (code - 2**30) / 2**17 * 32768
		    assert value in range(1000), (seq, code)
		    i = 1000 * round(((t_ns - start) / 1e6 - value) / 1000) + int(value)
		    assert abs(t_ns - start - i * 1e6) < 1e5 + 5 * sd, (seq, t_ns - start, sd)
		    sent.append(i)
		missing = set(range(sent[0], sent[-1] + 1)) - set(sent)
		# and more, if this machine stood still for seconds
		assert missing >= {3000, 3200, *range(3500, 3505)}, missing
		meta = dict(db.execute("SELECT key, value FROM meta"))
		assert meta["force_newtons"] == 1 and meta["force_mV_N"] == 1000, meta
		assert meta["force_lost"] == len(missing), (meta["force_lost"], missing)
		print(len(missing))
	END
	run -1 incise verify a.rec
	[[ "$output" == *"$(ask "SELECT value FROM meta WHERE key = 'force_lost'") samples were lost during the capture; the rest is as it was written" ]]
	# mV/N of an amplifier does not apply
	echo "force_mV_N = 620.0; force_zero_mV = 99.0;" >calibration.conf
	incise export --no-lineage a.rec --resample -o own.csv
	incise export --no-lineage a.rec --resample --calibration calibration.conf -o other.csv
	cmp <(grep -v '^#' own.csv) <(grep -v '^#' other.csv)
	[[ "$(incise info a.rec)" == *"31 bits over 16384 N from -8192 N"* ]]
	incise info a.rec --json >info.json
	[ "$(key info.json adc.newtons)" = 1 ]
	run -1 incise calibrate force --rig rig.conf --weights 50g,100g,150g
	[[ "$output" == *"measures newtons itself"* ]]
}

@test "an LSL stream that fits no force, is absent or ends is one line" {
	lsl
	# without the library
	run -1 --separate-stderr env PYLSL_LIB=/nonexistent/liblsl.so incise capture -o a.rec
	[[ "$stderr" == *"force: /nonexistent/liblsl.so of PYLSL_LIB cannot be loaded as liblsl; correct that variable" ]]
	[ "${#stderr_lines[@]}" = 1 ]
	run -1 --separate-stderr env -u PYLSL_LIB incise capture -o a.rec
	[[ "$stderr" == *"liblsl is not installed; install"*"set PYLSL_LIB="* || "$stderr" == *"no LSL stream"* ]]
	run -1 --separate-stderr env PYLSL_LIB="$INCISE_BUILD/lib/libincise.so" incise capture -o a.rec
	[[ "$stderr" == *"this liblsl has no function lsl_"*"; install version 1.13 or later, and name it in PYLSL_LIB" ]]
	# nobody sends
	run -1 --separate-stderr incise capture -o a.rec
	[[ "$stderr" == *"force: no LSL stream \"$name\" found within 5 s; start the program that sends it"* ]]
	[ "${#stderr_lines[@]}" = 1 ]
	send lsl_send "$name" --unit N
	[[ "$(incise info devices)" == *'force '*' = "lsl:'"$name"'";'*'Mx (Nm), Fz (N), t (no unit)'* ]]
	for channel in Mx:"channel 0 of the stream has the unit \"Nm\"; expected N, mN, kN, V or mV" \
		t:"channel 2 of the stream has no unit" \
		9:"the stream has no channel \"9\"; it has Mx (Nm), Fz (N), t (no unit)" \
		:"expected lsl:NAME or lsl:NAME:CHANNEL"; do
		rig "sim:" "lsl:$name:${channel%%:*}"
		run -1 --separate-stderr incise capture -o a.rec
		[[ "$stderr" == *"${channel#*:}"* ]] || complain "$stderr"
		[ "${#stderr_lines[@]}" = 1 ]
	done
	# The only channel in newtons needs no name; without a source id, LSL does not look for it
	# again when it ends.
	rig "sim:" "lsl:$name"
	begin_capture c
	until_rows force 100
	no_more
	fails "LSL $name, channel 1: the stream ended; start its program, and start again"
	send lsl_send "$name" --irregular
	run -1 --separate-stderr incise capture -o b.rec
	[[ "$stderr" == *"has a nominal rate of 0 Hz; expected 1 to 100000 Hz (a regular stream)" ]]
}

@test "an LSL stream that falls silent, or whose times are wrong, is not complete" {
	lsl
	# silent after 1.5 s of 4: what is missing is lost, though no sample comes that shows it
	send lsl_send "$name" --wait --pause 1500
	run -1 --separate-stderr incise capture -o a.rec --only force --duration 4s
	[[ "$stderr" == *"force samples were lost"* ]] || complain "$stderr"
	holds "$(ask "SELECT value FROM meta WHERE key = 'force_lost'") > 1000"
	[ "$(ask "SELECT count(*) FROM events WHERE kind = 'lost' AND text LIKE '%silent for the last%'")" = 1 ]
	no_more
	send lsl_send "$name" --wait --offset 1790000000
	run -1 --separate-stderr incise capture -o b.rec --only force --duration 60s
	[[ "$stderr" == *"its timestamps are 1.79e+09 s ahead of LSL's clock; "* ]] || complain "$stderr"
	no_more
	send lsl_send "$name" --wait --times 2
	run -1 --separate-stderr incise capture -o c.rec --only force --duration 60s
	[[ "$stderr" == *"it sends each sample more than once; "* ]] || complain "$stderr"
	no_more
	# one in a hundred is stamped 5 s back: it gets the time of its place
	send lsl_send "$name" --wait --back 100
	begin_capture d
	until_rows force 3000
	kill -INT $capture
	wait $capture || true
	[ "$(sqlite3 d.rec/recording.db "SELECT count(*) FROM events WHERE kind = 'lost' AND text LIKE '%number%'")" -lt 20 ]
	holds "$(sqlite3 d.rec/recording.db "SELECT value FROM meta WHERE key = 'force_lost'") < 3000"
	holds "$(sqlite3 d.rec/recording.db "SELECT max(t_ns) - min(t_ns) FROM force") < 1e9 * $(sqlite3 d.rec/recording.db "SELECT count(*) FROM force") / 500"
}

@test "an LSL stream whose program starts again goes on, and the hole is counted" {
	lsl
	send lsl_send "$name" --recover
	begin_capture a
	until_rows force 1000
	no_more
	# All rows of the first program, but those of the last moments, and a second's of the next one.
	incise info a.rec.part --json >rows.json
	send lsl_send "$name" --recover
	until_rows force "$(($(key rows.json rows.force) + 2000))"
	kill -INT $capture
	# some are lost
	ends_with 1
	# The second one is found again by its source id.
	ask "SELECT seq, t_ns FROM force ORDER BY seq" >rows
	python3 - "$(cat began)" <<-'END'
		import sys
		second = int(sys.argv[1])
		rows = [tuple(map(int, line.split("|"))) for line in open("rows")]
		hole = max(range(1, len(rows)), key=lambda i: rows[i][1] - rows[i - 1][1])
		(before, a), (after, b) = rows[hole - 1], rows[hole]
		assert a < second < b + 1e6, (second, a, b)
		# some windows later the number goes on as 1000 a second would
		last, end = rows[-1]
		assert abs((end - a) * 1e-6 - (last - before)) <= 2, (before, a, last, end)
		assert len(rows) - hole > 100, (len(rows), hole)
	END
	# and where it does not, the capture ends after 10 s
	begin_capture b
	until_rows force 100
	no_more
	fails "LSL $name, channel 1: no more samples arrived; see the program that sends them, and start again"
}

# A server of poses on a port of its own.
poses() {
	[ -e "$peers/ready" ] || skip "pyigtl is not there; see build/tests/streams/venv.log"
	send igtl_send "$@"
	port=$(cat began)
	rig "igtl:127.0.0.1:$port:Stylus" "sim:"
}

@test "poses of pyigtl are captured, and the loop is warned of the network" {
	poses
	begin_capture a
	until_rows tracker 150
	kill -INT $capture
	wait $capture || grep -q "force samples were lost" err
	[ "$(ask "SELECT value FROM meta WHERE key='tracker_lost'")" = 0 ]
	[ "$(ask "SELECT value FROM meta WHERE key='tracker_name'")" = "OpenIGTLink Stylus at 127.0.0.1" ]
	# Poses are those of the sender in their order, turned by 90 degrees about z; of a busy
	# machine pyigtl leaves some out. Singles, and rounding.
	ask "SELECT seq, t_ns, quote(x_mm), quote(y_mm), quote(z_mm), quote(qw), quote(qx), quote(qy),
		quote(qz) FROM tracker ORDER BY seq" >rows
	python3 - <<-'END'
		rows = [tuple(map(float, line.split("|"))) for line in open("rows")]
		for a, b in zip(rows, rows[1:]):
		    assert b[0] == a[0] + 1 and b[1] > a[1], (a, b)
		    assert (b[2] - a[2]) * 64 % 1000 > 0 and b[3:5] == (2, 10), (a, b)
		    assert abs(b[5] - 0.5**0.5) < 1e-7 and abs(b[8] - 0.5**0.5) < 1e-7, b
		    assert b[6] == b[7] == 0, b
	END
	is_intact a.rec
	# the arrival is kept next to the sender's time: on no machine are all delays the least
	[ "$(ask "SELECT min(arrival_ns >= t_ns) AND max(arrival_ns > t_ns) FROM tracker")" = 1 ]
	[ "$(ask "SELECT stamped = 1 AND rate_hz > 1 FROM streams WHERE name = 'tracker'")" = 1 ]
	no_more
	# without a name, it must be clear whose poses are meant
	poses --name Stylus --name Probe
	rig "igtl:127.0.0.1:$port" "sim:"
	run -1 --separate-stderr incise capture -o b.rec
	[[ "$stderr" == *"tracker: the server at 127.0.0.1 port $port sends several poses: "*"; name one, as in igtl:HOST:PORT:DEVICE" ]]
	rig "igtl:127.0.0.1:$port:Needle" "sim:"
	run -1 --separate-stderr incise capture -o b.rec
	[[ "$stderr" == *"sends no pose \"Needle\" within 5 s; poses come of: "*Stylus* ]]
	rig "igtl:127.0.0.1:$port:Stylus" "sim:"
	run incise doctor --rig rig.conf
	[[ "$output" == *"the haptic loop fades the force whenever the network delays poses of OpenIGTLink Stylus"* ]]
	echo 'stepper = "sim:";' >>rig.conf
	# so soft that it is stable with however few poses a busy machine delivers
	sed "s|model = .*|model = \"$root/scenes/liver.fis\";|; s|tissue = {|& gain = 0.001;|" "$root/scenes/liver.scene" >soft.scene
	run --separate-stderr incise haptic soft.scene --rig rig.conf --no-rt --overruns 0 --duration 0.3s
	[[ "$stderr" == *"poses come over a network, whose delay has no bound"* ]]
}

@test "what a hostile server sends is flagged or counted" {
	for what in nan:'~' mirror:'~' unseen:'!'; do
		poses --do "${what%:*}"
		begin_capture a
		until_rows tracker 150
		kill -INT $capture
		wait $capture || grep -q "force samples were lost" err
		[ "$(ask "SELECT value FROM meta WHERE key='tracker_lost'")" = 0 ]
		# one of ten, and a pose at either end
		[ "$(ask "SELECT abs(count(*) * 10 - (SELECT count(*) FROM tracker)) <= 20 AND count(*) > 5
			FROM tracker WHERE status = '${what#*:}'")" = 1 ] ||
			complain "$what: $(ask "SELECT status, count(*) FROM tracker GROUP BY status")"
		no_more
	done
	poses --do crc
	begin_capture a
	until_rows tracker 150
	kill -INT $capture
	ends_with 1
	[ "$(ask "SELECT abs(value * 10 - (SELECT value FROM meta WHERE key = 'tracker_rows') * 10 / 9) <= 20
		FROM meta WHERE key = 'tracker_lost'")" = 1 ] || complain "$(ask 'SELECT * FROM meta')"
}

@test "a server of poses that is absent, silent or speaks nonsense is one line" {
	rig "igtl:127.0.0.1:1" "sim:"
	run -1 --separate-stderr incise capture -o a.rec
	[[ "$stderr" == *"tracker: 127.0.0.1 port 1: Connection refused; start its OpenIGTLink server, and check host and port" ]]
	for arguments in h:0 h:65536 h:x h:99999:Stylus; do
		rig "igtl:$arguments" "sim:"
		run -1 --separate-stderr incise capture -o a.rec
		[[ "$stderr" == *"tracker: \"$arguments\": the port is not a number from 1 to 65535; correct it" ]] ||
			complain "$arguments: $stderr"
	done
	for arguments in "" ":1" "h:1:" "h::Stylus" "h:1:123456789012345678901" "[::1"; do
		rig "igtl:$arguments" "sim:"
		run -1 --separate-stderr incise capture -o a.rec
		[[ "$stderr" == *"tracker: "*": expected igtl:HOST:PORT:DEVICE with a name of at most 20 letters"* ]] ||
			complain "$arguments: $stderr"
	done
	for what in silence:"sends no message within 5 s; start its transmission" \
		half:"sends no message within 5 s; start its transmission" \
		noise:"does not send OpenIGTLink; correct host and port"; do
		poses --do "${what%%:*}"
		run -1 --separate-stderr incise capture -o a.rec
		[[ "$stderr" == *"${what#*:}" ]] || complain "$stderr"
		[ "${#stderr_lines[@]}" = 1 ]
		no_more
	done
}

@test "a server of poses that goes away is connected again, and its poses count as lost" {
	poses --do drop
	# Each connection has 150 poses; some are sent while there is none.
	begin_capture a
	until_rows tracker 400
	kill -INT $capture
	ends_with 1
	grep -q "tracker samples were lost" err || complain "$(cat err); $(ask "SELECT seq, arrival_ns, x_mm * 64 FROM tracker")"
	[ "$(ask "SELECT count(*) >= 2 FROM events WHERE kind = 'lost'")" = 1 ] ||
		complain "$(ask 'SELECT * FROM events')"
	# pose i was sent at i / 100 s: numbers go on as they do
	[ "$(ask "SELECT max(abs((b.x_mm - a.x_mm) * 64 - (b.seq - a.seq))) <= 1 FROM tracker a, tracker b
		WHERE b.rowid = a.rowid + 1 AND b.x_mm > a.x_mm")" = 1 ] ||
		complain "$(ask 'SELECT seq, x_mm * 64 FROM tracker')"
	begin_capture b
	until_rows tracker 100
	no_more
	fails "OpenIGTLink Stylus at 127.0.0.1 disconnected and was not back after 10 s; start its server again"
}

@test "a server of poses that stands still ends the capture" {
	poses --do nan
	begin_capture a
	until_rows tracker 10
	kill -STOP "$sender"
	fails "OpenIGTLink Stylus at 127.0.0.1 sent no message for 10 s; start its server again, check the network"
	kill -CONT "$sender"
}

@test "incise serve --lsl: pylsl reads poses, forces and events with their units and times" {
	lsl
	cut=a.rec
	incise capture -o $cut --rig "sim:clock=simulated,cut_s=1,pause_s=0.6,seed=3" --duration 5s
	incise serve $cut --lsl "$name" --rate 200 --igtl 0 --endless -v --json >report.json 2>serve.err 3>&- &
	sender=$!
	"$peers/lsl_receive" 500 "$name-pose" "$name-force" "$name-events" >read.json 2>read.err ||
		complain "$(cat read.err serve.err)"
	kill -INT "$sender"
	wait "$sender"
	sender=
	[ "$(key report.json lsl.prefix)" = "$name" ]
	[ "$(key report.json lsl.poses)" -gt 200 ]
	sqlite3 $cut/recording.db "SELECT t_ns, quote(x_mm), quote(y_mm), quote(z_mm) FROM tracker
		ORDER BY seq" >rows
	python3 - "$name" <<-'END'
		import json, sys
		name = sys.argv[1]
		read = json.load(open("read.json"))
		pose, force = read[name + "-pose"], read[name + "-force"]
		assert pose["type"] == "MoCap" and pose["rate"] == 0, pose
		assert [c[0] for c in pose["channels"]] == ["x", "y", "z", "qw", "qx", "qy", "qz"]
		assert pose["channels"][0] == ["x", "PositionX", "mm"], pose["channels"]
		assert pose["channels"][3][1] == "OrientationA", pose["channels"]
		assert force["type"] == "Force" and force["rate"] == 200, force
		assert force["channels"][2] == ["Fz", "ForceZ", "N"], force["channels"]
		assert pose["source"].startswith(name + "-pose@"), pose["source"]
		rows = [tuple(map(float, line.split("|"))) for line in open("rows")]
		at = {row[1:]: row[0] for row in rows}
		samples, times = pose["samples"], pose["times"]
		# The samples are in the recording to the last bit, and apart by as much; the clock of the
		# player and the line of the whole recording differ by less than 1 ms.
		known = [(at[tuple(s[:3])], t) for s, t in zip(samples, times)]
		for (a, s), (b, t) in zip(known, known[1:]):
		    if b > a:  # else it starts again
		        assert abs((b - a) * 1e-9 - (t - s)) < 1e-3, (a, b, s, t)
		# Forces are means of all samples of 5 ms, on a regular grid.
		gaps = [b - a for a, b in zip(force["times"], force["times"][1:])]
		assert sum(abs(g - 0.005) < 2e-4 for g in gaps) > 0.95 * len(gaps), gaps[:20]
		# The first of a play is a single sample, without a deviation: NaN.
		assert all(abs(s[2]) < 20 and not s[3] < 0 for s in force["samples"])
		assert sum(s[3] != s[3] for s in force["samples"]) <= 2 + len(force["samples"]) // 900
	END
	# and what one rig offers is a force of another
	incise serve --rig "sim:clock=real" --lsl "$name" --rate 500 --igtl 0 >out 2>serve.err 3>&- &
	sender=$!
	rig "sim:" "lsl:$name-force:Fz"
	begin_capture b
	until_rows force 400 || complain "$(cat serve.err)"
	kill -INT $capture
	wait $capture || grep -q "were lost" err
}
