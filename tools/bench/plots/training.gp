# SPDX-License-Identifier: GPL-2.0-or-later
# Error on unseen cuts over the time of training, a colour for each kind of method.
stats data using "seconds" nooutput
set title sprintf("Error on unseen cuts over the time of training, %d pairs\n%s, %s", \
	pairs, cpu, kernel)
set xlabel 'time of training / s'
set ylabel sprintf('rms error on unseen cuts / N (bars: 5 to 95 %% of %d data sets)', seeds)
set logscale xy
set format x '%.0e'
set format y '%g'
set yrange [*:*] extend
set xrange [STATS_min / 2:STATS_max * 6]
set key outside bottom center horizontal maxcols 2
plot for [i=1:words(data_kind)] data index word(data_kind, i) \
		using "seconds":"rmse_unseen_N":"rmse_unseen_N_p5":"rmse_unseen_N_p95" \
		with yerrorbars ls i pt 7 ps 0.8 title word(data_kind, i), \
	for [i=1:words(data_kind)] data index word(data_kind, i) \
		using "seconds":"rmse_unseen_N":"name" \
		with labels noenhanced left rotate by 20 offset 0.6,0.3 font small
