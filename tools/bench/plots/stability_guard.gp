# SPDX-License-Identifier: GPL-2.0-or-later
# Cases that come to rest, and how far the force is off, over the gain.
set multiplot layout 1,2 title "guards in the real plan, late tracker and late actuator" font large
set xrange [0.95:2.05]
set xlabel 'gain / largest that is accepted'
set key bottom left Left reverse
do for [key in "rest_share error_share"] {
	set title key eq "rest_share" ? "cases that come to rest" : "error of the force in a slow cut"
	set ylabel key eq "rest_share" ? "share" : "share of the force"
	set yrange [0:*]
	if (key eq "error_share") { set key top left Left reverse }
	plot for [g in data_guard] data index g using "gain":(column(key)) \
		with linespoints pt 7 ps 0.7 title g
}
unset multiplot
