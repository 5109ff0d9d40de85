# SPDX-License-Identifier: GPL-2.0-or-later
# incise bench, as a user meets it. Times are not judged here: the machine is shared.

load cli

setup() {
	work_folder
}

@test "bench precision measures a model of its own" {
	run -0 --separate-stderr incise bench precision
	[ -z "$stderr" ]
	[[ "$output" == *double_libm* ]]
	[[ "$output" == *fixed_direct* ]]
}

@test "bench precision reports as JSON" {
	incise bench precision --json >r.json
	for name in double_libm fixed_direct; do
		row=$(sqlite3 :memory: "SELECT key FROM json_each(readfile('r.json'), '\$.rows')
			WHERE json_extract(value, '\$.name') = '$name'")
		[ -n "$row" ]
		holds "$(key r.json "rows[$row].ns") > 0"
		holds "$(key r.json "rows[$row].rms_error_N") <= $(key r.json "rows[$row].max_error_N")"
		key r.json "rows[$row].bound_N" # there, perhaps null
		errors+=("$(key r.json "rows[$row].max_error_N")")
	done
	# double: some roundings of 3 N; fixed: half an LSB of 15 uN and more, under 1 mN
	holds "${errors[0]} < 1e-13"
	holds "${errors[1]} > 7e-6 && ${errors[1]} < 1e-3"
}

@test "bench precision measures a model of mine" {
	made_pairs >pairs.csv
	incise train pairs.csv -o m.fis 2>/dev/null
	incise bench precision m.fis --json >r.json
	holds "$(key r.json 'rows[0].max_error_N') < 1e-3"
	run --separate-stderr incise bench precision none.fis
	failed_with none.fis
	incise train pairs.csv --mf-type gbellmf -o bell.fis 2>/dev/null
	run --separate-stderr incise bench precision bell.fis
	failed_with gbellmf
}

@test "bench: bad usage" {
	run --separate-stderr incise bench
	bad_usage "'precision'"
	run --separate-stderr incise bench nothing
	bad_usage "'precision'"
	run --separate-stderr incise bench precision a b
	bad_usage "at most one model"
}
