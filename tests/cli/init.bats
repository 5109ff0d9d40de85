# SPDX-License-Identifier: GPL-2.0-or-later
# incise init: rig.conf, the calibrations of a rig, and where it goes on.

load cli

setup() {
	work_folder
}

# bats test_tags=check
@test "the simulated rig: rig.conf, all calibrations, and the commands that it names run" {
	run -0 --separate-stderr incise init lab --preset sim --camera none --yes
	! grep -q 'warning\|incise' <<<"$stderr"
	holds "$(grep -c '^pass: ' <<<"$output") == 4"
	sed -n 's/^  \(incise .*\)/\1/p' <<<"$output" | grep -v "incise calibrate\|doctor" >next
	[ "$(cut -d' ' -f2 next | tr '\n' ' ')" = "capture train haptic " ]
	cd lab
	run -0 incise info rig.conf
	# each key has its meaning above it
	[ "$(grep -c '^[[:space:]]*#' rig.conf)" -ge "$(grep -c ' = [^{]' rig.conf)" ]
	bash -eu ../next >out
	[ -s first.fis ]
	# once more: nothing is left to do, and nothing changes
	sha256sum rig.conf calibration.conf >../before
	run -0 incise init --yes
	holds "$(grep -c ': passed$' <<<"$output") == 4"
	sha256sum -c --quiet ../before
}

# bats test_tags=check
@test "it goes on where it stopped, and never changes a rig.conf" {
	incise init lab --preset sim --yes --no-calibration >out
	[ ! -e lab/calibration.conf ]
	grep -q "^  incise init  *# 5 calibrations left$" out
	cp lab/rig.conf before
	fails incise init lab --preset haply --yes -- "rig.conf is there" "--preset"
	fails incise init lab --camera none --yes -- "rig.conf is there"
	(cd lab && incise calibrate depth two-point --images 20 >../out)
	run -0 incise init lab --yes
	grep -qx "depth: passed" <<<"$output"
	holds "$(grep -c '^pass: ' <<<"$output") == 4"
	cmp before lab/rig.conf
}

# bats test_tags=check
@test "init as JSON: what was written, what passed, what is next" {
	incise init lab --preset sim --camera none --yes --json >r.json 2>/dev/null
	[ "$(key r.json written)" = 1 ]
	[ "$(key r.json 'calibrations[0].kind') $(key r.json 'calibrations[0].passed')" = "force 1" ]
	[ "$(key r.json 'next[0]')" = "cd lab" ]
	cd lab
	incise init --yes --no-calibration --json >../r.json
	[ "$(key ../r.json written) $(key ../r.json 'next[0]')" = "0 incise doctor" ]
}

# bats test_tags=check
@test "a real rig: devices by options, calibrations only listed" {
	for module in force_iio haptic_haply; do
		[ -e "$INCISE_BUILD/lib/incise/$module.so" ] || skip "$module is not built"
	done
	run -0 incise init lab --preset paper --tracker tty:/dev/ttyS9 --force iio:iio:device0,0 --camera none \
		--stepper kernel:/dev/incise-stepper0 --spring 2.5 --yes
	grep -qx 'tracker = "tty:/dev/ttyS9";' lab/rig.conf
	grep -qx '	spring_N_mm = 2.5;' lab/rig.conf
	! grep -q camera lab/rig.conf
	[ "$(grep -c '^  incise calibrate' <<<"$output")" = 4 ]
	grep -q "4 calibrations left" <<<"$output"
	[ ! -e lab/calibration.conf ]
	run -0 incise init lab2 --preset paper --tracker none --force iio:iio:device0,0 --stepper none --yes
	if ! compgen -G "/dev/video*" >/dev/null; then
		grep -qx "camera: none is attached; name it in rig.conf later" <<<"$output"
	fi
	! grep -q "tracker: none" <<<"$output"
	run -0 incise init arm --preset haply --yes
	grep -q "^  incise calibrate frame" <<<"$output"
	! grep -q capture <<<"$output"
}

# bats test_tags=check
@test "what it refuses leaves no file" {
	fails incise init lab -- "no terminal" "--yes"
	[ ! -e lab ]
	fails incise init lab --preset paper --tracker 'tty:"; clock = "real' --yes -- tracker
	misused incise init lab --preset paper --stepper kernel:/dev/null --spring soft --yes -- --spring soft
	fails incise init lab --preset paper --tracker ttyy:/dev/ttyS9 --yes -- "tracker: " '"ttyy"' "there are: sim"
	INCISE_MODULE_PATH=$PWD fails incise init lab --preset haply --yes -- "haptic: " libwebsockets-dev
	fails incise init lab --preset paper --camera v4l2 --yes -- "camera: " BACKEND:ARGUMENTS
	fails incise init lab --preset paper --tracker none --force none --camera none --stepper none --yes -- \
		"rig.conf: the rig has no device" "--tracker" "--preset sim"
	[ -z "$(ls -A lab)" ]
	misused incise init a b -- "one folder"
}

# bats test_tags=check
@test "on a terminal it asks, and an empty answer is the default" {
	cat >ask.py <<-'END'
		import os, pty, sys, termios
		answers = iter(sys.argv[1].split(","))
		seen = b""
		def read(fd):
		    global seen
		    data = os.read(fd, 1024)
		    seen += data
		    while b"] " in seen:
		        seen = seen[seen.index(b"] ") + 2:]
		        answer = next(answers)
		        if answer == "^C": # which would drop the output so far
		            mode = termios.tcgetattr(fd)
		            mode[3] |= termios.NOFLSH
		            termios.tcsetattr(fd, termios.TCSANOW, mode)
		        os.write(fd, b"\3" if answer == "^C" else (answer + "\n").encode())
		    return data
		sys.exit(os.waitstatus_to_exitcode(pty.spawn(sys.argv[2:], read)))
	END
	run -0 python3 ask.py "sim,yes,later,later,later,later" incise init lab
	[[ "$output" == *"Rig: sim, paper or haply? ["* ]]
	[[ "$output" == *"4 calibrations left"* ]]
	run -0 incise calibrate check --only force -c lab/calibration.conf
	run -2 python3 ask.py "elephant" incise init lab3 --no-calibration
	[[ "$output" == *elephant* ]]
	[ ! -e lab3/rig.conf ]
	# an answer that is too long is refused, and its end does not answer the next question
	run -0 python3 ask.py "$(printf %0299d)elephant,sim" incise init lab4 --no-calibration
	[[ "$output" == *"an answer has up to 298 letters"* ]]
	[ "$(grep -c ' = "sim:";' lab4/rig.conf)" = 4 ]
	# Ctrl-C at a question: nothing is written; at a calibration: rig.conf stays, and the next run goes on
	run -1 python3 ask.py "^C" incise init lab5
	[[ "$output" == *"stopped; nothing more was written"* ]]
	[ ! -e lab5/rig.conf ]
	run -1 python3 ask.py "sim,^C" incise init lab5
	[ -s lab5/rig.conf ]
	[ ! -e lab5/calibration.conf ]
	run -0 python3 ask.py "later,later,later,later,later" incise init lab5
	[[ "$output" == *"5 calibrations left"* ]]
}
