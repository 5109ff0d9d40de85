# SPDX-License-Identifier: GPL-2.0-or-later
# incise bench extremes: every case is held or refused, and stiff walls are as theory says.

load cli
load report

setup() {
	work_folder
}

@test "bench extremes: nothing is wrong, and each interface is tried" {
	quick_report extremes
	[ "$(of rows 'sum(wrong)')" = 0 ]
	[ "$(of rows 'count(*)' 'failed IS NOT NULL')" = 0 ]
	[ "$(of rows 'count(*)' 'tried != held + refused OR tried < 90')" = 0 ]
	holds "$(of rows 'sum(tried)') > 1e6"
	for row in model_double fixed_direct fixed_table force_table fixed_batch fixed_blob plane \
		sphere capsule mesh heights plant stability_limit spring profile pose_nan \
		pose_huge time_back time_1ns time_1h rates wall scenes device_fault \
		device_nonsense scene_bytes fis_bytes fx_bytes mesh_bytes rig_bytes \
		calibration_bytes recording_bytes; do
		holds "$(of rows 'held' "name = '$row'") > 0"
	done
	# What is broken is refused, but not everything.
	for row in fixed_blob wall scene_bytes fis_bytes mesh_bytes recording_bytes; do
		holds "$(of rows 'refused' "name = '$row'") > 0"
	done
	[ -n "$(key r.json machine.cpu)" ]
	[ "$(key r.json seed) $(key r.json quick)" = "1 1" ]
}

# bats test_tags=slow
@test "bench extremes: the same cases by seed" {
	incise bench extremes --quick --json >a.json
	incise bench extremes --quick --json >b.json
	incise bench extremes --quick --json --seed 2 >c.json
	for k in rows stiff; do
		[ "$(key a.json $k)" = "$(key b.json $k)" ]
	done
	[ "$(key a.json rows)" != "$(key c.json rows)" ]
}

@test "bench extremes: stiff walls are accepted up to the limit of theory, and bounded beyond" {
	quick_report extremes
	[ "$(of stiff 'count(*)')" = 10 ]
	[ "$(of stiff 'count(*)' 'accepted != (K_N_m <= theory_limit_N_m)')" = 0 ]
	[ "$(of stiff 'min(bounded)')" = 1 ]
	[ "$(of stiff 'sum(not_finite)')" = 0 ]
	holds "$(of stiff 'max(largest_N)') <= 4"
	# What is accepted is still at last; what a plan refuses moves by millimetres.
	holds "$(of stiff 'max(late_mm)' 'accepted') < 0.11"
	holds "$(of stiff 'min(late_mm)' "NOT accepted AND path = 'plan'") > 1"
	# Known: 2 b/T = 20 N/mm for little damping, and 0.40 N/mm of incise-scene(5).
	holds "($(of stiff 'max(theory_limit_N_m)') / 20000 - 1) ^ 2 < 0.05 ^ 2"
	holds "($(of stiff 'min(theory_limit_N_m)') / 400 - 1) ^ 2 < 0.01 ^ 2"
}

# bats test_tags=slow
@test "bench extremes prints a table and draws the walls" {
	command -v gnuplot >/dev/null || skip "gnuplot is not installed, it draws the chart"
	run -0 --separate-stderr incise bench extremes --quick --plot "a folder/stiff"
	[ -z "$stderr" ]
	[[ "$output" == *$'\n'"pose_nan "* ]]
	[[ "$output" == *"limit by theory, plan: "* ]]
	grep -q '<svg' "a folder/stiff.svg"
	[ "$(head -c 8 "a folder/stiff.png" | od -An -tx1 | tr -d ' \n')" = 89504e470d0a1a0a ]
}

@test "bench extremes: bad usage" {
	run --separate-stderr incise bench extremes a
	bad_usage "'extremes'"
	run --separate-stderr incise bench extremes --seed 0
	bad_usage "seed"
	run --separate-stderr incise bench training --seed 2
	bad_usage "--seed does not go with 'training'"
}

# bats test_tags=slow
@test "bench extremes that is interrupted, or has no room, leaves nothing behind" {
	mkdir t
	bench_interrupted extremes --quick
	TMPDIR=$PWD/none run --separate-stderr incise bench extremes --quick
	failed_with "$PWD/none/" "set TMPDIR"
}
