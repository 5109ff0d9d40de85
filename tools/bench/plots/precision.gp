# SPDX-License-Identifier: GPL-2.0-or-later
# Largest error over the time of an evaluation, a colour for each kind of evaluator.
stats data using "ns" nooutput
set title sprintf("Error over run time, %d rules\n%s, %s", rules, cpu, kernel)
set xlabel 'time per evaluation / ns (bars: 5 to 95 % of the runs)'
set ylabel 'largest error / N (thin lines: up to the certified bound)'
set logscale xy
set format y '%.0e'
set xrange [STATS_min / 1.5:STATS_max * 3]
set yrange [*:*] extend
set offsets 0, 0, graph 0.1, graph 0.05
set key outside bottom center horizontal
set style line 6 lc rgb ink
# An error of 0 has no place on a logarithmic axis.
error(dummy) = column("max_error_N") > 1e-18 ? column("max_error_N") : 1e-18
plot for [i=1:words(data_kind)] data index word(data_kind, i) \
		using "ns":(error(0)):(0):(column("bound_N") - error(0)) \
		with vectors nohead ls i lw 0.5, \
	for [i=1:words(data_kind)] data index word(data_kind, i) \
		using "ns":(error(0)):"ns_p5":"ns_p95" with xerrorbars ls i pt 7 ps 0.8 \
		title word(data_kind, i), \
	for [i=1:words(data_kind)] data index word(data_kind, i) using "ns":(error(0)):"name" \
		with labels noenhanced left rotate by 25 offset 0.5,0.3 font small
