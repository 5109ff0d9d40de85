# SPDX-License-Identifier: GPL-2.0-or-later
# Error of the force over the loop's rate, and over its cost: two lines for each wall and kind
# of poses.
n = words(data_blocks)
mN(key) = 1e3 * column(key)
error(i) = mN(i % 2 ? "rms_N" : "rendered_rms_N")
name(i) = sprintf("%s N/mm, %s poses: %s", word(block(i), 1), word(block(i), 2), i % 2 ? 'asked for' : 'rendered')
block(i) = word(data_blocks, (i + 1) / 2)
stats data using (1e3 * column("hold_N")) prefix "hold" nooutput
stats data using (1e3 * column("rms_N")) prefix "good" nooutput
stats data using (1e3 * column("rendered_rms_N")) prefix "bad" nooutput
stats data using (1e-3 * column("ns_per_s")) prefix "fast" nooutput
stats data using "rate_hz" prefix "rate" nooutput
low = (hold_min < good_min ? hold_min : good_min) / 1.4
high = (bad_max > good_max ? bad_max : good_max) * 1.4
layout = panels(80, 20, below(4), 1.8 * line_px + 10, 40, 0)
set multiplot layout 1,2 @layout \
	title "Error of the force in a cut of some 3 N, compared with the exact force of a plain wall" noenhanced
set logscale xy
set yrange [low:high]
set format y '%g'
set ylabel 'rms error of the force / mN'
set xrange [rate_min / 1.3:rate_max * 1.3]
set xlabel 'rate of the loop / Hz'
set xtics (250, 500, 1000, 2000, 4000, 8000)
set key off
do for [i=1:2*n] {
	set style line 10+i lc rgb colour((i + 1) / 2) lw 1.5 dt i % 2 ? 1 : 2 \
		pt int(word('7 6 5 4 9 8', i)) ps 0.8
}
plot for [i=1:2*n] data index block(i) using "rate_hz":(error(i)) \
		with linespoints ls 10+i, \
	data index block(1) using "rate_hz":(mN("hold_N")) with lines lc rgb ink lw 1 dt 3
set xrange [fast_min / 1.3:fast_max * 1.3]
eval 'set xtics ('.log_tics(fast_min / 1.3, fast_max * 1.3).')'
set xlabel 'run time for one second of the loop / µs'
unset ylabel
set format y ''
plot for [i=1:2*n] data index block(i) using (1e-3 * column("ns_per_s")):(error(i)) \
	with linespoints ls 10+i
eval key_panel
set key maxcols 2
plot for [i=1:2*n] NaN with linespoints ls 10+i title name(i), \
	NaN with lines lc rgb ink lw 1 dt 3 title word(block(1), 1).' N/mm, ideal sample and hold'
unset multiplot
