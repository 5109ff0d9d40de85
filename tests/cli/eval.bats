# SPDX-License-Identifier: GPL-2.0-or-later
# incise eval, and what it takes as a model.

load cli

setup_file() {
	made_pairs >"$BATS_FILE_TMPDIR/pairs.csv"
	incise train "$BATS_FILE_TMPDIR/pairs.csv" -o "$BATS_FILE_TMPDIR/m.fis" 2>/dev/null
	incise train "$BATS_FILE_TMPDIR/pairs.csv" --search type=gbellmf \
		-o "$BATS_FILE_TMPDIR/bell.fis" 2>/dev/null
}

setup() {
	work_folder
	cp "$BATS_FILE_TMPDIR"/*.fis "$BATS_FILE_TMPDIR"/*.sd .
}

# The model in the file bad.fis is refused with these texts.
refuses() {
	run --separate-stderr incise eval bad.fis <<<'5 20'
	failed_with bad.fis "$@" || return
	[ -z "$output" ] || complain "printed: $output"
}

# bats test_tags=check
@test "eval computes equation (3)" {
	# an independent evaluation of the example in incise-fis(5)
	example_in "$root/man/incise-fis.5" "[Rules]" >small.fis
	grep -q NumRules=2 small.fis
	printf '%s\n' "0 0" "5 20" "20 50" "7.5 31.25" >points
	incise eval small.fis points >got
	awk '{ a = exp(-$2^2 / 800); b = exp(-($2 - 50)^2 / 800)
		printf "%.10g\n", (a * 0.1 * $1 + b * 0.15 * $1) / (a + b) }' points >want
	paste got want | awk '($1 - $2)^2 > 1e-18 { bad = 1; print } END { exit bad || NR != 4 }'
}

@test "where no triangle is, the nearest rule answers and eval says so" {
	cat >gap.fis <<-'EOF'
		[System]
		Type='sugeno'
		NumInputs=1
		NumRules=2
		[Input1]
		Name='depth_mm'
		Range=[0 10]
		NumMFs=2
		MF1='a':'trimf',[0 1 2]
		MF2='b':'trimf',[8 9 10]
		[Output1]
		NumMFs=2
		MF1='one':'constant',[1]
		MF2='zero':'constant',[0]
		[Rules]
		1, 1 (1) : 1
		2, 2 (1) : 1
	EOF
	run -0 --separate-stderr incise eval gap.fis <<<$'1\n4.9\n5.1\n9'
	[ "${lines[*]}" = "1 1 0 0" ]
	[ "${#stderr_lines[@]}" -eq 1 ]
	[[ "$stderr" == "incise eval: warning: 2 inputs where no rule"* ]]
	run -0 --separate-stderr incise eval gap.fis --json <<<$'4.9\n11'
	[ "${#stderr_lines[@]}" -eq 2 ]
	[[ "${stderr_lines[0]}" == *"warning: 1 input out of the training range"* ]]
	echo "$output" >r.json
	[ "$(key r.json 'rows[0].extrapolated')" = 1 ]
}

# bats test_tags=check
@test "fixed point agrees with double within 1 mN on the support" {
	incise eval m.fis --grid 101x101 >double
	incise eval m.fis --grid 101x101 --arith fixed >fixed
	# 1 mN is what was promised, one step of the 12-bit force channel; that they differ at
	# all shows that two arithmetics ran
	paste double fixed | awk '
		!NF { next }
		$1 != $4 || $2 != $5 { exit 1 }
		{ e = $3 - $6; if (e < 0) e = -e; if (e > largest) largest = e; n++ }
		END { print n, largest; exit !(n == 10201 && largest < 1e-3 && largest > 0) }'
}

@test "eval reads standard input, - and a file alike" {
	printf '5 20\n\n# note\n  1,2\r\n3;4\n5\t6\n7, 8' >points
	incise eval m.fis points >a
	incise eval m.fis <points >b
	incise eval m.fis - <points >c
	[ "$(wc -l <a)" -eq 5 ]
	cmp a b
	cmp a c
	[ "$(head -n 1 a)" = "$(echo '5 20' | incise eval m.fis)" ]
}

@test "eval takes the model from standard input" {
	echo '5 20' >points
	run -0 incise eval - points <m.fis
	[ "$output" = "$(incise eval m.fis points)" ]
}

# bats test_tags=check
@test "eval answers up to the bad line, then names it" {
	for bad in "1 x" "1" "nan 1" "1 inf" "1 2 3" "1 2 x" "1e999 2"; do
		printf '5 20\n# note\n%s\n5 20\n' "$bad" >points
		fails incise eval m.fis points -- "points:3: column "
		[ "${#lines[@]}" -eq 1 ]
	done
	printf '5 20\n1 x\n' >points
	fails incise eval m.fis points -- "points:2: column 2 (velocity_mm_s)" "'x'"
	run --separate-stderr incise eval m.fis <points
	failed_with "standard input:2: column 2"
}

@test "eval outside the support takes its nearest end and says so" {
	run -0 --separate-stderr incise eval m.fis <<<$'-3 20\n25 20\n5 60\n5 20'
	[ "${#stderr_lines[@]}" -eq 1 ]
	[[ "$stderr" == "incise eval: warning: 3 inputs out of the training range (depth_mm 0 to 20, velocity_mm_s 0 to 50): clamped to it; the first is in line 1" ]]
	[ "${lines[0]}" = "$(echo '0 20' | incise eval m.fis)" ]
	[ "${lines[1]}" = "$(echo '20 20' | incise eval m.fis)" ]
	[ "${lines[2]}" = "$(echo '5 50' | incise eval m.fis)" ]
	run -0 --separate-stderr incise eval m.fis <<<'0 0'
	[ -z "$stderr" ]
}

@test "outside the data the standard deviation is not known, and the first such line is named" {
	printf '# depth velocity\n5 20\n\n500 20\n25 20\n' >points
	run -0 --separate-stderr incise eval m.fis points --uncertainty total
	[[ "${lines[0]}" == *" "[0-9]* ]]
	[[ "${lines[1]}" == [0-9]*" nan" && "${lines[2]}" == [0-9]*" nan" ]]
	[[ "$stderr" == *"warning: 2 inputs"*"; the first is in line 4" ]]
	run -0 --separate-stderr incise eval m.fis points --uncertainty parts
	[[ "${lines[1]}" == *" nan nan nan nan nan" ]]
	incise eval m.fis points --uncertainty parts --json >r.json 2>/dev/null
	jq -e '[.rows[] | .sd_N == null and .sd_data_N == null] == [false, true, true]' r.json
}

@test "eval --no-clamp extrapolates" {
	run -0 --separate-stderr incise eval m.fis --no-clamp <<<'30 20'
	[ "${#stderr_lines[@]}" -eq 1 ]
	[[ "$stderr" == *": extrapolated; the first is in line 1" ]]
	[ "$output" != "$(echo '20 20' | incise eval m.fis)" ]
	# within the support it changes nothing
	[ "$(echo '5 20' | incise eval m.fis --no-clamp)" = "$(echo '5 20' | incise eval m.fis)" ]
}

@test "eval --grid covers the support to its ends" {
	run -0 incise eval m.fis --grid 3x2
	[ "$(awk 'NF { printf "%s,%s ", $1, $2 }' <<<"$output")" = "0,0 0,50 10,0 10,50 20,0 20,50 " ]
	incise eval m.fis --grid 3x2 >grid
	[ "$(grep -c '^$' grid)" -eq 3 ]
	[ "$(awk 'NR == 4 { print $3 }' grid)" = "$(echo '10 0' | incise eval m.fis)" ]
}

# bats test_tags=check
@test "eval --uncertainty total prints force and standard deviation" {
	printf '5 20\n12 3\n999 20\n20 20\n' >points
	incise eval m.fis points --uncertainty total >got 2>/dev/null
	# the force is the same as without
	diff <(cut -d' ' -f1 got) <(incise eval m.fis points 2>/dev/null)
	[ "$(awk 'NF == 2 && $2 > 0 && $2 < 10' got | wc -l)" -eq 3 ]
	# outside the force is that of its nearest end, the deviation is not known
	[ "$(sed -n 3p got)" = "$(sed -n '4s/ .*//p' got) nan" ]
	incise eval m.fis points --uncertainty total --json >r.json 2>/dev/null
	holds "($(key r.json 'rows[1].sd_N') - $(sed -n '2s/.* //p' got))^2 < 1e-18"
	[ "$(incise eval m.fis --grid 2x2 --uncertainty total | awk 'NF == 4 && $4 < 10' | wc -l)" -eq 4 ]
	# any arithmetic: the deviation is that of the model
	diff <(cut -d' ' -f2 got) <(incise eval m.fis points --uncertainty total --arith fixed 2>/dev/null | cut -d' ' -f2)
	incise eval m.fis points >without 2>/dev/null
	run -0 awk 'NF != 1' without
	[ -z "$output" ]
}

@test "eval --uncertainty total refuses what is missing, stale or damaged, by name" {
	cp m.fis alone.fis
	run --separate-stderr incise eval alone.fis --uncertainty total <<<'5 20'
	failed_with alone.fis.sd "No such file"
	cp m.fis.sd alone.fis.sd
	echo '5 20' | incise eval alone.fis --uncertainty total >/dev/null
	cp bell.fis.sd alone.fis.sd
	run --separate-stderr incise eval alone.fis --uncertainty total <<<'5 20'
	failed_with alone.fis.sd:2 stale
	sed '12s/ / x/' m.fis.sd >alone.fis.sd
	run --separate-stderr incise eval alone.fis --uncertainty total <<<'5 20'
	failed_with alone.fis.sd:12 "not a number"
	run --separate-stderr incise eval - --uncertainty total <m.fis
	failed_with "--uncertainty:"
	# without --uncertainty nobody looks
	echo '5 20' | incise eval alone.fis >/dev/null
}

# tests/unit/model/fis.c has the rest, and cuts a file at each byte.
# bats test_tags=check
@test "what a .fis may hold and incise does not know is refused by name and line" {
	line=$(grep -n "^MF1='very_shallow'" m.fis | cut -d: -f1)
	sed "${line}s/gaussmf/pimf/" m.fis >bad.fis
	refuses "bad.fis:$line: " "'pimf'" gauss2mf
	line=$(grep -n "^Type='sugeno'" m.fis | cut -d: -f1)
	sed "s/^Type='sugeno'/Type='mamdani'/" m.fis >bad.fis
	refuses "bad.fis:$line: Type='mamdani'" Sugeno
	head -c -2 m.fis >bad.fis # the last rule lacks its last character
	refuses
	head -c -1 m.fis >bad.fis # the last line lacks its end: whole
	[ "$(echo '5 20' | incise eval bad.fis)" = "$(echo '5 20' | incise eval m.fis)" ]
	for bad in empty noise long; do
		case $bad in
		empty) : ;;
		noise) head -c 5000 "$INCISE_BUILD/bin/incise" ;;
		long) printf 'x%.0s' {1..100000} ;;
		esac >bad.fis
		refuses
	done
}

@test "the bell evaluates in double, and is refused in fixed point by name" {
	incise eval bell.fis <<<'5 20' >out
	holds "$(cat out) > 0"
	run --separate-stderr incise eval bell.fis --arith fixed <<<'5 20'
	failed_with bell.fis gbellmf depth_mm very_shallow
}

# bats test_tags=check
@test "eval reports as JSON" {
	printf '5 20\n999 20\n' | incise eval m.fis --json >r.json 2>/dev/null
	[ "$(sqlite3 :memory: "SELECT json_array_length(readfile('r.json'), '$.rows')")" = 2 ]
	[ "$(sqlite3 :memory: "SELECT json_extract(readfile('r.json'), '$.rows[0].depth_mm')")" = 5.0 ]
	[ "$(sqlite3 :memory: "SELECT json_extract(readfile('r.json'), '$.rows[0].extrapolated')")" = 0 ]
	[ "$(sqlite3 :memory: "SELECT json_extract(readfile('r.json'), '$.rows[1].extrapolated')")" = 1 ]
	force=$(sqlite3 :memory: "SELECT json_extract(readfile('r.json'), '$.rows[0].force_N')")
	[ "$(printf '%.9g' "$force")" = "$(echo 5 20 | incise eval m.fis | xargs printf '%.9g')" ]
}
