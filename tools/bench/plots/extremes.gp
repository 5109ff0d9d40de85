# SPDX-License-Identifier: GPL-2.0-or-later
# Stiff walls: displacement, motion at the end and force over the stiffness, by path.
stats data using "K_N_m" nooutput
set xrange [STATS_min / 2:STATS_max * 2]
least(y) = y < 1e-9 ? 1e-9 : y
titles = "'largest displacement / mm' 'motion at the end / mm' 'largest force / N'"
columns = "largest_mm late_mm largest_N"
array low[3]
array high[3]
do for [k=1:3] {
	stats data using (least(column(word(columns, k)))) nooutput
	low[k] = STATS_min / 1.4
	high[k] = STATS_max * 1.4
}
do for [path in data_path] {
	stats data index path using "theory_limit_N_m" nooutput
	n = path eq "plan" ? 1 : 2
	set arrow n from STATS_max, graph 0 to STATS_max, graph 1 nohead dt 2 lw 1 lc rgb colour(n) back
	set label n sprintf("limit of the %s", path) at STATS_max, graph 1.06 center tc rgb colour(n) font small
}
layout = panels(90, 20, below(1), above(1), 0, 40)
set multiplot layout 3,1 @layout \
	title "Stiff walls: 50 g, 0.01 N s/mm, pressed by 1 N, behind a limit of 4 N; 12 s at 1 kHz" noenhanced
set logscale xy
set format x ''
set key off
do for [k=1:3] {
	set ylabel word(titles, k) offset screen 0
	set yrange [low[k]:high[k]]
	if (high[k] / low[k] > 1e4) { set format y power; set ytics auto } else {
		set format y '%g'; eval 'set ytics ('.log_tics(low[k], high[k]).')' }
	if (k == 2) { unset label }
	if (k == 3) { set format x power; set xlabel 'stiffness of the wall / (N/m)' }
	plot for [i=1:2] data index word(data_blocks, i) \
		using "K_N_m":(least(column(word(columns, k)))) with linespoints lt i
}
eval key_panel
plot for [i=1:2] NaN with linespoints lt i title word(data_blocks, i)
unset multiplot
