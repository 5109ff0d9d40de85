# SPDX-License-Identifier: GPL-2.0-or-later
# The tool of a running loop: by incise tool, by packets to its control socket, by keys on a
# terminal. What a change does to the force is in tests/unit/scene/tools.c.

load cli

setup() {
	work_folder
	mkdir "$XDG_RUNTIME_DIR/incise"
	chmod 700 "$XDG_RUNTIME_DIR/incise"
	page=$XDG_RUNTIME_DIR/incise/neck.state
	control=$XDG_RUNTIME_DIR/incise/neck.control
	cp "$root/scenes/neck.scene" "$root"/scenes/liver.{scene,fis,fis.tex} .
	pid=
}

teardown() {
	[ -z "$pid" ] || kill -9 "$pid" 2>/dev/null || :
	[ -z "${outside:-}" ] || rm -rf "$outside"
}

# serve SCENE: in the background as $pid, until it ticks.
serve() {
	incise haptic "$1" --rig sim: --no-rt --overruns 0 --state "$page" --verbose \
		>out 2>err </dev/null 3>&- &
	pid=$!
	until_runs
}

until_runs() {
	for ((i = 0; i < 9600; i++)); do
		[ "$(incise status "$page" --json 2>/dev/null |
			sed -n 's/.*"state": "\(.*\)".*/\1/p')" != running ] || return 0
		sleep 0.05
	done
	complain "it did not start: $(cat err)"
}

complain() {
	printf '%s\n' "$@" >&2
	return 1
}

ended() {
	kill -INT "$pid"
	wait "$pid"
	pid=
}

# packets: a Python program with connect() and ask(socket, bytes).
packets() {
	python3 - "$control" <<-PYTHON
		import socket, sys, time
		def connect():
		    s = socket.socket(socket.AF_UNIX, socket.SOCK_SEQPACKET)
		    s.connect(sys.argv[1])
		    s.settimeout(60)
		    return s
		def ask(s, request):
		    s.send(request)
		    return s.recv(1000).decode()
		$(cat)
	PYTHON
}

# bats test_tags=check
@test "it is printed, set, and set back, and status has it" {
	serve neck.scene
	run -0 incise tool neck
	[ "$output" = "neck: blade (auto)" ]
	for tool in tube handle blade; do
		run -0 incise tool neck $tool
		[ "$output" = "neck: $tool" ]
		[ "$(incise status neck --json | sed -n 's/.*"tool": "\(.*\)".*/\1/p')" = $tool ]
		incise status neck | grep -qx "tool       $tool"
		incise status neck --prometheus |
			grep -qx "incise_loop_tool{scene=\"neck\",tool=\"$tool\"} 1"
	done
	incise tool "$page" auto --json >r.json
	[ "$(key r.json loop) $(key r.json tool) $(key r.json wanted)" = "neck blade auto" ]
	ended
	grep -q "the hand holds the tube" err
}

@test "another scene keeps the tool that was set" {
	# shellcheck disable=SC2016
	setsid --fork --wait sh -c 'echo $$ >pid; exec incise haptic "$@"' sh neck.scene \
		--rig sim: --no-rt --overruns 0 --state "$page" --verbose >out 2>err 3>&- &
	await test -s pid
	pid=$(cat pid)
	until_runs
	incise tool neck tube
	kill -HUP "$pid"
	for ((i = 0; i < 600; i++)); do
		[ "$(incise status neck --json | sed -n 's/.*"reloads": \(.*\),/\1/p')" != 1 ] || break
		sleep 0.05
	done
	run -0 incise tool neck
	[ "$output" = "neck: tube" ]
}

@test "what is missing is said" {
	run -1 --separate-stderr incise tool neck
	[[ "$stderr" == "incise tool: neck: no loop of that name has run here; "* ]]
	serve liver.scene
	run -1 --separate-stderr incise tool neck tube
	[ "$stderr" = "incise tool: neck: the scene has only the blade: no insertion: tissue.insertion_N_mm and tissue.spread_N_mm are 0" ]
	run -0 incise tool neck blade
	mv "$control" moved
	run -1 --separate-stderr incise tool neck
	[[ "$stderr" == "incise tool: neck: its loop has no control socket: $control is missing; "* ]]
	mv moved "$control"
	kill -9 "$pid"
	wait "$pid" || :
	run -1 --separate-stderr incise tool neck tube
	[[ "$stderr" == "incise tool: neck: no loop of that name runs; "* ]]
	# The next loop takes the place of the socket that was left.
	[ -S "$control" ]
	serve neck.scene
	incise tool neck tube
	ended
	[ ! -e "$control" ]
	[ -e "$page" ]
}

@test "one who may not write to the socket is told who may" {
	[ "$(id -u)" = 0 ] || skip "needs root, to be somebody else"
	command -v setpriv >/dev/null || skip "needs setpriv"
	# The temporary folder of bats is for its user alone.
	outside=$(mktemp -d /tmp/incise-tool-XXXXXX)
	page=$outside/neck.state control=$outside/neck.control
	chmod 755 "$outside"
	serve neck.scene
	[ "$(stat -c %a "$control")" = 600 ]
	as 65534 65534 test -r "$page" -a -x "$INCISE_BUILD/bin/incise-tool" ||
		skip "others cannot reach the page or the program"
	run -1 --separate-stderr as 65534 65534 incise-tool "$page" tube
	[[ "$stderr" == *"only user root, or in /run/incise the group incise, may use "* ]]
	ended
	# In a folder that hands its group on, as /run/incise.
	chgrp 65534 "$outside"
	chmod 2775 "$outside"
	serve neck.scene
	[ "$(stat -c '%a %g' "$control")" = "660 65534" ]
	as 65533 65534 incise-tool "$page" tube
}

# as UID GID PROGRAM ARGUMENTS…
as() {
	setpriv --reuid "$1" --regid "$2" --clear-groups "${@:3}"
}

# bats test_tags=check
@test "requests are not trusted" {
	serve neck.scene
	packets <<-'PYTHON'
		s = connect()
		assert ask(s, b'tool') == 'ok held=blade wanted=auto\n'
		assert ask(s, b'tool auto\n') == 'ok held=blade wanted=auto\n'
		for bad in b'tools', b'too', b'tool ', b'tool  tube', b'tool tubes', b'tool Tube', \
		        b'\n', b'tool \0', b'tool\r\n', b'\xff' * 255, b'x' * 256, b'x' * 100000:
		    assert ask(s, bad).startswith('error '), bad
		assert ask(s, b'tool') == 'ok held=blade wanted=auto\n'
	PYTHON
	incise tool neck
}

@test "many clients, and such as hang, harm neither the loop nor each other" {
	serve neck.scene
	packets <<-'PYTHON'
		silent = [connect() for i in range(50)]
		hanging = connect()
		try:
		    while True:
		        hanging.send(b'tool', socket.MSG_DONTWAIT)
		except OSError:
		    pass
		for i in range(200):
		    s = connect()
		    assert ask(s, b'tool') == 'ok held=blade wanted=auto\n'
		    if i % 2:
		        s.close()
		# The oldest made room for the others.
		assert silent[0].recv(10) == b''
	PYTHON
	run -0 incise tool neck tube
	[ "$output" = "neck: tube" ]
	ended
}

@test "a file that is no socket is left alone, and the loop runs without" {
	echo mine >"$control"
	serve neck.scene
	grep -q "warning: no control socket: $control: File exists" err
	ended
	[ "$(cat "$control")" = mine ]
}

# Runs incise haptic neck.scene on a terminal of its own: the keys of $1, then the signal of $2.
# Prints its output and how it ended; fails if the terminal is not as before.
at_terminal() {
	timeout 300 python3 - "$1" "$2" "$page" <<-'PYTHON'
		import os, pty, subprocess, sys, termios, time
		keys, number, page = sys.argv[1], int(sys.argv[2]), sys.argv[3]
		master, slave = pty.openpty()
		before = termios.tcgetattr(slave)
		pid = os.fork()
		if pid == 0:
		    os.setsid()
		    os.dup2(slave, 0); os.dup2(slave, 1); os.dup2(slave, 2)
		    os.close(os.open(os.ttyname(0), os.O_RDWR)) # its controlling terminal
		    os.execvp('incise', ['incise', 'haptic', 'neck.scene', '--rig', 'sim:',
		                         '--no-rt', '--overruns', '0', '--state', page])
		def until(condition):
		    for i in range(1200):
		        if condition():
		            return
		        time.sleep(0.05)
		    sys.exit('it never came')
		out = b''
		def said(text):
		    def look():
		        global out
		        out += os.read(master, 65536)
		        return text in out
		    return look
		until(lambda: not termios.tcgetattr(slave)[3] & termios.ECHO)
		assert termios.tcgetattr(slave)[3] & termios.ISIG
		names = {'b': b'blade', 'h': b'handle', 't': b'tube', 'a': b'auto'}
		for key in keys:
		    out = b''
		    os.write(master, key.encode())
		    if key in names:
		        until(said(b'tool: ' + names[key] + b'\r\n'))
		    # The loop takes it at its next tick, which may not come after the signal.
		    if key in names and key != 'a':
		        until(lambda: subprocess.check_output(['incise', 'tool', page]) ==
		              b'neck: ' + names[key] + b'\n')
		os.kill(pid, number)
		status = os.waitpid(pid, 0)[1]
		assert termios.tcgetattr(slave) == before, 'the terminal is not as it was'
		print(os.waitstatus_to_exitcode(status))
	PYTHON
}

@test "keys on a terminal, which is as before at the end" {
	[ "$(at_terminal tbhaXt 2)" = 0 ]
	grep -q . "$page"
	[ "$(incise status neck --json | sed -n 's/.*"tool": "\(.*\)".*/\1/p')" = tube ]
}

@test "the terminal is as before after a signal that kills, and after a fault" {
	ulimit -c 0
	for number in 6 3 11 7; do
		[ "$(at_terminal t $number)" = -$number ]
	done
}

@test "in a pipe no key is read" {
	incise haptic neck.scene --rig sim: --no-rt --overruns 0 --state "$page" \
		--duration 1s >out 2>err < <(yes t)
	[ "$(incise status neck --json | sed -n 's/.*"tool": "\(.*\)".*/\1/p')" = blade ]
}

# The virtual tube goes into the tissue once in 10 s, beside a scalpel that cuts for 8 s of each 9.
@test "a tube with a station of the tracker is held while it is nearer" {
	sed 's/^tissue = {/tissue = { gain = 0.65;/' neck.scene >soft.scene
	rig=sim:clock=simulated,depth_mm=5,times=3
	# Two stations share the rate: the shipped scene is too stiff for that, and is refused.
	run -1 --separate-stderr incise plan neck.scene --rig $rig,tube_s=10
	[[ "$stderr" == *"with a tracker of 60 Hz and 4.2 ms; "* ]]
	incise plan neck.scene --rig $rig >/dev/null
	phases() {
		incise haptic soft.scene --duration 40s -o - "$@" |
			awk -F, 'NR > 1 { n[$10]++ }
				END { printf "%d %d\n", n["cutting"], n["insertion"] }'
	}
	read -r cutting insertion < <(phases --rig $rig,tube_s=10)
	[ "$cutting" -gt 10000 ] && [ "$insertion" -gt 1000 ]
	read -r cutting insertion < <(phases --rig $rig)
	[ "$cutting" -gt 10000 ] && [ "$insertion" = 0 ]
	# By name it is held all the time, and the scalpel is not.
	read -r cutting insertion < <(phases --rig $rig,tube_s=10 --tool tube)
	[ "$cutting" = 0 ] && [ "$insertion" -gt 2000 ]
	read -r cutting insertion < <(phases --rig $rig,tube_s=10 --tool blade)
	[ "$cutting" -gt 10000 ] && [ "$insertion" = 0 ]
}
