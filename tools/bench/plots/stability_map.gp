# SPDX-License-Identifier: GPL-2.0-or-later
# Largest stable stiffness: a panel for each damping of the wall, a curve for each delay.
least = 1e-4
walls = ''
delays = ''
has(list, value) = strstrt(list, " ".value." ") > 0
note(wall, delay) = (walls = has(" ".walls, wall) ? walls : walls.wall." ", \
	delays = has(" ".delays, delay) ? delays : delays.delay." ", 0)
stats data using (note(strcol("BT_m"), strcol("delay"))) nooutput
n = words(walls)
layout = panels(80, 20, below(1), above(2), 25, 0)
set multiplot layout 1,n @layout \
	title "Largest stable stiffness of a sampled wall, stable below\n\
lines: computed; markers: simulated; triangle downward: no stiffness is stable" noenhanced
set logscale xy
set xrange [5e-4:20]
set yrange [least:50]
set format xy power
set xlabel "device damping bT/m"
set key off
block(wall, delay) = sprintf("%s %s", wall, word(delays, delay))
# Nothing is stable: a triangle at the lower edge.
place(y) = y > least * 1.3 ? y : least * 1.3
marker(d) = int(word('7 5 9 13 6 4', d))
do for [i=1:n] {
	w = word(walls, i)
	set title sprintf("(%s) wall damping BT/m = %s", "abcdefgh"[i:i], w)
	set ylabel i == 1 ? "wall stiffness KT²/m" : ""
	plot for [d=1:words(delays)] more \
			using (strcol("block") eq block(w, d) ? column("x") : NaN):"y" with lines lt d, \
		for [d=1:words(delays)] data \
			using (strcol("BT_m") eq w && strcol("delay") eq word(delays, d) \
				? column("bT_m") : NaN):(place(column("sim_KT2_m"))): \
			(column("sim_KT2_m") > 0 ? marker(d) : 11) with points lt d pt variable ps 0.9
	set format y ''
}
eval key_panel
plot for [d=1:words(delays)] NaN with linespoints lt d pt marker(d) ps 0.9 \
	title 'delay of '.word(delays, d).(word(delays, d) eq "1" ? ' tick' : ' ticks')
unset multiplot
