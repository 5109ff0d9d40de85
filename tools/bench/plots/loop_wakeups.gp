# SPDX-License-Identifier: GPL-2.0-or-later
# Lateness of the loop and of cyclictest: a row of histograms for each rate.
set multiplot layout words(data_rate_hz),words(data_load) title sprintf("How late the loop's \
thread wakes, and cyclictest beside it%s%s, %.3g s each", words(data_load) > 1 ? ": " : "\n", \
	policy, seconds) font large
set logscale xy
set xrange [0.9:20000]
set yrange [least:1]
set format xy '10^{%L}'

set xlabel 'late / µs'
set ylabel 'share of wake-ups'
set style fill solid
set key top right samplen 2
share(none) = column("y") > 0 ? column("y") : 1e-9
do for [b=1:words(data_blocks)] {
	# "1000 idle 99.9 %: 155 us, cyclictest 101 us"
	block = word(data_blocks, b)
	name = word(block, 1).' '.word(block, 2)
	both = strstrt(block, "cyclictest") > 0
	set title sprintf("%g kHz, %s\n%s", word(block, 1) / 1e3, word(block, 2), \
		block[strlen(name) + 2:*]) font small
	plot more index name.' loop' using "x":(share(0)) with fillsteps fc rgb sky \
			title 'loop', \
		for [k=1:both] more index name.' cyclictest' using "x":(share(0)) \
			with steps ls 2 title 'cyclictest'
}
unset multiplot
