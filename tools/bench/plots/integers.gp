# SPDX-License-Identifier: GPL-2.0-or-later
# The largest difference of the force in each second between integers and double, a colour for each
# scene, and what is certified for it, dashed.
set title sprintf("Force in integers against double, along the same poses\n%s, %s", cpu, kernel) \
	font large
set logscale y
set format y '%g'
set xlabel 'time / s'
set ylabel 'largest difference in a second / mN'
set key outside right top Left reverse samplen 2
set yrange [1e-3:*]
set autoscale xfix
plot for [i=1:words(data_block)] data index word(data_block, i) using "x":"y" \
		with lines lw 1.3 lt i title word(data_block, i), \
	for [i=1:words(data_block)] data index word(data_block, i) using "x":"z" \
		with lines lw 1.3 dt 2 lt i \
		title word(data_block, i).', certified'
