# SPDX-License-Identifier: GPL-2.0-or-later
# --help of every verb, and its manual page beside it.

load cli

setup() {
	work_folder
	verbs=$({ incise --help && incise help advanced; } | awk '/^  [a-z]/ { print $1 }')
	[ "$(wc -w <<<"$verbs")" -ge 8 ]
	# "calibrate force": incise-calibrate-force
	words=$(cd "$INCISE_BUILD/bin" && printf '%s\n' incise-*-* | sed 's/^incise-//; s/-/ /')
	mapfile -t all < <(printf '%s\n' "$verbs" "$words" | sed '/^$/d')
}

# "calibrate force" → incise-calibrate-force; without a word incise itself
program() {
	echo "incise${1:+-${1// /-}}"
}

# bats test_tags=check
@test "a page has the options and the exit status of its program, and what its source adds" {
	printf 'option\to\toutput\tFILE\twrite it; see --json\noption\t\tjson\t\treport as JSON\nexit\t0\tsuccess\nexit\t1\tfailure\n' >table
	printf '%s\n' '.Sh OPTIONS' First. '.It output' More. '.Bl -tag' '.It inner' .El '.Sh EXIT STATUS' '.It 1' Failed. .El Last. >page
	run -0 "$root/mk/manual" table page
	[ "$output" = ".Sh OPTIONS
First.
.Bl -tag -width Ds
.It Fl o , Fl -output Ar FILE
Write it; see \fB\-\-json\fP.
More.
.Bl -tag
.It inner
.El
.It Fl -json
Report as JSON.
.El
.Sh EXIT STATUS
.Bl -tag -width Ds -compact
.It 0
Success.
.It 1
Failed.
.El
Last." ]
	sed -i 's/output/outputs/' page
	run -1 --separate-stderr "$root/mk/manual" table page
	[ "$stderr" = "page: option outputs: not in the table of the program" ]
	# each page that was built has its list
	for verb in "${all[@]}"; do
		grep -q '^\.It Fl V , Fl -version$' "$INCISE_BUILD/man/$(program "$verb").1"
		grep -q '^\.It 2$' "$INCISE_BUILD/man/$(program "$verb").1"
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
	[ "$(COLUMNS=80 incise-train --help | sed -n 1p)" = "Usage: incise train DATA.csv|NAME.rec… [-o MODEL.fis] [OPTIONS]" ]
	[ "$(COLUMNS=63 incise-train --help | sed -n 1p)" = "Usage: incise train DATA.csv|NAME.rec… [-o MODEL.fis] [OPTIONS]" ]
	[ "$(COLUMNS=62 incise-train --help | sed -n 2p)" = "        [OPTIONS]" ]
	# of the terminal, where nobody says otherwise
	run -0 script -qec 'unset COLUMNS; stty cols 50; incise-train --help' /dev/null </dev/null
	[ "$(tr -d "\r" <<<"$output" | sed -n 2p)" = "        MODEL.fis] [OPTIONS]" ]
	# an example can be pasted
	[ "$(COLUMNS=62 incise-train --help | sed -n '/pairs.csv/,/liver/p')" = \
		"  incise train pairs.csv --group cut --check 0.3 \\
      -o liver.fis" ]
}

# bats test_tags=check
@test "who runs a scene lists those that are installed" {
	for word in haptic view; do
		[ ! -x "$INCISE_BUILD/bin/incise-$word" ] || incise $word --help | grep -qx "Installed scenes: liver, neck, wall"
	done
}

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
}

@test "manual pages are well formed" {
	command -v mandoc >/dev/null || skip "mandoc is not installed"
	cd "$INCISE_BUILD/man"
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
