# SPDX-License-Identifier: GPL-2.0-or-later
# The viewer in Chromium: tests/web/viewer.py has the checks, by their names.

load cli

setup() {
	command -v chromium >/dev/null || skip "chromium is not installed"
	work_folder
}

viewer() { # CHECK…
	timeout 540 python3 -B "$root/tests/web/viewer.py" "$@" || complain "viewer.py $*"
}

# A recording with frames, and its page.
recorded() {
	incise capture -o c.rec --rig sim:clock=simulated,camera_hz=5 --camera frames --duration 4s >/dev/null
	incise plot c.rec -o page.html >/dev/null
}

# bats test_tags=check
@test "a page with a document: pixels of a known pattern, keys, pointers, and a bare head" {
	viewer pixels keys pointers bare
}

# bats test_tags=check
@test "a live page: token, reconnection, state and controls, requests" {
	viewer token reconnect stream requests
}

@test "the page at 390 and 1280 pixels, dark and light, and without motion" {
	viewer looks still
}

@test "100 000 live messages leave the memory of the page as it was" {
	viewer memory
}

@test "incise plot -o page.html opens without a network; incise serve --http shows the same recording" {
	recorded
	viewer mailed served
}

@test "two tabs of a live rig: control, a capture, a mark, and a server that starts again" {
	viewer tabs
}
