# SPDX-License-Identifier: GPL-2.0-or-later
# --help of every verb, and its manual page beside it.

load cli

setup() {
	work_folder
	verbs=$(incise --help | awk '/^Commands:/ { on = 1; next } on && !NF { exit } on && /^  [a-z]/ { print $1 }')
	[ "$(wc -w <<<"$verbs")" -ge 8 ]
	# "calibrate force": incise-calibrate-force
	words=$(cd "$INCISE_BUILD/bin" && printf '%s\n' incise-*-* | sed 's/^incise-//; s/-/ /')
	mapfile -t all < <(printf '%s\n' "$verbs" "$words" | sed '/^$/d')
}

# "calibrate force" → incise-calibrate-force; without a word incise itself
program() {
	echo "incise${1:+-${1// /-}}"
}

options_of_help() {
	"$(program "$1")" --table | awk -F'\t' '/^option/ { print "--" $3; if ($2) print "-" $2 }' | sort -u
}

# Options that items of the page's lists are headed by: ".It Fl o , Fl -output Ar FILE".
options_of_page() {
	sed -n 's/^\.It Fl/ Fl/p' "$root/man/$(program "$1").1" | grep -oE ' Fl [-A-Za-z][a-z-]*' |
		sed 's/ Fl /-/' | sort -u
}

# bats test_tags=check
@test "help and manual name the same options" {
	for verb in "${all[@]}"; do
		[ -f "$root/man/$(program "$verb").1" ]
		# at least --help, -h, --version, -V: the patterns found something
		[ "$(options_of_help "$verb" | wc -l)" -ge 4 ]
		diff <(options_of_help "$verb") <(options_of_page "$verb")
	done
}

# bats test_tags=check
@test "no line of a help is wider than the terminal" {
	for columns in 80 60; do
		for name in "" "${all[@]}"; do
			COLUMNS=$columns "$(program "$name")" --help >out
			# characters, not bytes
			run ! grep -P "(*UTF)^.{$((columns + 1))}" out
			[ "$(wc -l <out)" -ge 8 ] || complain "$name: $(cat out)"
		done
	done
	# as wide as asked for, in characters: a line of this one has a dash of three bytes
	[ "$(COLUMNS=80 incise-train --help | sed -n 1p)" = "Usage: incise train DATA.csv|NAME.rec… -o MODEL.fis [OPTIONS]" ]
	[ "$(COLUMNS=61 incise-train --help | sed -n 1p)" = "Usage: incise train DATA.csv|NAME.rec… -o MODEL.fis [OPTIONS]" ]
	[ "$(COLUMNS=60 incise-train --help | sed -n 2p)" = "        [OPTIONS]" ]
	# of the terminal, where nobody says otherwise
	run -0 script -qec 'unset COLUMNS; stty cols 50; incise-train --help' /dev/null </dev/null
	[ "$(tr -d "\r" <<<"$output" | sed -n 2p)" = "        MODEL.fis [OPTIONS]" ]
	# an example can be pasted
	[ "$(COLUMNS=60 incise-train --help | sed -n '/pairs.csv/,/liver/p')" = \
		"  incise train pairs.csv --group cut --check 0.3 \\
      -o liver.fis" ]
}

# bats test_tags=check
@test "every program is asked here, and every page of a program has one" {
	# incise names its verbs, and words of verbs are what else is built
	[ "$(printf 'incise-%s\n' "${all[@]}" | tr ' ' - | sort)" = \
		"$(cd "$INCISE_BUILD/bin" && printf '%s\n' incise-* | sort)" ]
	for page in "$root"/man/incise-*.1; do
		name=${page##*/}
		# benchmarks have pages of their own
		[ -e "$root/tools/${name%.1}.c" ] || [ -e "$root/tools/bench/bench_$(sed 's/^incise-bench-//; s/\.1$//' <<<"$name").c" ] ||
			complain "$name is of no program"
	done
	# the list of bench's help: name, operands, and what it measures
	benchmarks=$(incise bench --help | sed -nE '/^Measure/,/^compare/s/^  ([a-z]+)( \[[^]]*\])?  .*/\1/p')
	[ "$(wc -w <<<"$benchmarks")" -ge 6 ]
	for benchmark in $benchmarks; do
		[ -e "$root/man/incise-bench-$benchmark.1" ] || complain "$benchmark has no page"
	done
	# incise itself
	for option in --help -h --version -V; do
		incise $option >/dev/null
		options_of_page "" | grep -qx -e $option
	done
}

@test "manual pages are well formed" {
	command -v mandoc >/dev/null || skip "mandoc is not installed"
	cd "$root/man"
	# lines are of 90 columns here, pages are ours, and what else is installed is not told from them
	mandoc -Tlint ./*.[1-8] 2>/dev/null >"$BATS_TEST_TMPDIR/lint" || :
	run ! grep -vE 'longer than 80 bytes|operating system explicitly|manual not found|mandoc\.db' \
		"$BATS_TEST_TMPDIR/lint"
	# it was the pages that it read
	[ "$(grep -c 'operating system explicitly' "$BATS_TEST_TMPDIR/lint")" = "$(printf '%s\n' *.[1-8] | wc -l)" ]
	for page in *.[1-8]; do
		# a page with tables begins with the name of their preprocessor
		[[ "$(grep -v "^'.. t$" "$page" | head -n 1)" == '.\" SPDX-License-Identifier: '* ]]
		! grep -q '^\.TS' "$page" || [[ "$(head -n 1 "$page")" == "'\\\" t" ]]
	done
}

@test "manual pages of ours that others refer to exist" {
	grep -hoE '^\.Xr (incise|libincise|rig|calibration)[a-z.@-]* [1-8]' "$root"/man/*.[1-8] |
		sort -u >"$BATS_TEST_TMPDIR/references"
	[ "$(wc -l <"$BATS_TEST_TMPDIR/references")" -ge 10 ]
	while read -r _ name section; do
		[ -f "$root/man/$name.$section" ] || complain "$name($section) does not exist"
	done <"$BATS_TEST_TMPDIR/references"
}
