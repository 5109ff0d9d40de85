# SPDX-License-Identifier: GPL-2.0-or-later
# incise haptic as a service manager meets it: real time, notifications, watchdog, another scene
# while it runs, recovery by rule. What systemd makes of it is in tests/vm.

load cli
load stepper_module

setup() {
	watch_machine
	memory_folder
	cp "$root"/scenes/liver.{scene,fis,fis.tex} "$root/scenes/wall.scene" .
	module_folder
}

# The shortest watchdog is one of 400 ms.
teardown() {
	machine_watched 200
	[ -z "${pid:-}" ] || kill -9 "$pid" 2>/dev/null || :
	[ -z "${listener:-}" ] || kill "$listener" 2>/dev/null || :
	left_memory
}

listen() {
	export NOTIFY_SOCKET=$PWD/notify
	python3 "$root/tests/cli/listen.py" "$NOTIFY_SOCKET" >told 3>&- &
	listener=$!
	awaits listening
}

# Until what was told has a line with this, at most 8 min: less than the limit of a test.
awaits() {
	for ((i = 0; i < 9600; i++)); do
		grep -qE -e "$1" told && return
		sleep 0.05
	done
	complain "never told '$1': $(cat told err 2>/dev/null)"
}

# Runs in the background as $pid, without a terminal.
serve() {
	# shellcheck disable=SC2016
	setsid --fork --wait sh -c 'echo $$ >pid; exec incise haptic "$@"' sh "$@" --no-rt \
		--overruns 0 --verbose --json >r.json 2>err 3>&- &
	await test -s pid
	pid=$(cat pid)
}

# Wait for its end: its exit code is that of setsid.
ended() {
	code=0
	wait $! || code=$?
	pid=
	[ "$code" = "$1" ] || complain "exit $code: $(cat err)"
}

# bats test_tags=check
@test "a service manager is told: ready, how it goes, that ticks go on, stopping" {
	listen
	WATCHDOG_USEC=1000000 serve liver.scene --rig sim: --state page
	awaits READY=1
	grep -q "STATUS=runs at 1000 Hz" told
	awaits "STATUS=[0-9]* of 1000 Hz"
	awaits WATCHDOG=1
	kill -TERM "$pid"
	awaits STOPPING=1
	ended 0
	# In this order, and not before the first tick.
	[ "$(grep -oE 'READY=1|STOPPING=1' told | tr '\n' ' ')" = "READY=1 STOPPING=1 " ]
	[ "$(key r.json stopped_by)" = Terminated ]
	grep -q "^incise haptic: self-test: " err
	grep -q "^incise haptic: Terminated: the force ramps to zero" err
}

# said_nothing N: so many seconds went by without a tick.
said_nothing() {
	[ "$(grep -c "STATUS=0 of 1000 Hz" told)" -ge "$1" ]
}

@test "the watchdog is fed only while ticks come" {
	make_module stepper_mine mine INCISE_BACKEND_ABI
	rig mine:hangs
	listen
	WATCHDOG_USEC=400000 serve liver.scene --rig rig.conf
	awaits READY=1
	# 500 ticks, then none. Each second it says how many there were, and feeds before it says so.
	await test -e hangs
	await said_nothing 4
	[ "$(sed '1,/STATUS=0 of 1000 Hz/d' told | grep -c WATCHDOG=1)" = 0 ] || complain "$(cat told)"
	: >told
	touch goes
	awaits WATCHDOG=1
	kill -TERM "$pid"
	ended 0
}

@test "SIGHUP reads the scene again, without a step; what is none is refused" {
	listen
	serve liver.scene --rig sim:depth_mm=10,times=1000,pause_s=0.2,cut_s=1 --state page
	awaits READY=1
	sed -i 's/force_N = [0-9.]*/force_N = 0.05/' liver.scene
	grep -q 'force_N = 0.05' liver.scene
	kill -HUP "$pid"
	awaits RELOADING=1
	awaits "READY=1$"
	grep -q "liver.scene: reloaded" err
	echo "nonsense" >>liver.scene
	: >told
	kill -HUP "$pid"
	awaits "not reloaded: liver.scene:[0-9]*: "
	sed -i '$d' liver.scene
	sed -i 's/rate_hz = [0-9.]*/rate_hz = 500.0/' liver.scene
	: >told
	kill -HUP "$pid"
	awaits "not reloaded: liver.scene: rate_hz is 500, but the loop runs at 1000 Hz"
	grep -q "warning: not reloaded, the previous scene continues: liver.scene:" err
	incise status ./page --json >s.json || :
	[ "$(key s.json 'loops[0].reloads')" = 1 ]
	[ "$(key s.json 'loops[0].reloads_refused')" = 2 ]
	[ "$(key s.json 'loops[0].state')" = running ]
	# It goes on.
	goes_on() {
		incise status ./page --json >later.json
		[ "$(key later.json 'loops[0].ticks')" -gt "$(key s.json 'loops[0].ticks')" ]
	}
	await goes_on
	kill -TERM "$pid"
	ended 0
}

@test "what a program that died left latched is cleared by --recover, and nothing else" {
	make_module stepper_mine mine INCISE_BACKEND_ABI
	rig mine:left
	run --separate-stderr incise haptic liver.scene --rig rig.conf --no-rt --duration 0.1s
	[ "$status" -eq 1 ]
	[[ "$stderr" != *cleared* ]]
	run -0 --separate-stderr incise haptic liver.scene --rig rig.conf --no-rt --overruns 0 --recover -v --duration 0.1s
	[[ "$stderr" == *"mine at left: cleared the fault of an earlier program"* ]]
	rig mine:latched
	run --separate-stderr incise haptic liver.scene --rig rig.conf --no-rt --recover --duration 0.1s \
		--state page
	[ "$status" -eq 1 ]
	[[ "$stderr" != *cleared* ]]
	[[ "${stderr_lines[-1]}" == *"e-stop: release it, then clear"* ]]
	# The page keeps why.
	run -1 incise status ./page
	[[ "$output" == *fault* && "$output" == *e-stop* ]]
}

@test "overruns in a row end it, with the force taken away" {
	make_module stepper_mine mine INCISE_BACKEND_ABI
	rig mine:slow
	run --separate-stderr incise haptic liver.scene --rig rig.conf --no-rt --overruns 5 --duration 1h
	[ "$status" -eq 1 ]
	[[ "${stderr_lines[-1]}" == *"5 ticks in a row were a period late or more"*"too slow or too busy for 1000 Hz" ]]
	# those, and what the host was late with before
	overruns=$(sed -n 's/.* missed deadlines in \([0-9]*\) overruns .*/\1/p' <<<"$output")
	[ "$overruns" -ge 5 ]
}

@test "two loops of one scene do not share a page" {
	serve liver.scene --rig sim: --state page
	await test -s page
	run --separate-stderr incise haptic liver.scene --rig sim: --no-rt --state page --duration 0.1s
	failed_with page "$pid"
	kill -TERM "$pid"
	ended 0
}

@test "a scene by its name is that of this folder, else of the machine" {
	run -0 incise haptic liver --rig sim:clock=simulated --duration 0.1s
	# one that came with the program; that of this folder comes first
	run -0 incise haptic neck --rig sim:clock=simulated --duration 0.1s
	echo nonsense >neck.scene
	fails incise haptic neck --rig sim:clock=simulated --duration 0.1s -- neck.scene: syntax
	run --separate-stderr incise haptic nothing --rig sim:clock=simulated --duration 0.1s
	# each name once, though this folder has what came with the program too
	failed_with "nothing:"
	[ "$(grep -o "\bliver\b" <<<"$stderr" | wc -l)" = 1 ] || complain "$stderr"
}

# Rights that this test takes away; who has none to begin with needs not.
as_nobody() {
	if [ "$(id -u)" = 0 ]; then
		setpriv --reuid=65534 --regid=65534 --clear-groups prlimit --rtprio=0 --memlock=65536 "$@"
	else
		prlimit --rtprio=0 --memlock=65536 "$@"
	fi
}

@test "real time that is denied is refused with the command that grants it" {
	run --separate-stderr incise haptic liver.scene --rig sim: --cpu 1000 --duration 0.1s
	[ "$status" -eq 1 ]
	chmod 755 . 2>/dev/null || :
	as_nobody true 2>/dev/null || skip "rights cannot be given up here"
	as_nobody test -x "$INCISE_BUILD/bin/incise-haptic" || skip "the build is not for others to see"
	run --separate-stderr as_nobody incise haptic liver.scene --rig sim: --duration 0.1s
	failed_with "RLIMIT_RTPRIO" "prlimit" "--no-rt"
	run -0 as_nobody incise haptic liver.scene --rig sim: --duration 0.1s --no-rt --overruns 0
	run -0 as_nobody incise haptic liver.scene --rig sim:clock=simulated --duration 0.1s
}

@test "in real time no page is faulted in, and little memory is held" {
	chrt -f 80 true 2>/dev/null || skip "this machine gives no SCHED_FIFO"
	incise haptic wall.scene --rig sim: --overruns 0 --state page --json >r.json 3>&- &
	pid=$!
	has_ticks() {
		[ "$(incise status ./page --prometheus | sed -n 's/^incise_loop_ticks_total{.*} //p')" -ge 1000 ]
	}
	await has_ticks
	awk '/^VmRSS/ { print; exit !($2 > 0 && $2 <= 12 * 1024) }' /proc/$pid/status
	awk '/^VmLck/ { print; exit !($2 > 1000) }' /proc/$pid/status
	# Only what the scene needs, to the last library.
	awk '$6 ~ /\.so/ { n = split($6, part, "/"); print part[n] }' /proc/$pid/maps | sort -u |
		sed 's/\.so.*//' | grep -vxE 'ld-linux.*|libc|libm|libdl|libpthread' | tr '\n' ' ' >mapped
	# AddressSanitizer and the like would be seen here, too.
	[ "$(cat mapped)" = "libconfig libincise libjansson " ] || complain "$(cat mapped)"
	kill -TERM $pid
	wait $pid
	pid=
	[ "$(key r.json scheduling)" = "SCHED_FIFO 80" ]
	[ "$(key r.json thread.minor_faults)" = 0 ]
	[ "$(key r.json thread.major_faults)" = 0 ]
}
