# SPDX-License-Identifier: GPL-2.0-or-later
# Uncertainties of training pairs, from the columns of a dataset to the parts of a prediction.

load cli

# Rigs a, b and c: 8 cuts each, with the parts of a calibrated rig. The gain of rig b is 4 % too large,
# that of c 4 % too small; its pairs state 2 %. No rand(): awks differ.
make_rigs() {
	local rig
	for rig in a b c; do
		awk -v rig=$rig 'BEGIN {
			print "cut,depth_mm,velocity_mm_s,force_N,force_u_gain_N,force_u_zero_N,force_u_noise_N," \
				"depth_u_tip_z_mm,depth_u_noise_mm,velocity_u_noise_mm_s"
			gain = rig == "a" ? 1 : rig == "b" ? 1.04 : 0.96
			for (cut = 1; cut <= 8; cut++)
				for (i = 1; i <= 40; i++) {
					d = (8 + cut) * i / 40
					v = 25 + 20 * sin(i / 4 + cut)
					f = gain * (1 + 0.03 * cos(5 * cut + length(rig))) * (0.1 * d + 0.01 * v)
					f += 0.01 * cos(97 * i + 31 * cut)
					printf "%s-%02d,%.4f,%.4f,%.5f,%.6f,-0.01,%.3f,-0.05,0.02,0.3\n", rig, cut, d, v, f,
						-0.02 * f, i % 4 ? 0.01 : 0.4
				}
		}' >$rig.csv
	done
}

setup() {
	work_folder
	make_rigs
}

train() {
	incise train "$@" --group cut --mf 2,2 >out 2>err || complain "$(cat err)"
}

@test "parts of the columns are in the model's interval, and a model without them is as before" {
	train a.csv b.csv c.csv -o m.fis
	grep -q "uncertainties: own parts .* N; calibrations .* N on the model, .* N of another rig" out
	grep -qx "common [1-9].*" m.fis.sd
	grep -q "^% incise: options: .* --uncertainty parts" m.fis
	printf '3 20\n8 30\n12 40\n' >points
	incise eval m.fis points --uncertainty parts >got
	awk 'NF != 6 || $6 < $5 * 0.1 || $6 > $2 { bad = 1 } { d = $2 ^ 2 - $3 ^ 2 - $4 ^ 2 - $5 ^ 2
		if (d > 1e-9 || d < -1e-9 || $5 < 0.015) { print; bad = 1 } } END { exit bad || NR != 3 }' got
	cut -d' ' -f1,2 got | diff - <(incise eval m.fis points --uncertainty total)
	incise eval m.fis points --uncertainty parts --json >r.json
	holds "($(key r.json 'rows[0].sd_calibration_N') - $(sed -n 1p got | cut -d' ' -f5))^2 < 1e-18"
	# none, and columns that are not there, give the same bytes
	for rig in a b c; do cut -d, -f1-4 $rig.csv >plain_$rig.csv; done
	train a.csv b.csv c.csv -o none.fis --uncertainty none
	train plain_a.csv plain_b.csv plain_c.csv -o plain.fis
	grep -v '^% incise' none.fis | diff - <(grep -v '^% incise' plain.fis)
	diff none.fis.sd plain.fis.sd
	grep -qx "common 0" plain.fis.sd
	incise eval plain.fis points --uncertainty parts | awk '$5 != 0 { exit 1 }'
}

# The nearest point within the ranges of m.fis, which a loop takes.
nearest() {
	incise info m.fis --json | jq -r --argjson d "$1" --argjson v "$2" \
		'[[$d, $v], .inputs] | transpose | map([([.[0], .[1].min] | max), .[1].max] | min) | join(" ")'
}

@test "plan and status give the force of a model with its uncertainty" {
	run_folder
	train a.csv b.csv c.csv -o m.fis
	printf 'model = "m.fis";\nlimits = { force_N = 2.0; };\n' >m.scene
	incise plan m.scene --json >r.json
	at="$(key r.json rest.depth_mm) $(key r.json rest.velocity_mm_s)"
	[ "${at%% *}" = "$(key r.json worst.depth_mm)" ]
	# shellcheck disable=SC2086 # two numbers
	nearest $at | incise eval m.fis --uncertainty parts >want
	holds "($(key r.json rest.force_N) - $(cut -d' ' -f1 want))^2 < 1e-12"
	holds "($(key r.json rest.sd_N) - $(cut -d' ' -f2 want))^2 < 1e-12"
	holds "($(key r.json rest.sd_calibration_N) - $(cut -d' ' -f5 want))^2 < 1e-12"
	incise plan m.scene | grep -q "the model where that one rests: .* N at .* mm and .* mm/s, u = .* N of a new cut (data"
	incise haptic m.scene --rig sim:clock=simulated --duration 1s --state m.state >/dev/null 2>&1
	incise status ./m.state --json >s.json
	nearest "$(key s.json 'loops[0].depth_mm')" "$(key s.json 'loops[0].velocity_mm_s')" |
		incise eval m.fis --uncertainty total >want
	holds "($(key s.json 'loops[0].model.sd_N') - $(cut -d' ' -f2 want))^2 < 1e-12"
	incise status ./m.state | grep -q "^model      .* N at .* mm"
	rm m.fis.sd
	incise status ./m.state --json >s.json
	[ -z "$(key s.json 'loops[0].model')" ]
}

@test "figures of models and of pairs have bands" {
	train a.csv b.csv c.csv -o m.fis
	incise plot m.fis -o m.svg
	for text in "95 % intervals" "a new cut on a new rig" "the mean of all cuts" output; do
		grep -q ">\(<!\[CDATA\[\)\?$text" m.svg || complain "no '$text'"
	done
	incise train a.csv b.csv c.csv --premises m.fis -o sums.fis >/dev/null 2>&1
	incise plot sums.fis -o sums.svg
	grep -q "a new cut on a new rig" sums.svg
	run ! grep -q "the mean of all cuts" sums.svg
	rm m.fis.sd
	incise plot m.fis -o plain.svg
	run ! grep -q "95 % intervals" plain.svg
	awk -F, -v OFS=, '{ print $0, NR == 1 ? "force_u_N" : 0.02 * $4 + 0.01 }' a.csv >u.csv
	incise plot u.csv -o u.svg
	grep -q "95 % by the uncertainty" u.svg
	sed '2,$s/,[^,]*$/,nan/' u.csv >nan.csv
	incise plot nan.csv -o nan.svg
	run ! grep -q "95 % by the uncertainty" nan.svg
}

# bats test_tags=check
@test "what cannot carry uncertainties is refused, and what lacks them is named" {
	train a.csv -o m.fis
	for way in "--search classic -o x.fis" "--premises m.fis -o x.fac" "--share mpi -o x.fis"; do
		# shellcheck disable=SC2086 # several words
		run --separate-stderr incise train a.csv b.csv $way
		bad_usage "cannot take uncertainties, which a.csv has; give --uncertainty none"
	done
	cut -d, -f1-4 b.csv >plain.csv
	fails incise train a.csv plain.csv -o x.fis -- "plain.csv:"
	run --separate-stderr incise train plain.csv --uncertainty parts -o x.fis
	failed_with "plain.csv:" "--uncertainty parts"
	sed '2,$s/-0.01,/nan,/' a.csv >nan.csv
	incise train nan.csv --group cut --mf 2,2 -o x.fis >/dev/null 2>err
	grep -q "nan.csv: its uncertainties are not all stated (nan), so none is used" err
	sed '9s/-0.01,/nan,/' a.csv >late.csv
	run --separate-stderr incise train late.csv --group cut -o y.fis
	[[ "$stderr" == *"late.csv:9: column 6 (force_u_zero_N): nan is not finite"* ]]
	incise capture -o r.rec --rig sim:clock=simulated,cut_s=2,pause_s=1 --duration 8s >/dev/null
	fails incise train r.rec --uncertainty parts -o z.fis -- "r.rec:" "is not stated: "
}

@test "recordings state the same as their export does" {
	cat >c.conf <<-'END'
		force_mV_N = 1230.0; tip_mm = [1.0, 0.0, -20.0]; surface_u_mm = 0.05;
		force_delay_ms = 0.0; force_delay_sd_ms = 0.02; tracker_delay_ms = 4.2; tracker_delay_sd_ms = 0.1;
		history = (
		{ kind = "force"; date = "2026-11-20T10:00:00Z"; pass = true;
		  values = ( { key = "force_mV_N"; left = 1230.0; u = 12.0; } ); },
		{ kind = "tip"; date = "2026-11-20T10:00:00Z"; pass = true; values = (
		  { key = "tip_x_mm"; left = 1.0; u = 0.03; }, { key = "tip_y_mm"; left = 0.0; u = 0.02; },
		  { key = "tip_z_mm"; left = -20.0; u = 0.04; } ); } );
	END
	incise capture -o r.rec -c c.conf --rig sim:clock=simulated,cut_s=2,pause_s=1,tip_x_mm=1,tip_z_mm=-20 --duration 14s >/dev/null
	incise export --no-lineage r.rec --rate 25 --uncertainty parts -o r.csv >/dev/null
	train r.rec --rate 25 --uncertainty parts -o rec.fis
	train r.csv -o csv.fis
	# the decimals of CSV: 5 of the force
	for model in rec csv; do
		echo '5 20' | incise eval $model.fis --uncertainty parts >$model.out 2>/dev/null
	done
	paste -d' ' rec.out csv.out | awk '{ for (i = 1; i <= 6; i++) { d = $i - $(i + 6)
		if (d > 1e-3 || d < -1e-3) { print; exit 1 } } }'
	grep -qx "common [1-9].*" rec.fis.sd
	# A calibration after the fact that is twice as uncertain is seen as such.
	sed 's/u = 12.0/u = 48.0/' c.conf >worse.conf
	incise recalibrate r.rec -c worse.conf >/dev/null
	train r.rec --rate 25 --uncertainty parts -o worse.fis
	worse=$(echo '5 20' | incise eval worse.fis --uncertainty parts 2>/dev/null | cut -d' ' -f5)
	holds "$worse > 1.2 * $(cut -d' ' -f5 rec.out)"
}
