# SPDX-License-Identifier: GPL-2.0-or-later
# Averaged normals: what is smooth is late.
set title sprintf("Normals of a mesh averaged over so many ticks of 1 ms: smooth or late\n%s, %s", cpu, kernel)
unset logscale
set key off
set xlabel 'lag of the direction of the force / ms'
set ylabel 'ripple of it from tick to tick / mrad'
stats data using "lag_ms" prefix "lag" nooutput
stats data using "ripple_mrad" prefix "ripple" nooutput
set logscale xy
set xrange [lag_min / 1.3:lag_max * 1.6]
set yrange [ripple_min / 1.5:ripple_max * 1.5]
eval 'set xtics ('.log_tics(lag_min / 1.3, lag_max * 1.6).')'
eval 'set ytics ('.log_tics(ripple_min / 1.5, ripple_max * 1.5).')'
plot data using "lag_ms":"ripple_mrad" with linespoints lt 1, \
	data using "lag_ms":"ripple_mrad":(strcol("average_ticks")) with labels left offset 0.8,0.5 font small
