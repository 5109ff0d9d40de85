# SPDX-License-Identifier: GPL-2.0-or-later
# The largest difference of the force in each second between integers and double, a colour for each
# scene, and what is certified for it, dashed.
set title sprintf("Force computed in integers compared with double precision, along the same poses\n\
dashed: the certified bound\n%s, %s", cpu, kernel)
set logscale y
set format y '%g'
set xlabel 'time / s'
set ylabel 'largest difference within 1 s / mN'
set key outside right top
set yrange [*:*]
set autoscale xfix
plot for [i=1:words(data_block)] data index word(data_block, i) using "x":"y" \
		with lines lt i lw 0.8 title words_of(word(data_block, i)), \
	for [i=1:words(data_block)] data index word(data_block, i) using "x":"z" \
		with lines dt 2 lt i
