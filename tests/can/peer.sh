# SPDX-License-Identifier: GPL-2.0-or-later
# Words for tests that talk to the drive of tests/can/drive.py; for sh and for bats. They need
# $INCISE_BUILD and work in the folder of the moment.
# shellcheck shell=sh

# drive_start OPTIONS…: starts it, or $drive_program, behind $drive_ahead; $drive is its name for
# rig.conf, such as slcan:/dev/pts/5:0x10.
drive_start()
{
	drive=
	rm -f drive.in
	mkfifo drive.in
	: >drive.out
	${drive_ahead:-} "$INCISE_BUILD/tests/can/${drive_program:-drive}" "$@" <drive.in >drive.out 2>drive.err 3>&- &
	drive_pid=$!
	exec 7>drive.in
	drive_answer 0 || return
	drive=$(sed -n 's/^ready //p' drive.out)
	[ -n "$drive" ]
}

# drive_answer BEFORE: the answer after so many, within 60 s: an emulated machine is slow.
drive_answer()
{
	drive_tries=0
	until [ "$(wc -l <drive.out)" -gt "$1" ]; do
		drive_tries=$((drive_tries + 1))
		if [ $drive_tries -gt 3000 ] || ! kill -0 "$drive_pid" 2>/dev/null; then
			echo "the drive does not answer:" "$(cat drive.err)"
			return 1
		fi
		sleep 0.02
	done
	drive_line=$(tail -n 1 drive.out)
}

# drive_tell COMMAND…: its answer is in $drive_line.
drive_tell()
{
	drive_before=$(wc -l <drive.out)
	echo "$@" >&7
	drive_answer "$drive_before" || return
	case $drive_line in
	'{"error": "'[a-zA-Z]*)
		echo "$drive_line"
		return 1
		;;
	esac
}

# drive_value KEY: of $drive_line, where it is a number, a word or null.
drive_value()
{
	printf '%s\n' "$drive_line" | sed -n "s/.*\"$1\": \"\{0,1\}\([^,\"}]*\).*/\1/p"
}

# drive_is STATE: asks for it.
drive_is()
{
	drive_tell state || return
	[ "$(drive_value state)" = "$1" ] || {
		echo "the drive is not $1: $drive_line"
		return 1
	}
}

# drive_until STATE: waits for it, a minute at most.
drive_until()
{
	drive_rounds=0
	until drive_is "$1" >/dev/null; do
		drive_rounds=$((drive_rounds + 1))
		if [ $drive_rounds -gt 3000 ] || ! kill -0 "$drive_pid" 2>/dev/null; then
			echo "the drive never was $1: $drive_line $(cat drive.err)"
			return 1
		fi
		sleep 0.02
	done
}

# Stopped: without power, or on its way there no more.
drive_stopped()
{
	drive_tell state || return
	case $(drive_value state) in
	"switch-on disabled" | ready | fault) ;;
	*)
		echo "the drive has power: $drive_line"
		return 1
		;;
	esac
	[ "$(drive_value velocity)" = 0 ] || {
		echo "the drive moves: $drive_line"
		return 1
	}
}

drive_end()
{
	[ -n "${drive_pid:-}" ] || return 0
	exec 7>&-
	wait "$drive_pid" 2>/dev/null || :
	drive_pid=
}
