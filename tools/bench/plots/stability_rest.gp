# SPDX-License-Identifier: GPL-2.0-or-later
# Swing of scenes under a leaning hand, by force: with the gain that a refusal names, and with twice that.
n = words(data_blocks)
set title "Scenes under leans of a hand: widest oscillation with the gain that the plan accepts, and with twice that"
set ylabel 'peak-to-peak oscillation in the last quarter of 8 s / mm'
set format y power
set logscale y
eval key_below
least(y) = y < 2e-7 ? 2e-7 : y
stats data using (least(column("twice_mm"))) nooutput
high = STATS_max > 0.01 ? STATS_max : 0.01
set yrange [1e-7:high * 5]
set xrange [0.4:n + 0.6]
set xtics ()
set for [i=1:n] xtics add (word(data_blocks, i) i)
set arrow from graph 0, first 0.01 to graph 1, first 0.01 nohead dt 2 lc rgb ink
set label 'limit: a larger one is no rest' at graph 0.98, first 0.02 right font small
# Cases of one force stand next to each other, by surface and device.
beside(i, side) = i + side * 0.2 + 0.012 * (int(column(0)) % 12 - 6)
plot for [i=1:n] data index word(data_blocks, i) using (beside(i, -1)):(least(column("swing_mm"))) \
		with points pt 7 ps 0.6 lc rgb green title i == 1 ? 'the gain that is accepted' : '', \
	for [i=1:n] data index word(data_blocks, i) using (beside(i, 1)):(least(column("twice_mm"))) \
		with points pt 2 ps 0.6 lc rgb vermillion title i == 1 ? 'twice that' : ''
