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

@test "doctor checks a simulated rig and finds no problem in it" {
	run --separate-stderr incise doctor --rig sim:
	[ -z "$stderr" ]
	[[ "$(finding devices rig)" == "  ok "*"sim:" ]]
	for device in tracker force stepper; do
		[[ "$(finding devices $device)" == "  ok "*opens ]]
	done
	[[ "$(finding devices camera)" == "  ok "*"names none" ]]
	[[ "$(finding display window)" == *warning*"no window"*"--video"* ]]
	[[ "$(finding calibration file)" == *warning*"calibration.conf: No such file"*"incise help calibrate" ]]
	[[ "$(finding disk free)" == *GiB* ]]
	[[ "${lines[-1]}" =~ ^[0-9]+\ problems,\ [0-9]+\ warnings$ ]]
	# scheduling and memory are of this machine
	problems=$(grep -c "^  problem " <<<"$output" || :)
	[[ "${lines[-1]}" == "$problems problems, "* ]]
	[ "$status" -eq $((problems > 0)) ]
	[ "$problems" -eq "$(awk '/^[a-z]/ { group = $0 } /^  problem / && group == "real time"' <<<"$output" | wc -l)" ]
}

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
		[[ "$(finding devices rig)" == "  warning "*"neither ./rig.conf nor /etc/incise/rig.conf"*"→ "*rig.conf.example* ]]
	}
}

@test "doctor knows the age of each calibration" {
	incise calibrate force --rig sim:clock=simulated --weights 0,50g,100g,200g --series 3 \
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
	END
}
