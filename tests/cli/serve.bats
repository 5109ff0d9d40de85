# SPDX-License-Identifier: GPL-2.0-or-later
# incise serve: OpenIGTLink for clients that others wrote, and for those that misbehave.

load cli

teardown() {
	[ -z "$server" ] || kill -KILL "$server" 2>/dev/null || :
}

# Start incise serve on a free port, and wait for it: sets server and port.
start_server() {
	local i
	: >log
	incise-serve "$@" --igtl 0 -v --json >report.json 2>log 3>&- &
	server=$!
	for ((i = 0; i < 9600; i++)); do
		port=$(sed -n 's/.*OpenIGTLink on 127.0.0.1:\([0-9]*\):.*/\1/p' log)
		[ -z "$port" ] || return 0
		kill -0 "$server" || complain "$(cat log)"
		sleep 0.05
	done
	complain "no port in 8 min: $(cat log)"
}

# End it as Ctrl-C does: exit 0 and a report.
stop_server() {
	local status=0
	kill -INT "$server"
	wait "$server" || status=$?
	server=
	[ "$status" = 0 ] || complain "exit $status: $(cat log)"
	[ -s report.json ] || complain "no report: $(cat log)"
}

client() {
	timeout 400 python3 -B "$root/tests/streams/igtl_client.py" "$@"
}

# An expression of Python about a file of JSON, or lines of it, as j.
holds() {
	python3 -c '
import json, sys
text = open(sys.argv[1]).read()
try:
    j = json.loads(text)
except ValueError:
    j = [json.loads(line) for line in text.splitlines()]
sys.exit(not eval(sys.argv[2]))' "$@" || complain "$2: $(head -c 2000 "$1")"
}

@test "pyigtl receives poses, forces, data and frames with times of acquisition" {
	[ -e "$INCISE_BUILD/tests/streams/ready" ] || skip "pip could not install pyigtl; see tests/venv"
	start_server --rig sim: --camera frames
	timeout 400 "$INCISE_BUILD/tests/streams/venv/bin/python" -B "$root/tests/streams/igtl_receive.py" "$port" 5 TipToTracker Force ForceData Camera >found.json
	stop_server
	holds found.json 'all(a[0] < b[0] for rows in j.values() for a, b in zip(rows, rows[1:]))'
	# rotations of unit determinant: columns at right angles
	holds found.json 'all(abs(sum(m[i][0] * m[i][1] for i in range(3))) < 1e-5 and
		abs(sum(m[i][2] ** 2 for i in range(3)) - 1) < 1e-5 for _, m in j["TipToTracker"])'
	holds found.json 'all(m[0][:3] == [1, 0, 0] and m[0][3] == m[1][3] == 0 for _, m in j["Force"])'
	holds found.json 'set(json.loads(j["ForceData"][0][1])) == {"t_ns", "force_N", "sd_N", "samples", "lost"}'
	holds found.json 'all(shape == [1, 480, 640, 3] for _, shape in j["Camera"])'
	# no message is older than the server, nor from the future: not the time of sending, but near it
	python3 -c '
import json, os, sys, time
t = [row[0] for rows in json.load(open("found.json")).values() for row in rows]
sys.exit(not (os.stat("log").st_ctime - 60 < min(t) and max(t) <= time.time()))'
}

@test "the client of libopenigtlink reads all types, and their checksums are right" {
	[ -x "$INCISE_BUILD/tests/streams/ReceiveClient" ] || skip "openigtlink-examples is not installed"
	start_server --rig sim: --camera frames
	"$INCISE_BUILD/tests/streams/ReceiveClient" 127.0.0.1 "$port" >received 2>&1 3>&- &
	reader=$!
	# it prints the content only of what has the right checksum
	for ((i = 0; i < 600; i++)); do
		if grep -q 'Dimensions *: (640, 480, 1)' received && grep -q 'String: {"t_ns":' received &&
			grep -q ' Status    : rig sim:' received && [ "$(grep -c 'Receiving TRANSFORM' received)" -gt 20 ]; then
			break
		fi
		sleep 0.1
	done
	kill "$reader"
	wait "$reader" || :
	[ "$i" -lt 600 ] || complain "$(tail -n 40 received)"
	stop_server
}

# bats test_tags=check
@test "a recording is played: the poses are those of its rows, at their times" {
	incise capture -o a.rec --rig sim:clock=simulated,depth_mm=6,times=1,pause_s=0.2,cut_s=1 >/dev/null
	start_server a.rec --rate 1000 --endless
	client receive "$port" 400 >found.json
	stop_server
	sqlite3 -separator ' ' a.rec/recording.db "SELECT x_mm, y_mm, z_mm FROM tracker" >rows
	python3 - <<-'END'
		import json
		rows = {tuple(round(float(x), 3) for x in line.split()) for line in open("rows")}
		poses = [m for m in map(json.loads, open("found.json")) if m["name"] == "TipToTracker"]
		assert len(poses) > 15, len(poses)
		for pose in poses:
		    # a float has 24 bits
		    near = tuple(round(x, 3) for x in pose["matrix"][9:])
		    assert any(all(abs(a - b) < 2e-3 for a, b in zip(near, row)) for row in rows), near
	END
	holds report.json 'j["lost"] == 0 and j["igtl"]["accepted"] == 1'
	# and ends by itself, with at most so many values a second, whatever the speed
	timeout 60 incise serve a.rec --igtl 0 --speed 10 --json >out 2>err
	[ ! -s err ] || complain "$(cat err)"
	holds out 'j["source"] == "recording a.rec" and 0 < j["poses"] < 110 * j["seconds"] + 2'
}

@test "a loop is followed: its state, its end, and the next one of its name" {
	cp "$root"/scenes/{wall.scene,liver*} . 2>/dev/null || cp "$root"/scenes/* .
	incise haptic wall.scene --rig sim: --no-rt --overruns 0 --duration 1h --state wall.state >/dev/null 2>&1 3>&- &
	loop=$!
	for ((i = 0; i < 600; i++)); do
		! incise status ./wall.state 2>/dev/null | grep -q running || break
		sleep 0.1
	done
	start_server ./wall.state
	client receive "$port" 300 >found.json
	holds found.json '{m["name"] for m in j} == {"TipToTracker", "Force", "ForceData", "Status"}'
	holds found.json 'all(m["code"] == 1 and m["error"] == "running" for m in j if m["type"] == "STATUS")'
	kill -KILL "$loop"
	wait "$loop" || :
	timeout 60 incise serve ./wall.state --igtl 0 --duration 50ms 2>&1 >/dev/null | grep -q 'loop wall does not run; its next run is followed'
	# 16: not present
	for ((i = 0; i < 100; i++)); do
		client receive "$port" 1 1 GET_STATUS >found.json
		! grep -q '"code": 16' found.json || break
	done
	holds found.json 'j["text"].endswith("its process is dead")'
	incise haptic wall.scene --rig sim: --no-rt --overruns 0 --duration 1h --state wall.state >/dev/null 2>&1 3>&- &
	loop=$!
	client receive "$port" 300 >found.json
	holds found.json 'any(m["type"] == "TRANSFORM" for m in j)'
	stop_server
	kill -TERM "$loop"
	wait "$loop" || :
}

# bats test_tags=check
@test "clients ask for values, stop and start them, and choose the version" {
	start_server --rig sim:
	# what comes behind the answer to the last request
	client receive "$port" 20 2 STP_STRING GET_CAPABIL >found.json
	holds found.json 'all(m["version"] == 2 for m in j[-20:])'
	holds found.json 'all(m["type"] != "STRING" for m in j[-20:])'
	holds found.json 'all(int(m["metadata"]["lost"]) >= 0 and int(m["metadata"]["t_ns"]) > 0 for m in j[-20:])'
	holds found.json 'all(a["id"] < b["id"] for a, b in zip(j[-20:], j[-19:]))'
	client receive "$port" 20 1 STP_TRANS STP_STRING STT_TRANS:Force NONSENSE GET_CAPABIL >found.json
	holds found.json 'all(m["name"] != "TipToTracker" for m in j[-20:])'
	stop_server
	holds report.json 'j["igtl"]["requests"] == 7 and j["igtl"]["requests_ignored"] == 1'
	start_server --rig sim: --igtl 0/2
	client receive "$port" 5 >found.json
	holds found.json 'all(m["version"] == 2 for m in j)'
	stop_server
}

# bats test_tags=check
@test "a client too many is told that the server is busy" {
	start_server --rig sim:
	client full "$port" 32 >found.json
	stop_server
	holds found.json '(j["type"], j["name"], j["code"], j["error"]) == ("STATUS", "Status", 6, "busy")'
	holds found.json '"32 clients" in j["text"]'
	holds report.json '(j["igtl"]["accepted"], j["igtl"]["refused"]) == (32, 1)'
	grep -q 'refused: 32 clients are connected' log
}

@test "clients that hang, die and send nonsense slow no other, and memory is bounded" {
	start_server --rig sim:camera_hz=10 --camera frames --idle 1s
	client crowd "$port" 500 >found.json
	# each of the five received its 500 poses
	holds found.json 'j == 5 * [{"poses": 500, "ordered": True}]'
	# A frame has 0.9 MB; each of nine clients may hold a part of one, and two wait: 20 MB with all
	# that is mapped anyway; three times that is a leak.
	awk '/^VmHWM/ { exit $2 > 60000 }' "/proc/$server/status" || complain "$(grep VmHWM "/proc/$server/status")"
	stop_server
	holds report.json 'any(c["closed"] == "it took nothing for too long" and c["lost"] > 0 for c in j["igtl"]["clients"])'
	grep -q 'closed: it began a message and did not end it' log
	grep -q 'closed: it sent bytes that are not OpenIGTLink' log
}

# bats test_tags=check
@test "addresses: this machine only unless one is given, IPv6 in brackets, mistakes are explained" {
	refuses() { # CODE MESSAGE ARGUMENT…
		local code=$1 message=$2
		shift 2
		run -"$code" --separate-stderr timeout 60 incise serve --rig sim: --duration 50ms "$@"
		[[ "${stderr_lines[0]}" == "incise serve: $message"* ]] || complain "$stderr"
	}
	incise serve --rig sim: --duration 50ms --igtl 0 -v 2>&1 >/dev/null | grep -q 'on 127.0.0.1:'
	incise serve --rig sim: --duration 50ms --igtl 0.0.0.0:0 -v 2>&1 >/dev/null | grep -q 'on 0.0.0.0:'
	[ ! -s /proc/net/if_inet6 ] ||
		incise serve --rig sim: --duration 50ms --igtl '[::1]:0' -v 2>&1 >/dev/null | grep -q 'on \[::1\]:'
	refuses 2 "--igtl: '::1:0': put an IPv6 address in brackets" --igtl ::1:0
	refuses 1 "--igtl 192.0.2.1:0: Cannot assign requested address; give an address of this machine" --igtl 192.0.2.1:0
	run -1 --separate-stderr timeout 60 incise serve --rig sim:clock=simulated
	[[ "$stderr" == *"its clock is simulated"* ]]
	start_server --rig sim:
	refuses 1 "--igtl $port: Address already in use; another program listens there" --igtl "$port"
	stop_server
	run -1 --separate-stderr timeout 60 incise serve nosuch
	[[ "$stderr" == "incise serve: nosuch: no loop of that name has run here"* ]] || complain "$stderr"
	printf 'a,b\n1,2\n' >e1.csv
	run -1 --separate-stderr timeout 60 incise serve e1.csv
	[[ "$stderr" == "incise serve: e1.csv: "*table* ]] || complain "$stderr"
}

@test "frames of a recording are sent, or counted and said; one without a camera is refused" {
	incise capture -o a.rec --rig sim:clock=simulated,depth_mm=6,times=1,camera_hz=10 --camera frames --duration 3s >/dev/null
	rows=$(sqlite3 a.rec/recording.db "SELECT count(*) FROM frames")
	incise serve a.rec --igtl 0 --rate 1000 --speed 2 --json >out 2>err
	holds out "j['frames'] + j['lost'] == $rows and j['frames'] > 0"
	# faster than frames can be decoded: some are left out, and it says how many
	incise serve a.rec --igtl 0 --rate 20000 --speed 100 --json >out 2>err
	holds out "j['frames'] + j['lost'] == $rows"
	lost=$(python3 -c 'import json; print(json.load(open("out"))["lost"])')
	[ "$lost" = 0 ] || grep -q "^incise serve: warning: $lost frames were skipped" err || complain "$(cat err)"
	incise capture -o b.rec --rig sim:clock=simulated --duration 1s >/dev/null
	run -1 --separate-stderr timeout 60 incise serve b.rec --igtl 0 --camera frames
	[[ "$stderr" == "incise serve: --camera frames: b.rec has no camera; "* ]] || complain "$stderr"
}

@test "the UTC of a recording without wall time is that of its rows, not of the command" {
	incise capture -o t.rec --rig sim:clock=simulated,times=2,depth_mm=5,pause_s=20 --trigger 0.2N --clock-source none >/dev/null
	sqlite3 t.rec/recording.db "SELECT (SELECT min(t_ns) FROM force), (SELECT t_ns FROM events WHERE kind = 'start'),
		(SELECT value FROM meta WHERE key = 'started')" >rows
	incise info t.rec --json >info.json
	start_server t.rec --endless
	client receive "$port" 3 >found.json
	stop_server
	python3 - <<-'END'
		import calendar, json, time
		first, start, started = open("rows").read().strip().split("|")
		of = lambda text: calendar.timegm(time.strptime(text, "%Y-%m-%dT%H:%M:%SZ"))
		wait = (int(first) - int(start)) / 1e9
		assert wait > 1, wait
		# whole seconds are cut off
		assert 0 <= of(started) + wait - of(json.load(open("info.json"))["started"]) < 1, wait
		# clients come after the start; the recording has some seconds
		t = [m["utc_s"] for m in map(json.loads, open("found.json")) if m["type"] == "TRANSFORM"]
		assert all(of(started) + wait <= x for x in t), (t, started, wait)
	END
}
