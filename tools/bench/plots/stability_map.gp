# SPDX-License-Identifier: GPL-2.0-or-later
# Largest stable stiffness: a panel for each damping of the wall, a curve for each delay.
least = 1e-4
set multiplot layout 1,words(data_BT_m) title "Largest stable stiffness of a sampled wall\n\
lines computed, points simulated in time; stable below; triangle: none is" font large
set logscale xy
set xrange [5e-4:20]
set yrange [least:50]
set format xy '10^{%L}'

set xlabel "damping of the device, bT/m"
set key top left Left reverse
block(wall, delay) = sprintf("%s %s", wall, word(data_delay, delay))
# Nothing is stable: a triangle at the lower edge.
place(y) = y > least * 1.3 ? y : least * 1.3
do for [i=1:words(data_BT_m)] {
	w = word(data_BT_m, i)
	set title sprintf("damping of the wall BT/m = %s", w)
	set ylabel i == 1 ? "stiffness of the wall, KT^2/m" : ""
	plot for [d=1:words(data_delay)] more index block(w, d) using "x":"y" \
			with lines ls d title 'delay '.word(data_delay, d), \
		for [d=1:words(data_delay)] data index block(w, d) \
			using "bT_m":(place(column("sim_KT2_m"))):(column("sim_KT2_m") > 0 ? 7 : 11) \
			with points ls d pt variable ps 0.9
}
unset multiplot
