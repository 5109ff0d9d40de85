# SPDX-License-Identifier: GPL-2.0-or-later
# The runner of the unit tests must not overlook a failure, nor a check the rest behind one; make on
# a machine that has nothing names the command that installs what is needed.

load cli

# A test program that prints the given lines and exits with a status.
program() {
	printf '#!/bin/sh\ncat <<E\n%s\nE\nexit %d\n' "$2" "$3" >"$1"
	chmod +x "$1"
}

good='[       OK ] test_a
[  PASSED  ] 1 test(s).'

@test "make without compiler and pkg-config is one line that says what installs them" {
	mkdir bin
	for name in sh make sed awk sort find nproc expr grep uname mkdir rm ln env cat dirname; do
		ln -s "$(command -v $name)" bin
	done
	run -2 env -u MAKEFLAGS -u MAKELEVEL PATH="$PWD/bin" make -C "$root" --no-print-directory O="$PWD/build"
	[ "${#lines[@]}" = 1 ] || complain "$output"
	[[ "$output" == *"not installed: cc ar pkg-config: run 'make deps'"* ]]
	run -2 env -u MAKEFLAGS -u MAKELEVEL PKG_CONFIG_LIBDIR="$PWD" PKG_CONFIG_PATH= make -C "$root" \
		--no-print-directory O="$PWD/build"
	[[ "$output" == *"not installed: libconfig "*"run 'make deps'"* ]]
	# Goals that need none of it are not held up.
	run -0 env -u MAKEFLAGS -u MAKELEVEL PATH="$PWD/bin" make -C "$root" --no-print-directory help
	[[ "${lines[0]}" == bench* ]]
	[[ "$output" != *"not found"* ]]
}

# bats test_tags=check
@test "a passing program passes" {
	program a "$good" 0
	run -0 "$root/tests/unit/run" ./a
	[ "${lines[-1]}" = "1 passed, 0 failed, 0 skipped" ]
}

# bats test_tags=check
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

@test "a skipped test is named with its reason, and a program that was not built is a failure" {
	program a 'skipped: no screen
[  SKIPPED ] test_b
'"$good" 0
	program b "[  SKIPPED ] test_c
$good" 0
	run -1 "$root/tests/unit/run" ./a ./b ./none
	grep -qx "skipped: ./a: no screen" <<<"$output"
	grep -qx "skipped: ./b: test_c" <<<"$output"
	grep -qx "FAIL  ./none: it was not built" <<<"$output"
	[ "${lines[-1]}" = "2 passed, 1 failed, 2 skipped" ]
}

@test "where a unit test cannot be built, the others run" {
	mkdir -p tests/unit/x
	program tests/unit/x/good "$good" 0
	run make --no-print-directory -C "$root" O="$INCISE_BUILD" DEPS=no check-unit \
		unit_programs="$PWD/tests/unit/x/none $PWD/tests/unit/x/good"
	[ "$status" -ne 0 ]
	[[ "$output" == *"FAIL  x/none: it was not built"* ]]
	[[ "$output" == *"ok    x/good"* ]]
}

# bats test_tags=check
@test "a check ends with one summary: what took how long, failed, and was skipped with the reason" {
	run -0 "$root/tests/timed" times first printf '%s\n' "ok    base/crc32c" \
		"skipped: view/draw: no screen" "3 passed, 0 failed, 1 skipped"
	run -3 "$root/tests/timed" times second sh -c 'echo "ok 1 this"; echo "not ok 2 that"
		echo "ok 3 other # skip no adapter"; echo "ok 4 another # skip no adapter"
		echo "FAIL  base/ring" >&2; exit 3'
	[[ "$output" == *"FAIL  base/ring"* ]]
	NEEDS=second run -1 "$root/tests/timed" times third touch there
	[ ! -e there ]
	NEEDS=first run -0 "$root/tests/timed" times fourth true
	run -2 "$root/tests/timed" times fifth sh -c 'echo "make[2]: *** [mk/lib.mk:11: build/x.o] Error 1"
		echo "make[1]: *** [mk/test.mk:60: fifth] Error 2"; exit 2'
	run -1 "$root/tests/timed" times sixth false
	# what it prints is that of its parts
	run -1 "$root/tests/timed" times whole sh -c 'echo "not ok 2 that"; false'
	run -0 "$root/tests/timed" times
	[ "$(grep -c FAILED <<<"$output")" = 5 ]
	diff - <(sed -n '/^failed:/,$p' <<<"$output") <<-END
		failed:
		  fifth: build/x.o: Error 1
		  second: that
		  second: base/ring
		  third: not run: third, which needs second
		  sixth: see times.logs/sixth
		skipped:
		  first: view/draw: no screen
		  second: no adapter (2 tests)
		all that was printed: times.logs/PART
		4 passed, 3 failed, 3 skipped
	END
}

@test "a test in real time is repeated where the machine stood still, and nowhere else" {
	# Lines that begin with @test would be tests of this file.
	sed 's/^ */@test /' >late.bats <<-'END'
		"fails in time" { false; }
		"fails late" { stands_still; false; }
		"fails late once" { stands_still; [ "$(wc -l <"$counts/3")" = 2 ]; }
		"passes" { stands_still; wait; }
	END
	cat >>late.bats <<-'END'
		load "$tree/tests/cli/cli"
		setup() { watch_machine; echo >>"$counts/$BATS_TEST_NUMBER"; }
		teardown() { machine_watched 100; }
		stands_still() { kill -STOP $witness; sleep 0.2; kill -CONT $witness; }
	END
	mkdir counts
	run env -i PATH="$(tr : '\n' <<<"$PATH" | grep -v bats-core | paste -sd :)" HOME="$PWD" \
		INCISE_BUILD="$INCISE_BUILD" tree="$root" counts="$PWD/counts" bats late.bats
	echo "$output"
	# A machine that is late by itself repeats more.
	grep -qE "^(not ok 1 |ok 1 .* # skip )" <<<"$output"
	grep -q "^ok 2 fails late # skip failed three times on a machine that stood still for up to" <<<"$output"
	grep -qx "ok 3 fails late once" <<<"$output"
	grep -qx "ok 4 passes" <<<"$output"
	[ "$(wc -l <counts/2) $(wc -l <counts/4)" = "3 1" ]
}

@test "a program that is left running holds no part up" {
	# A pipe would be open until that program ends.
	timeout 60 "$root/tests/timed" times left sh -c 'sleep 100 & echo $!' >out 3>&-
	kill "$(cat times.logs/left)"
	cmp out times.logs/left
}

# In a library of that name, as the driver of OpenGL is; made by the compiler of the tests.
@test "leaks of OpenGL's driver are suppressed by its name, and no others" {
	cat >driver.c <<-'C'
		#include <stdlib.h>
		void *volatile kept;
		void open_driver(void) { kept = malloc(2352); kept = NULL; }
	C
	cat >program.c <<-'C'
		void open_driver(void);
		int main(void) { open_driver(); return 0; }
	C
	leaks() {
		# The frames of the library have to be in the report.
		env -u ASAN_OPTIONS LSAN_OPTIONS="suppressions=$root/tests/unit/lsan.supp:print_suppressions=0" "./$1"
	}
	for name in gallium-25.0.7 other; do
		${CC:-cc} -g -fsanitize=address -fPIC -shared -o "lib$name.so" driver.c
		${CC:-cc} -g -fsanitize=address -o "$name" program.c "./lib$name.so" || skip "no AddressSanitizer"
	done
	run leaks other
	[ "$status" -ne 0 ]
	[[ "$output" == *LeakSanitizer* ]] || skip "LeakSanitizer cannot run here"
	run -0 leaks gallium-25.0.7
}

# Packages are built in there beside other makes, with folders as /usr/lib/udev/rules.d.
@test "a folder whose name ends in .d is no file of dependencies" {
	mkdir -p o/deb/src/rules.d o/obj/rules.d
	run -0 make --no-print-directory -C "$root" O="$PWD/o" DEPS=no help
}
