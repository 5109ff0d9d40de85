# SPDX-License-Identifier: GPL-2.0-or-later
# Error over run time for two springs, and over the stiffness with steps of 1 ms.
names = "explicit_euler semi_implicit_euler implicit_euler trapezoid rk4 exact_zoh plant"
titles = "'explicit Euler' 'semi-implicit Euler' 'implicit Euler' trapezoid RK4 \
'exact, a matrix (ZOH)' 'exact, plant with events'"
diverged = 10 # its place on the axis
set style line 6 lc rgb ink lw 1.5
set style line 7 lc rgb grey lw 1.5
set multiplot layout 1,3 title "Integrators of a mass on a spring: 50 g, ratio of damping 0.1" \
	font large

set logscale xy
set format xy '10^{%L}'
set yrange [1e-17:diverged * 3]
set ylabel 'largest error / largest place'
set xlabel 'run time for 1 ms of motion / ns'
set xrange [2:30000]
set key off
error(none) = column("max_error") < diverged ? \
	(column("max_error") > 1e-16 ? column("max_error") : 1e-16) : none
do for [K in "1000 100000"] {
	set title K eq "1000" ? '1 kN/m, steps from 1 ms down' \
		: '100 kN/m, from the largest step that holds'
	plot for [i=1:5] data index word(names, i).' '.K using "ns_per_ms":(error(NaN)) \
			with linespoints ls i pt 7 ps 0.7, \
		for [i=6:7] data index word(names, i).' '.K using "ns_per_ms":(error(NaN)) \
			with points ls i pt 7 ps 1.5
	set ylabel ''
}
set key on at graph 0.97, graph 0.6 right samplen 2
set title 'steps of 1 ms; at the top: diverged'
set xlabel 'stiffness / (N/m)'
set xrange [5:2e9]
plot for [i=1:7] more index word(names, i) using "K_N_m":(error(diverged)) \
	with linespoints ls i pt 7 ps 0.7 title word(titles, i)
unset multiplot
