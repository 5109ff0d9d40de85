# SPDX-License-Identifier: GPL-2.0-or-later
# incise train, as a user meets it.

load cli

setup() {
	work_folder
	made_pairs >pairs.csv
}

# Training on the file bad.csv fails, says these texts, and leaves nothing.
refuses() {
	run --separate-stderr incise train bad.csv -o m.fis
	failed_with bad.csv "$@" || return
	[ -z "$output" ] || complain "printed: $output" || return
	[ "$(ls -A)" = "$(printf '%s\n' bad.csv pairs.csv)" ] || complain "left: $(ls -A)"
}

# A model without its name and the notes of its sources.
parameters() {
	grep -v -e ^Name -e ^% "$1"
}

@test "each group that is held out has its name and its error" {
	sed '2,$s/^c/d/' pairs.csv | awk -F, -v OFS=, 'NR > 1 { $4 *= 1.1 } 1' >other.csv
	for group in cut recording; do
		incise train pairs.csv other.csv --group $group --check 0.4 -o m.fis --overwrite >out 2>/dev/null
		incise train pairs.csv other.csv --group $group --check 0.4 -o m.fis --overwrite --json >r.json 2>/dev/null
		[ "$(key r.json check_groups)" = "$(jq '.check_names | length' r.json)" ]
		jq -r '[.check_names, .check_names_rms_error_N] | transpose[] | join(" ")' r.json >held
		while read -r kind name rest; do
			file=${rest#of }
			[ $kind = cut ] && file=${file% *} || file=$name
			awk -F, -v name="$name" -v all=$group \
				'NR > 1 && (all == "recording" || $1 == name) { print $2, $3, $4 }' "$file" >rows
			rmse=$(paste rows <(cut -d' ' -f1,2 rows | incise eval m.fis 2>/dev/null) |
				awk '{ s += ($3 - $4) ^ 2 } END { printf "%.12g", sqrt(s / NR) }')
			holds "(${rest##* } - $rmse)^2 < 1e-18" || complain "$kind $name" || return
			grep -q "^  $kind $name.* $(printf %.5g "$rmse") N$" out
		done <<<"$(sed 's/^recording \([^ ]*\) /recording \1 of \1 /' held)"
	done
}

@test "few groups make a wide interval, and the report says so" {
	incise train pairs.csv --group cut -o m.fis >out
	run ! grep "wide" out
	grep -v -e ^c4 -e ^c5 -e ^c6 pairs.csv >few.csv
	incise train few.csv --group cut -o few.fis >out 2>/dev/null
	grep -q "95 % interval: noise .* N (wide: only 3 cuts)" out
	grep -q "^  RMSE, N  *training *$" out
	grep -q "^  cross-validated: [0-9.]*, quadratic [0-9.]*, linear [0-9.]*, mean [0-9.]* N$" out
}

# bats test_tags=check
@test "train learns, and says how well" {
	run -0 --separate-stderr incise train pairs.csv --group cut --check 0.3 -o m.fis
	[ "${lines[0]}" = "pairs.csv: 192 pairs to train (4 cuts), 96 to check (2 cuts)" ]
	[ "${lines[-1]}" = "wrote m.fis and m.fis.sd" ]
	grep -q "^Type='sugeno'" m.fis
	[ "$(grep -c "gaussmf" m.fis)" -eq 9 ]
	[ "$(grep -c "'linear'" m.fis)" -eq 20 ]
	# the model of a known force: 0.45 + 0.28 N at 10 mm, times 1 + 0.35·20/35. The
	# cuts used may all lie on one side, by up to 5 %, and the fit adds some.
	force=$(echo '10 20' | incise eval m.fis)
	holds "$force > 0.73 * 1.2 * 0.93 && $force < 0.73 * 1.2 * 1.07"
}

# bats test_tags=check
@test "train reports as JSON" {
	incise train pairs.csv --group cut --check 0.3 --seed 1 -o m.fis --json >r.json 2>warned
	[ "$(key r.json pairs)" = 288 ]
	[ "$(key r.json train.pairs)" = 192 ]
	[ "$(key r.json check.pairs)" = 96 ]
	[ "$(key r.json train_groups)" = 4 ]
	[ "$(key r.json check_groups)" = 2 ]
	[ "$(key r.json rules)" = 20 ]
	[ "$(key r.json parameters)" = 78 ] # 20·3 consequents, 9·2 premises
	[ "$(key r.json model)" = m.fis ]
	[ "$(key r.json rules_unfired)" = 0 ]
	train=$(key r.json train.rms_error_N)
	# the name up to 0.1, on which scripts lean
	[ "$(key r.json train.rmse_N)" = "$train" ]
	check=$(key r.json check.rmse_N)
	# cuts differ by up to 5 % of at most 2.6 N
	holds "0 < $train && $train < 0.13"
	holds "0 < $check && $check < 0.2"
	holds "($check - sqrt($(key r.json check.mse_N2)))^2 < 1e-16"
	holds "$check < $(key r.json baselines.mean.rmse_N)"
	holds "$check < $(key r.json baselines.linear.rmse_N)"
	holds "$(key r.json baselines.knn.rmse_N) > 0"
	holds "$(key r.json knn_k) >= 1"
	holds "$(key r.json best_epoch) <= $(key r.json epochs)"
	holds "$(key r.json ridge) >= 0"
	# null where a rule is out of reach
	condition=$(key r.json condition)
	holds "${condition:-2} > 1"
	# what was warned of is in the report
	[ "$(sqlite3 :memory: "SELECT json_array_length(readfile('r.json'), '\$.warnings')")" \
		-eq "$(grep -c '^incise train: warning: ' warned)" ]
}

@test "train leaves out where the blade did not advance, and says how many" {
	# a third of the rows more, from the way out
	awk -F, 'BEGIN { OFS = "," } NR == 1 { print $0, "advancing"; next } { print $0, 1 }
		NR % 3 == 0 { print $1, $2, $3, "nan", 0 }' pairs.csv >all.csv
	run -0 --separate-stderr incise train all.csv --group cut --check 0.3 -o m.fis
	[ "${lines[0]}" = "all.csv: 192 pairs to train (4 cuts), 96 to check (2 cuts)" ]
	[ "${lines[1]}" = "left out 96 of 384 rows: the blade did not advance" ]
	# the model is that of the others alone
	incise train pairs.csv --group cut --check 0.3 -o other.fis >out
	cmp <(parameters m.fis) <(parameters other.fis)
	run ! grep -q "left out" out
	incise train all.csv -o m.fis --overwrite --json >r.json
	[ "$(key r.json pairs)" = 288 ]
	[ "$(key r.json left_out)" = 96 ]
	incise train pairs.csv -o m.fis --overwrite --json >r.json
	[ "$(key r.json left_out)" = 0 ]
	# what is left out may hold anything
	run --separate-stderr incise train all.csv -o n.fis --all-rows
	failed_with all.csv "not finite"
	sed -i 's/nan/0.0/' all.csv
	incise train all.csv -o m.fis --overwrite --all-rows --json >r.json
	[ "$(key r.json pairs)" = 384 ]
	[ "$(key r.json left_out)" = 0 ]
	sed -i 's/,1$/,0/' all.csv
	run --separate-stderr incise train all.csv -o n.fis
	failed_with all.csv "all 384 rows" advancing
	[ ! -e n.fis ]
}

@test "train without check pairs" {
	incise train pairs.csv -o m.fis --json >r.json 2>/dev/null
	[ "$(key r.json train.pairs)" = 288 ]
	[ -z "$(key r.json check)" ] # null
	[ "$(key r.json train_groups)" = 6 ]
}

@test "train reads standard input, grouped as the file is, and writes standard output" {
	incise train pairs.csv --seed 2 -o a.fis 2>/dev/null
	incise train - --seed 2 -o - <pairs.csv >b.fis 2>/dev/null
	cmp <(parameters a.fis) <(parameters b.fis)
	incise train <(cat pairs.csv) --mf 2,2 -o c.fis --overwrite | grep -q "^grouped by cut"
	run --separate-stderr incise train - -o c.fis --overwrite < <(sed '5s/^/x,/' pairs.csv)
	failed_with "standard input:5:"
}

@test "train writes the first model and the history" {
	incise train pairs.csv --search classic --check 0.5 --epochs 7 -o m.fis -o first.initial.fis \
		-o epochs.csv --json >r.json 2>/dev/null
	[ "$(head -n 1 epochs.csv)" = epoch,train_rmse,check_rmse ]
	[ "$(tail -n 1 epochs.csv | cut -d, -f1)" = "$(key r.json epochs)" ]
	# the report's errors are those of the epoch that was kept
	row=$(awk -F, -v best="$(key r.json best_epoch)" '$1 == best' epochs.csv)
	holds "($(cut -d, -f2 <<<"$row") / $(key r.json train.rmse_N) - 1)^2 < 1e-18"
	holds "($(cut -d, -f3 <<<"$row") / $(key r.json check.rmse_N) - 1)^2 < 1e-18"
	# evenly spaced centres, no consequents yet
	[ "$(sed -n "/^.Input2/,/^.Output1/s/^MF[0-9]='[^']*':'gaussmf',\[[^ ]* \(.*\)\]/\1/p" first.initial.fis |
		awk '{ printf "%.3f ", $1 }')" = "0.000 16.667 33.333 50.000 " ]
	[ "$(grep -c "'linear',\[0 0 0\]" first.initial.fis)" -eq 20 ]
	run ! cmp -s first.initial.fis m.fis
}

@test "train takes other columns, shapes and kinds" {
	sed '1s/.*/cut,a,b,torque_mNm/' pairs.csv >other.csv
	incise train other.csv --inputs b,a --target torque_mNm --mf 2,3 --search type=gbellmf \
		-o m.fis --json >r.json 2>/dev/null
	[ "$(key r.json rules)" = 6 ]
	holds "$(key r.json train.rmse_mNm) > 0"
	holds "$(key r.json train.mse_mNm2) > 0"
	[ "$(grep -c "':'gbellmf'" m.fis)" -eq 5 ]
	[ "$(sed -n "s/^Name='\(.*\)'/\1/p" m.fis | tail -n 3 | tr '\n' ' ')" = "b a torque_mNm " ]
	incise train other.csv --inputs a --target torque_mNm -o one.fis 2>/dev/null
	[ "$(grep -c gaussmf one.fis)" -eq 3 ]
}

# bats test_tags=check
@test "train warns where a baseline is better and where data are thin" {
	# a plane with noise: linear regression is right, and 78 parameters are too many
	awk -v OFS=, 'BEGIN { print "depth_mm,velocity_mm_s,force_N"
		for (i = 0; i < 90; i++) { x = i * 37 % 90; y = i * 41 % 90
			print x, y, x + 2 * y + 30 * ((i * 7919 % 1000) / 1000 - 0.5) } }' >flat.csv
	run -0 --separate-stderr incise train flat.csv --check 0.3 --search classic -o m.fis
	[[ "$stderr" == *"warning: linear regression predicts the check data better"* ]]
	[[ "$stderr" == *"training pairs for 78 parameters"* ]]
	[ -s m.fis ]
}

@test "train warns of rules that the data never reach" {
	# depth and velocity in step: half of the grid is empty
	awk -v OFS=, 'BEGIN { print "depth_mm,velocity_mm_s,force_N"
		for (i = 0; i < 400; i++) print i / 20, i / 8, i / 200 }' >step.csv
	incise train step.csv -o m.fis --json >r.json 2>err
	grep -q "rules never fire in the data" err
	# how many depends on where the functions have gone; the far corners stay empty
	holds "$(key r.json rules_unfired) >= 2"
}

@test "train writes the standard deviation beside the model, and checks it" {
	run -0 --separate-stderr incise train pairs.csv --group cut --check 0.3 -o m.fis
	[ -s m.fis.sd ]
	[[ "$output" == *"95 % interval: noise 0."*" N (wide: only 4 cuts), holds "*" % of the unseen cuts ("*" % of the thirds by depth_mm), "*" % of the worst cut"* ]]
	incise train pairs.csv --group cut --check 0.3 -o n.fis --json >r.json 2>/dev/null
	cmp m.fis.sd n.fis.sd
	# two cuts only, and they may be the outermost of the six
	holds "$(key r.json interval95_coverage) > 0.6 && $(key r.json interval95_coverage) <= 1"
	# the file holds the noise reported; JSON has fewer digits
	holds "($(sed -n 's/^noise //p' m.fis.sd) / $(key r.json noise_N) - 1)^2 < 1e-16"
	# what the report says is what eval says
	sed 1d pairs.csv | cut -d, -f2,3 | incise eval m.fis --uncertainty total >all
	[ "$(wc -l <all)" -eq 288 ]
	awk '$2 < '"$(sed -n 's/^noise //p' m.fis.sd)"' / 20 { exit 1 }' all
	holds "$(key r.json 'interval95_thirds[2]') <= 1 && $(key r.json interval95_least_group) >= 0"
}

@test "train leaves no standard deviation where there is no place beside the model" {
	incise train pairs.csv --mf 2,2 -o - >out 2>/dev/null
	incise train pairs.csv --mf 2,2 -o /dev/null >out2 2>/dev/null
	[ "$(ls -A)" = "$(printf '%s\n' out out2 pairs.csv)" ]
	[ ! -e /dev/null.sd ]
}

@test "train --search sample=N sets how many pairs the search uses" {
	awk -v OFS=, 'BEGIN { print "depth_mm,velocity_mm_s,force_N"
		for (i = 0; i < 5000; i++) { d = i * 7919 % 2011 / 100; v = i * 104729 % 5021 / 100
			print d, v, d * 0.1 + v * d * 0.001 } }' >some.csv
	# three pairs for each consequent of a rule at least: 3 · 4 · 3
	for sample in :3000 10:36 4000:4000 0:5000; do
		# shellcheck disable=SC2086 # none where there is none
		incise train some.csv --mf 2,2 $([ -z "${sample%:*}" ] || echo "--search sample=${sample%:*}") \
			-o m.fis --overwrite --json >r.json 2>/dev/null
		[ "$(key r.json pairs_tuned)" = "${sample#*:}" ] || complain "$sample: $(key r.json pairs_tuned)" || return
		[ "$(key r.json pairs)" = 5000 ]
	done
	grep -q '^% incise: options: .* --search sample=0' m.fis
}

# The largest resident memory of a command, in kB. Address space is no measure of it: a library
# may map what it never touches.
peak_kb() {
	ASAN_OPTIONS=$ASAN_OPTIONS:quarantine_size_mb=1 python3 - "$@" <<-'END'
		import resource, subprocess, sys
		subprocess.run(sys.argv[1:], check=True, stdout=open("r.json", "w"), stderr=subprocess.DEVNULL)
		print(resource.getrusage(resource.RUSAGE_CHILDREN).ru_maxrss)
	END
}

@test "train takes a million pairs in the memory of a few" {
	awk -v OFS=, 'BEGIN { print "cut,depth_mm,velocity_mm_s,force_N"
		for (i = 0; i < 1000000; i++) { d = i * 7919 % 20011 / 1000; v = i * 104729 % 50021 / 1000
			print "c" int(i / 20000), d, v, d * 0.1 + v * d * 0.001 } }' >many.csv
	awk -F, 'NR == 1 || ++n[$1] <= 200' many.csv >some.csv
	few=$(peak_kb incise train some.csv --group cut --check 0.3 -o m.fis --json)
	[ "$(key r.json train.pairs)" = 7000 ]
	all=$(peak_kb incise train many.csv --group cut --check 0.3 -o m.fis --overwrite --json)
	# a million rows of three numbers and a cut are 32 MB
	[ $((all - few)) -lt 16000 ] || complain "10000 pairs: $few kB, a million: $all kB"
	[ "$(key r.json pairs_tuned)" = 3000 ]
	[ "$(key r.json train.pairs)" = 700000 ]
	# d·v lies within reach of rules that are planes: 20 of them come close
	holds "$(key r.json check.r2) > 0.9999"
}

@test "train: a constant output is learnt" {
	awk -F, 'NR > 1 { $4 = 0.7 } 1' OFS=, pairs.csv >flat.csv
	incise train flat.csv -o m.fis 2>/dev/null
	# consequents are shrunk by the ridge towards the mean, which is the constant
	force=$(echo '7 13' | incise eval m.fis)
	holds "($force - 0.7)^2 < 1e-12"
}

# bats test_tags=check
@test "train: fewer pairs than parameters" {
	head -n 60 pairs.csv >bad.csv # 59 pairs, 60 consequent parameters
	refuses "59 training pairs" "60 consequent parameters"
	head -n 61 pairs.csv >enough.csv
	incise train enough.csv -o m.fis 2>/dev/null
	[ -s m.fis ]
}

# bats test_tags=check
@test "train: three pairs say nothing" {
	sed -n '1p;2p;60p;150p' pairs.csv >bad.csv
	run --separate-stderr incise train bad.csv --mf 1,1 -o m.fis
	failed_with bad.csv "3 training pairs" "at least 5"
	run --separate-stderr incise train bad.csv --mf auto -o m.fis
	failed_with bad.csv "3 training pairs"
	[ ! -e m.fis ]
}

@test "train replaces the data's neighbour and keeps odd names" {
	cp pairs.csv "my pairs, 100% #1.csv"
	incise train "my pairs, 100% #1.csv" --mf 2,2 -o "my model's.fis" 2>/dev/null
	[ -s "my model's.fis" ]
}

@test "train refuses a target that no double spans, and is quiet about rounding" {
	awk 'BEGIN { OFS = ","; print "depth_mm,velocity_mm_s,force_N"
		for (i = 0; i < 100; i++) print i % 10, i, (i % 2 ? "" : "-") "1.7e308" }' >max.csv
	run --separate-stderr incise train max.csv --mf 2,2 -o m.fis
	failed_with max.csv force_N "scale it"
	[ ! -e m.fis ]
	awk 'BEGIN { OFS = ","; print "depth_mm,velocity_mm_s,force_N"
		for (i = 0; i < 900; i++) print i % 30, int(i / 30), 5 }' >flat.csv
	run -0 --separate-stderr incise train flat.csv --mf 2,2 -o m.fis
	[[ "$stderr" != *"predicts its own data better"* ]]
}

# bats test_tags=check
@test "rows that repeat others count once, and are on one side of a check" {
	awk 'BEGIN { print "depth_mm,velocity_mm_s,force_N"
		for (i = 0; i < 60; i++) {
			d = (i * 7919) % 1000 / 50; v = (i * 104729) % 997 / 20
			for (k = 0; k < 10; k++)
				printf "%.4f,%.4f,%.4f\n", d, v, 0.05 * d + (i * 1299709) % 1000 / 1000
		} }' >repeated.csv
	run --separate-stderr incise train repeated.csv --check 0.3 --mf 5,4 -o m.fis
	failed_with repeated.csv "42 training pairs cannot determine the 60 consequent" \
		"540 of 600 rows repeat another row"
	incise train repeated.csv --check 0.3 --mf 2,2 -o m.fis --json >r.json 2>/dev/null
	[ "$(key r.json repeated) $(key r.json pairs)" = "540 600" ]
	# the force has noise of 0.29 N, which no model can know of unseen rows
	awk -v error="$(key r.json check.rms_error_N)" 'BEGIN { exit !(error > 0.15) }'
}

@test "pairs are grouped by a column cut, unless --group says otherwise" {
	made_pairs >pairs.csv
	incise train pairs.csv --mf 2,2 -o m.fis >out 2>/dev/null
	grep -q "288 pairs to train (6 cuts)" out
	grep -q "^grouped by cut" out
	incise train pairs.csv --mf 2,2 --group cut -o n.fis >out 2>/dev/null
	run ! grep -q "^grouped by" out
	cmp m.fis n.fis
	sed '1s/$/,day/; 2,$s/$/,1/' pairs.csv >day.csv
	run -0 --separate-stderr incise train day.csv --mf 2,2 --group day -o n.fis --overwrite
	[ "${lines[0]}" = "day.csv: 288 pairs to train (1 group)" ]
	[[ "$stderr" == *"--group day: all pairs are of one group"* ]]
	incise train pairs.csv --mf 2,2 --group none -o n.fis --overwrite --json >r.json 2>/dev/null
	[ -z "$(key r.json group)" ] && [ "$(key r.json train_groups)" = 0 ]
	run ! cmp -s m.fis n.fis
	# not where a source has none
	sed 's/^cut/number/' pairs.csv >plain.csv
	incise train pairs.csv plain.csv --mf 2,2 -o n.fis --overwrite >out 2>/dev/null
	run ! grep -q "cuts" out
}

# bats test_tags=check
@test "train names a third input that is better on unseen cuts, and the command" {
	local name="it's slow.csv"
	awk 'BEGIN { print "cut,depth_mm,velocity_mm_s,time_in_tissue_s,force_N"
		for (c = 0; c < 12; c++) for (i = 0; i < 25; i++) {
			v = 5 + 2 * c; t = i * 0.4 / v
			print "c" c "," i * 0.4 "," v + (i * 7 + c) % 5 "," t "," \
				(0.1 * i + 0.02 * v) * exp(-2 * t) + 0.02 * ((i * 31 + c * 17) % 7) } }' >"$name"
	incise train "$name" -o m.fis >out 2>/dev/null
	command=$(sed -n 's/^with time_in_tissue_s the .* less (it may only reflect how the hand moved .*): //p' out)
	[ "$command" = "incise train --inputs depth_mm,velocity_mm_s,time_in_tissue_s --overwrite 'it'\\''s slow.csv' -o m.fis" ]
	incise train - -o p.fis <"$name" 2>/dev/null | grep -q ': give --inputs depth_mm,velocity_mm_s,time_in_tissue_s$'
	incise train "$name" -o n.fis --json >r.json 2>/dev/null
	[ "$(key r.json better_inputs)" = '["depth_mm","velocity_mm_s","time_in_tissue_s"]' ]
	cmp <(parameters m.fis) <(parameters n.fis)
	error=$(key r.json better_inputs_rms_error_N)
	holds "$error < 0.95 * $(key r.json crossval_rms_error_N)"
	# the command leads to that error
	eval "$command --json" >better.json 2>/dev/null
	holds "($(key better.json crossval_rms_error_N) - $error)^2 < 1e-18"
	[ -z "$(key better.json better_inputs)" ]
}
