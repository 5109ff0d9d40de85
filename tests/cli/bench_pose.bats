# SPDX-License-Identifier: GPL-2.0-or-later
# incise bench pose and timeline, as a user meets them. All is simulated, and the same on
# each machine, but for times, which are not judged here.

load cli
load report

setup() {
	work_folder
}

@test "bench pose has a row for each method, motion, rate and delay" {
	quick_report pose
	[ "$(of rows 'count(*)')" = $((8 * 5 * 4 * 2)) ]
	[ "$(of losses 'count(*)')" = $((8 * 5)) ]
	[ "$(of rows 'count(*)' 'rms_error_mm IS NULL OR max_error_mm IS NULL OR rms_error_mm_s IS NULL')" = 0 ]
	[ "$(of rows 'count(*)' 'rms_error_mm > max_error_mm OR p99_error_mm > max_error_mm OR rms_error_deg > max_error_deg')" = 0 ]
	[ "$(of rows 'count(*)' "ns IS NULL AND name <> 'exact_delayed'")" = 0 ]
	holds "$(of rows 'min(ns)') > 0"
	[ -n "$(key r.json machine.cpu)" ]
	[ "$(key r.json quick)" = 1 ]
	holds "$(of figures 'count(*)' "kind = 'exact'") == 40"
	holds "$(of figures 'count(*)' "kind = 'time'") == 28"
}

@test "bench pose: a held pose is off by velocity times age" {
	quick_report pose
	# exactly so at even speed; ages are the same, the noise is that of some 400 poses
	of rows 'name, rms_error_mm, held_theory_mm' "name = 'held' AND motion = 'line'"
	holds "$(of rows 'max(abs(rms_error_mm / held_theory_mm - 1))' \
		"name = 'held' AND motion = 'line'") < 0.01"
	# to first order of the age, 21 ms on the mean at most, elsewhere
	holds "$(of rows 'max(abs(rms_error_mm / held_theory_mm - 1))' \
		"name = 'held' AND motion IN ('stroke', 'surgeon')") < 0.03"
	# and what is exact and late by exactly 4 and 12 ms at 30 mm/s
	holds "$(of rows 'max(abs(rms_error_mm - 0.03 * delay_ms))' \
		"name = 'exact_delayed' AND motion = 'line'") < 1e-9"
	# of velocities it knows none: that of the line is missed whole
	holds "$(of rows 'max(abs(rms_error_mm_s - 30))' "name = 'held' AND motion = 'line'") < 1e-9"
}

# Of methods, the largest part of one's error in another's, over all other conditions.
at_most() {
	sqlite3 :memory: "WITH r AS (SELECT json_extract(value, '\$.name') AS name,
			json_extract(value, '\$.rms_error_mm') AS rms, json_extract(value, '\$.jump_mm') AS jump,
			json_extract(value, '\$.motion') AS motion,
			json_extract(value, '\$.tracker_hz') AS hz,
			json_extract(value, '\$.delay_ms') AS late
			FROM json_each(readfile('r.json'), '\$.rows'))
		SELECT max(a.$3 / b.$3) FROM r a JOIN r b USING (motion, hz, late)
		WHERE a.name = '$1' AND b.name = '$2' AND ${4:-1}"
}

@test "bench pose: the predictor is better than held poses where the motion is smooth" {
	quick_report pose
	smooth="motion IN ('line', 'stroke', 'surgeon')"
	holds "$(at_most library held rms "$smooth") < 0.7"
	holds "$(at_most library held rms "$smooth AND late = 12") < 0.3"
	# and even than exact ones that are late, of a tracker of 240 Hz
	holds "$(at_most library exact_delayed rms "$smooth AND hz = 240") < 0.5"
	# what it shows does not jump as a pose does that is taken as it is
	holds "$(at_most library line jump "$smooth") < 0.5"
	# (at 1000 Hz and 12 ms the noise of a pose is carried twelve periods on)
	holds "$(at_most library held jump "$smooth AND late = 4") < 0.4"
	holds "$(at_most library held jump "$smooth") < 0.75"
	# not told that poses are late it is, as these are
	holds "$(at_most exact_delayed library_punctual rms "motion = 'stroke'") < 1"
}

@test "bench pose lists what is worse than no tracker, and why" {
	quick_report pose
	[ "$(of rows 'count(*)' '(failed IS NULL) <> (rms_error_mm <= spread_mm)')" = 0 ]
	[ "$(of rows 'count(*)' "failed NOT LIKE 'worse than no tracker: error % mm, that of%'")" = 0 ]
	# two noisy poses a millisecond apart say nothing of a tremor that is 12 ms away
	[ "$(of rows 'count(*)' "name = 'line' AND motion = 'tremor' AND tracker_hz = 1000
		AND failed IS NOT NULL")" = 2 ]
	# of large motions no method is
	[ "$(of rows 'count(*)' "motion <> 'tremor' AND failed IS NOT NULL")" = 0 ]
	run -0 --separate-stderr incise bench pose --quick
	[ -z "$stderr" ]
	[[ "$output" == *"* line, tremor, 1000 Hz, 12 ms late: worse than no tracker: "* ]]
}

@test "bench pose: the longer nothing comes the farther off, and never beyond the motion" {
	quick_report pose
	for name in held line library library_100um; do
		last=0
		for gap in 25 50 100 200 500; do
			now=$(of losses rms_error_mm "name = '$name' AND gap_ms = $gap")
			holds "$now > $last"
			last=$now
		done
	done
	# the library goes on for five periods, 42 ms, and stays: 94 mm/s carry it 4 mm, and
	# the stroke is 40 mm long and 10 deep
	holds "$(of losses 'max(max_error_mm)' "name = 'library'") < 42"
	# a parabola goes on
	holds "$(of losses 'max(max_error_mm)' "name = 'parabola'") > 42"
}

@test "bench timeline has a row for each method, lateness, clock and window" {
	quick_report timeline
	[ "$(of rows 'count(*)')" = $((8 * 3 * 3 * 7)) ]
	[ "$(of rows 'count(*)' 'rms_error_us IS NULL OR max_error_us IS NULL OR ns_per_sample IS NULL')" = 0 ]
	[ "$(of rows 'count(*)' 'rms_error_us > max_error_us OR p99_error_us > max_error_us OR abs(mean_error_us) > rms_error_us')" = 0 ]
	# none of 20 ms and an interrupt is later than that; the truth is not after the arrival
	holds "$(of rows 'max(max_error_us)' "name = 'arrival'") < 20300"
	holds "$(of rows 'min(mean_error_us)' "name = 'arrival'") > 0"
	# least squares go through the middle of what is late: by its mean, which is arrivals'
	holds "$(of rows 'max(abs(mean_error_us / 10000 - 1))' \
		"name = 'squares' AND late = 'bursts' AND window_s >= 10") < 0.05"
	# a clock of 200 ppm is off by 24 ms after 2 min, and the nominal rate with it
	holds "$(of rows 'min(max_error_us)' \
		"name = 'lowest' AND drift_ppm = -200 AND window_s = 120") > 23000"
	[ -n "$(key r.json machine.cpu)" ]
}

@test "bench timeline: the library's line is within what it states" {
	quick_report timeline
	# over all streams; twice the standard uncertainty
	for name in line_live line_final; do
		holds "$(of rows 'avg(within_2sd)' "name = '$name'") >= 0.95"
		[ "$(of rows 'count(*)' "name = '$name' AND failed IS NOT NULL")" = 0 ]
		# by rms it is below the stated one, but at the first
		holds "$(of rows 'avg(rms_error_us <= stated_us)' "name = '$name' AND window_s >= 30") >= 0.95"
		# and by far below arrivals as they are
		holds "$(of rows 'max(rms_error_us)' "name = '$name'") < 2500"
		holds "$(of rows 'max(rms_error_us)' \
			"name = '$name' AND late = 'exponential' AND window_s >= 30") < 50"
	done
	# the longer it sees a stream the better
	holds "$(of rows 'avg(rms_error_us)' "name = 'line_live' AND window_s = 120") < \
		$(of rows 'avg(rms_error_us)' "name = 'line_live' AND window_s = 1") / 3"
}

@test "bench timeline lists who is surer than he may be, and worse than arrivals" {
	quick_report timeline
	# bursts whose phases never change: 20 ms are 4.8 periods
	[ "$(of rows 'count(*)' "name = 'line_untold' AND late = 'bursts' AND drift_ppm = 0
		AND window_s >= 10 AND failed LIKE 'stated uncertainty too small: %'")" = 4 ]
	[ "$(of rows 'count(*)' "name = 'lowest' AND drift_ppm = -200 AND window_s = 120
		AND failed LIKE 'worse than arrival times: %'")" = 3 ]
	[ "$(of rows 'count(*)' "failed = ''")" = 0 ]
	run -0 --separate-stderr incise bench timeline --quick
	[ -z "$stderr" ]
	[[ "$output" == *"* lowest, bursts, -200 ppm, 120 s: worse than arrival times: "* ]]
}

# bats test_tags=slow
@test "bench pose and timeline are the same in each run" {
	for word in pose timeline; do
		for i in 1 2; do
			incise bench $word --quick --json >r.json
			of figures 'group_concat(name || value)' "kind = 'exact'" >exact$i
		done
		[ -s exact1 ]
		cmp exact1 exact2
	done
}

# bats test_tags=slow
@test "bench pose and timeline draw" {
	command -v gnuplot >/dev/null || skip "gnuplot is not installed, it draws the chart"
	for word in pose timeline; do
		run -0 --separate-stderr incise bench $word --quick --plot "a folder/$word"
		[ -z "$stderr" ]
	done
	for name in pose pose-rates timeline timeline-windows; do
		[ "$(head -c 8 "a folder/$name.png" | od -An -tx1 | tr -d ' \n')" = 89504e470d0a1a0a ]
		grep -q '<svg' "a folder/$name.svg"
	done
	grep -q 'surgeon: two cuts' "a folder/pose-rates.svg"
	grep -q 'line live, stated' "a folder/timeline-windows.svg"
}

@test "bench pose and timeline: bad usage" {
	for word in pose timeline; do
		run --separate-stderr incise bench $word more
		bad_usage "'$word'"
		run --separate-stderr incise bench $word --duration 1s
		bad_usage "--duration does not go with"
		run --separate-stderr incise bench $word --plot a/
		bad_usage "--plot"
	done
}
