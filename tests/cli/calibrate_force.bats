# SPDX-License-Identifier: GPL-2.0-or-later
# incise calibrate force: on the virtual rig against its truth, and on files that are wrong.

load cli

# Pairs of three ascending series and a descending one, 1250 mV/N and 180 mV, noise of 1 mV
# or so that is the same in each run; lines can be changed by an awk condition on i.
made_weights() {
	awk "BEGIN { print \"mass_g,reading_mV,series,direction\"
		for (s = 1; s <= 4; s++) for (k = 0; k <= 6; k++) {
			i++; m = 50 * (s == 4 ? 6 - k : k)
			r = 180 + 1250 * m * 1e-3 * 9.80665 * (1 - 1.2 / 7950) + sin(7 * i)
			d = s == 4 ? \"down\" : \"up\"
			$1
			print m \",\" r \",\" s \",\" d } }"
}

# bats test_tags=check
@test "the virtual rig's sensitivity is found, kept, reported and put in force" {
	command -v gnuplot || skip "gnuplot is not installed"
	run -0 --separate-stderr incise calibrate force \
		--rig sim:clock=simulated,seed=5,force_mV_N=1265.5,force_zero_mV=160 \
		--weights 50g,100g,0.15kg,200g,300g -o pairs.csv -o r --zero </dev/null
	# the sim's force is exact: codes and noise leave 0.01 %
	mV_N=$(key r/report.json sensitivity_mV_N)
	holds "$mV_N > 1265.5 * 0.9999 && $mV_N < 1265.5 * 1.0001"
	zero=$(key r/report.json zero_mV)
	holds "$zero > 159.9 && $zero < 160.1"
	holds "$(key r/report.json zero_return_percent) < 0.01"
	holds "$(key r/report.json clips_N) > 3.8 && $(key r/report.json clips_N) < 3.85"
	[ "$(key r/report.json pass)" = 1 ]
	[ -s r/fit.png ] && [ -s r/residuals.png ]
	grep -q "^resolution of the scale *B" r/report.txt
	grep -qE "^force_mV_N = 1265\.[0-9]+; ## mV/N, U = " calibration.conf
	grep -q '^force_zero_mV = 1' calibration.conf
	grep -q 'raw = "pairs.csv"' calibration.conf
	[[ "${stderr_lines[0]}" == "1   up        0 g"* ]]
	# once more from what was kept: the same, and the history grows
	run -0 incise calibrate force --from pairs.csv --json
	echo "$output" >again.json
	holds "$(key again.json sensitivity_mV_N) - $mV_N < 0.01"
	[ "$(grep -c 'kind = "force"' calibration.conf)" = 2 ]
	incise capture -o a.rec --rig sim:clock=simulated --duration 600ms -c calibration.conf
	[ "$(sqlite3 a.rec/recording.db \
		"SELECT value FROM meta WHERE key = 'calibration_conf'")" = "$(cat calibration.conf)" ]
}

@test "a dry run, and one that does not pass, put nothing in force" {
	made_weights "" >w.csv
	incise calibrate force --from w.csv --dry-run
	[ ! -e calibration.conf ]
	run --separate-stderr incise calibrate force --from w.csv --nominal 1500
	failed_with "refused, the previous calibration stays active" "-16.67 % from the nominal 1500 mV/N, more than 5 %"
	run ! grep -q '^force_mV_N' calibration.conf
	grep -q 'pass = false;' calibration.conf
	run -0 incise calibrate force --from w.csv --gravity latitude=48,altitude=300
	[[ "$output" == *"force_mV_N  1249."*" ± "*" mV/N  1240."*" (nominal)  +"*" mV/N (+0."*" %)"* ]]
	grep -q '^force_mV_N = ' calibration.conf
}

@test "the report ends with value, U, previous value, change, limits and file" {
	made_weights "" >w.csv
	run -0 incise calibrate force --from w.csv --gravity latitude=48
	[ "${lines[-2]%%,*}" = "pass: +0.78 % from the nominal 1240 mV/N" ] || complain "$output"
	[[ "${lines[-2]}" == *", within 5 %; U = "* ]]
	[ "${lines[-1]}" = "wrote calibration.conf: active from now on" ]
	# the next one has the date of this one, whose value is the same
	run -0 incise calibrate force --from w.csv --gravity latitude=48 --dry-run -o r
	[[ "${lines[-5]}" =~ ^result\ +value\ ±\ U\ \(k\ =\ 2\)\ +previous\ +change$ ]] || complain "$output"
	[[ "${lines[-4]}" == "force_mV_N  12"*" ± "*" mV/N  12"*" ($(date -u +%Y)-"*")  +0.0"*" mV/N (+0.00 %)" ]] || complain "$output"
	[ "${lines[-2]}" = "calibration.conf: not written (--dry-run)" ]
	[ "${lines[-1]}" = "wrote r/ (6 files)" ]
	[[ "$(tail -n 1 r/report.txt)" == "pass: +0.78 % from"* ]]
	# changed by hand since, and one that does not pass
	sed -i 's/^force_mV_N = [^;]*/force_mV_N = 1300.0/' calibration.conf
	run -1 --separate-stderr incise calibrate force --from w.csv --nominal 1500
	[[ "$output" == *" 1300."*" (by hand)  -"*" mV/N (-"* ]] || complain "$output"
	[[ "${lines[-2]}" == "FAIL: -16.67 % from the nominal 1500 mV/N, more than 5 %;"* ]] || complain "$output"
	[ "${lines[-1]}" = "wrote calibration.conf: in its history only, the previous values stay active" ]
}

@test "a weight beyond the converter's end does not hold up those after it" {
	# 5 V less 180 mV at 1260 mV/N are 3.83 N: 500 g are too much
	incise calibrate force --rig sim:clock=simulated,force_mV_N=1260 \
		--weights 0,100g,200g,300g,500g --repeat 3 >out 2>err
	grep -q 'pairs  *18 of 21 used, 4 loads, 3 series; 3 saturated, 0 outliers' out
}

# bats test_tags=check
@test "what cannot be is refused by name" {
	made_weights "" | awk -F, -v OFS=, 'NR > 1 { t = $1; $1 = $2; $2 = t } 1' >swapped.csv
	made_weights "m = 100; r = 1400" >one.csv
	made_weights "if (i > 4) continue" >few.csv
	made_weights "m /= 1000" >kg.csv
	made_weights "r = 5000 - r" >falls.csv
	while read -r file said; do
		fails incise calibrate force --from "$file.csv" -- "refused" "$said"
	done <<-END
		swapped the columns of loads and readings are swapped
		one have the same load
		few at least 5 pairs of 3 loads
		kg the masses seem to be in kg
		falls the reading does not increase with the load
	END
	[ ! -e calibration.conf ]
}

# bats test_tags=check
@test "files that are no pairs are named with their line" {
	while IFS='|' read -r text said; do
		printf '%b' "$text" >w.csv
		fails incise calibrate force --from w.csv -- "w.csv" "$said"
	done <<-'END'
		mass,reading_mV\n1,2\n|w.csv:1: expected a line of column names
		mass_g,reading_mV\n1,2\n1,x\n|w.csv:3: reading_mV: expected a number, found 'x'
		mass_g,reading_mV\n1,\n|w.csv:2: reading_mV: expected a number, found ''
		mass_g,reading_mV\n1\n|w.csv:2: 1 fields, but the first line names 2 columns
		mass_g,reading_mV\n1,5,2,5\n|w.csv:2: 4 fields, but the first line names 2 columns
		mass_g,reading_mV,mass_g\n1,5,2\n|w.csv:1: two columns are called mass_g
		mass_g,reading_mV\nnan,1\n|w.csv:2: mass_g: expected a number
		mass_g,reading_mV,direction\n1,1,left\n|w.csv:2: direction: expected up or down
		mass_g,reading_mV,series\n1,1,1.5\n|w.csv:2: series: expected a whole number
		|w.csv: no pairs; expected a line of column names
	END
	fails incise calibrate force --from none.csv -- "none.csv:"
	echo 'force_mV_N = "x";' >calibration.conf
	made_weights "" >w.csv
	fails incise calibrate force --from w.csv -- "calibration.conf:1: force_mV_N:"
}

@test "stopped in the middle, the old calibration stays" {
	echo 'force_mV_N = 1234;' >calibration.conf
	cp calibration.conf before
	incise calibrate force --rig sim: --weights 50g,100g,200g </dev/null 2>said &
	pid=$!
	await grep -q "50 g" said
	kill -INT "$pid"
	status=0
	wait "$pid" || status=$?
	[ "$status" = 1 ]
	grep -q "stopped; the previous calibration stays active" said
	cmp calibration.conf before
}
