# SPDX-License-Identifier: GPL-2.0-or-later
# A tracker that answers behind a pseudo terminal: `load fastrak`. Variable: fastrak, its
# process. Call pull_away in teardown.
# shellcheck shell=bash

# A FASTRAK at $PWD/tracker that takes commands on 9; with options of its own. It plays a device,
# which sends in time however busy this machine is: ahead of other programs where that is permitted.
plug_in() {
	local ahead=(chrt --fifo 1)
	"${ahead[@]}" true 2>/dev/null || ahead=()
	mkfifo to
	"${ahead[@]}" "$INCISE_BUILD/tests/polhemus/fastrak" --link "$PWD/tracker" "$@" <to >from 2>&1 3>&- &
	fastrak=$!
	exec 9>to
	for _ in $(seq 100); do
		grep -q ready from && return
		sleep 0.1
	done
	complain "no emulator: $(cat from)"
}

pull_away() {
	exec 9>&-
	[ -z "$fastrak" ] || kill "$fastrak"
}
