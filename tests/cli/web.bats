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
@test "a page with a document: pixels of a known pattern, keys" {
	viewer pixels keys
}

# bats test_tags=check
@test "a live page: token, state and controls, requests" {
	viewer token stream requests
}

@test "pointers, a bare head, reconnection, 390 and 1280 pixels, dark and light, no motion" {
	viewer pointers bare reconnect looks still
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
