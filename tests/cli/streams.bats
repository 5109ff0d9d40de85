# SPDX-License-Identifier: GPL-2.0-or-later
# Sources from the network, sent by the libraries that others use (tests/streams): pylsl with its
# liblsl, and pyigtl.

load cli

setup() {
	watch_machine
	work_folder
	peers="$INCISE_BUILD/tests/streams"
}

teardown() {
	machine_watched 100
	[ -z "$sender" ] || kill "$sender" 2>/dev/null || true
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
	END
}

# Start a program of tests/streams in the background; its first line is in the file began.
send() {
	"$peers/$1" "${@:2}" >began 2>send.err 3>&- &
	sender=$!
	for _ in $(seq 100); do
		[ ! -s began ] || return 0
		sleep 0.1
	done
	complain "$1 does not start: $(cat send.err)"
}

ask() {
	sqlite3 a.rec/recording.db "$1"
}

@test "an LSL stream in newtons is captured: values, times and losses are those sent" {
	lsl
	send lsl_send "$name" --seconds 20 --hole 3500:5 --nan 3000
	# some samples are missing on purpose
	run -1 --separate-stderr incise capture -o a.rec --duration 4.5s
	[[ "$stderr" == *"force samples were lost"* ]]
	# Exact in steps of 2^-17 N; times to the sender's clock within the bound that LSL states,
	# tenths of a millisecond on one machine, and a tenth of the period at most.
	python3 - "$(cat began)" <<-'END'
		import sqlite3, sys
		start = int(sys.argv[1])
		db = sqlite3.connect("a.rec/recording.db")
		rows = db.execute("SELECT seq, t_ns, code FROM force ORDER BY seq").fetchall()
		assert len(rows) > 4000, len(rows)
		sent = []
		for seq, t_ns, code in rows:
		    i = round((t_ns - start) / 1e6)
		    assert abs(t_ns - start - i * 1e6) < 1e5, (seq, t_ns - start)
		    assert (code - 2**30) / 2**17 == i % 1000 / 32768, (seq, i, code)
		    sent.append(i)
		missing = set(range(sent[0], sent[-1] + 1)) - set(sent)
		assert missing == {3000, *range(3500, 3505)}, missing
		meta = dict(db.execute("SELECT key, value FROM meta"))
		assert meta["force_newtons"] == 1 and meta["force_mV_N"] == 1000, meta
		assert meta["force_lost"] == len(missing), (meta["force_lost"], missing)
		sd, = db.execute("SELECT delay_sd_ns FROM streams WHERE name = 'force'").fetchone()
		assert 0 < sd < 1e6, sd
	END
	run -1 incise verify a.rec
	[[ "$output" == *"6 samples were lost during the capture; the rest is as it was written" ]]
	# mV/N of an amplifier does not apply
	echo "force_mV_N = 620.0; force_zero_mV = 99.0;" >calibration.conf
	incise export a.rec -o own.csv
	incise export a.rec --calibration calibration.conf -o other.csv
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
	# nobody sends
	run -1 --separate-stderr incise capture -o a.rec
	[[ "$stderr" == *"force: no LSL stream \"$name\" found within 5 s; start the program that sends it"* ]]
	[ "${#stderr_lines[@]}" = 1 ]
	send lsl_send "$name" --unit N --seconds 6
	for channel in Mx:"channel 0 of the stream has the unit \"Nm\"; expected N, mN, kN, V or mV" \
		t:"channel 2 of the stream has no unit" \
		9:"name its channel, as in lsl:NAME:CHANNEL; the stream has Mx (Nm), Fz (N), t (no unit)" \
		:"expected lsl:NAME or lsl:NAME:CHANNEL"; do
		rig "sim:" "lsl:$name:${channel%%:*}"
		run -1 --separate-stderr incise capture -o a.rec
		[[ "$stderr" == *"${channel#*:}"* ]] || complain "$stderr"
		[ "${#stderr_lines[@]}" = 1 ]
	done
	# The only channel in newtons needs no name; without a source id, LSL does not look for it
	# again when it ends.
	rig "sim:" "lsl:$name"
	run -1 --separate-stderr incise capture -o a.rec --duration 30s
	[[ "$stderr" == *"LSL $name, channel 1: the stream ended; start its program, and start again"* ]] ||
		complain "$stderr"
	send lsl_send "$name" --irregular --seconds 20
	run -1 --separate-stderr incise capture -o b.rec
	[[ "$stderr" == *"has a nominal rate of 0 Hz; expected 1 to 100000 Hz (a regular stream)" ]]
}
