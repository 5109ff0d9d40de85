# SPDX-License-Identifier: GPL-2.0-or-later
# Queries of a bench's report: `load report`, behind `load cli`.
# shellcheck shell=bash

# A value of the row with a name: row r.json fixed_table bound_N.
row() {
	local k
	k=$(sqlite3 :memory: "SELECT key FROM json_each(readfile('$1'), '\$.rows')
		WHERE json_extract(value, '\$.name') = '$2'")
	[ -n "$k" ] || complain "no row $2" || return
	key "$1" "rows[$k].$3"
}

# One number over a list of r.json: of LIST 'max(ratio)' ['condition'].
# Names of columns are keys of its objects; bT_m and BT_m are one to SQL.
of() {
	local keys
	keys=$(sqlite3 :memory: "SELECT group_concat(DISTINCT
		'json_extract(e.value, ''\$.' || o.key || ''') AS ' || o.key)
		FROM json_each(readfile('r.json'), '\$.$1') e, json_each(e.value) o")
	[ -n "$keys" ] || complain "no list $1" || return
	sqlite3 :memory: "SELECT $2 FROM (SELECT $keys
		FROM json_each(readfile('r.json'), '\$.$1') e) WHERE ${3:-1}"
}

# Of each bench one quick report is made in a run of bats, which the tests of all files share:
# measured once, or by incise bench all, whose tests put its reports here.
shared_reports=$BATS_RUN_TMPDIR/reports

# The report of a bench as r.json.
quick_report() {
	local report=$shared_reports/$1.json

	mkdir -p "$shared_reports"
	if [ ! -e "$report" ]; then
		# two tests may measure it at once
		incise bench "$1" --quick --json >"$report.$BATS_TEST_NUMBER" || return
		mv "$report.$BATS_TEST_NUMBER" "$report"
	fi
	cp "$report" r.json
}
