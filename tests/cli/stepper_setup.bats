# SPDX-License-Identifier: GPL-2.0-or-later
# udev/stepper-setup on folders that stand for configfs: all of the file, or nothing, and what
# is wrong with its line. The module itself: tests/vm/guest/stepper_setup.sh.

load cli

setup() {
	work_folder
	export INCISE_CONFIGFS=$PWD/configfs RUNTIME_DIRECTORY=$PWD/run
	steppers=$INCISE_CONFIGFS/incise-stepper
	mkdir -p "$steppers" bin
	# What makes a folder in configfs gets its files, and goes with them.
	cat >bin/mkdir <<-END
		#!/bin/sh
		/bin/mkdir "\$@" || exit
		for folder in "$steppers"/*/; do
			[ -d "\$folder" ] || exit 0
			[ -e "\$folder/live" ] || ln -s "$PWD/live" "\$folder/live"
			touch "\$folder/estop" "\$folder/sync" "\$folder/cdev" "\$folder/dev_name"
		done
		for folder in "$steppers"/*/*/; do
			[ ! -d "\$folder" ] || (cd "\$folder" && touch step dir enable limit_min limit_max home fault)
		done
	END
	cat >bin/rmdir <<-'END'
		#!/bin/sh
		rm -rf "$@"
	END
	printf '#!/bin/sh\ncat dmesg 2>/dev/null\n' >bin/dmesg
	printf '#!/bin/sh\necho "modprobe: FATAL: Module $1 not found in directory /lib/modules/6" >&2\nexit 1\n' >bin/modprobe
	chmod +x bin/*
	PATH=$PWD/bin:$PATH
	echo 0 >live
	cat >stepper.conf <<-'END'
		# one motor
		bench/motor0/step = chip:17
		bench/motor0/dir=chip:27    # as on the board

		  bench/motor0/enable=chip:22:active-low:pull-up
		bench/estop=a:chip:6:pull-up
	END
}

stepper_setup() { "$root/udev/stepper-setup" "$@"; }

# refused CODE TEXT: of stepper.conf, with nothing left.
refused() {
	run "-$1" --separate-stderr stepper_setup start stepper.conf
	[ -z "$output" ]
	[ "$stderr" = "stepper-setup: $2" ] || complain "$stderr"
	[ -z "$(ls "$steppers" run 2>/dev/null | grep -v :)" ]
}

# bats test_tags=check
@test "each line of the file is written, the controller is live, and stop removes it" {
	printf 'other/motor0/step=chip:1\r\nother/motor0/dir=chip:2' >>stepper.conf
	run -0 stepper_setup start stepper.conf
	[ -z "$output" ]
	[ "$(cat "$steppers"/bench/motor0/{step,dir,enable} "$steppers"/bench/estop "$steppers"/other/motor0/{step,dir})" = \
		$'chip:17\nchip:27\nchip:22:active-low:pull-up\na:chip:6:pull-up\nchip:1\nchip:2' ]
	[ "$(cat "$steppers"/bench/live)" = 1 ]
	run -1 --separate-stderr stepper_setup start stepper.conf
	[ "$stderr" = "stepper-setup: $PWD/run/controllers: it is started already; stop it first" ]
	# of others it removes nothing
	mkdir "$steppers/mine"
	echo "renamed" >stepper.conf
	run -0 stepper_setup stop
	[ "$(ls "$steppers")" = mine ]
	[ "$(cat live)" = 0 ]
	run -0 stepper_setup stop
}

# bats test_tags=check
@test "a file that says nothing sets up nothing" {
	for text in "" "# bench/estop=chip:1" " "; do
		echo "$text" >stepper.conf
		run -0 stepper_setup start stepper.conf
		[ -z "$output$(ls "$steppers")" ]
	done
	# the example neither; without its marks it is whole
	cp "$root/doc/stepper.conf.example" stepper.conf
	run -0 stepper_setup start stepper.conf
	[ -z "$output$(ls "$steppers")" ]
	sed -i 's/^#\([a-z0-9]*\/\)/\1/' stepper.conf
	run -0 stepper_setup start stepper.conf
	[ -z "$output" ]
	[ "$(cat "$steppers"/bench/motor0/step)" = pinctrl-bcm2711:17 ]
}

# bats test_tags=check
@test "a line that is none is refused with its number" {
	line=" is not CONTROLLER/LINE=... or CONTROLLER/motorN/LINE=..."
	value=" is not LABEL:OFFSET[:active-low][:pull-up|:pull-down], nor a number"
	while IFS='|' read -r text expected; do
		cp stepper.conf whole.conf
		echo "$text" >>stepper.conf
		refused 2 "stepper.conf:7: $expected"
		mv whole.conf stepper.conf
	done <<-END
		bench|"bench"$line
		motor0/step=|motor0/step: ""$value
		motor0=chip:1|"motor0=chip:1"$line
		/motor0/step=chip:1|"/motor0/step=chip:1"$line
		../estop=chip:1|"../estop=chip:1"$line
		bench/motor8/step=chip:1|"bench/motor8/step=chip:1"$line
		bench/motor0/home=chip|bench/motor0/home: "chip"$value
		bench/motor0/home=chip:a|bench/motor0/home: "chip:a"$value
		bench/motor0/home=:3|bench/motor0/home: ":3"$value
		bench/motor0/home=chip:3:pull|bench/motor0/home: "chip:3:pull"$value
		bench/motor0/home=chip:3 pull-up|bench/motor0/home: "chip:3 pull-up"$value
		bench/motor0/step=chip:4|bench/motor0/step: line 2 has it already
		bench/motor0/stpe=chip:4|bench/motor0/stpe: no such line; there are: dir enable fault home limit_max limit_min step
		bench/limit_min=chip:4|bench/limit_min: no such line; there are: estop sync
		bench/live=chip:1|bench/live: no such line; there are: estop sync
	END
}

# bats test_tags=check
@test "what the module refuses is refused with the line that it names" {
	rm live
	ln -s /dev/full live
	refused 1 "stepper.conf: bench: No space left on device; motors are numbered from 0 without a gap"
	echo "[    1.0] incise-stepper incise-stepper.0: line estop: no chip labelled before" >dmesg
	refused 1 "stepper.conf: bench: No space left on device; motors are numbered from 0 without a gap"
	help="'gpioinfo' prints the chips' labels and their lines"
	printf '#!/bin/sh\n[ -e seen ] && cat later || : >seen\n' >bin/dmesg
	while IFS='|' read -r said expected; do
		rm -f seen
		echo "[    2.0] incise-stepper incise-stepper.0: $said" >later
		refused 1 "stepper.conf$expected; $help"
	done <<-END
		line motor0-step: no chip labelled chip|:2: bench/motor0/step: no chip labelled chip
		line estop of a:chip: it is not available: -EBUSY|:6: bench/estop: of a:chip: it is not available: -EBUSY
		error -ENOENT: line motor0-limit-min: it is not available|: bench/motor0/limit_min: it must be wired
	END
}

# bats test_tags=check
@test "nothing is done to a controller that is there, without the file, or without the module" {
	mkdir "$steppers/bench"
	run -1 --separate-stderr stepper_setup start stepper.conf
	[ "$stderr" = "stepper-setup: stepper.conf:2: bench: it is there already; remove $steppers/bench, or take another name" ]
	[ "$(ls "$steppers")" = bench ]
	rmdir "$steppers/bench"
	run -2 --separate-stderr stepper_setup start none.conf
	[ "$stderr" = "stepper-setup: none.conf: cannot be read; name a file" ]
	rmdir "$steppers"
	run -1 --separate-stderr stepper_setup start stepper.conf
	[ "$stderr" = "stepper-setup: incise_stepper: Module incise_stepper not found in directory /lib/modules/6; install incise-dkms, or run 'make module_install'" ]
	run -2 --separate-stderr stepper_setup begin
	[[ "${stderr_lines[0]}" == "stepper-setup start FILE" ]]
}
