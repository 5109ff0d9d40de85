# SPDX-License-Identifier: GPL-2.0-or-later
# examples/openhaptics and examples/forcedimension: compiled with stand-ins for the headers of the closed
# libraries, which are not here, and used by their page.

load cli

setup() {
	work_folder
	id=t$BATS_TEST_NUMBER-$$
}

teardown() {
	[ -z "${device:-}" ] || kill -9 "$device" 2>/dev/null || :
	rm -f "/dev/shm/incise-$id"
}

# As C, and as C++, which a header with default arguments needs.
compile() { # FOLDER
	local flags=(-Wall -Wextra -Werror "-I$root/lib/include" "-I$root/tests/haptic/stub")
	"${CC:-cc}" -std=gnu11 -D_GNU_SOURCE "${flags[@]}" "$root/examples/$1/device.c" -lm -o device
	"${CXX:-c++}" -x c++ "${flags[@]}" "$root/examples/$1/device.c" -lm -o device.cc
	[ "$(head -n 1 "$root/examples/$1/device.c")" = "// not compiled against the real headers, not run against the real thing" ]
	[ "$(wc -l <"$root/examples/$1/device.c")" -le 200 ]
}

has_page() {
	[ -e "/dev/shm/incise-$id" ]
}

ended() {
	! has_page
}

serve() { # ARGUMENT…
	./device "$id" "$@" 3>&- &
	device=$!
	await has_page
}

# bats test_tags=check
@test "openhaptics: a stand-in's pose, limits and buttons reach a rig" {
	compile openhaptics
	serve
	incise doctor --rig "local:$id" --report r.json >out || :
	grep -q "haptic = \"local:$id\";    # stub of HD 0" out
	grep -q "buttons: 2, pressed: 0x2" out
	[ "$(key r.json haptic.peak_N)" = 3.3 ]
	[ "$(key r.json haptic.continuous_N)" = 0.88 ]
	printf '\n\n\n' >enter
	run --separate-stderr incise calibrate frame --rig "local:$id" --point 0,0,0 --point 50,0,0 --point 0,50,0 \
		-o touched.csv <enter
	failed=$stderr
	[[ "$failed" == *"points 1 and 2"* ]]
	[ "$(awk -F, 'NR == 2 { printf "%.6f %.6f %.6f", $4, $5, $6 }' touched.csv)" = "1.000000 2.000000 3.000000" ]
	kill "$device"
	await ended
}

# It measures the noise for 10 s.
@test "the protocol waits for nobody without a terminal, and gives no force then" {
	compile openhaptics
	serve
	incise doctor --rig "local:$id" --report r.json --protocol <&- >out 2>said || :
	grep -q "walls *not measured: standard input is no terminal" out
	[ ! -s said ]
	[ "$(jq '[.haptic.protocol[] | select(.step == "wall" and .value == null)] | length' r.json)" = 4 ]
}

# bats test_tags=check
@test "openhaptics: a tick with an error has neither force nor sample" {
	"${CC:-cc}" -std=gnu11 -D_GNU_SOURCE -Wall -Wextra -Werror "-I$root/lib/include" "-I$root/tests/haptic/stub" \
		"$root/tests/haptic/touch_failure.c" -lm -o touch_failure
	./touch_failure "$id"
}

# bats test_tags=check
@test "forcedimension: a stand-in's metres become millimetres, a dead owner is told" {
	compile forcedimension
	serve 12
	incise doctor --rig "local:$id" --report r.json >out || :
	grep -q "haptic = \"local:$id\";    # stub of dhd" out
	[ "$(key r.json haptic.peak_N)" = 12.0 ] || [ "$(key r.json haptic.peak_N)" = 12 ]
	kill -9 "$device"
	wait "$device" || :
	device=
	incise info devices >out
	grep -q "stub of dhd: its owner has died" out
	rm "/dev/shm/incise-$id"
	run -2 --separate-stderr ./device "$id"
	[[ "$stderr" == *"usage:"*"PEAK_N"* ]]
}
