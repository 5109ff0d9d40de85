# SPDX-License-Identifier: GPL-2.0-or-later
# incise bench integers, as a user meets it. Times are not judged here: the machine is shared.

load cli

setup() {
	work_folder
}

@test "bench integers holds the shipped scenes within what is certified" {
	incise bench integers --quick --json >r.json
	[ "$(python3 -c 'import json; print(" ".join(r["name"] for r in json.load(open("r.json"))["rows"]))')" = \
		"liver neck wall" ]
	python3 - <<-'END'
		import json
		rows = json.load(open('r.json'))['rows']
		assert all(r['holds'] and 0 < r['rms_error_N'] < r['max_error_N'] <= r['bound_N'] for r in rows)
		# much of it in contact, and little apart
		assert all(r['contact'] > r['ticks'] / 2 and r['apart'] < r['ticks'] / 100 for r in rows)
		assert all(r['double_ns'] > 0 and r['integers_ns'] > 0 for r in rows)
	END
}

@test "bench integers says it as text, and draws it" {
	command -v gnuplot >/dev/null || skip "gnuplot is not installed"
	run -0 --separate-stderr incise bench integers --quick wall --plot over
	[[ "$output" =~ $'\n'wall\ +[0-9.]+\ +[0-9.]+\ +[0-9.]+\  ]]
	[ -s over.png ]
	run --separate-stderr incise bench integers none
	failed_with "none: no such scene"
}
