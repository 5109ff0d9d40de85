# SPDX-License-Identifier: GPL-2.0-or-later
# Attacks on a recording while it is written, and on one that lies on a disk. What is left
# must open, verify, and hold all that was committed. A few of each in `make check`, with a
# seed that differs from run to run and is printed; ATTACK=full, as of `make check-attack`,
# has the full counts. ATTACK_SEED=N repeats a run.

load ../cli/cli

setup() {
	work_folder
	export INCISE_MODULE_PATH=$INCISE_BUILD/lib/incise
	: "${ATTACK_SEED:=$((RANDOM * 32768 + RANDOM))}"
	programs=$INCISE_BUILD/tests/attack
}

# attack FEW MANY PROGRAM ARGUMENT…: the count and the seed go behind them.
attack() {
	local count=$1
	[ "$ATTACK" != full ] || count=$2
	shift 2
	local program=$1
	shift
	"$programs/$program" "$@" "$count" "$ATTACK_SEED"
}

# Its result stands in the log of a full run.
tell() {
	[ "$ATTACK" != full ] || echo "# $output" >&3
}

@test "kill -9 at random moments: at most 200 ms are lost, and nothing that was committed" {
	run -0 attack 20 100 storage kill
	tell
}

@test "errors of the disk, once or from then on" {
	run -0 attack 40 1000 storage eio
	tell
}

@test "errors of fsync" {
	run -0 attack 40 1000 storage sync
	tell
}

@test "writes that do less than they were asked for" {
	run -0 attack 40 1000 storage short
	tell
}

@test "a disk that is full after any number of bytes" {
	run -0 attack 40 1000 storage enospc
	tell
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
