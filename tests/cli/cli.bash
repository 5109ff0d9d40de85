# SPDX-License-Identifier: GPL-2.0-or-later
# Shared part of the command-line tests: `load cli`. Variables: root, the source tree.
# shellcheck shell=bash

bats_require_minimum_version 1.5.0

: "${INCISE_BUILD:?is the build folder; run make check-cli}"
root=$(cd "$BATS_TEST_DIRNAME/../.." && pwd)
PATH=$INCISE_BUILD/bin:$PATH

# Loops put their state pages into a folder of the test's own.
run_folder() {
	export XDG_RUNTIME_DIR=$BATS_TEST_TMPDIR/run
	mkdir -p "$XDG_RUNTIME_DIR"
}

# A folder to work in that is empty; bats keeps files of its own beside it.
work_folder() {
	rm -rf "${BATS_TEST_TMPDIR:?is not set in setup_file}/work" # of a try before, where a test may retry
	mkdir "$BATS_TEST_TMPDIR/work"
	cd "$BATS_TEST_TMPDIR/work"
	run_folder
}

# Of the files that have none of their own.
setup() {
	work_folder
}

# The same in memory, where there is room: a disk that others keep busy can stand still for
# seconds, and a test of what is lost in real time is not about that one. left_memory() at
# the end.
memory_folder() {
	local free
	free=$(df -k --output=avail /dev/shm 2>/dev/null | tail -n 1)
	if [ "${free:-0}" -gt 1000000 ] && [ -w /dev/shm ]; then
		in_memory=$(mktemp -d /dev/shm/incise-XXXXXX)
		cd "$in_memory"
		run_folder
	else
		work_folder
	fi
}

left_memory() {
	cd /
	[ -z "$in_memory" ] || rm -rf "$in_memory"
}

# The shipped liver without its texture, for a model that is put beside it.
smooth_liver() {
	sed 's/^model = .*/model = "liver.fis";/' "$root/scenes/liver.scene" >liver.scene
	grep -q '^model = "liver.fis";' liver.scene
}

# For tests in real time, in which programs have to answer each other within so many ms:
# watch_machine in setup(), machine_watched MS in teardown(). A witness wants to run every 5 ms. A
# test that fails is repeated where the machine let the witness wait for MS or more meanwhile, and
# nowhere else; after three such tries it is skipped with that reason.
watch_machine() {
	late=$BATS_FILE_TMPDIR/late.$BATS_TEST_NUMBER
	[ "${BATS_TEST_TRY_NUMBER:-1}" -le 3 ] ||
		skip "failed three times on a machine that stood still for up to $(cat "$late") ms each time"
	rm -f "$late" "$late.end"
	# No job of this shell, whose tests may wait for all of theirs.
	witness=$(
		python3 - "$late" $$ >/dev/null 3>&- <<-'END' &
			import os, signal, sys, time
			most, next, ends = -1, time.monotonic(), False
			def asked(*_):
			    global ends
			    ends = True
			signal.signal(signal.SIGTERM, asked)
			while os.path.exists('/proc/' + sys.argv[2]):
			    now = time.monotonic()
			    if int(1000 * (now - next)) > most:
			        most = int(1000 * (now - next))
			        with open(sys.argv[1] + '.new', 'w') as file:
			            file.write(str(most))
			        os.rename(sys.argv[1] + '.new', sys.argv[1])
			    if ends:
			        os.rename(sys.argv[1], sys.argv[1] + '.end')
			        break
			    next = max(next, now) + 0.005
			    time.sleep(max(0, next - time.monotonic()))
		END
		echo $!
	)
	until [ -s "$late" ] || ! kill -0 "$witness"; do sleep 0.02; done
}

machine_watched() {
	[ -n "${witness:-}" ] || return 0
	# it counts a wait that just ended
	kill "$witness" 2>/dev/null || return 0
	await test -e "$late.end" || return
	mv "$late.end" "$late"
	BATS_TEST_RETRIES=0
	[ "$(cat "$late")" -lt "$1" ] || BATS_TEST_RETRIES=3
}

# Wait until a command succeeds. A minute ends a test that hangs, and is no measure of anything.
await() {
	local i
	for ((i = 0; i < 9600; i++)); do
		! "$@" >/dev/null 2>&1 || return 0
		sleep 0.05
	done
	complain "not within 8 min: $*"
}

# A recording is as it was written, with samples that were lost or without.
is_intact() {
	incise verify "$1" --json >intact.json || :
	[ "$(key intact.json intact)" = 1 ] || complain "$1: $(cat intact.json)"
}

# A capture in real time. A machine that stands still loses samples: that may make it exit 1.
captures() {
	incise capture "$@" 2>captures.err || grep -q "were lost" captures.err || complain "$(cat captures.err)"
}

# Monotonic time in ms; the clock of the day may be set meanwhile.
uptime_ms() {
	awk '{ printf "%.0f\n", 1000 * $1 }' /proc/uptime
}

# Wait until a program catches a signal: until_it_catches PID incise-haptic 2, of the mask's bits.
# Before it is the program it is a shell, which may catch it as well, and forget it.
until_it_catches() {
	local i mask
	for ((i = 0; i < 9600; i++)); do
		mask=$(awk -v name="${2:0:15}" '/^Name/ && $2 != name { exit } /^SigCgt/ { print $2 }' \
			"/proc/$1/status" 2>/dev/null) || :
		! ((0x${mask:-0} & $3)) || return 0
		kill -0 "$1" 2>/dev/null || complain "$2 ended before it caught signals" || return
		sleep 0.05
	done
	complain "$2 does not catch $3 within 8 min"
}

# In front of a command: without the rights by which root opens what file modes deny.
plainly=()
[ "$(id -u)" != 0 ] ||
	plainly=(setpriv --bounding-set=-dac_override,-dac_read_search --inh-caps=-dac_override,-dac_read_search)

complain() {
	echo "$*"
	return 1
}

# Run a bench with $TMPDIR in t, send SIGINT as soon as it has files there. It says that it was
# interrupted, as its last line, and leaves no file.
bench_interrupted() {
	local i pid status=0
	TMPDIR=$PWD/t incise bench "$@" >out 2>err 3>&- &
	pid=$!
	for ((i = 0; i < 3000; i++)); do
		[ -z "$(ls -A t)" ] || break
		sleep 0.02
	done
	[ -n "$(ls -A t)" ] || complain "no file within 8 min: $(cat err)" || return
	kill -INT $pid
	wait $pid || status=$?
	[ "$status" -eq 1 ] || complain "exit $status: $(cat err)" || return
	grep -q "^incise bench: interrupted" err || complain "$(cat err)" || return
	[ -z "$(ls -A t)" ] || complain "left: $(ls -A t)"
}

# A text holds these pieces: path, line, key, value. The wording is in tests/messages/cli, which `make golden`
# writes: where INCISE_MESSAGES names a file, the text is appended to it behind the name of the test's file.
holds_pieces() {
	local text=$1 piece
	for piece in "${@:2}"; do
		[[ "$text" == *"$piece"* ]] || complain "no '$piece' in: $text" || return
	done
	[ "${INCISE_MESSAGES:-}" ] || return 0
	text=${text//"$BATS_TEST_TMPDIR"/TMP}
	text=${text//"$BATS_FILE_TMPDIR"/TMP}
	text=${text//"$INCISE_BUILD"/BUILD}
	text=${text//"$root"/ROOT}
	printf '%s\n' "$(basename "$BATS_TEST_FILENAME" .bats): $text" >>"$INCISE_MESSAGES"
}

# A test that skips something may lack messages.
declare -F bats_skip >/dev/null || eval "bats_$(declare -f skip)"
skip() {
	[ -z "${INCISE_MESSAGES:-}" ] ||
		echo "$(basename "$BATS_TEST_FILENAME" .bats): (skipped)" >>"$INCISE_MESSAGES"
	bats_skip "$@"
}

# The last run (with --separate-stderr) failed with 1 and one line that holds these pieces.
failed_with() {
	[ "$status" -eq 1 ] || complain "exit $status: $stderr" || return
	[ "${#stderr_lines[@]}" -eq 1 ] || complain "more than one line: $stderr" || return
	[[ "$stderr" == "incise "*": "* ]] || complain "no verb is named: $stderr" || return
	holds_pieces "$stderr" "$@"
}

# The last run was bad usage: 2, one line that holds these pieces, and where help is.
bad_usage() {
	[ "$status" -eq 2 ] || complain "exit $status: $stderr" || return
	[ "${#stderr_lines[@]}" -eq 2 ] || complain "not two lines: $stderr" || return
	[[ "${stderr_lines[0]}" == "incise "* ]] || complain "no verb is named: $stderr" || return
	[[ "${stderr_lines[1]}" == "Try 'incise "*" --help'." ]] || complain "$stderr" || return
	holds_pieces "${stderr_lines[0]}" "$@"
}

# fails COMMAND… -- PIECE…: run it, and then as failed_with; misused, as bad_usage.
fails() {
	judge_refusal failed_with "$@"
}

misused() {
	judge_refusal bad_usage "$@"
}

judge_refusal() {
	local verdict=$1 words=()
	while shift && [ "$1" != -- ]; do
		words+=("$1")
	done
	run --separate-stderr "${words[@]}"
	"$verdict" "${@:2}"
}

# One value of a JSON file, by path: key report.json check.rmse_N. Fails without it.
key() {
	local type
	[ "$(sqlite3 :memory: "SELECT json_valid(readfile('$1'))")" = 1 ] ||
		complain "$1 is no JSON" || return
	type=$(sqlite3 :memory: "SELECT json_type(readfile('$1'), '\$.$2')")
	[ -n "$type" ] || complain "$1 has no key $2" || return
	sqlite3 :memory: "SELECT json_extract(readfile('$1'), '\$.$2')"
}

# sqlite3, with a row a sample in the tables of a recording; see tests/rows/sql.c.
sqlite3() {
	local argument program=(command sqlite3)
	for argument; do
		[[ "$argument" != */recording.db ]] || program=("$INCISE_BUILD/tests/sql")
	done
	"${program[@]}" "$@"
}

# What the database of a recording answers: ask RECORDING SQL.
ask() {
	sqlite3 "$1/recording.db" "$2"
}

# A recording as the version of its time wrote it: old_form RECORDING FORM, of tests/forms.
old_form() {
	local files=("$root/tests/forms/$2.sql")

	[ "$2" -gt 4 ] || files+=("$root"/tests/forms/[1-"$2"]-4.sql)
	mkdir "$1"
	cat "${files[@]}" | sqlite3 "$1/recording.db"
}

# Whether a comparison of numbers holds: holds "$a < 0.1". An empty value is an error.
holds() {
	awk "BEGIN { exit !($1) }" || complain "does not hold: $1"
}

# Training pairs of 6 cuts over 0-20 mm and 0-50 mm/s; the force is smooth, differs by a
# few percent between cuts and carries up to 5 mN of noise (no rand(): awks differ).
made_pairs() {
	awk 'BEGIN {
		print "cut,depth_mm,velocity_mm_s,force_N"
		for (c = 1; c <= 6; c++)
			for (i = 0; i < 8; i++)
				for (j = 0; j < 6; j++) {
					d = i * 20 / 7; v = 10 * j
					noise = (c * 7919 + i * 104729 + j * 1299709) % 1000 / 1000 - 0.5
					f = (0.045 * d + 0.0028 * d * d) * (1 + 0.35 * v / (v + 15))
					printf "c%d,%.6f,%g,%.6f\n", c, d, v,
						f * (1 + 0.02 * (c - 3.5)) + 0.01 * noise
				}
	}'
}

# $1 times the pairs of made_pairs, each time of other cuts and forces.
many_pairs() {
	made_pairs | awk -F, -v OFS=, -v times="$1" '
		NR == 1 { print; next }
		{ for (k = 1; k <= times; k++) print $1 "-" k, $2, $3, sprintf("%.6f", $4 + k / 1000) }'
}

# The file between .Bd -literal and .Ed of a manual page that holds a word.
example_in() {
	awk -v word="$2" '
		/^\.Bd -literal/ { inside = 1; text = ""; next }
		/^\.Ed/ { if (inside && index(text, word)) { printf "%s", text; exit }; inside = 0 }
		inside { text = text $0 "\n" }' "$1" | sed 's/\\e/\\/g; s/\\-/-/g'
}
