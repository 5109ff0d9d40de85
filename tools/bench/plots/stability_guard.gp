# SPDX-License-Identifier: GPL-2.0-or-later
# Distance and force with the guard; the caps that are bounded behind a late actuator.
set multiplot layout 1,3 title "50 g pressed on a wall that answers late. Not bounded: ".\
	unbounded font ',12'
set logscale xy
set xrange [0.8:300]
set xlabel 'stiffness of the wall / N/mm'
set key top left Left reverse
set style line 6 lc rgb '#555555' lw 1.5
do for [key in "largest_mm largest_N"] {
	set title key eq "largest_mm" ? "guard on: how far the hand is thrown" \
		: "guard on: how hard, without a clamp"
	set ylabel key eq "largest_mm" ? "largest way / mm" : "largest force / N"
	plot for [d=1:words(data_delay)] data index word(data_delay, d) using "K_N_mm":(column(key)) \
		with linespoints ls d pt 7 ps 0.7 title word(data_delay, d).' ticks late'
}
unset logscale x
set xrange [-0.5:5.5]
set yrange [0.008:3]
set title 'guard behind a late actuator'
set xlabel 'delay / ticks'
set ylabel 'cap / (m/T)'
set key bottom left
colour(verdict) = verdict eq "bounded" ? 0x2e8b57 : 0xc0392b
plot (x < 0 ? NaN : 2*sin(pi/(4*x+2))) with lines ls 1 title '2 sin(pi/(4d+2))', \
	share with lines dt 2 lc rgb 'black' title 'as built', \
	for [v in more_verdict] more index v using "delay":"share" with points \
		pt (v eq "bounded" ? 7 : 2) ps 1.4 lw 2 lc rgb colour(v) \
		title v eq "bounded" ? 'bounded at every stiffness' : 'grows at some'
unset multiplot
