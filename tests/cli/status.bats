# SPDX-License-Identifier: GPL-2.0-or-later
# incise status: what loops told, by name, by file and all of them; live, as JSON and for
# Prometheus. tests/state/loop plays them.

load cli

setup() {
	work_folder
	export XDG_RUNTIME_DIR=$PWD TMPDIR=$PWD
	export TZ=UTC
	mkdir incise
	loop=$INCISE_BUILD/tests/state/loop
	played=
}

teardown() {
	[ -z "$played" ] || kill -KILL "$played" 2>/dev/null || true
}

# play NAME WHAT: in the background, until its page is there and has ticks where it ticks.
play() {
	"$loop" "incise/$1.state" "$2" 3>&- &
	played=$!
	for ((i = 0; i < 600; i++)); do
		[ ! -e "incise/$1.state" ] || break
		sleep 0.1
	done
	[ "$2" = start ] || until_ticks "$1"
}

until_ticks() {
	for ((i = 0; i < 600; i++)); do
		incise status "incise/$1.state" --prometheus |
			grep -q '^incise_loop_ticks_total{.*} 0$' || return 0
		sleep 0.1
	done
}

# runs NAME: status takes it for running, in files seen and seen.err; for `await`: a loop that a busy
# machine keeps from its ticks for 0.2 s is not well.
runs() {
	incise status "$1" >seen 2>seen.err && grep -q "^$1: running since " seen
}

@test "without a loop it says how to start one" {
	! compgen -G "/run/incise/*.state" >/dev/null || skip "a loop has run on this machine"
	fails incise status -- "no loop has run here" "incise haptic SCENE"
	fails incise status neck -- "neck:" "incise haptic neck"
	fails incise status nosuch/neck.state -- "nosuch/neck.state:"
	rmdir incise
	fails incise status neck -- "no loop of that name"
}

# bats test_tags=check
@test "a loop that was stopped as asked is well" {
	"$loop" incise/neck.state done
	run -0 --separate-stderr incise status neck
	[ -z "$stderr" ]
	[[ "${lines[0]}" == "neck: stopped since "* ]]
	[[ "$output" == *"reason     SIGTERM"* ]]
	[[ "$output" == *"scene      /scenes/other.scene"* ]]
	[[ "$output" == *"reloads    1 done, 1 refused"* ]]
	[[ "$output" == *"policy     SCHED_FIFO 80, CPU 1"* ]]
	[[ "$output" == *"rate       1000 Hz requested, 1000.00 Hz on average"* ]]
	[[ "$output" == *"ticks      1000, 3 missed in 1 overrun"* ]]
	# lateness was 1, 2 … 1000 us: buckets are 3.2 % wide
	[[ "$output" == *"lateness   median 508, 99 % 999, 99.9 % 999, 99.99 % 1000, max 1000.0 us"* ]]
	[[ "$output" == *"tick       median 5.00, "*" max 5.0 us"* ]]
	[[ "$output" == *"flags      contact 1000, clamped 100"* ]]
	[[ "$output" == *"force      2.000 N now, 2.000 N at most, limited in 100 ticks"* ]]
	# 999 ways of 0.01 mm against 2 N
	[[ "$output" == *"energy     19.98 mJ into the tissue, 0.00 mJ back"* ]]
	[[ "$output" == *"thread     11 minor and 12 major page faults, 13 voluntary, 14 involuntary context switches"* ]]
	# the same by the scene and by the file
	run -0 incise status scenes/neck.scene
	[[ "${lines[0]}" == "neck: stopped since "* ]]
	run -0 incise status incise/neck.state
	[[ "${lines[0]}" == "neck: stopped since "* ]]
	mv incise/neck.state other
	run -0 incise status ./other
	[[ "${lines[0]}" == "other: stopped since "* ]]
}

@test "a real loop tells its state, by the name of its scene" {
	incise haptic "$root/scenes/wall.scene" --rig sim: --no-rt --overruns 0 --duration 1h \
		--state incise/wall.state >/dev/null 2>&1 3>&- &
	played=$!
	# the self-test comes first
	await runs wall
	incise status wall --json >report.json || :
	[ "$(key report.json 'loops[0].state')" = running ]
	[ "$(key report.json 'loops[0].pid')" = "$played" ]
	[ "$(key report.json 'loops[0].scene')" = "$root/scenes/wall.scene" ]
	[[ "$(key report.json 'loops[0].stages')" == *'"contact"'* ]]
	kill -TERM "$played"
	wait "$played"
	run -0 incise status wall
	[[ "${lines[0]}" == "wall: stopped since "* ]]
}

@test "a page that is cut off ends neither its loop nor who reads it" {
	incise haptic "$root/scenes/wall.scene" --rig sim: --no-rt --overruns 0 --duration 1h \
		--state incise/wall.state >/dev/null 2>&1 3>&- &
	played=$!
	await runs wall
	incise status wall --follow --json >followed 2>&1 3>&- &
	follower=$!
	for size in 0 1 600 1000000; do
		truncate -s $size incise/wall.state
		# the loop's other thread makes it whole again, when it runs
		for ((i = 0; i < 3000; i++)); do
			[ "$(stat -c %s incise/wall.state)" -le 1000000 ] || break
			sleep 0.02
		done
		await runs wall
		[ ! -s seen.err ]
		grep -q "^wall: running since .*, process $played$" seen
		[ "$(stat -c %s incise/wall.state)" -gt 1000000 ]
	done
	kill -TERM "$played"
	wait "$played"
	wait "$follower" || complain "$(cat followed)"
	[ "$(tail -n 1 followed >report.json && key report.json state)" = stopped ]
	run -0 incise status wall
	[[ "${lines[0]}" == "wall: stopped since "* ]]
}

@test "where there is no folder for pages, a loop says where it puts its own, and status finds it" {
	[ ! -d /run/incise ] || skip "this machine has the system's folder"
	unset XDG_RUNTIME_DIR
	mkdir temporary
	export TMPDIR=$PWD/temporary
	place=$TMPDIR/incise-$(id -u)
	incise haptic "$root/scenes/wall.scene" --rig sim: --no-rt --overruns 0 --duration 1h \
		>/dev/null 2>err 3>&- &
	played=$!
	await runs wall
	[ ! -s seen.err ]
	[ "$(sed -n 2p seen)" = "page       $place/wall.state, of user $(id -un)" ]
	[ "$(stat -c %a "$place")" = 700 ]
	grep -qF "the status file is $place/wall.state" err
	incise status --json >report.json || :
	[ "$(key report.json 'loops[0].user')" = "$(id -un)" ]
	kill -TERM "$played"
	wait "$played"
	# A folder where others may write could be anybody's.
	chmod 777 "$place"
	fails incise status wall -- "no loop of that name"
	run -0 --separate-stderr incise haptic "$root/scenes/wall.scene" --rig sim: --no-rt \
		--overruns 0 --duration 100ms
	[[ "$stderr" == *"no status file: $place belongs to another user, or others may write there"* ]]
	# Nor a link to one.
	mv "$place" real
	chmod 700 real
	ln -s "$PWD/real" "$place"
	fails incise status wall -- "no loop of that name"
}

# bats test_tags=check
@test "a fault is told with its reason, and is no success" {
	"$loop" incise/neck.state fault || true
	run -1 --separate-stderr incise status neck
	[ -z "$stderr" ]
	[[ "${lines[0]}" == "neck: fault since "* ]]
	[ "${lines[1]}" = "reason     stepper: e-stop: release it, then clear" ]
	run -1 incise status neck --json
	run -1 incise status neck --prometheus
	run -1 incise status neck --follow
}

@test "a loop that lives and does not tick is not well" {
	play neck stall
	# its last tick is longer ago each time
	for ((i = 0; i < 600; i++)); do
		incise status neck >/dev/null || break
		sleep 0.1
	done
	run -1 incise status neck
	[[ "${lines[0]}" == "neck: running, but it does not tick, since "* ]]
	incise status neck --json >report.json || true
	[ "$(key report.json 'loops[0].stalled')" = 1 ]
	kill -TERM "$played"
	wait "$played" || true
	run -0 incise status neck
	# frozen from outside, as by a debugger
	play frozen run
	kill -STOP "$played"
	run -1 incise status frozen
	[[ "${lines[0]}" == "frozen: running, but it does not tick, since "* ]]
}

@test "all loops are shown, by name, and one that is not well is said" {
	! compgen -G "/run/incise/*.state" >/dev/null || skip "a loop has run on this machine"
	"$loop" incise/b.state done
	"$loop" incise/a.state done
	: >incise/notes.txt
	run -0 --separate-stderr incise status
	[ -z "$stderr" ]
	[[ "${lines[0]}" == "a: stopped since "* ]]
	[ "$(grep -c '^[ab]: stopped' <<<"$output")" = 2 ]
	incise status --json >report.json
	[ "$(key report.json 'loops[1].name')" = b ]
	"$loop" incise/c.state fault || true
	run -1 incise status
	[[ "$output" == *"c: fault since "* ]]
	# what is no page is warned of, and the others are shown
	rm incise/c.state
	echo "rate_hz = 1000.0;" >incise/d.state
	run -0 --separate-stderr incise status
	[[ "$stderr" == *"warning: "*"incise/d.state: not a status file"* ]]
	[ "$(grep -c '^[ab]: stopped' <<<"$output")" = 2 ]
}

# bats test_tags=check
@test "JSON has the values of the status" {
	before=$(date +%s)
	"$loop" incise/neck.state done
	incise status neck --json >report.json
	[ "$(key report.json 'loops[0].state')" = stopped ]
	[ "$(key report.json 'loops[0].reason')" = SIGTERM ]
	[ "$(key report.json 'loops[0].ticks')" = 1000 ]
	[ "$(key report.json 'loops[0].reloads_refused')" = 1 ]
	[ "$(key report.json 'loops[0].major_faults')" = 12 ]
	[ "$(key report.json 'loops[0].flags.clamped')" = 100 ]
	[ "$(key report.json 'loops[0].lateness_us.max')" = 1000.0 ]
	[ "$(key report.json 'loops[0].lateness_us.mean')" = 500.5 ]
	holds "$(key report.json 'loops[0].absorbed_mJ') > 19.979999"
	holds "$(key report.json 'loops[0].absorbed_mJ') < 19.980001"
	# it was told when the test ran
	holds "$(key report.json 'loops[0].since_unix_s') > $before - 1"
	holds "$(key report.json 'loops[0].since_unix_s') < $(date +%s) + 1"
}

# bats test_tags=check
@test "Prometheus' text is as its format says" {
	name='ne"c\k'
	"$loop" incise/neck.state done
	"$loop" "incise/$name.state" done
	incise status incise/neck.state --prometheus >one.prom
	"$root/tests/state/prometheus.py" <one.prom >one
	grep -qx 'incise_loop_ticks_total scene=neck 1000.0' one
	grep -qx 'incise_loop_state scene=neck state=stopped 1.0' one
	grep -qx 'incise_loop_state scene=neck state=running 0.0' one
	grep -qx 'incise_loop_work_absorbed_joules_total scene=neck 0.01998' one
	grep -qx 'incise_loop_lateness_seconds_count scene=neck 1000.0' one
	grep -qx 'incise_loop_lateness_seconds_sum scene=neck 0.5005' one
	# 1 us … 1000 us: exact, as bounds are edges of the page's own
	grep -qx 'incise_loop_lateness_seconds_bucket scene=neck le=3.2767e-05 32.0' one
	grep -qx 'incise_loop_lateness_seconds_bucket scene=neck le=0.000524287 524.0' one
	grep -qx 'incise_loop_page_faults_total scene=neck kind=major 12.0' one
	# labels that need it are escaped; several loops stand in one family
	incise status "incise/$name.state" --prometheus | "$root/tests/state/prometheus.py" >other
	grep -qxF "incise_loop_ticks_total scene=$name 1000.0" other
	if ! compgen -G "/run/incise/*.state" >/dev/null; then
		incise status --prometheus | "$root/tests/state/prometheus.py" >both
		[ "$(wc -l <both)" = "$(($(wc -l <one) * 2))" ]
	fi
}

# until_lines FILE N: the file has so many.
until_lines() {
	for ((i = 0; i < 3000; i++)); do
		# It may not be there yet.
		! { [ -e "$1" ] && [ "$(wc -l <"$1")" -ge "$2" ]; } || return 0
		sleep 0.02
	done
	complain "no $2 lines within 60 s: $(cat "$1")"
}

@test "--follow in a pipe is a line a second, and ends with the loop" {
	play neck run
	incise status neck --follow >out 2>err 3>&- &
	follower=$!
	until_lines out 2
	await grep -qE '^[-0-9]+ [:0-9]+ running, 1000\.0 Hz, [0-9]+ ticks, ' out
	kill -TERM "$played"
	wait "$follower"
	[ ! -s err ]
	mapfile -t lines <out
	[ "${#lines[@]}" -ge 3 ]
	[[ "${lines[-1]}" == *" stopped, "*": SIGTERM" ]]
}

@test "--follow ends at SIGINT, and with the one who reads" {
	play neck run
	# A program in the background of a script ignores SIGINT unless it says otherwise.
	env --default-signal=INT incise status neck --follow >out 3>&- &
	follower=$!
	until_lines out 1
	kill -INT "$follower"
	wait "$follower"
	# the first that measured a rate
	run -0 bash -c 'incise status neck --follow --json | grep -m 1 "\"measured_hz\": *[0-9]"'
	echo "$output" >report.json
	[ "$(key report.json state)" = running ]
	holds "$(key report.json measured_hz) > 999"
}

@test "--follow of a loop that ended says so once" {
	"$loop" incise/neck.state done
	run -0 --separate-stderr incise status neck --follow
	[ "${#lines[@]}" -eq 1 ]
	[[ "$output" == *" stopped, "* ]]
}

@test "--follow on a terminal draws a view that goes away" {
	play neck run
	python3 - >shown <<-'PYTHON'
		import fcntl, os, pty, signal, struct, sys, termios
		pid, master = pty.fork()
		if pid == 0:
		    fcntl.ioctl(0, termios.TIOCSWINSZ, struct.pack('HHHH', 8, 40, 0, 0))
		    os.execvp('incise', ['incise', 'status', 'neck', '--follow'])
		asked, out = False, b''
		while True:
		    try:
		        part = os.read(master, 65536)
		    except OSError:
		        break
		    if not part:
		        break
		    out += part
		    if not asked and out.count(b'\x1b[H') >= 4:
		        os.kill(pid, signal.SIGINT)
		        asked = True
		sys.stdout.buffer.write(out)
		sys.exit(os.waitstatus_to_exitcode(os.waitpid(pid, 0)[1]))
	PYTHON
	python3 - <<-'PYTHON'
		text = open('shown', 'rb').read().decode()
		begin, end = '\x1b[?1049h', '\x1b[?1049l'
		assert text.count(begin) == 1 and text.count(end) == 1
		view, after = text.split(begin)[1].split(end)
		frames = view.split('\x1b[H')[1:]
		assert len(frames) >= 3, len(frames)
		for frame in frames:
		    rows = frame.replace('\x1b[K', '').replace('\x1b[J', '').split('\r\n')
		    rows = [row for row in rows if '\x1b' not in row and row]
		    assert len(rows) <= 7 and all(len(row) <= 40 for row in rows), rows
		    assert rows[0].startswith('neck: running'), rows
		# what was last seen stays
		assert '1000 Hz requested' in after
	PYTHON
}

@test "names of files cannot give orders to a terminal" {
	"$loop" $'incise/a\e[2Jb.state' done
	run -0 incise status $'incise/a\e[2Jb.state'
	[[ "${lines[0]}" == 'a?[2Jb: stopped since '* ]]
	[[ "$output" != *$'\e'* ]]
}

# bats test_tags=check
@test "a page that is no page, or of another release, is refused" {
	echo "rate_hz = 1000.0;" >a.state
	fails incise status a.state -- "a.state:"
	echo nonsense >a.state
	fails incise status a.state -- "a.state:"
	"$loop" incise/neck.state done
	printf '\2' | dd of=incise/neck.state bs=1 seek=8 conv=notrunc 2>/dev/null
	fails incise status neck -- "a status file of version 2.0" "one release"
	"$loop" incise/other.state done
	truncate -s 1000 incise/other.state
	fails incise status other -- "damaged or truncated"
}

# Compiles what the manual says of the bytes, and reads a page by it and nothing else.
@test "the layout in incise-state(5) is that of a page" {
	"$loop" incise/neck.state done
	{
		echo '#include <stdint.h>'
		echo '#include <stdio.h>'
		example_in "$root/man/incise-state.5" 'struct slot'
		cat <<-'C'
			static unsigned char page[4000000];
			int main(void)
			{
				struct head *head = (void *)page;
				size_t n = fread(page, 1, sizeof(page), stdin);
				struct run *run = (void *)(page + head->run.offset);
				struct live *live = (void *)(page + head->live.offset);
				uint64_t *written = (void *)(page + head->ring.offset);
				struct slot *slot = (void *)(written + 1);
				uint64_t *cost = (void *)(page + head->cost.offset), sum = 0;
				for (uint64_t i = 0; i < head->cost.count; i++)
					sum += cost[i];
				printf("%.8s %u %d %d %d %d %d\n", head->magic, head->major,
				       n == head->bytes, head->head.size == sizeof(*head),
				       head->run.size == sizeof(*run), head->live.size == sizeof(*live),
				       head->ring.size == sizeof(*slot));
				printf("%g %s %s\n", head->rate_hz, head->rig, head->policy);
				printf("%u %s %s %d %d\n", run->run, run->reason, run->scene,
				       (int)run->refused, (int)run->involuntary);
				printf("%d %d %d %.2f %d\n", (int)live->ticks, (int)live->skipped,
				       (int)live->flagged[3], live->absorbed_mJ, (int)sum);
				printf("%d %d %.2f %g %u %u\n", (int)*written, (int)slot[7].number,
				       slot[7].tick.depth_mm, slot[7].tick.command_N[2],
				       slot[7].tick.flags, slot[7].tick.tool);
				return live->tick.t_ns != slot[999].tick.t_ns;
			}
		C
	} >reader.c
	${CC:-cc} -Wall -Werror -o reader reader.c
	run -0 ./reader <incise/neck.state
	[ "${lines[0]}" = "INCSTATE 1 1 1 1 1 1" ]
	[ "${lines[1]}" = "1000 sim: SCHED_FIFO 80, CPU 1" ]
	[ "${lines[2]}" = "4 SIGTERM /scenes/other.scene 1 14" ]
	[ "${lines[3]}" = "1000 3 100 19.98 1000" ]
	[ "${lines[4]}" = "1000 8 0.07 2 1 1" ]
}
