# SPDX-License-Identifier: GPL-2.0-or-later
# Stiff walls: displacement, motion at the end and force over the stiffness, by path.
do for [path in data_path] {
	stats data index path using "theory_limit_N_m" nooutput
	n = path eq "plan" ? 1 : 2
	set arrow n from STATS_max, graph 0 to STATS_max, graph 1 nohead dt 2 lc 2 * n
	set label n sprintf("limit of the %s", path) at STATS_max, graph 0.06 left \
		offset 0.5,0 textcolor lt 2 * n
}
set multiplot layout 3,1 title "Stiff walls: 50 g, 0.01 N s/mm, pressed by 1 N, behind a limit of 4 N; 12 s at 1 kHz"
set logscale xy
set format x '%.0e'
set xrange [7:1.5e9]
set xlabel 'stiffness of the wall / (N/m)'
set lmargin 12
set bmargin 4
set key inside top right
least(y) = y < 1e-9 ? 1e-9 : y
titles = "'largest displacement / mm' 'motion in the last quarter / mm' 'largest force / N'"
columns = "largest_mm late_mm largest_N"
array low[3] = [0.5, 1e-9, 0.5]
array high[3] = [200, 20, 8]
do for [k=1:3] {
	set ylabel word(titles, k)
	set yrange [low[k]:high[k]]
	set format y k == 2 ? '%.0e' : '%g'
	if (k > 1) { set key off }
	plot for [i=1:2] data index word(data_blocks, i) \
		using "K_N_m":(least(column(word(columns, k)))) with linespoints \
		lc 2 * i pt 7 ps 0.8 title word(data_blocks, i)
}
unset multiplot
