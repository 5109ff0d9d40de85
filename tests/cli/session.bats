# SPDX-License-Identifier: GPL-2.0-or-later
# Sessions, as a user meets them: written by incise haptic and incise view, and assessed.

load cli

setup_file() {
	export XDG_RUNTIME_DIR="$BATS_FILE_TMPDIR/run"
	mkdir -p "$XDG_RUNTIME_DIR"
}

setup() {
	work_folder
	cp "$root"/scenes/neck.scene .
	# one cut along the skin of the virtual surgeon: 1.2 s to 5.6 s
	quick=sim:clock=simulated,depth_mm=6,times=1,pause_s=1,cut_s=4
}

teardown() {
	[ -z "${pid:-}" ] || kill -9 "$pid" 2>/dev/null || :
}

@test "in simulated time the same run gives the same session, and another one another" {
	incise haptic neck --rig $quick --duration 8s --session a.session --code P07 >a.txt
	incise haptic neck --rig $quick --duration 8s --session b.session --code P07 >b.txt
	cmp a.session b.session
	cmp a.txt b.txt
	incise haptic neck --rig $quick,seed=2 --duration 8s --session c.session --code P07 >/dev/null
	run ! cmp -s a.session c.session
	# every tick was seen, and the loop's own report agrees
	[ "$(key a.session ticks)" = 8000 ]
	[ "$(key a.session ticks_lost)" = 0 ]
	[ -z "$(key a.session start_unix_s)" ]
	[ "$(key a.session code)" = P07 ]
	[ "$(key a.session end.kind)" = asked ]
	incise haptic neck --rig $quick --duration 8s --json >r.json
	# rounded to four decimals
	holds "($(key a.session force.largest_N) - $(key r.json force_max_N))^2 < 1e-8"
}

@test "a session changes nothing of the run" {
	incise haptic neck --rig $quick --duration 4s --log a.csv >/dev/null
	incise haptic neck --rig $quick --duration 4s --log b.csv --session b.session >/dev/null
	cmp a.csv b.csv
}

# Wait until the loop $pid catches SIGINT. Before it is the loop it is a shell, which may, too.
until_it_runs() {
	for ((i = 0; i < 200; i++)); do
		mask=$(awk '/^Name/ && $2 != "incise-haptic" { exit } /^SigCgt/ { print $2 }' \
			/proc/$pid/status)
		((0x${mask:-0} & 2)) && sleep 0.5 && return
		sleep 0.05
	done
	complain "it does not run within 10 s"
}

@test "in real time every tick is in the session, at 20 kHz too; SIGINT ends it with its reason" {
	sed -i 's/rate_hz = .*/rate_hz = 20000.0;/' neck.scene
	incise haptic neck --rig sim: --no-rt --state none --overruns 0 --session a.session \
		--json >r.json 3>&- &
	pid=$!
	until_it_runs
	kill -INT $pid
	wait $pid
	pid=
	holds "$(key r.json ticks) > 1000"
	[ "$(key a.session ticks)" = "$(key r.json ticks)" ]
	[ "$(key a.session ticks_lost)" = 0 ]
	[ "$(key a.session end.kind)" = signal ]
	[ "$(key a.session end.why)" = Interrupt ]
	# a real clock says when; that of the test was not set back meanwhile
	holds "$(key a.session start_unix_s) > $(stat -c %Y neck.scene) - 1"
}

@test "a fault ends a session with its reason" {
	incise haptic neck --rig sim: --no-rt --state none --overruns 1 --session a.session \
		>/dev/null 2>err 3>&- &
	pid=$!
	# one tick too late ends it: on a busy machine before this one, which is stopped for 0.1 s
	until_it_runs 2>/dev/null || :
	! kill -STOP $pid || sleep 0.1
	kill -CONT $pid || :
	status=0
	wait $pid || status=$?
	pid=
	[ "$status" -eq 1 ]
	[ "$(key a.session end.kind)" = fault ]
	[[ "$(key a.session end.why)" == *"came a period late"* ]]
	grep -q "came a period late" err
}

@test "a session is of one scene: it is not read again" {
	setsid incise haptic neck --rig sim: --no-rt --state none --overruns 0 --session a.session \
		>/dev/null 2>err 3>&- </dev/null &
	pid=$!
	until_it_runs
	kill -HUP $pid
	for ((i = 0; i < 100; i++)); do
		! grep -q "not reloaded" err || break
		sleep 0.05
	done
	grep -q "not reloaded.*--session is of one scene" err
	kill -INT $pid
	wait $pid
	pid=
	[ "$(key a.session end.kind)" = signal ]
}

@test "a session is a file that is not there yet, and no input" {
	echo mine >a.session
	run --separate-stderr incise haptic neck --rig $quick --duration 1s --session a.session
	failed_with "a.session: exists"
	[ "$(cat a.session)" = mine ]
	incise haptic neck --rig $quick --duration 1s --session a.session --overwrite >/dev/null
	[ "$(key a.session ticks)" = 1000 ]
	run --separate-stderr incise haptic neck --rig $quick --duration 1s --session neck.scene --overwrite
	failed_with "neck.scene"
	run --separate-stderr incise haptic neck --rig $quick --duration 1s --session none/a.session
	failed_with "none/a.session"
	run --separate-stderr incise haptic neck --rig $quick --duration 1s --session -
	bad_usage "expected a file"
	run --separate-stderr incise haptic neck --rig $quick --duration 1s --code P07
	bad_usage "--code needs --session"
	for code in "A B" ABCDEFGHIJKLMNOPQ é ""; do
		run --separate-stderr incise haptic neck --rig $quick --duration 1s --session b.session --code "$code"
		bad_usage "is no code"
	done
	[ ! -e b.session ]
}
