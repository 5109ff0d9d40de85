# SPDX-License-Identifier: GPL-2.0-or-later
# Modules of devices: anyone can write one, and it is loaded just when rig.conf names it.

load cli
load stepper_module

setup() {
	work_folder
	cp "$root"/scenes/liver.{scene,fis,fis.tex} .
	module_folder
}

@test "a module from outside the tree is loaded when it is named, and drives" {
	make_module stepper_mine mine INCISE_BACKEND_ABI
	rig mine:42
	run -0 --separate-stderr incise haptic liver.scene --rig rig.conf --no-rt --duration 0.1s
	[ "${stderr_lines[0]}" = loaded ]
	[ "${stderr_lines[1]}" = "opened mine at 42, lead 3" ]
	[[ "$stderr" == *closed* ]]
	[[ "$output" == *" actuate"* ]]
}

@test "an actuator whose 0 is not known is refused, or taken as it stands" {
	make_module stepper_mine mine INCISE_BACKEND_ABI
	rig "mine:lost with switch"
	run --separate-stderr incise haptic liver.scene --rig rig.conf --no-rt --duration 0.1s
	[ "$status" -eq 1 ]
	[[ "${stderr_lines[-1]}" == "incise haptic: mine at lost with switch is not homed; run 'incise stepper home --rig rig.conf', or give --home" ]]
	# It has a switch, but no way to go there.
	run --separate-stderr incise haptic liver.scene --rig rig.conf --no-rt --duration 0.1s --home
	[ "$status" -eq 1 ]
	[[ "${stderr_lines[-1]}" == *"mine at lost with switch does not support being homed"* ]]
	rig "mine:lost"
	run -0 --separate-stderr incise haptic liver.scene --rig rig.conf --no-rt --duration 0.1s
	[[ "$stderr" == *"warning: mine at lost cannot be homed: its 0 is its present position"* ]]
}

@test "a fault of the actuator ends the loop with its name" {
	make_module stepper_mine mine INCISE_BACKEND_ABI
	rig "mine:pressed"
	run --separate-stderr incise haptic liver.scene --rig rig.conf --no-rt --duration 10s
	[ "$status" -eq 1 ]
	[[ "${stderr_lines[-1]}" == "incise haptic: liver.scene: a device failed at tick 21: e-stop: release it, then clear; the force was removed" ]]
	[[ "$output" == "21 ticks"* ]]
}

@test "a module that is not named is not loaded" {
	make_module stepper_mine mine INCISE_BACKEND_ABI
	rig sim:
	run -0 --separate-stderr incise haptic liver.scene --rig rig.conf -c none --no-rt --duration 0.1s
	[ -z "$stderr" ]
}

@test "the modules that there are stand in the message" {
	make_module stepper_mine mine INCISE_BACKEND_ABI
	touch modules/tracker_other.so modules/stepper_.so modules/stepper_x.txt
	rig other:1
	run --separate-stderr incise haptic liver.scene --rig rig.conf --no-rt --duration 0.1s
	failed_with 'rig.conf:2: stepper: no such backend "other"' 'there are: sim, mine'
	[[ "$stderr" == *mine ]]
}

# bats test_tags=check
@test "a module that is none, or another's, is refused" {
	make_module stepper_mine mine 99
	rig mine:1
	run --separate-stderr incise haptic liver.scene --rig rig.conf --no-rt --duration 0.1s
	[ "$status" -eq 1 ]
	[[ "${stderr_lines[-1]}" == *"stepper_mine.so: built for interface 99, this is "*"; build it again" ]]
	make_module stepper_mine other INCISE_BACKEND_ABI
	run --separate-stderr incise haptic liver.scene --rig rig.conf --no-rt --duration 0.1s
	[ "$status" -eq 1 ]
	[[ "${stderr_lines[-1]}" == *"contains another backend than its name says"* ]]
	echo 'int incise_nothing;' >empty.c
	$CC -shared -fPIC -o modules/stepper_mine.so empty.c
	run --separate-stderr incise haptic liver.scene --rig rig.conf --no-rt --duration 0.1s
	failed_with "has no symbol incise_backend"
	echo nonsense >modules/stepper_mine.so
	run --separate-stderr incise haptic liver.scene --rig rig.conf --no-rt --duration 0.1s
	failed_with "rig.conf:2: stepper:"
}

@test "a module that is a pipe is none, and nobody waits for it" {
	mkdir -p modules && rm -f modules/stepper_mine.so && mkfifo modules/stepper_mine.so
	rig mine:1
	run --separate-stderr timeout 60 incise haptic liver.scene --rig rig.conf --no-rt --duration 0.1s
	failed_with 'no such backend "mine"'
}

@test "the modules that are built are found beside the library" {
	unset INCISE_MODULE_PATH
	[ -e "$INCISE_BUILD/lib/incise/stepper_gpio.so" ] || skip "libgpiod is not installed"
	rig gpio:no-such-chip
	sed -i 's/lead_mm/lines = { step = 1; dir = 2; }; &/' rig.conf
	run --separate-stderr incise haptic liver.scene --rig rig.conf --no-rt --duration 0.1s
	failed_with "rig.conf:2: stepper:" gpiodetect
}

# A copy of a file that needs another version of a library, which there is not.
without_library() {
	grep -q "$3" "$1" || complain "$1 does not need $3" || return
	sed "s/${3//./\\.}/$4/g" "$1" >"$2"
}

@test "a library that a module needs and is missing is named with its package" {
	[ -e "$INCISE_BUILD/lib/incise/tracker_usb.so" ] || skip "libusb is not installed"
	mkdir -p modules
	export INCISE_MODULE_PATH=$PWD/modules
	without_library "$INCISE_BUILD/lib/incise/tracker_usb.so" modules/tracker_usb.so \
		libusb-1.0.so.0 libusb-1.0.so.9
	echo 'tracker = "usb:"; force = "sim:";' >usb.conf
	run --separate-stderr incise capture -o a.rec --duration 1s --rig usb.conf </dev/null
	failed_with "libusb-1.0.so.9 is missing" "apt-get install libusb-1.0-9"
}

@test "a library that incise view needs and is missing is named with its package" {
	mkdir bin lib
	cp "$INCISE_BUILD"/bin/incise "$INCISE_BUILD"/bin/incise-view bin
	cp "$INCISE_BUILD"/lib/libincise*.so.2 lib
	without_library "$INCISE_BUILD/lib/libincise-view.so.2" lib/libincise-view.so.2 \
		libSDL2-2.0.so.0 libSDL2-2.0.so.9
	run --separate-stderr bin/incise view --help
	failed_with "incise view: libSDL2-2.0.so.9 is missing" "apt-get install libsdl2-2.0-9"
	[ -z "$output" ]
	cp "$INCISE_BUILD/lib/libincise-view.so.2" lib
	run -0 bin/incise view --help
}

@test "a backend that this build lacks is named with the package that brings it" {
	mkdir -p modules && rm -f modules/*
	fails incise info usb: -- 'usb:: no backend "usb" in this build: apt-get install libusb-1.0-0-dev, and build incise again; there are: sim'
	fails incise info canopen:x -- 'no such backend "canopen"; there are: sim'
}

@test "features have packages of mk/packages, and each module that needs a package is a feature" {
	cd "$BATS_TEST_DIRNAME/../.."
	sed -n 's/^FEATURE("\([^"]*\)", "\([^"]*\)", .*/\1|\2/p' lib/base/features.def >"$BATS_TEST_TMPDIR/rows"
	[ "$(wc -l <"$BATS_TEST_TMPDIR/rows")" = "$(grep -c '^FEATURE(' lib/base/features.def)" ]
	for package in $(cut -d'|' -f2 "$BATS_TEST_TMPDIR/rows"); do
		grep -q "^$package " mk/packages || complain "mk/packages has no $package"
	done
	cut -d'|' -f1 "$BATS_TEST_TMPDIR/rows" | tr ' ' '\n' | sort >"$BATS_TEST_TMPDIR/names"
	[ -z "$(uniq -d "$BATS_TEST_TMPDIR/names")" ]
	sed -n 's/^\(pc\|headers\)_\([a-z0-9_]*\) := .*/\2/p' lib/*/module.mk lib/*/*/module.mk | sort -u >"$BATS_TEST_TMPDIR/needy"
	[ "$(wc -l <"$BATS_TEST_TMPDIR/needy")" -ge 12 ]
	while read -r module; do
		grep -qx "$module" "$BATS_TEST_TMPDIR/names" || complain "lib/base/features.def has no $module"
	done <"$BATS_TEST_TMPDIR/needy"
}
