# SPDX-License-Identifier: GPL-2.0-or-later
# Attacks on a recording while it is written, and on one that lies on a disk. What is left
# must open, verify, and hold all that was committed. A few of each with ATTACK=few, the same ones
# each time; ATTACK=full, as of `make check-attack`, has the full counts, with a seed that differs
# from run to run and is printed. ATTACK_SEED=N repeats a run.

load ../cli/cli

setup() {
	work_folder
	export INCISE_MODULE_PATH=$INCISE_BUILD/lib/incise
	[ "$ATTACK" != full ] || : "${ATTACK_SEED:=$((RANDOM * 32768 + RANDOM))}"
	: "${ATTACK_SEED:=1}"
	programs=$INCISE_BUILD/tests/attack
}

teardown() {
	[ -z "$mounted" ] || umount "$mounted"
}

# attack FEW MANY PROGRAM ARGUMENT…: the count and the seed go behind them.
attack() {
	local count=$1
	[ "$ATTACK" != full ] || count=$2
	shift 2
	local program=$1
	shift
	"$programs/$program" "$@" "$count" "$ATTACK_SEED" $camera
}

# Its result stands in the log of a full run.
tell() {
	[ "$ATTACK" != full ] || echo "# $output" >&3
}

@test "kill -9 at random moments: nothing is lost that was committed" {
	run -0 attack 20 100 kill
	tell
}

@test "kill -9 before any write or sync, those of closing too" {
	run -0 attack 60 1000 faults die
	tell
}

@test "errors of the disk, once or from then on" {
	run -0 attack 40 1000 faults eio
	tell
}

@test "errors of fsync" {
	run -0 attack 40 1000 faults sync
	tell
}

@test "writes that do less than they were asked for" {
	run -0 attack 40 1000 faults short
	tell
}

@test "a disk that is full after any number of bytes" {
	run -0 attack 40 1000 faults enospc
	tell
}

# Where pictures can be recorded; the attacks that follow are with them.
with_camera() {
	[ -e "$INCISE_MODULE_PATH/frames_mkv.so" ] || skip "frames_mkv.so is not built"
	incise capture --help | grep -q -- --camera || skip "incise capture takes no camera"
	camera=camera
}

@test "kill -9 while pictures are recorded" {
	with_camera
	run -0 attack 3 50 kill
	tell
}

# A recording with pictures takes half a second of a processor: a test of each kind, or a busy machine would
# take longer than a test may.
with_pictures() {
	with_camera
	run -0 attack "$1" "$2" faults "$3"
	tell
}

@test "kill -9 before any write or sync while pictures are recorded" {
	with_pictures 8 100 die
}

@test "errors of the disk while pictures are recorded" {
	with_pictures 6 100 eio
}

@test "errors of fsync while pictures are recorded" {
	with_pictures 6 100 sync
}

@test "a disk that is full while pictures are recorded" {
	with_pictures 6 100 enospc
}

@test "writes that do less than they were asked for, while pictures are recorded" {
	with_pictures 2 50 short
}

@test "bytes of recording.db that went bad" {
	incise capture -o good.rec --rig sim:clock=simulated --duration 1s >/dev/null
	run -0 attack 100 2000 damage good.rec recording.db
	tell
}

@test "bytes of camera.mkv that went bad" {
	[ -e "$INCISE_MODULE_PATH/frames_mkv.so" ] || skip "frames_mkv.so is not built"
	"$programs/record" good.rec 200
	incise verify good.rec
	run -0 attack 100 2000 damage good.rec camera.mkv
	tell
}

@test "a disk that someone else fills" {
	mkdir disk
	mount -t tmpfs -o size=40m tmpfs disk 2>/dev/null ||
		skip "mounting a small tmpfs is not permitted; that of so many bytes stands in"
	mounted=$PWD/disk
	# 1 min is what the disk has room for at the start
	incise capture -o disk/a.rec --rig sim:clock=real --duration 1min >out 2>err 3>&- &
	pid=$!
	until incise info disk/a.rec.part --json >rows.json 2>/dev/null &&
		[ "$(key rows.json rows.force)" -gt 1000 ]; do
		kill -0 $pid || complain "$(cat err)"
		sleep 0.1
	done
	dd if=/dev/zero of=disk/else bs=64k 2>/dev/null || true
	status=0
	wait $pid || status=$?
	[ "$status" -eq 1 ] || complain "exit $status: $(cat err)"
	# but for the line of each second
	[ "$(grep -cv '^[0-9]* s: ' err)" -eq 1 ] || complain "$(cat err)"
	rm disk/else
	# ended cleanly, or up to the last commit
	incise verify --json disk/a.rec >report.json || [ -d disk/a.rec.part ]
	[ "$(key report.json intact)" = 1 ] || complain "$(cat report.json)"
	holds "$(key report.json 'streams[0].present') > 1000"
}

# Made by someone who knows the format and recomputes every checksum: a second implementation of
# it, which must also agree on the statement of the untouched recording.
forge() {
	[ -e "$INCISE_MODULE_PATH/frames_mkv.so" ] || skip "frames_mkv.so is not built"
	echo 'force_mV_N = 1240.0;' >calibration.conf
	for seed in 1 2; do
		printf '%s\n' 'clock = "simulated";' 'tracker = "sim:";' 'force = "sim:";' 'camera = "sim:";' \
			"sim = { seed = $seed; force_hz = 200.0; camera_hz = 1.0; };" >rig.conf
		incise capture -o $seed.rec --rig rig.conf -c calibration.conf --camera frames \
			--duration 3s --clock-source sim:1800000000 2>capture.log
	done
	run -0 /usr/bin/python3 "$BATS_TEST_DIRNAME/forgeries.py" "$programs/statement" 1.rec 2.rec "$1" "$ATTACK_SEED"
	[[ "$output" == "$1 forgeries of 58 kinds, $1 found and named: "* ]]
	echo "# $output" >&3
}

@test "58 forgeries, one of each kind, with all checksums right" {
	forge 58
}

# bats test_tags=slow
@test "500 forgeries, with all checksums right, with those of the ledger, and with none" {
	forge 500
}
