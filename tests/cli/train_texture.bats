# SPDX-License-Identifier: GPL-2.0-or-later
# incise train --texture: the saw-tooth of simulated tissue, as it is described and drawn; what is refused.

load cli

# Teeth of 1.5 mm on the mean, 20 %, in tissue that varies by 10 % from cut to cut.
tissue=sim:clock=simulated,cut_s=4,pause_s=0.1,times=4,force_hz=1000

setup_file() {
	cd "${BATS_FILE_TMPDIR:?}"
	incise capture -o tooth.rec --rig $tissue --camera off >/dev/null 2>&1
	incise capture -o smooth.rec --rig $tissue,tooth=0 --camera off >/dev/null 2>&1
	incise train tooth.rec --texture -o t.fis >out 2>/dev/null
	incise export tooth.rec -o raw.csv >/dev/null 2>&1
}

setup() {
	work_folder
	cp -r "$BATS_FILE_TMPDIR"/{tooth.rec,smooth.rec,raw.csv,out} "$BATS_FILE_TMPDIR"/t.fis* .
}

# bats test_tags=check
@test "train learns the saw-tooth of a recording" {
	grep -qE "^6 rules, " out
	grep -q "smooth model .* --mf" out
	grep -qE "^texture over the way in mm, of [0-9]+ events in 4 cuts" out
	[ "$(tail -n 1 out)" = "wrote t.fis, t.fis.sd and t.fis.tex" ]
	incise info t.fis --json | jq .texture >a.json
	incise info t.fis.tex --json | jq .texture >b.json
	cmp a.json b.json
	incise info t.fis | grep -qx "$(grep "events per mm" out)"
	# A tear each 1.5 mm of the path, of which the way is the sum of depth and length; of a fall from 1.2 to 0.8
	# the sensor's noise and the mean over a cell leave some.
	rate=$(jq .recorded.rate a.json)
	holds "$rate > 0.5 / 1.5 * 1.4142 && $rate < 1.1 / 1.5"
	drop=$(jq '.recorded.drop_deciles[4]' a.json)
	holds "$drop > 0.27 && $drop < 1.1 / 3"
	# Rendered, to a fifth; the spectrum is nearer than without.
	holds "$(jq .rendered.rate a.json) / $rate > 0.8 && $(jq .rendered.rate a.json) / $rate < 1.25"
	holds "$(jq .spectrum_error_dB a.json) < 0.5 * $(jq .without_texture_error_dB a.json)"
	holds "$(jq .most a.json) <= 0.9"
	# the same file again
	incise train tooth.rec --texture -o u.fis >/dev/null 2>&1
	cmp t.fis.tex u.fis.tex
}

@test "a raw export has the same texture as its recording" {
	incise train raw.csv --texture -o c.fis --json 2>/dev/null | jq .texture >c.json
	incise info t.fis.tex --json | jq .texture >r.json
	[ "$(jq .cuts c.json)" = "$(jq .cuts r.json)" ]
	# numbers of a CSV are rounded, so that an event may be one or none
	events=$(jq .events r.json)
	holds "($(jq .events c.json) - $events)^2 <= (0.02 * $events + 1)^2"
	# without the way, the largest depth is it: the cut along the skin is no new tissue
	awk -F, -v OFS=, '/^#/ { next } { NF--; print }' raw.csv >depth.csv
	run -0 --separate-stderr incise info --dataset depth.csv
	run --separate-stderr incise train depth.csv --texture -o d.fis --json
	[ "$status" -eq 1 ] || holds "$(jq .texture.length <<<"$output") < 0.5 * $(jq .length r.json)"
}

@test "a figure shows the tape, the drops and the spectrum" {
	command -v gnuplot >/dev/null || skip "gnuplot is not installed"
	incise plot t.fis.tex -o t.svg >/dev/null
	python3 "$root/tests/cli/figures.py" t.svg
	for text in "way / mm" "drop / %" "frequency / (1/mm)" recorded rendered; do
		grep -qF ">$text<" t.svg || complain "no $text"
	done
}

# Training fails, says these texts, and leaves no file of a model.
refuses() {
	local source=$1
	shift
	run --separate-stderr incise train "$source" --texture -o bad.fis
	failed_with "$@" || return
	[ -z "$(ls bad.fis* 2>/dev/null)" ] || complain "left: $(ls bad.fis*)"
}

@test "train refuses sources without a texture" {
	refuses smooth.rec events 20 || return
	grep -v '^#' raw.csv >rows.csv
	sed '1s/cut,/stroke,/' rows.csv >x.csv
	refuses x.csv x.csv cut stroke || return
	{ head -n 1 rows.csv; tail -n +2 rows.csv | sort -t, -k1,1 -k3,3g; } >x.csv
	refuses x.csv x.csv t_s order || return
	incise export tooth.rec --average 12x10,by-cut,count=5 -o mean.csv >/dev/null 2>&1
	refuses mean.csv mean.csv means count
}

# bats test_tags=check
@test "train refuses options that a texture cannot have" {
	local wrong
	for wrong in "--rate 100 -o m.fis" "--share mpi -o m.fis" "--premises t.fis -o m.fac" "-o -"; do
		# shellcheck disable=SC2086
		run --separate-stderr incise train raw.csv --texture $wrong
		bad_usage --texture || return
	done
	for wrong in "--mf 3,2" "--inputs depth_mm"; do
		# shellcheck disable=SC2086
		run --separate-stderr incise train raw.csv -o u.fis.tex $wrong
		bad_usage u.fis.tex "${wrong%% *}" || return
	done
}

@test "a texture belongs to its model" {
	incise train tooth.rec --check 0.5 -o t.fis --overwrite 2>&1 >/dev/null | grep -q "t.fis.tex .*--texture"
	run -0 --separate-stderr incise info t.fis
	[[ "$stderr" == *t.fis.tex:2:*stale* ]] || complain "$stderr"
	run --separate-stderr incise provenance t.fis.tex
	failed_with t.fis.tex .tex
	run --separate-stderr incise eval t.fis.tex
	failed_with t.fis.tex texture
	# It is an input with its model, and is not overwritten as another one's.
	run --separate-stderr incise compile t.fis -o t.fis.tex --overwrite
	failed_with t.fis.tex input
}
