# SPDX-License-Identifier: GPL-2.0-or-later
# Error of the force over the loop's rate, and over its cost: two lines for each wall and kind
# of poses.
set multiplot layout 1,2 title "Error of the force over a cut of some 3 N, against the exact \
force of a plain wall" font large
set logscale xy
set yrange [0.05:100]
set ylabel 'rms error / mN'
set xrange [200:10000]
set xlabel 'rate of the loop / Hz'
set xtics (250, 500, 1000, 2000, 4000, 8000)
set key bottom left Left reverse samplen 3 spacing 0.9
n = words(data_blocks)
block(i) = word(data_blocks, (i + 1) / 2)
mN(key) = 1e3 * column(key)
error(i) = mN(i % 2 ? "rms_N" : "rendered_rms_N")
name(i) = i % 2 ? word(block(i), 1).' N/mm, '.word(block(i), 2).' poses: asked for' : 'rendered'
do for [i=1:2*n] {
	set style line 10+i lc (i + 1) / 2 lw 1.5 \
		dt i % 2 ? 1 : 2 pt i % 2 ? 7 : 6 ps 0.8
}
plot for [i=1:2*n] data index block(i) using "rate_hz":(error(i)) \
		with linespoints ls 10+i title name(i), \
	data index block(1) using "rate_hz":(mN("hold_N")) with lines lc rgb ink lw 1 dt 3 \
		title word(block(1), 1).' N/mm, ideal sample and hold'
set xrange [*:*]
set xtics auto
set xlabel 'run time for a second of haptics / µs'
set key off
plot for [i=1:2*n] data index block(i) using (1e-3 * column("ns_per_s")):(error(i)) \
	with linespoints ls 10+i
unset multiplot
