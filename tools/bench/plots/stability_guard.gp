# SPDX-License-Identifier: GPL-2.0-or-later
# Cases that come to rest, and how far the force is off, over the gain. A wide line is seen below
# a narrow one that runs over it.
n = words(data_guard)
wide(k) = 1.2 + 0.9 * (n - k)
large(k) = 0.8 + 0.18 * (n - k)
layout = panels(80, 20, below(2), above(1), 90, 0)
set multiplot layout 1,2 @layout \
	title "Guards in the real plan, with a late tracker and a late actuator" noenhanced
set xrange [0.95:2.05]
set xlabel 'gain relative to the largest accepted / 1'
set key off
do for [key in "rest_share error_share"] {
	rest = key eq "rest_share"
	set title rest ? "(a) cases that come to rest" : "(b) error of the force in a slow cut"
	set ylabel rest ? "share of the cases / 1" : "error relative to the force / 1"
	set yrange [0:*]
	plot for [k=1:n] data index word(data_guard, k) using "gain":(column(key)) \
		with linespoints lt k lw wide(k) ps large(k)
}
eval key_panel
plot for [k=1:n] NaN with linespoints lt k lw wide(k) ps large(k) title words_of(word(data_guard, k))
unset multiplot
