# SPDX-License-Identifier: GPL-2.0-or-later
# incise calibrate check: what is due, and tracker against camera.

load cli

# 8 s with a camera: two cuts; made once, for the tests that look at it
recording=$BATS_FILE_TMPDIR/a.rec
need_recording() {
	[ ! -e "$recording" ] || return 0
	printf '%s\n' 'clock = "simulated"; tracker = "sim:"; force = "sim:"; camera = "sim:";' \
		'sim = { depth_mm = [5.0, 10.0]; times = [1, 1]; cut_s = 3.0; };' \
		>"$BATS_FILE_TMPDIR/rig.conf"
	incise capture -o "$recording" -r "$BATS_FILE_TMPDIR/rig.conf"
}

# An entry of the history: kind, key, value, date, pass.
entry() {
	printf '{ kind = "%s"; date = "%s"; pass = %s; verdict = "said so";
		values = ( { key = "%s"; left = %s; u = 0.5; unit = "x"; } ); }' \
		"$1" "$4" "$5" "$2" "$3"
}

today=$(date -u +%Y-%m-%dT00:00:00Z)

# bats test_tags=check
@test "nothing calibrated is nominal, and due" {
	run -1 incise calibrate check
	[[ "$output" == *"0 calibrations"*"force    due: never calibrated: nominal, 1240 mV/N"* ]]
	[ "$(grep -c 'never calibrated' <<<"$output")" = 5 ]
	run -1 incise calibrate check --json
	echo "$output" >c.json
	[ "$(key c.json due)" = 5 ]
	[ "$(key c.json kinds[1].kind)" = depth ]
}

@test "no value that a person has written is called nominal" {
	local kind text
	while IFS='|' read -r kind text said; do
		echo "$text" >calibration.conf
		run -1 incise calibrate check
		[[ "$output" == *$'\n'"$kind "*": never calibrated: set by hand: $said; nominal: "* ]] ||
			complain "$output" || return
		[ "$(grep -c 'never calibrated: nominal' <<<"$output")" = 4 ]
		run -1 incise calibrate check --json --only "$kind"
		echo "$output" >c.json
		[[ "$(key c.json 'kinds[0].why')" == "never calibrated: set by hand: $said; nominal: "* ]]
		holds "$(key c.json "kinds[0].in_force.${said%% *}") == ${said##* }"
	done <<-'END'
		force|force_mV_N = 1500.0;|force_mV_N = 1500
		force|force_zero_mV = 20.0;|force_zero_mV = 20
		depth|depth_mm_px = 0.2;|depth_mm_px = 0.2
		tip|tip_mm = [0.0, 2.5, 0.0];|tip_y_mm = 2.5
		delay|camera_delay_ms = 12.0;|camera_delay_ms = 12
		stepper|stepper_backlash_mm = 0.05;|stepper_backlash_mm = 0.05
	END
	# none has passed; or another key of the kind was calibrated, and this one is by hand
	echo "force_mV_N = 1500.0; history = ( $(entry force force_mV_N 1300.0 "$today" false) );" >calibration.conf
	run -1 incise calibrate check
	[[ "$output" == *"no calibration has passed: set by hand: force_mV_N = 1500; nominal: 1240 mV/N"* ]]
	echo "force_mV_N = 1300.0; force_zero_mV = 20.0;
		history = ( $(entry force force_mV_N 1300.0 "$today" true) );" >calibration.conf
	run -1 incise calibrate check
	[[ "$output" == *"changed by hand since: force_zero_mV = 20"* ]]
	# of two calibrations each has set one key
	echo "force_delay_ms = 3.0; camera_delay_ms = 9.0;
		history = ( $(entry delay camera_delay_ms 9.0 "$today" true),
			$(entry delay force_delay_ms 3.0 "$today" true) );" >calibration.conf
	run -0 incise calibrate check --only delay
}

@test "a file that is named has to exist" {
	fails incise calibrate check -c typo.conf -- "typo.conf:"
	[ -z "$output" ]
}

# bats test_tags=check
@test "what is in force, old, failed, changed by hand or of the future" {
	cat >calibration.conf <<-END
		force_mV_N = 1250.0; depth_mm_px = 0.12; force_delay_ms = 3.0;
		stepper_N_step = 0.001; tip_mm = [1.0, 0.0, 0.0];
		history = ( $(entry force force_mV_N 1250.0 "$today" true),
			$(entry depth depth_mm_px 0.12 2020-01-01T00:00:00Z true),
			$(entry delay force_delay_ms 3.0 "$today" true),
			$(entry delay force_delay_ms 900.0 "$today" false),
			$(entry stepper stepper_N_step 0.002 "$today" true),
			$(entry tip tip_x_mm 1.0 2999-01-01T00:00:00Z true) );
	END
	run -1 incise calibrate check
	[[ "$output" == *"6 calibrations"* ]]
	grep -q "^force    good, ${today%T*}, [01] days\? old" <<<"$output"
	grep -q 'force_mV_N  *1250.0 ± 1.0 x (k = 2)' <<<"$output"
	grep -q "^depth    due, 2020-01-01, .*: older than 365 days" <<<"$output"
	grep -q "^delay    FAILED, .*: the last one, of ${today%T*}, failed" <<<"$output"
	grep -q "^stepper  due, .*: changed by hand since: stepper_N_step = 0.001" <<<"$output"
	grep -q "active: 0.001" <<<"$output"
	grep -q "^tip      due, .*: its date is in the future" <<<"$output"
	run -0 incise calibrate check --only force
	[ "$(grep -cE '^(depth|delay|tip|stepper)' <<<"$output")" = 0 ]
	run -0 incise calibrate check --only force,depth --due 100y
	run -1 incise calibrate check --only force,depth --due 7d --json
	echo "$output" >c.json
	[ "$(key c.json due)" = 1 ]
	[ "$(key c.json kinds[0].due)" = 0 ]
	holds "$(key c.json kinds[1].age_days) > 2000"
	[ "$(key c.json kinds[1].values[0].left)" = 0.12 ]
}

@test "camera and tracker of the virtual rig agree" {
	need_recording
	run -1 incise calibrate check --recording "$recording" --json
	echo "$output" >c.json
	[ "$(key c.json recording.agree)" = 1 ]
	# vision's bias is below 0.05 px, the tracker's time below 0.2 ms at 20 mm/s
	holds "$(key c.json recording.bias_mm) > -0.02 && $(key c.json recording.bias_mm) < 0.02"
	holds "$(key c.json recording.place_mm) < 0.05"
	holds "$(key c.json recording.travel_mm) > 50"
}

# altered SQL : a copy of the recording with another camera or tracker.
altered() {
	rm -rf b.rec
	cp -r "$recording" b.rec
	sqlite3 b.rec/recording.db "$1"
	run -1 incise calibrate check --recording b.rec
}

@test "a shifted camera, metal nearby and a wrong scale are told apart" {
	need_recording
	altered "UPDATE frames SET depth_mm = depth_mm + 1.2 WHERE depth_mm > 0"
	[[ "$output" == *"the camera may have moved: they differ by +1."* ]]
	altered "UPDATE tracker SET z_mm = z_mm + 2 * max(0, x_mm - 25) / 25"
	[[ "$output" == *"metal may be near"* ]]
	altered "UPDATE frames SET depth_mm = depth_mm * 1.08 WHERE depth_mm > 0"
	[[ "$output" == *"a scale may be wrong: they differ by 8."* ]]
}

# bats test_tags=check
@test "a recording without a camera, and what is none" {
	incise capture -o n.rec --rig sim:clock=simulated,cut_s=1 --duration 3s
	run --separate-stderr incise calibrate check --recording n.rec
	failed_with "n.rec:" "record a few slow cuts with the camera"
	fails incise calibrate check --recording none.rec -- "none.rec"
	echo 'history = 1;' >calibration.conf
	fails incise calibrate check -- "calibration.conf:1: history:"
}
