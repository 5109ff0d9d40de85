# SPDX-License-Identifier: GPL-2.0-or-later
# The runner of the unit tests must not overlook a failure.

load cli

setup() {
	work_folder
}

# A test program that prints the given lines and exits with a status.
program() {
	printf '#!/bin/sh\ncat <<E\n%s\nE\nexit %d\n' "$2" "$3" >"$1"
	chmod +x "$1"
}

good='[       OK ] test_a
[  PASSED  ] 1 test(s).'

@test "a passing program passes" {
	program a "$good" 0
	run -0 "$root/tests/unit/run" ./a
	[ "${lines[-1]}" = "1 passed, 0 failed, 0 skipped" ]
}

@test "a leak reported at exit is a failure" {
	program a "$good" 0
	program b "$good" 23
	run -1 "$root/tests/unit/run" ./a ./b
	[ "${lines[-1]}" = "2 passed, 1 failed, 0 skipped" ]
}

@test "a program that dies before its last line is a failure" {
	program a '[       OK ] test_a' 0
	run -1 "$root/tests/unit/run" ./a
}

@test "no test at all is a failure" {
	run -1 "$root/tests/unit/run"
}
