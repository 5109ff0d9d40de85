# SPDX-License-Identifier: GPL-2.0-or-later
# incise info rig: which rig.conf is used, and what it resolves to.

load cli

# The row of a key, with one blank between its columns.
row() {
	grep -E "^${1//[/\\[} " <<<"$output" | tr -s ' '
}

# bats test_tags=check
@test "rig names the file that is used, and those that were passed over" {
	[ ! -e /etc/incise/rig.conf ] || skip "this machine has a rig"
	run -1 --separate-stderr incise info rig
	[[ "$stderr" == "incise info: no rig: there is no ./rig.conf and no /etc/incise/rig.conf; "* ]]
	echo 'tracker = "sim:";' >rig.conf
	run -0 --separate-stderr incise info rig
	[ "${lines[0]}" = "rig          rig.conf" ]
	[ "$(row tracker)" = 'tracker "sim:" rig.conf:1' ]
	[ "$(wc -l <<<"$output")" -eq 4 ]
	[ -z "$stderr" ]
}

@test "the machine's rig is used where the folder has none, with the reason" {
	unshare -rm true 2>/dev/null || skip "no user namespaces"
	cat >inside <<-'END'
		mount -t tmpfs none /etc
		mkdir /etc/incise
		echo 'force = "sim:";' >/etc/incise/rig.conf
		incise info rig
		incise info rig --json
	END
	run -0 --separate-stderr unshare -rm sh -e inside
	[ "${lines[0]}" = "rig          /etc/incise/rig.conf" ]
	[ "${lines[1]}" = "passed over  rig.conf: No such file or directory" ]
	[ "$(row force)" = 'force "sim:" /etc/incise/rig.conf:1' ]
	[[ "$output" == *'"passed_over": ['*'"rig.conf: No such file or directory"'* ]]
}

# bats test_tags=check
@test "every key has its value, unit and origin" {
	cat >rig.conf <<-'END'
		clock   = "real";
		tracker = "usb:0f44:0002";
		stepper = ["kernel:/dev/a:0", "can:can0:0x10"];
		surface = { normal = [0, 0, 2]; };
		actuator = (
			{ spring_N_mm = 2; travel_mm = 20; lead_mm = 4; },
			{ spring_N_mm = 1.5; travel_mm = 30; lead_mm = 4;
			  direction = [0, 1, 0]; can = { mode = "csv"; }; }
		);
	END
	run -0 --separate-stderr incise info rig --all
	[ "$(row clock)" = 'clock "real" rig.conf:1' ]
	[ "$(row tracker)" = 'tracker "usb:0f44:0002" rig.conf:2' ]
	[ "$(row force)" = "force - default" ]
	[ "$(row 'stepper[2]')" = 'stepper[2] "can:can0:0x10" rig.conf:3' ]
	[ "$(row surface.normal)" = "surface.normal [0, 0, 1] rig.conf:4" ]
	[ "$(row surface.point_mm)" = "surface.point_mm [0, 0, 0] mm default" ]
	[ "$(row tracker_setup.repeat_ms)" = "tracker_setup.repeat_ms 100 ms default" ]
	[ "$(row 'actuator[1].direction')" = "actuator[1].direction [0, 0, 1] default" ]
	[ "$(row 'actuator[2].spring_N_mm')" = "actuator[2].spring_N_mm 1.5 N/mm rig.conf:7" ]
	[ "$(row 'actuator[2].acceleration_mm_s2')" = "actuator[2].acceleration_mm_s2 500 mm/s² default" ]
	[ "$(row 'actuator[2].high_us')" = "actuator[2].high_us - default" ]
	[ "$(row 'actuator[2].can.mode')" = 'actuator[2].can.mode "csv" rig.conf:8' ]
	[ "$(row 'actuator[2].can.position_gain_1_s')" = "actuator[2].can.position_gain_1_s 20 1/s default" ]
	# keys of devices that are not there are left out
	[ -z "$(row force_setup.rate_hz)$(row sim.seed)$(row 'actuator[1].can.mode')" ]
	# and the columns stand below each other, whatever the units' bytes
	[ "$(grep -E ' (default|rig\.conf:[0-9]+)$' <<<"$output" | grep -v '"can\|"usb\|"kernel' |
		python3 -c 'import sys; print(*{l.rindex(" ") for l in sys.stdin})' | wc -w)" -eq 1 ]
}

@test "every key of rig.conf(5) that the simulated rig has is listed" {
	run -0 --separate-stderr incise info --all sim:seed=7,withdrawal=paper,clock=simulated
	[ "$(row clock)" = 'clock "simulated" sim:' ]
	[ "$(row sim.seed)" = "sim.seed 7 sim:" ]
	[ "$(row sim.withdrawal)" = 'sim.withdrawal "paper" sim:' ]
	[ "$(row sim.depth_mm)" = "sim.depth_mm [5, 10, 15, 20] mm default" ]
	[ "$(grep -c ^sim <<<"$output")" -ge 45 ]
	# a name that ends with a unit has one behind its value
	grep -E '^[a-z_.0-9]*_(mm|s|N|hz|ms|us|V|K|kg|deg|ppm|px|s2|mm2|mV) ' <<<"$output" >named
	[ "$(wc -l <named)" -ge 35 ]
	run ! grep -vE '([]0-9] (mm|s|N|Hz|ms|V|K|kg|°|ppm|px|mV)(/[a-zA-Z]+²?)?|N s/mm| -) +(default|sim:)$' named
}

@test "info rig --json has typed values" {
	printf '%s\n' 'camera = "v4l2:a \"b\"";' 'camera_setup = { width = 640; };' >rig.conf
	incise info rig --all --json >report.json
	python3 - <<-'END'
		import json
		report = json.load(open("report.json"))
		assert report["kind"] == "rig" and report["file"] == "rig.conf", report
		assert report["passed_over"] == []
		key = {row["key"]: row for row in report["keys"]}
		assert key["camera"] == {"key": "camera", "value": 'v4l2:a "b"', "unit": None, "from": "rig.conf:1"}
		assert key["camera_setup.width"] == {
		    "key": "camera_setup.width", "value": 640, "unit": "px", "from": "rig.conf:2"}
		assert key["camera_setup.gain"]["value"] is None
		assert key["surface.normal"]["value"] == [0, 0, 1]
		assert key["tracker"]["value"] is None and key["tracker"]["from"] == "default"
	END
}

# bats test_tags=check
@test "a rig.conf with an error is refused with its line, and no device is opened" {
	printf '\ntrakcer = "sim:";\n' >rig.conf
	fails incise info rig --all -- "rig.conf:2: trakcer:"
	fails incise info none.conf -- "none.conf:"
	# not even a node that would say so
	printf 'tracker = "tty:/dev/none:115200";\n' >rig.conf
	run -0 --separate-stderr incise info rig --all
	[ "$(row tracker)" = 'tracker "tty:/dev/none:115200" rig.conf:1' ]
}
