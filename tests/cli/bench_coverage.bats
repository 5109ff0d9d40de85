# SPDX-License-Identifier: GPL-2.0-or-later
# incise bench coverage: the truth of virtual rigs is held by what is stated.

load cli
load report

setup() {
	work_folder
}

# 9 rigs: a common error is one draw for each, of which fewer than 5 are held once in 20000 at
# 95 %; an own one is hundreds of draws for each.
@test "bench coverage: intervals hold the truth, in all and by part" {
	quick_report coverage
	[ "$(key r.json rigs) $(key r.json refused) $(key r.json seed)" = "9 0 1" ]
	[ "$(of rows 'count(*)')" = 24 ]
	[ "$(of rows 'count(*)' "part = 'own' AND (coverage < 0.93 OR coverage > 0.975)")" = 0 ]
	[ "$(of rows 'count(*)' "part = 'common' AND coverage < 0.55")" = 0 ]
	[ "$(of rows 'count(*)' "part = 'total' AND coverage < 0.55")" = 0 ]
	# mostly own
	[ "$(of rows 'count(*)' "part = 'total' AND name IN ('force', 'velocity') AND (coverage < 0.93 OR coverage > 0.975)")" = 0 ]
	# rms of 9 normal errors: chi squared of 9 is below 1.15 and above 27.9 each once in 1000
	[ "$(of sources 'count(*)' 'rms < sqrt(1.15 / 9) OR rms > sqrt(27.9 / 9) OR coverage < 0.55')" = 0 ]
	# what the rows of a recording share is mostly the surface, and the delay
	for name in depth time; do
		holds "$(of correlations measured "name = '$name'") > 0.5"
		holds "$(of correlations stated "name = '$name'") > 0.5"
	done
	holds "$(of correlations measured "name = 'velocity'") < 0.1"
}

@test "bench coverage prints tables, and bad usage" {
	run -0 --separate-stderr incise bench coverage --help
	run --separate-stderr incise bench coverage a
	[ "$status" = 2 ]
	run --separate-stderr incise bench coverage --plot x
	[ "$status" = 2 ]
}

@test "bench coverage that is interrupted leaves nothing behind" {
	mkdir t
	bench_interrupted coverage --quick
}
