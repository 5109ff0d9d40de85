# SPDX-License-Identifier: GPL-2.0-or-later
# Hours of the wall scene in simulated time; the whole day is `make check-day`.

load cli

# bats test_tags=slow
@test "an hour of ticks: no drift, no leak, no counter that wraps" {
	run -0 "$INCISE_BUILD/tests/day" "$root/scenes/wall.scene" 1
	[ "$(grep -c '^ok ' <<<"$output")" = 14 ]
}

# 250 s before a double is too short for ns, and a counter of 32 bits for 1/2^21 s; and before
# half of all that 64 bits hold. Odd, so that no last bit is 0 by chance.
@test "the loop does not care when it runs" {
	for start in 9006949254740993 4611685768427387905; do
		run -0 "$INCISE_BUILD/tests/day" "$root/scenes/wall.scene" 0.15 $start
		[ "$(grep -c '^ok ' <<<"$output")" = 14 ]
	done
}
