# SPDX-License-Identifier: GPL-2.0-or-later
# Averaged normals: what is smooth is late. Grids of heights: the error over the size of a cell.
layout = panels(95, 30, below(1), above(2), 95, 0)
set multiplot layout 1,2 @layout \
	title sprintf("Normals of a mesh averaged over ticks of 1 ms; heights of a mesh\n%s, %s", cpu, kernel) noenhanced
set logscale xy
set key off
set title '(a) averaged normals; number of ticks'
set xlabel 'lag of the direction of the force / ms'
set ylabel 'ripple of it from tick to tick / mrad'
stats data using "lag_ms" prefix "lag" nooutput
stats data using "ripple_mrad" prefix "ripple" nooutput
set xrange [lag_min / 1.3:lag_max * 1.6]
set yrange [ripple_min / 1.5:ripple_max * 1.5]
eval 'set xtics ('.log_tics(lag_min / 1.3, lag_max * 1.6).')'
eval 'set ytics ('.log_tics(ripple_min / 1.5, ripple_max * 1.5).')'
plot data using "lag_ms":"ripple_mrad" with linespoints lt 1, \
	data using "lag_ms":"ripple_mrad":(strcol("average_ticks")) with labels left offset 0.8,0.5 font small
set title '(b) heights; points: run time of a place'
set xlabel 'cell of the grid / mm'
set ylabel 'largest error of the force / N'
unset logscale
set autoscale
stats more using "cell_mm" prefix "cell" nooutput
stats more using "force_error_N" prefix "force" nooutput
set logscale xy
set xrange [cell_min / 1.6:cell_max * 2.5]
set yrange [force_min / 1.5:force_max * 1.5]
eval 'set xtics ('.log_tics(cell_min / 1.6, cell_max * 2.5).')'
eval 'set ytics ('.log_tics(force_min / 1.5, force_max * 1.5).')'
plot more index "grid" using "cell_mm":"force_error_N" with linespoints lt 2, \
	more index "grid" using "cell_mm":"force_error_N":(sprintf("%.0f ns", column("ns"))) \
		with labels left offset 0.8,0.5 font small, \
	more index "mesh" using (cell_min / 1.6):"force_error_N":(cell_max * 4):(0) with vectors nohead lt 7 dt 2, \
	more index "mesh" using (cell_min / 1.5):"force_error_N":(sprintf("the mesh itself, %.0f ns", column("ns"))) \
		with labels left offset 0,0.6 font small
unset multiplot
