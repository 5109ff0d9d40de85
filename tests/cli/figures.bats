# SPDX-License-Identifier: GPL-2.0-or-later
# Figures, measured from their SVG by figures.py: no text leaves the canvas, no two overlap, each
# axis is labelled "quantity / unit", no legend entry is without data. Figures of the demo and of
# the report are measured where these are made, in demo.bats and bench_all.bats.

load cli

setup_file() {
	command -v gnuplot >/dev/null || skip "gnuplot is not installed, it draws the figures"
	cd "$BATS_FILE_TMPDIR"
	made_pairs >pairs.csv
	incise train pairs.csv -o m.fis 2>/dev/null
}

setup() {
	work_folder
	cp "$BATS_FILE_TMPDIR"/{pairs.csv,m.fis} .
}

measured() {
	[ $# -gt 0 ] && [ -s "$1" ] || complain "no figure: $*" || return
	python3 "$BATS_TEST_DIRNAME/figures.py" "$@"
}

# A figure of gnuplot with commands before its one plot, in the style of all.
figure() {
	printf '%s\n' 'ext = "svg"' 'load "style.gp"' 'set output "made.svg"' \
		'set xlabel "time / s"' 'set ylabel "force / N"' 'set xrange [0:1]' 'set key top left' "$@" 'unset output' >made.gp
	[ -e style.gp ] || cp "$root/tools/cli/style.gp" .
	gnuplot made.gp
}

# The check finds this in the figure made, and nothing else.
finds() {
	run python3 "$BATS_TEST_DIRNAME/figures.py" made.svg
	[ "$status" = 1 ] || complain "it found nothing" || return
	[[ "$output" == "made.svg: "$1 ]] || complain "$output"
}

# bats test_tags=check
@test "the check accepts a sound figure, and finds each fault of another" {
	figure 'plot x title "line"'
	measured made.svg
	figure 'set label "far out" at graph 0.99, graph 0.5 front' 'plot x'
	finds "'far out' leaves the canvas by *.* px"
	figure 'set label "one" at 0.5,0.2 front' 'set label "two" at 0.51,0.2 front' 'plot x'
	finds "'one' and 'two' overlap by *.* px"
	# a turned text next to an upright one
	figure 'set label "upright and long" at 0.5,0.2 front' \
		'set label "turned / s" at 0.55,0.15 rotate by 45 front' 'plot x'
	finds "'upright and long' and 'turned / s' overlap by *.* px"
	figure 'set label "in the way" at 0.5,0.5 center front' 'plot x'
	finds "data cross 'in the way'"
	figure 'set yrange [0:1]' 'plot 0.9 + 0.1 * sin(200 * x) title "over the key"'
	finds "data cross 'over the key'"
	# turned, and within a band that no line of it crosses
	figure 'set label "turned / s" at 0.5,0.45 rotate by 45 front' 'plot x title "line"'
	finds "data cross 'turned / s'"
	figure 'set label "in a band" at 0.3,0.5 center front' 'set yrange [0:1]' \
		'plot "+" using 1:(0.2):(0.8) with filledcurves title "band"'
	finds "data cross 'in a band'"
	figure 'set pointintervalbox 1' 'plot "+" every 50 using 1:1:(0.1) with yerrorbars'
	finds "* white discs hide data"
	figure 'plot "+" every 50 using 1:1:(0.1) with yerrorbars'
	measured made.svg
	figure 'set xlabel "time, s"' 'plot x'
	finds "the label 'time, s' is no 'quantity / unit'"
	figure 'set ylabel "force / lbf"' 'plot x'
	finds "the label 'force / lbf' is no 'quantity / unit'"
	figure 'unset ylabel' 'plot x'
	finds "the label of an axis is missing"
	figure 'plot x title "line", NaN with points title "ghost"'
	finds "the legend's 'ghost' has no data"
	figure 'set label "median 12 us" at 0.2,0.8 front' 'plot x'
	finds "'median 12 us' is in the form of a program"
	figure 'set format y "%.0e"' 'set yrange [1e-6:1e-5]' 'set ytics (1e-6)' 'plot 2e-6'
	finds "'1e?06' is in the form of a program"
	figure 'plot x title "fixed_table"'
	finds "'fixed_table' is in the form of a program"
}

@test "names of points are placed where they cover no other, nor a marker" {
	cat >points <<-'END'
		first_of_all 0.50 0.50
		second 0.51 0.50
		third_with_a_long_name 0.52 0.51
		fourth 0.50 0.49
		at_the_right_edge 0.99 0.5
		at_the_top 0.9 0.99
		below 0.1 0.01
	END
	figure 'eval name_margins' \
		'stats "points" using (name_point(words_of(strcol(1)), $2, $3, $2 - 0.02, $2 + 0.02, $3, $3)) nooutput' \
		'eval name_points' 'set yrange [0:1]' 'plot "points" using 2:3 with points lt 1'
	measured made.svg
	for name in "first of all" second "third with a long name" fourth "at the right edge" "at the top" below; do
		grep -q ">$name<" made.svg
	done
}

@test "tics of a logarithmic axis fit its range" {
	cp "$root/tools/cli/style.gp" .
	gnuplot -e "ext='svg'; load 'style.gp'; set print 'tics'; print log_tics(0.4, 30);
		print log_tics(1.2, 1.9); print log_tics(1e-3, 10); print log_tics(0.95, 5)"
	diff tics - <<-'END'
		0.5,1,2,5,10,20
		1.2,1.4,1.6,1.8
		0.001,0.01,0.1,1,10
		1,1.5,2,3,5
	END
}

@test "no script has colours of its own" {
	cd "$root"
	# a literal in a script, or as in a string of C
	pattern="[ \"]rgb(color)? *('|\\\\\")|#[0-9A-Fa-f]{6}"
	grep -qE "$pattern" <<<"plot x lc rgb 'red'"
	grep -qE "$pattern" tools/cli/style.gp
	run ! grep -nE "$pattern" tools/bench/plots/*.gp $(grep -l plot_begin tools/*.c tools/*/*.c)
}

@test "the style can be changed, and stays" {
	incise capture -o a.rec --rig sim:clock=simulated,times=1,pause_s=0.1 --duration 2s >/dev/null
	incise replay a.rec wall -o a.png >/dev/null
	sed -i "s/^blue = .*/blue = '#123456'/" plot/style.gp
	incise replay a.rec wall -o b.png >/dev/null
	grep -qi 'rgb( *18, *52, *86)' b.svg
	incise replay a.rec wall -o b.png --overwrite >/dev/null
	cmp plot/style.gp "$root/tools/cli/style.gp"
	(cd plot && gnuplot -e "ext='pdf'" a.gp)
	[ "$(head -c 5 a.pdf)" = %PDF- ]
}

@test "figures of a model, with few and many functions" {
	incise plot m.fis -o model.svg >/dev/null
	incise train pairs.csv --group none -o many.fis --mf 9,7 --epochs 1 2>/dev/null
	incise plot many.fis -o many.svg >/dev/null
	sed "s/'very_shallow'/'a name that is far too long for its place'/" m.fis >named.fis
	incise plot named.fis -o named.svg >/dev/null
	measured model.svg many.svg named.svg
	grep -q ">a name that is f…<" named.svg
}

@test "a figure of a replay, with and without a force" {
	incise capture -o a.rec --rig sim:clock=simulated,depth_mm=10,times=1,pause_s=0.1,cut_s=4 \
		--duration 3s >/dev/null
	smooth_liver
	cp m.fis liver.fis
	incise replay a.rec liver.scene -o replay.png >/dev/null
	measured replay.svg
	grep -q '>recorded<' replay.svg
}

@test "figures of calibrations" {
	calibrate() {
		incise calibrate "$1" "${@:3}" -o "$2" --overwrite </dev/null >/dev/null 2>&1
		measured "$2"/fit.svg "$2"/residuals.svg
	}
	sim=sim:clock=simulated
	calibrate force force --rig $sim,seed=5 --weights 50g,100g,200g,300g --zero
	calibrate tip tip --rig $sim,motion=1,tip_x_mm=3,tip_y_mm=-20,tip_z_mm=60 --duration 20s
	calibrate stepper stepper --rig $sim,bench=1,handle_friction_N=0,backlash_mm=0.04,stall_mm_s=9
	incise calibrate delay --rig $sim,motion=2 --duration 15s -o delay </dev/null >/dev/null
	measured delay/fit.svg
	awk 'BEGIN { print "depth_mm,length_px"; for (i = 0; i < 40; i++)
		printf "%.3f,%.3f\n", i / 2, 380 - i * 4 + 0.1 * ((i * 7919 % 101) / 101 - 0.5) - (i == 9) * 30 }' >p.csv
	calibrate depth depth line --from p.csv --nominal 0.125
	grep -q '>outliers<' depth/fit.svg
}
