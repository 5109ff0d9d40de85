# SPDX-License-Identifier: GPL-2.0-or-later
# The CAN backends with the real programs, against an independent CiA 402 drive over slcan on
# a pty; see tests/can/README.md. tests/vm/guest/can_drive.sh has it on a CAN interface.

load cli
# shellcheck source=tests/can/peer.sh
. "${BATS_TEST_DIRNAME}/../can/peer.sh"

setup() {
	[ -x "$INCISE_BUILD/tests/can/drive" ] ||
		skip "python-canopen is not there; see tests/can/venv"
	work_folder
}

teardown() {
	[ -z "${pid:-}" ] || kill -9 "$pid" 2>/dev/null || :
	drive_end
}

@test "the drive of these tests is what python-canopen's own master takes for one" {
	run -0 "$INCISE_BUILD/tests/can/selftest"
	[[ "$output" != *"not ok"* ]]
	[ "${#lines[@]}" -ge 8 ]
}
