# SPDX-License-Identifier: GPL-2.0-or-later
# incise calibrate stepper on the virtual rig's bench, in simulated time, and from files.

load cli

setup() {
	work_folder
	bench=sim:clock=simulated,bench=1,handle_friction_N=0
	# A force channel of 0.1 %, as incise calibrate force leaves it.
	cat >calibration.conf <<-END
		force_mV_N = 1240.0;
		history = ( { kind = "force"; date = "2026-11-21T14:48:16Z";
		  values = ( { key = "force_mV_N"; left = 1240.0; u = 1.24; unit = "mV/N"; } );
		  pass = true; } );
	END
	cp calibration.conf before.conf
}

teardown() {
	[ -z "$pid" ] || kill -9 "$pid" 2>/dev/null || :
}

stepper() {
	run --separate-stderr incise calibrate stepper "$@"
}

# Up and down between 0 and 1.5 mm of 2 N/mm with 0.04 mm of backlash: a file of points.
# Argument: an awk expression of x, F, up and n that spoils F.
made_points() {
	awk -v OFS=, "BEGIN {
		print \"t_s,steps,position_mm,force_N\"
		for (k = 0; k < 6; k++)
			for (i = (k > 0); i <= 60; i++) {
				up = k % 2 == 0; n++
				s = int(i * 40); if (!up) s = 2400 - s
				x = s * 0.000625
				way = i * 0.025
				# behind the turn it stands still
				F = up ? 2 * x : 2 * (x + 0.04)
				if (!up && way < 0.04) F = 3
				if (up && k && way < 0.04) F = 0.08
				F += ((n * 7919) % 1000 / 1000 - 0.5) * 0.0006
				$1
				printf \"%.3f,%d,%.6f,%.6f\n\", n / 10, s, x, F
			}
	}"
}

# bats test_tags=check
@test "finds what the virtual actuator is made of, and writes it" {
	stepper --rig $bench,backlash_mm=0.04,stall_mm_s=9 --json -o points.csv
	[ "$status" -eq 0 ] || complain "$stderr"
	[ -z "$stderr" ]
	echo "$output" >r.json
	# 2 N/mm, 2 mm in 3200 steps. Uncertainties are those stated, k = 3.
	holds "($(key r.json N_step) - 0.00125)^2 <= 9 * $(key r.json N_step_u)^2"
	holds "$(key r.json N_step_u) < 0.0000014"
	holds "($(key r.json backlash_mm) - 0.04)^2 <= 9 * $(key r.json backlash_u_mm)^2"
	holds "$(key r.json backlash_u_mm) < 0.001"
	holds "$(key r.json hysteresis_N) < 0.005 && $(key r.json stiction_N) < 0.02"
	# It stalls at 9 mm/s, which is 14400 steps/s: between the two, 3 % apart.
	holds "$(key r.json rate.kept_1_s) <= 14400 && $(key r.json rate.lost_1_s) > 14390"
	holds "$(key r.json rate.lost_1_s) < 1.04 * $(key r.json rate.kept_1_s)"
	[ "$(key r.json pass)" = 1 ]
	grep -q '^stepper_N_step = 0.0012' calibration.conf
	grep -q '^stepper_backlash_mm = 0.0[34]' calibration.conf
	grep -q '^stepper_steps_s = 1[34]' calibration.conf
	grep -q 'raw = "points.csv"' calibration.conf
	# It is a file that the others read.
	[ "$(grep -c 'kind = ' calibration.conf)" -eq 2 ]
	# The same points say the same again.
	incise calibrate stepper --from points.csv --json >again.json
	holds "($(key again.json N_step) / $(key r.json N_step) - 1)^2 < 1e-8"
	[ "$(key again.json rate)" = '' ]
	[ "$(grep -c 'kind = ' calibration.conf)" -eq 3 ]
	grep -q 'found = 0.0012' calibration.conf
}

@test "an actuator that loses no step says how fast it was asked" {
	stepper --rig $bench,screw_mm_s=5 --dry-run
	[ "$status" -eq 0 ]
	[[ "$output" == *"8000 /s lost no step; this range and rig.conf allow no faster"* ]]
}

@test "too much force: it goes back, and nothing is written" {
	stepper --rig $bench --range 0mm..1.5mm --max-force 1N
	[ "$status" -eq 1 ]
	[[ "$stderr" == *"going back"* ]]
	[[ "$stderr" == *"the force exceeded 1.00 N"*"--range"* ]]
	cmp calibration.conf before.conf
}

@test "SIGINT ends it with the motor at rest, and the old calibration stays" {
	incise calibrate stepper --rig ${bench/simulated/real} >out 2>err </dev/null &
	pid=$!
	# until it has handlers of its own, which is when the motor has power
	until_it_catches $pid incise-calibrate 2
	kill -INT $pid
	code=0
	wait $pid || code=$?
	pid=
	[ "$code" -eq 1 ]
	grep -q 'at rest at .* without power; nothing has changed' err
	cmp calibration.conf before.conf
}

# bats test_tags=check
@test "refuses by name what it cannot bear" {
	while IFS='|' read -r spoil text; do
		made_points "$spoil" >p.csv
		stepper --from p.csv
		failed_with "$text"
	done <<-END
		F = -F|reversed
		F = 0.1 + n * 7 % 11 / 1000|does not react
		if (n > 180) F -= 0.1|steps were lost
		if (F > 2) F = 2|does not follow
		y = x; x = F; F = y|swapped
	END
	made_points '' | awk -F, 'NR < 70' >p.csv
	stepper --from p.csv
	failed_with "two in each direction"
	made_points '' | cut -d, -f 1,2,3 >p.csv
	stepper --from p.csv
	failed_with "force_N"
	made_points '' | cut -d, -f 2,4 >p.csv
	stepper --from p.csv
	failed_with "--step-mm"
	incise calibrate stepper --from p.csv --step-mm 0.000625 --dry-run
	made_points '' | sed '9s/,[^,]*$/,x/' >p.csv
	stepper --from p.csv
	failed_with "p.csv:9" "force_N:" "'x'"
	stepper --rig $bench --range 0mm..50mm
	failed_with "--range" "50 mm"
	cmp calibration.conf before.conf
}

# bats test_tags=check
@test "what does not pass is kept, but is not in force" {
	made_points 'F += 0.3 * x * x' >p.csv
	stepper --from p.csv
	[ "$status" -eq 1 ]
	[[ "$stderr" == *"refused, the previous calibration stays active: linearity of"* ]]
	run ! grep -q '^stepper_N_step' calibration.conf
	grep -q 'pass = false' calibration.conf
}

# bats test_tags=check
@test "a report with pictures, text and JSON" {
	command -v gnuplot >/dev/null || skip "needs gnuplot"
	made_points '' >p.csv
	incise calibrate stepper --from p.csv --dry-run -o bench >out
	for file in fit.png residuals.png; do
		[ "$(head -c 4 bench/$file | tail -c 3)" = PNG ]
	done
	head -n -2 out | cmp - bench/report.txt # the last lines name the files
	grep -q 'sensitivity of the sensor *B' out
	holds "($(key bench/report.json N_mm) - 2)^2 < 0.0001"
}
