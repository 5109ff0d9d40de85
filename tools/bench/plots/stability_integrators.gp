# SPDX-License-Identifier: GPL-2.0-or-later
# Error over run time for two springs, and over the stiffness with steps of 1 ms.
names = "explicit_euler semi_implicit_euler implicit_euler trapezoid rk4 exact_zoh plant"
titles = "'explicit Euler' 'semi-implicit Euler' 'implicit Euler' trapezoid RK4 \
'exact, matrix (ZOH)' 'exact, plant with events'"
diverged = 10 # its place on the axis
layout = panels(95, 30, below(3), above(1), 30, 0)
set multiplot layout 1,3 @layout \
	title "Integrators of a mass on a spring: 50 g, damping ratio 0.1" noenhanced
stats data using "ns_per_ms" nooutput
stats more using "K_N_m" prefix "K" nooutput
set logscale xy
set format y power
set format x '%g'
set yrange [1e-17:diverged * 3]
set ylabel 'largest error relative to the amplitude / 1'
set xlabel 'run time for 1 ms of motion / ns'
set xrange [STATS_min / 2:STATS_max * 2]
eval 'set xtics ('.log_tics(STATS_min / 2, STATS_max * 2).')'
set key off
error(none) = column("max_error") < diverged ? \
	(column("max_error") > 1e-16 ? column("max_error") : 1e-16) : none
do for [K in "1000 100000"] {
	set title K eq "1000" ? '(a) 1 kN/m, steps of 1 ms and less' \
		: '(b) 100 kN/m, from the largest stable step'
	plot for [i=1:5] data index word(names, i).' '.K using "ns_per_ms":(error(NaN)) \
			with linespoints lt i, \
		for [i=6:7] data index word(names, i).' '.K using "ns_per_ms":(error(NaN)) \
			with points lt i ps 1.2
	unset ylabel
	set format y ''
}
set key off
set title '(c) steps of 1 ms'
set xlabel 'stiffness / (N/m)'
set label 1 'diverged' at graph 0.02, first diverged * 0.3 font small
set xrange [K_min / 2:K_max * 2]
set xtics auto
set format x power
plot for [i=1:7] more index word(names, i) using "K_N_m":(error(diverged)) \
	with linespoints lt i
eval key_panel
set key maxcols 3
plot for [i=1:7] NaN with linespoints lt i title word(titles, i)
unset multiplot
