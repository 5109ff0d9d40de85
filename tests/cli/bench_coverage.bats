# SPDX-License-Identifier: GPL-2.0-or-later
# incise bench coverage: the truth of virtual rigs is held by what is stated.

load cli
load report

setup() {
	work_folder
}

# 12 rigs: a common error is one draw for each, of which 8 or more are held but once in 10^4 at
# 95 %; an own one is hundreds of draws for each.
@test "bench coverage: intervals hold the truth, in all and by part" {
	quick_report coverage
	[ "$(key r.json rigs) $(key r.json refused) $(key r.json seed)" = "12 0 1" ]
	[ "$(of rows 'count(*)')" = 24 ]
	[ "$(of rows 'count(*)' "part = 'own' AND (coverage < 0.93 OR coverage > 0.975)")" = 0 ]
	[ "$(of rows 'count(*)' "part = 'common' AND coverage < 0.66")" = 0 ]
	[ "$(of rows 'count(*)' "part = 'total' AND coverage < 0.66")" = 0 ]
	# mostly own
	[ "$(of rows 'count(*)' "part = 'total' AND name IN ('force', 'velocity') AND (coverage < 0.93 OR coverage > 0.975)")" = 0 ]
	# rms of 12 normal errors: chi squared of 12 is below 2.2 and above 34 each once in 1000
	[ "$(of sources 'count(*)' 'rms < sqrt(2.2 / 12) OR rms > sqrt(34.0 / 12) OR coverage < 0.66')" = 0 ]
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
