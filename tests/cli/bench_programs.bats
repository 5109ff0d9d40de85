# SPDX-License-Identifier: GPL-2.0-or-later
# The benchmarks for developers, tests/bench: each runs, and finds what it found before. Times are not
# judged here.

load cli
load report

# Its quick report, as r.json, which leaves no file behind.
quick_program() {
	[ -x "$INCISE_BUILD/tests/bench/$1" ] || complain "$1 is not built: make bench-all" || return
	mkdir t
	TMPDIR=$PWD/t "$INCISE_BUILD/tests/bench/$1" --quick --json >r.json || return
	[ -z "$(ls -A t)" ] || complain "left: $(ls -A t)" || return
	[ "$(key r.json schema) $(key r.json quick)" = "incise/bench/$1/1 1" ]
}

# bats test_tags=slow
@test "extremes: nothing is wrong, and each interface is tried" {
	quick_program extremes
	[ "$(of rows 'count(*)' 'tried != held + refused OR tried < 90 OR failed IS NOT NULL')" = 0 ]
	holds "$(of rows 'sum(tried)') > 4.5e5"
	[ "$(of rows 'count(*)' 'held > 0')" -ge 32 ]
	# what is broken is refused, but not everything
	for row in fixed_blob wall scene_bytes fis_bytes mesh_bytes recording_bytes; do
		holds "$(of rows 'refused' "name = '$row'") > 0"
	done
	# stiff walls are accepted up to the limit of theory, and bounded beyond; known limits
	[ "$(of stiff 'count(*)' 'accepted != (K_N_m <= theory_limit_N_m) OR NOT bounded')" = 0 ]
	holds "$(of stiff 'max(largest_N)') <= 4"
	holds "$(of stiff 'max(late_mm)' 'accepted') < 0.11"
	holds "($(of stiff 'min(theory_limit_N_m)') / 400 - 1) ^ 2 < 0.01 ^ 2"
}

# 9 rigs: a common error is one draw for each, of which fewer than 5 are held once in 20000 at
# 95 %; an own one is hundreds of draws for each.
# bats test_tags=slow
@test "coverage: intervals hold the truth, in all and by part" {
	quick_program coverage
	[ "$(of rows 'count(*)')" = 24 ]
	[ "$(of rows 'count(*)' "part = 'own' AND (coverage < 0.93 OR coverage > 0.975)")" = 0 ]
	[ "$(of rows 'count(*)' "part <> 'own' AND coverage < 0.55")" = 0 ]
	# rms of 9 normal errors: chi squared of 9 is below 1.15 and above 27.9 each once in 1000
	[ "$(of sources 'count(*)' 'rms < sqrt(1.15 / 9) OR rms > sqrt(27.9 / 9) OR coverage < 0.55')" = 0 ]
	holds "$(of correlations measured "name = 'depth'") > 0.5"
	holds "$(of correlations measured "name = 'velocity'") < 0.1"
}

# bats test_tags=slow
@test "settings: error and run time of grids of heights and trackers" {
	quick_program settings
	holds "$(of heights 'count(*)' "name = 'grid' AND failed IS NULL") >= 4"
	# within the sagitta of the mesh and the certified bound, which is the one that was asked for
	mesh=$(of heights depth_error_mm "name = 'mesh'")
	[ "$(of heights 'max(depth_error_mm > bound_mm + 1.01 * '$mesh' OR bound_mm > wanted_mm)' "name = 'grid'")" = 0 ]
	# bilinear: half a cell has a quarter of the error, here of the force of a normal and a depth
	holds "$(of heights depth_error_mm 'cell_mm = 4') > 2.5 * $(of heights depth_error_mm 'cell_mm = 2')"
	holds "$(of heights size_kB 'cell_mm = 2') > 3 * $(of heights size_kB 'cell_mm = 4')"
	holds "$(of heights 'min(ns)') > 0"
	# a prediction is better than none
	holds "$(of trackers 'max(rms_error_mm / held_rms_mm)') < 0.2"
}

# bats test_tags=slow
@test "integers: the shipped scenes are within what is certified" {
	quick_program integers
	[ "$(of rows 'group_concat(name)')" = liver,neck,wall ]
	[ "$(of rows 'count(*)' 'NOT holds OR rms_error_N <= 0 OR max_error_N > bound_N')" = 0 ]
	# much of it in contact, and little apart
	[ "$(of rows 'count(*)' 'contact < ticks / 2 OR apart > ticks / 100')" = 0 ]
}

# bats test_tags=slow
@test "timeline: the library's line is within what it states" {
	quick_program timeline
	for name in line_live line_final; do
		holds "$(of rows 'avg(within_2sd)' "name = '$name'") >= 0.95"
		[ "$(of rows 'count(*)' "name = '$name' AND failed IS NOT NULL")" = 0 ]
		holds "$(of rows 'max(rms_error_us)' "name = '$name'") < 2500"
	done
	# what is surer than it may be is listed
	[ "$(of rows 'count(*)' "name = 'line_untold' AND failed LIKE 'stated uncertainty too small: %'")" -ge 4 ]
}

# bats test_tags=slow
@test "prediction: the interval holds new cuts on new rigs, and calibration is a part of it" {
	quick_program prediction
	# of 4 models: their shares scatter by about 3 %, so their mean by 1.5 %; 95 less two of that
	holds "$(of rows 'min(covered_percent)') > 92"
	holds "$(of rows sd_calibration_N 'rigs = 1') > 1.1 * $(of rows sd_calibration_N 'rigs = 3')"
	holds "$(of rows 'min(covered_percent - without_percent)') > 0"
}

# bats test_tags=slow
@test "vision: error and time of each kind of frame" {
	[ -e "$INCISE_BUILD/lib/incise/vision_opencv.so" ] || skip "OpenCV's headers were absent"
	quick_program vision
	[ "$(of rows 'count(*)')" = 18 ]
	[ "$(of rows 'count(*)' 'found < 7 OR abs(bias_px) > 0.1 OR max_error_px > 2 OR rms_error_px > max_error_px')" = 0 ]
}

# bats test_tags=slow
@test "capture: load of each run, which leaves nothing behind" {
	for module in vision_opencv frames_mkv; do
		[ -e "$INCISE_BUILD/lib/incise/$module.so" ] || skip "$module.so was not built"
	done
	quick_program capture
	[ "$(of rows 'count(*)' 'cpu_percent > 0 AND late_ms > 0 AND quarter_MB > 1')" = 6 ]
	# of 0.8 s at least; the tracker's last record may be under way
	[ "$(of rows 'count(*)' 'force + force_lost < 0.8 * 10000 - 1 OR tracker + tracker_lost < 190')" = 0 ]
}

# bats test_tags=slow
@test "serve: poses reach a client next to a bare socket, and the loop ticks meanwhile" {
	quick_program serve
	# a second of 1 kHz, on a machine that may be busy
	[ "$(of rows 'count(*)' 'messages >= 100 AND p50_us <= max_us')" = 3 ]
	[ "$(of loop 'count(*)' 'ticks >= 100 AND p50_us > 0')" = 2 ]
}

# bats test_tags=slow
@test "bad usage of a program, and an interrupted one" {
	run -2 "$INCISE_BUILD/tests/bench/timeline" more
	run -2 "$INCISE_BUILD/tests/bench/timeline" --seed 2
	TMPDIR=$PWD/none run -1 "$INCISE_BUILD/tests/bench/extremes" --quick
	[[ "$output" == *"$PWD/none/"*"set TMPDIR"* ]]
}
