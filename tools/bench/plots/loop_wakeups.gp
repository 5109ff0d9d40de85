# SPDX-License-Identifier: GPL-2.0-or-later
# Lateness of the loop and of cyclictest: a column of histograms for each rate.
both = strstrt(data_blocks, "cyclictest") > 0
rows = words(data_load)
layout = panels(90, 20, below(both), above(2) + line_px, 40, 4.4 * line_px)
set multiplot layout rows,words(data_rate_hz) columnsfirst @layout \
	title sprintf("Lateness of the loop's \
wake-ups%s\n%s, %.3g s each", both ? ", and of cyclictest next to it" : "", policy, seconds) noenhanced
stats more using (column("y") > 0 ? column("x") : NaN) nooutput
set logscale xy
set xrange [STATS_min / 1.5:STATS_max * 2]
set yrange [least:1]
set format y power
if (STATS_max / STATS_min < 1e3) { eval 'set xtics ('.log_tics(STATS_min / 1.5, STATS_max * 2).')' } else { set format x power }
set ylabel 'share of wake-ups / 1'
set style fill solid noborder
set key off
share(none) = column("y") > 0 ? column("y") : 1e-9
do for [b=1:words(data_blocks)] {
	# "1000 idle 99.9 %: 155 µs, cyclictest 101 µs"
	block = word(data_blocks, b)
	name = word(block, 1).' '.word(block, 2)
	peer = strstrt(block, "cyclictest") > 0
	set xlabel b % rows == 0 ? 'lateness / µs' : ''
	if (b == rows + 1) { unset ylabel; set format y '' }
	set title sprintf("%g kHz, %s\n%s", word(block, 1) / 1e3, word(block, 2), \
		block[strlen(name) + 2:*]) font small
	histogram = "more index name.' loop' using 'x':(share(0)) with fillsteps fc rgb sky"
	peers = "more index name.' cyclictest' using 'x':(share(0)) with steps lt 2"
	eval 'plot '.histogram.(peer ? ', '.peers : '')
}
if (both) {
	eval key_panel
	plot NaN with boxes fc rgb sky title 'loop', NaN with lines lt 2 title 'cyclictest'
}
unset multiplot
