# SPDX-License-Identifier: GPL-2.0-or-later
# incise doctor: findings, with the command that mends each.

load cli

setup() {
	work_folder
	unset DISPLAY WAYLAND_DISPLAY
}

# The line of a check, and the fix behind it.
finding() { # GROUP NAME
	awk -v group="$1" -v name="$2" '
		/^[a-z]/ { inside = $0 == group }
		inside && $2 == name { print; getline; if (/→/) print }' <<<"$output"
}

# bats test_tags=check
@test "doctor checks a simulated rig and finds no problem in it" {
	run --separate-stderr incise doctor --rig sim:
	[ -z "$stderr" ]
	[[ "$(finding devices rig)" == "  ok "*"sim:" ]]
	for device in tracker force stepper; do
		[[ "$(finding devices $device)" == "  ok "*opens ]]
	done
	[[ "$(finding devices camera)" == "  ok "*"names none" ]]
	[[ "$(finding display window)" == *warning*"no window"*"FILE.mp4"* ]]
	[[ "$(finding calibration file)" == *warning*"calibration.conf: No such file"*"incise help calibrate" ]]
	# the disk's space over the bytes of a row (2 of force, 84 of tracker) and of blocks (3000 of each), as capture
	# expects them; the space may change by a minute's worth meanwhile
	[[ "$(finding disk free)" =~ ok\ +free\ +([0-9.]+)\ GiB\ here:\ ([0-9]+)\ min ]]
	holds "${BASH_REMATCH[1]} < 2 || (${BASH_REMATCH[2]} / (${BASH_REMATCH[1]} * 1073741824 / (10000 * 2 + 120 * 84 + 2 * 3000) / 60) - 1) ^ 2 < 0.03 ^ 2"
	[[ "${lines[-2]}" =~ ^[0-9]+\ problems?,\ [0-9]+\ warnings?$ ]]
	# scheduling and memory are of this machine
	problems=$(grep -c "^  problem " <<<"$output" || :)
	[[ "${lines[-2]}" == "$problems problem"* ]]
	[ "$status" -eq $((problems > 0)) ]
	# it needs no calibration
	[ "$problems" -gt 0 ] || [ "${lines[-1]}" = "next: incise capture -o first.rec" ] || complain "${lines[-1]}"
	[ "$problems" -eq "$(awk '/^[a-z]/ { group = $0 } /^  problem / && group == "real time"' <<<"$output" | wc -l)" ]
}

# bats test_tags=check
@test "doctor names the device that does not open, and a broken rig.conf" {
	printf 'tracker = "tty:/dev/none:115200";\nforce = "sim:";\n' >rig.conf
	run -1 --separate-stderr incise doctor
	[[ "$(finding devices rig)" == "  ok "*rig.conf ]]
	[[ "$(finding devices tracker)" == "  problem "*"/dev/none"*"→ incise info devices"* ]]
	[[ "$(finding devices force)" == "  ok "*opens ]]
	[[ "$(finding devices stepper)" == "  ok "*"names none" ]]
	echo 'trakcer = "sim:";' >rig.conf
	run -1 --separate-stderr incise doctor
	[[ "$(finding devices rig)" == "  problem "*"rig.conf:1"*"trakcer"*"→ incise help rig.conf"* ]]
	rm rig.conf
	[ -e /etc/incise/rig.conf ] || {
		run --separate-stderr incise doctor
		[[ "$(finding devices rig)" == "  warning "*"neither ./rig.conf nor /etc/incise/rig.conf"*"→ incise init"* ]]
		[[ "${lines[-1]}" == "next: incise init "* ]]
	}
}

# The lines of a group.
group() {
	awk -v group="$1" '/^[a-z]/ { inside = $0 == group; next } inside && NF' <<<"$output" | tr -s ' '
}

# bats test_tags=check
@test "doctor ends with the next command: the first problem's, the calibrations that are left, then a capture" {
	next() { # COMMAND CALIBRATIONS
		incise doctor --json >r.json || :
		python3 - "$@" <<-'END'
			import json, sys
			report = json.load(open("r.json"))
			problems = [c["fix"] for c in report["checks"] if c["state"] == "problem" and c["fix"]]
			expected = problems[0] if problems else sys.argv[1]
			assert report["next"] == expected, (report["next"], expected)
			asked = {c["name"] for c in report["checks"] if c["group"] == "calibration"}
			assert asked == set(sys.argv[2].split()), asked
		END
	}
	incise init --preset sim --stepper none --camera none --yes --no-calibration >out
	next "incise init" file
	incise calibrate force --weights 0,50g,100g,200g >out
	# a rig without camera and stepper needs no calibration of them
	next "incise init" "force tip delay"
	incise init --yes >out
	next "incise capture -o first.rec" "force tip delay"
	echo 'tracker = "tty:/dev/none:115200";' >rig.conf
	next "incise init" "tip"
	[ "$(python3 -c 'import json; print(json.load(open("r.json"))["problems"])')" -ge 1 ]
}

# bats test_tags=check
@test "doctor names what brings an absent program, by apt and by pip" {
	mkdir bin
	for program in sh env dirname; do
		ln -s "$(command -v $program)" bin
	done
	run --separate-stderr env PATH="$PWD/bin" "$INCISE_BUILD/bin/incise-doctor" --rig sim:
	[[ "$(finding programs gnuplot)" == "  warning "*"no plots"*"→ sudo apt-get install gnuplot-nox" ]]
	mkdir python
	echo 'raise ImportError' >python/jinja2.py
	run --separate-stderr env PYTHONPATH="$PWD/python" incise doctor --rig sim:
	[[ "$(finding programs jinja2)" == "  warning "*"no HTML reports"*"→ sudo apt-get install python3-jinja2    # or: pip install jinja2" ]]
}

@test "doctor lists CAN interfaces and USB devices by name" {
	unshare -rm true 2>/dev/null || skip "no user namespaces"
	[ -d /sys/bus/usb/devices ] || mount_usb=no
	mkdir -p net/{can0,can1,eth0} usb/{usb1,1-1,1-1.2,1-1:1.0}
	echo 280 | tee net/can0/type >net/can1/type
	echo 0x40081 >net/can0/flags
	echo 0x40080 >net/can1/flags
	echo 1 >net/eth0/type
	echo 09 | tee usb/usb1/bDeviceClass >usb/1-1/bDeviceClass
	echo 00 >usb/1-1.2/bDeviceClass
	echo 0f44 >usb/1-1.2/idVendor
	echo 0002 >usb/1-1.2/idProduct
	echo Polhemus >usb/1-1.2/manufacturer
	echo FASTRAK >usb/1-1.2/product
	cat >inside <<-'END'
		mount --bind net /sys/class/net
		[ ! -d /sys/bus/usb/devices ] || mount --bind usb /sys/bus/usb/devices
		incise doctor "$@"
	END
	run --separate-stderr unshare -rm sh -e inside --rig sim:
	[[ "$(group attached)" == *" ok can can0: CAN interface, up; the rig does not use it"* ]]
	[[ "$(group attached)" == *" ok can can1: CAN interface, down; the rig does not use it"* ]]
	[[ "$(group attached)" != *eth0* ]]
	[ "${mount_usb:-}" = no ] || [[ "$(group attached)" == *" ok usb 0f44:0002 at 1-1.2: Polhemus FASTRAK"* ]]
	[ "$(grep -c " usb " <<<"$(group attached)")" -le 1 ]
	# the rig's own, which is down, and of a machine without a rig
	printf '%s\n' 'tracker = "sim:"; stepper = "can:can1:0x10";' \
		'actuator = { spring_N_mm = 2; travel_mm = 20; lead_mm = 4; };' >rig.conf
	run -1 --separate-stderr unshare -rm sh -e inside
	[[ "$(group attached)" == *" warning can can1: CAN interface, down; the rig has a drive on it"*"→ sudo ip link set can1 up type can bitrate 1000000"* ]]
	[[ "$(group attached)" == *" ok can can0: "*"does not use it"* ]]
}

@test "doctor reports a module that lacks its library, with the package" {
	[ -e "$INCISE_BUILD/lib/incise/tracker_usb.so" ] || skip "libusb is not installed"
	mkdir modules
	cp "$INCISE_BUILD/lib/incise/tracker_tty.so" modules
	sed 's/libusb-1\.0\.so\.0/libusb-1.0.so.9/g' "$INCISE_BUILD/lib/incise/tracker_usb.so" \
		>modules/tracker_usb.so
	export INCISE_MODULE_PATH=$PWD/modules
	run --separate-stderr incise doctor --rig sim:
	[[ "$(group modules)" == *" ok loadable 1 modules of devices and file formats"* ]]
	[[ "$(group modules)" == *" warning module tracker_usb cannot be loaded: libusb-1.0.so.9 is missing"*"→ sudo apt-get install libusb-1.0-9"* ]]
}

@test "doctor wants the kernel module for a rig that names it" {
	[ ! -e /sys/module/incise_stepper ] || skip "the module is loaded"
	run --separate-stderr incise doctor --rig sim:
	[[ "$(finding kernel module)" == "  ok "*"the rig has no stepper"* ]]
	printf '%s\n' 'tracker = "sim:"; stepper = "kernel:/dev/incise-stepper0";' \
		'actuator = { spring_N_mm = 2; travel_mm = 20; lead_mm = 4; };' >rig.conf
	run --separate-stderr incise doctor
	[[ "$(finding kernel module)" == "  warning "*"→ sudo modprobe incise_stepper"* ]]
	[[ "$(finding devices stepper)" == "  problem "*"→ sudo cp /usr/share/incise/stepper.conf.example /etc/incise/stepper.conf"* ]]
}

# bats test_tags=check
@test "doctor knows the age of each calibration" {
	incise calibrate force --rig sim:clock=simulated --weights 0,50g,100g,200g --repeat 3 \
		--duration 200ms >/dev/null
	run --separate-stderr incise doctor --rig sim:
	[[ "$(finding calibration force)" == "  ok "*"0 days old" ]]
	[[ "$(finding calibration depth)" == "  warning "*"never calibrated"*"→ incise calibrate depth" ]]
	run -1 --separate-stderr incise doctor --rig sim: -c none.conf
	[[ "$(finding calibration file)" == "  problem "*"none.conf: No such file"* ]]
	echo 'force_mV_N = "no number";' >wrong.conf
	run -1 --separate-stderr incise doctor --rig sim: -c wrong.conf
	[[ "$(finding calibration file)" == "  problem "*"wrong.conf cannot be read"* ]]
}

@test "doctor reports a denied limit with its command" {
	[ "$(id -u)" = 0 ] || skip "root drops the right here"
	setpriv --reuid=65534 --regid=65534 --clear-groups test -x "$INCISE_BUILD/bin/incise" ||
		skip "the build folder is closed to other users"
	run --separate-stderr setpriv --bounding-set=-sys_nice,-ipc_lock --inh-caps=-sys_nice,-ipc_lock \
		--reuid=65534 --regid=65534 --clear-groups prlimit --rtprio=0:0 \
		"$INCISE_BUILD/bin/incise" doctor --rig sim: --json
	[ "$status" -eq 1 ]
	python3 - "$output" <<-'END'
		import json, sys
		report = json.loads(sys.argv[1])
		assert report["schema"] == "incise/doctor/1"
		found = {(c["group"], c["name"]): c for c in report["checks"]}
		denied = found["real time", "scheduling"]
		assert denied["state"] == "problem" and denied["fix"], denied
		assert report["problems"] == sum(c["state"] == "problem" for c in report["checks"]) >= 1
		assert report["warnings"] == sum(c["state"] == "warning" for c in report["checks"])
		assert all((c["state"] == "ok") <= (c["fix"] is None) for c in report["checks"])
		assert report["recording_min"] >= 0
	END
}

# bats test_tags=check
@test "doctor measures a haptic device, and writes a report" {
	rig=sim:haptic,clock=simulated,motion=still,noise_mm=0.03
	run --separate-stderr incise doctor --rig $rig
	[[ "$(finding devices haptic)" == "  ok "*opens ]]
	[[ "$(finding devices samples)" == "  ok "*"1000 Hz"*", 0 % lost" ]]
	[[ "$(finding devices state)" == "  ok "*"buttons: 2, pressed: 0" ]]
	# it is tracker and stepper
	[[ "$(finding devices tracker)$(finding devices stepper)" == "" ]]
	[[ "$(finding devices force)" == "  ok "*"names none" ]]
	echo >enter
	run --separate-stderr incise doctor --rig $rig --protocol --report r.json <enter
	python3 - r.json <<-'END'
		import json, sys
		report = json.load(open(sys.argv[1]))
		assert report["schema"] == "incise/doctor/1" and report["rig"].startswith("sim:haptic"), report
		steps = report["haptic"]["protocol"]
		value = {(s["step"], s["quantity"].split(",")[0]): s for s in steps}
		# 0.03 mm and the encoder's 0.01 / sqrt(12); a white line has about sd * sqrt(8 ln(bins) / n)
		noise = value["noise", "standard deviation along an axis"]
		assert abs(noise["value"] - 0.0301) < 0.001 and noise["pass"], noise
		line = value["noise", "strongest line above 5 Hz"]
		assert 0.002 < line["value"] < 0.01, line
		# the plan's largest is 1.08 N/mm; the weight's force is that of gravity
		walls = [s["value"] for s in steps if s["step"] == "wall"]
		assert walls == [0, 0, 0, 0] and 0.9 < report["haptic"]["limit_N_mm"] < 1.2, report["haptic"]
		assert [s["pass"] for s in steps if s["step"] == "weight"] == [True]
	END
	[[ "$(finding devices walls)" == "  ok "*"0, 0, 0, 0 swings a second at 25, 50, 75, 90 % of 1."* ]]
}

@test "doctor warns of a device that swings, sticks or stops" {
	rig=sim:haptic,clock=simulated,motion=still,noise_mm=0.03
	# a device with less damping than it states swings, and friction holds a weight
	cat >rig.conf <<-'END'
		clock = "simulated";
		haptic = "sim:motion=lean,lean_N=2,z_mm=5,begin_s=3,damping_N_s_mm=0.001,hand_kg=0,hand_N_mm=0,hand_N_s_mm=0";
		haptic_setup = { damping_N_s_mm = 0.01; };
	END
	run --separate-stderr incise doctor --protocol </dev/null
	[[ "$(finding devices walls)" =~ "  warning "\ *walls\ *0,\ 0,\ [1-9][0-9],\ [1-9][0-9]\ swings ]] || complain "$output"
	run --separate-stderr incise doctor --rig sim:haptic,clock=simulated,coulomb_N=0.3 --protocol </dev/null
	[[ "$(finding devices walls)" == "  warning "*"100 g: "[1-9][0-9].*" % off"* ]]
	rm rig.conf
	run --separate-stderr incise doctor --rig sim:haptic,clock=simulated,peak_N=0.01 --protocol </dev/null
	[[ "$(finding devices walls)" == "  problem "*"nothing leant on the wall of 0.27 N/mm"* ]]
	# a device that stops is a problem with its reason
	run -1 --separate-stderr incise doctor --rig "$rig,unplugged_s=0.5"
	[[ "$(finding devices samples)" == "  problem "*"unplugged"* ]]
	run --separate-stderr incise doctor --rig "$rig,changes_s=0.5"
	[[ "$(finding devices state)" == "  warning "*"its changes_s has passed; set it later; buttons: 2"* ]]
	printf 'clock = "simulated"; haptic = "sim:"; haptic_setup = { rate_hz = 400.0; };\n' >rig.conf
	run --separate-stderr incise doctor
	[[ "$(finding devices rate)" == "  warning "*"1000 Hz, but it declares 400 Hz"* ]]
}

@test "doctor gives a force after an Enter behind its request only" {
	export INCISE_MODULE_PATH=$INCISE_BUILD/tests/haptic
	python3 - "spring:doctor-$$" >out <<-'END'
		import os, pty, subprocess, sys
		ours, theirs = pty.openpty()
		doctor = subprocess.Popen(["incise", "doctor", "--rig", sys.argv[1], "--protocol"],
		                          stdin=theirs, stderr=subprocess.PIPE, text=True)
		os.close(theirs)
		for line in doctor.stderr:
		    if "lay the handle down" in line:
		        os.write(ours, b"\n" * 9)  # eight too many
		    elif "lean steadily" in line:
		        print("asked", flush=True)
		        os.write(ours, b"\4")  # its end
		doctor.wait()
	END
	[ "$(grep -c asked out)" = 1 ]
	grep -q "problem .* walls .* the input ended; press Enter at each request" out || complain "$(cat out)"
}

# bats test_tags=check
@test "the report hides whole words of the host's name in free text only" {
	unshare -ru sh -c 'echo noise.lab >/proc/sys/kernel/hostname' 2>/dev/null || skip "no user namespaces"
	cat >rig.conf <<-'END'
		# noise.lab, noise: noises of noise_mm in noise.lab.org
		clock = "simulated"; haptic = "sim:motion=still";
	END
	cat >inside <<-'END'
		echo noise.lab >/proc/sys/kernel/hostname
		HOME=/home/ann incise doctor --report r.json
	END
	sed -i '1s|$| /home/ann/x /home/anna|' rig.conf
	run unshare -ru sh inside
	[ "$(key r.json rig | head -n 1)" = "# ***, ***: noises of noise_mm in ***.org ***/x /home/anna" ]
	[ "$(key r.json 'haptic.protocol[0].step')" = noise ]
}

# bats test_tags=check
@test "doctor says why the loop refuses a device of somebody else's" {
	id=t$BATS_TEST_NUMBER-$$
	sed 's/PEAK_N, 0, 0, 0.1, /0, 0, 0, 0, /; s/n, t, n,/n, t - 5_000_000_000, n,/; s/v, 0, 0, 1, 0/v, 0, 0, 2, 0/' \
		"$root/examples/haptic_page/device.py" >device.py
	python3 device.py "$id" 3>&- &
	device=$!
	await test -e "/dev/shm/incise-$id"
	fails incise calibrate torque --rig "local:$id" -- "set haptic_setup.peak_N"
	run -1 --separate-stderr incise doctor --rig "local:$id"
	kill $device
	wait $device
	[[ "$(finding devices times)" == "  problem "*"5 s old: its times are not of CLOCK_MONOTONIC"* ]]
	[[ "$(finding devices peak_N)" == "  problem "*"set haptic_setup.peak_N"* ]]
	[[ "$(finding devices mass_kg)" == "  problem "*"set haptic_setup.mass_kg"* ]]
	[[ "$(finding devices quaternion)" == "  problem "*"(2, 0, 0, 0) is no rotation"* ]]
}
